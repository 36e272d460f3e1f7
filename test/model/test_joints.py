"""Every kind of joint by one set of checkers: its Jacobian, what it leaves free, its reaction.

A joint is looked at between two bodies that lie askew; the second hangs on the first by it alone.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from alf_ros import AssemblyError, Simulation, kernel
from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND, Joint
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model import joints
from alf_ros.model.compile import Model, hold
from alf_ros.model.constraints.rows import joint_rows
from alf_ros.scene.scene import scene_from_text
from support.joint_cases import CASES, PLANAR_CASES, SPATIAL_CASES, simulation


def test_every_kind_is_here() -> None:
    assert set(PLANAR_CASES) == set(joints.types(2))
    assert set(SPATIAL_CASES) == set(joints.types(3))


def test_only_what_is_named_is_imported() -> None:
    """A mechanism of pins and a slider knows no screw, and the package no name of a type."""
    code = (
        'import sys, alf_ros; alf_ros.Simulation(alf_ros.load_scene("slider_crank"));'
        'print(*sorted(n for n in sys.modules if n.startswith("alf_ros.model.joints.")))'
    )
    done = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True, text=True)
    kinds = {name.split('.')[3] for name in done.stdout.split()} - {'contract'}
    assert kinds == {'revolute', 'slider'}


# --------------------------------------------------------------------------------------- Jacobian


@pytest.mark.parametrize('dimension, kind', CASES)
def test_jacobian(dimension: int, kind: str) -> None:
    """Φ is quadratic: its difference over any distance is exact, away from Φ = 0 too."""
    model = simulation(dimension, kind).model
    random = np.random.default_rng(3)
    rows, unit = model.system.rows, model.unit
    m = rows.alpha.size
    positions = m - rows.velocity
    for _ in range(5):
        q, v = random.standard_normal((2, model.q.size))
        phi, gradient, rate = np.zeros((2, m)), np.zeros(m), np.zeros((2, m))
        for n, sign in enumerate((1.0, -1.0)):
            kernel.violation(unit, rows, q + sign * v, phi[n])
        g, g2 = np.zeros(rows.i.size * dimension), np.zeros(rows.b.size)
        kernel.jacobian(unit, rows, q, g, g2)
        kernel.times_jacobian(unit, rows, g, g2, v, gradient)
        difference = 0.5 * (phi[0] - phi[1])
        assert gradient[:positions] == pytest.approx(difference[:positions], abs=1e-12)
        # Φ̇_q likewise, for all rows: Φ_q is linear in q
        w = random.standard_normal(model.q.size)
        for n, sign in enumerate((1.0, -1.0)):
            kernel.jacobian(unit, rows, q + sign * v, g, g2)
            kernel.times_jacobian(unit, rows, g, g2, w, rate[n])
        g2d, along = np.zeros(rows.b.size), np.zeros(m)
        kernel.jacobian_rate(unit, rows, v, g2d)
        gd = (v.reshape(-1, dimension)[rows.i] - v.reshape(-1, dimension)[rows.j]).ravel()
        kernel.times_jacobian(unit, rows, gd, g2d, w, along)
        assert along == pytest.approx(0.5 * (rate[0] - rate[1]), abs=1e-12)
        # and Φ_qᵀ is its transpose
        y, back = random.standard_normal(m), np.zeros(model.q.size)
        v[model.n :] = 0.0
        kernel.jacobian(unit, rows, q, g, g2)
        kernel.add_transposed(unit, rows, g, g2, y, back)
        kernel.times_jacobian(unit, rows, g, g2, v, gradient)
        assert back @ v == pytest.approx(y @ gradient, abs=1e-11)


# ------------------------------------------------------------------------------------ what is free


def value(f: Form, blocks: Floats) -> Floats:
    return np.asarray(f.constant + sum(C @ blocks[b] for b, C in f.parts.items()))


def twists(dimension: int) -> list[tuple[Floats, Floats]]:
    """Unit motions (velocity of the origin, spin)."""
    spins = 1 if dimension == 2 else 3
    moves = [(e, np.zeros(spins)) for e in np.eye(dimension)]
    return moves + [(np.zeros(dimension), e) for e in np.eye(spins)]


def carried(model: Model, body: str, twist: tuple[Floats, Floats]) -> Floats:
    """q̇ (blocks, D) of the blocks of one body that moves with a twist."""
    layout, D = model.layout, model.layout.dimension
    q, qd = model.q.reshape(-1, D), np.zeros((layout.blocks, D))
    points = len(layout.body[body].points)
    for n, block in enumerate(layout.of_body[body]):
        arm = q[block]
        turned = np.cross(twist[1], arm) if D == 3 else twist[1][0] * np.array([-arm[1], arm[0]])
        qd[block] = turned + (twist[0] if n < points else 0.0)
    return qd


@pytest.mark.parametrize('dimension, kind', CASES)
def test_freedoms(dimension: int, kind: str) -> None:
    """The rows of the bodies allow every rigid motion; the rows of the joint leave its freedoms.

    `one` stands still; `two` moves with each unit twist.
    """
    case = (PLANAR_CASES if dimension == 2 else SPATIAL_CASES)[kind]
    model = simulation(dimension, kind).model
    motions = [carried(model, 'two', twist) for twist in twists(dimension)]
    for block in model.layout.of_auxiliary.values():
        for axis in range(dimension):
            motion = np.zeros((model.layout.blocks, dimension))
            motion[block, axis] = 1.0
            motions.append(motion)
    system, names, _ = hold(model, [], velocities=True)
    rows = system.rows
    g, g2 = np.zeros(rows.i.size * dimension), np.zeros(rows.b.size)
    kernel.jacobian(model.unit, rows, model.q, g, g2)
    joint = model.mechanism.joints[-1]
    own = {row.name for row in joint_rows(joint, model.layout)}
    rates = np.zeros((len(names), len(motions)))
    for n, moved in enumerate(motions):
        kernel.times_jacobian(model.unit, rows, g, g2, moved.ravel(), rates[:, n])
    rigid = [n for n, name in enumerate(names) if name.startswith('two')]
    joints = [n for n, name in enumerate(names) if name in own]
    assert rigid and np.abs(rates[rigid]).max() < 1e-12
    taken = rates[joints]
    if case.shared:  # what both carry does not move, as `one` stands still
        block = model.layout.of_point['A']
        taken = np.vstack([taken, np.array([motion[block] for motion in motions]).T])
    rank = int((np.linalg.svd(taken, compute_uv=False) > 1e-9).sum()) if taken.size else 0
    assert len(motions) - rank == case.free
    assert rank == taken.shape[0]  # and no row says what another says


# --------------------------------------------------------------------------------------- reactions


@dataclass(frozen=True)
class Instant:
    """Places, velocities and accelerations of all blocks, (blocks, D)."""

    layout: Layout
    q: Floats
    qd: Floats
    qdd: Floats

    def needs(self, body_name: str, gravity: Floats) -> tuple[Floats, Floats]:
        """Force, and torque about the world's origin, that a body needs from its joints.

        From accelerations of places on it alone, with its mass at point masses that have its mass,
        its centre and its inertia: d/dt ∫ r × ṙ dm = ∫ r × r̈ dm.
        """
        body, D = self.layout.body[body_name], self.layout.dimension
        J = np.array(body.inertia)
        second = 0.5 * J * np.eye(2) if D == 2 else 0.5 * np.trace(J) * np.eye(3) - J
        spread, directions = np.linalg.eigh(second)
        centre = np.array(body.com)
        places = [((1.0 - 0.2 * D) * body.mass, centre)]
        for moment, axis in zip(spread, directions.T, strict=True):
            arm = np.sqrt(max(moment, 0.0) / (0.2 * body.mass)) * axis
            places += [(0.1 * body.mass, centre + s * arm) for s in (1.0, -1.0)]
        force, torque = np.zeros(D), np.zeros(1 if D == 2 else 3)
        for m, local in places:
            f = self.layout.place(body_name, tuple(local))
            each = m * (value(Form(f.parts, np.zeros(D)), self.qdd) - gravity)
            force += each
            torque += moment_of(value(f, self.q), each)
        return force, torque

    def spin(self, body: str) -> Floats:
        """(1 or 3,) rad/s."""
        D = self.layout.dimension
        if body == GROUND:
            return np.zeros(1 if D == 2 else 3)
        axes = [self.layout.direction(body, tuple(e)) for e in np.eye(D)]
        R = np.array([value(a, self.q) for a in axes]).T
        W = np.array([value(Form(a.parts, np.zeros(D)), self.qd) for a in axes]).T @ R.T
        return np.array([W[1, 0]]) if D == 2 else np.array([W[2, 1], W[0, 2], W[1, 0]])

    def place(self, joint: Joint, which: int) -> tuple[Floats, Floats]:
        """Where a joint is on its parent (0) or child (1), and how fast it moves."""
        body = (joint.parent, joint.child)[which]
        f = self.layout.place(body, joint.frames[which].origin)
        still = np.zeros(self.layout.dimension)
        return value(f, self.q), value(Form(f.parts, still), self.qd)


def moment_of(arm: Floats, force: Floats) -> Floats:
    if arm.size == 3:
        return np.cross(arm, force).astype(np.float64)
    return np.array([arm[0] * force[1] - arm[1] * force[0]])


@pytest.mark.parametrize('dimension, kind', CASES)
def test_reaction(dimension: int, kind: str) -> None:
    """It balances both bodies (Newton, Euler), and does no work in what the joint leaves free."""
    sim = simulation(dimension, kind)
    sim.step(100)
    sample, state = sim.sample(), sim.state
    shape = (-1, dimension)
    at = Instant(
        sim.model.layout,
        state.q.reshape(shape),
        state.qd.reshape(shape),
        sample._accelerated[0].qdd.reshape(shape),
    )
    gravity = np.array([1.0, -9.81] if dimension == 2 else [1.0, 0.5, -9.81])
    assert sample.diagnostics.redundant == 0
    assert sample.diagnostics.position_violation < 1e-13
    left = {name: at.needs(name, gravity) for name in ('one', 'two')}
    for joint in sim.model.mechanism.joints:
        reaction = sample.reactions[joint.name]
        force, torque = reaction.force, np.atleast_1d(reaction.torque)
        place, velocity = at.place(joint, 1)
        about_origin = torque + moment_of(place, force)
        for body, sign in ((joint.child, -1.0), (joint.parent, 1.0)):
            if body != GROUND:
                left[body][0][:] += sign * force
                left[body][1][:] += sign * about_origin
        # against the velocity of that place of the parent
        parent = at.spin(joint.parent)
        base, base_velocity = at.place(joint, 0)
        arm = place - base
        turned = (
            np.cross(parent, arm) if dimension == 3 else parent[0] * np.array([-arm[1], arm[0]])
        )
        work = force @ (velocity - base_velocity - turned)
        work += torque @ (at.spin(joint.child) - parent)
        assert work == pytest.approx(0.0, abs=1e-9)
        if joint.name == 'joint':
            assert np.abs(np.concatenate([force, torque])).max() > 1e-2
    for force, torque in left.values():
        assert force == pytest.approx(0.0, abs=1e-9)
        assert torque == pytest.approx(0.0, abs=1e-9)


# what is zero, from the place of the child in the axes of the parent (D,), and the axes of the
# child in those of the parent (D, D), in columns
MEANING = {
    (2, 'revolute'): lambda gap, axes, joint: [*gap],
    (2, 'slider'): lambda gap, axes, joint: [gap[1]],
    (2, 'prismatic'): lambda gap, axes, joint: [gap[1], axes[1, 0]],
    (2, 'weld'): lambda gap, axes, joint: [*gap, axes[1, 0]],
    (2, 'no_slip'): lambda gap, axes, joint: [gap[1] - joint.value],
    (2, 'gear'): lambda gap, axes, joint: [np.linalg.norm(gap) - joint.value - joint.of_parent],
    (2, 'rolling'): lambda gap, axes, joint: [np.linalg.norm(gap) - joint.value - joint.of_parent],
    (2, 'rack'): lambda gap, axes, joint: [gap[1] - joint.value],
    (2, 'blade'): lambda gap, axes, joint: [],
    (3, 'spherical'): lambda gap, axes, joint: [*gap],
    (3, 'revolute'): lambda gap, axes, joint: [*gap, *axes[:2, 2]],
    (3, 'universal'): lambda gap, axes, joint: [*gap, axes[2, 0]],
    (3, 'cylindrical'): lambda gap, axes, joint: [*gap[:2], *axes[:2, 2]],
    (3, 'screw'): lambda gap, axes, joint: [
        *gap[:2],
        *axes[:2, 2],
        gap[2] - joint.value * np.arctan2(axes[1, 0], axes[0, 0]),
    ],
    (3, 'prismatic'): lambda gap, axes, joint: [*gap[:2], *(axes - np.eye(3)).ravel()],
    (3, 'planar'): lambda gap, axes, joint: [gap[2], *axes[:2, 2]],
    (3, 'weld'): lambda gap, axes, joint: [*gap, *(axes - np.eye(3)).ravel()],
    (3, 'perpendicular'): lambda gap, axes, joint: [axes[2, 2]],
    (3, 'distance'): lambda gap, axes, joint: [np.linalg.norm(gap) - joint.value],
    (3, 'no_slip'): lambda gap, axes, joint: [gap[2] - joint.value],
    (3, 'disk'): lambda gap, axes, joint: [gap[2] - joint.value * np.hypot(*axes[:2, 2])],
}


@pytest.mark.parametrize('dimension, kind', CASES)
def test_meaning(dimension: int, kind: str) -> None:
    """Where the bodies have gone the joint holds, by its definition."""
    sim = simulation(dimension, kind)
    sim.step(150)
    layout, q = sim.model.layout, sim.state.q.reshape(-1, dimension)
    assert np.abs(q - sim.initial_state.q.reshape(-1, dimension)).max() > 0.05
    joint = sim.model.mechanism.joints[-1]
    parent, child = (
        np.array([value(layout.direction(body, axis), q) for axis in frame.axes])
        for body, frame in zip((joint.parent, joint.child), joint.frames, strict=True)
    )
    there, here = (
        value(layout.place(body, frame.origin), q)
        for body, frame in zip((joint.parent, joint.child), joint.frames, strict=True)
    )
    assert parent @ parent.T == pytest.approx(np.eye(dimension), abs=1e-12)
    open_ = MEANING[dimension, kind](parent @ (here - there), parent @ child.T, joint)
    assert np.array(open_) == pytest.approx(0.0, abs=1e-11)


def moves(kind: str) -> Instant:
    """A moment in the motion of a planar case."""
    sim = simulation(2, kind)
    sim.step(150)
    state = sim.state
    return Instant(sim.model.layout, *(x.reshape(-1, 2) for x in (state.q, state.qd, state.qd)))


def test_blade_and_wheels_in_the_plane_do_not_slip() -> None:
    """The velocity of the material points that touch, on parent and child."""
    for kind in ('blade', 'no_slip', 'rack', 'gear'):
        at = moves(kind)
        joint = at.layout.mechanism.joints[-1]
        (base, base_velocity), (tip, tip_velocity) = at.place(joint, 0), at.place(joint, 1)
        y = value(at.layout.direction(joint.parent, joint.frames[0].axes[1]), at.q)
        if kind == 'blade':
            edge = value(at.layout.direction(joint.child, joint.frames[1].axes[1]), at.q)
            assert tip_velocity @ edge == pytest.approx(0.0, abs=1e-11)
            assert np.abs(tip_velocity).max() > 0.1
            continue
        away = (tip - base) / np.linalg.norm(tip - base) if kind == 'gear' else y
        touch = tip - joint.value * away
        on = []
        for body, place, velocity in (
            (joint.parent, base, base_velocity),
            (joint.child, tip, tip_velocity),
        ):
            arm = touch - place
            on.append(velocity + at.spin(body)[0] * np.array([-arm[1], arm[0]]))
        slip = on[1] - on[0]
        assert slip == pytest.approx(0.0, abs=1e-10), kind
        assert np.abs(at.spin(joint.child)).max() > 0.1


DOOR = """
mechanism:
  alf: 1
  space: spatial
  points:
    Low: {at: [0, 0, 0], fixed: true}
    High: {at: [0, 0, 2], fixed: true}
    Edge: {at: [0.9, 0, 1]}
  bodies:
    door:
      {points: [Low, High, Edge], mass: 30, inertia: {about_com: [10, 2, 12]}, com: [1, 0.45, 0]}
  joints:
    low: {type: spherical, between: [ground, door], at: Low}
    high: {type: spherical, between: [ground, door], at: High}
effects: {gravity: {acceleration: [0, 0, -9.81]}}
"""


def test_a_door_on_two_fixed_points() -> None:
    """Two hinges carry three forces each, one too many: the weight has indeterminate shares."""
    sim = Simulation(scene_from_text(DOOR))
    sim.step(20)
    sample = sim.sample()
    low, high = sample.reactions['low'], sample.reactions['high']
    assert (sample.diagnostics.redundant, sample.diagnostics.singular) == (1, False)
    assert low.indeterminate and high.indeterminate
    assert low.force[2] + high.force[2] == pytest.approx(30 * 9.81, rel=1e-12)
    pull = 30 * 9.81 * 0.45 / 2.0  # of the couple, 2 m apart
    assert low.force[0] == pytest.approx(pull, rel=1e-12)
    assert high.force[0] == pytest.approx(-pull, rel=1e-12)


def test_fixed_points_at_the_wrong_distance() -> None:
    """½ (2² - 1.9²) / 1.9 m"""
    text = DOOR.replace('[Low, High, Edge], mass', '[Low, High], length: 1.9, mass')
    text = text.replace('    Edge: {at: [0.9, 0, 1]}\n', '')
    with pytest.raises(AssemblyError, match='door_length is off by 0.103 m'):
        Simulation(scene_from_text(text))
