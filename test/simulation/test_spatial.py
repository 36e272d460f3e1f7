"""Mechanisms in space: exact motions, every kind of joint, reactions against Newton and Euler."""

from __future__ import annotations

import json

import numpy as np
import pytest

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND
from alf_ros.mechanism.affine import Form
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.sample import Sample
from support.paths import DATA
from support.thorough import combined

BRICARD = json.loads((DATA / 'A04_bricard.json').read_text())


def bricard(kind: str, shared: bool) -> str:
    """The overconstrained loop of six revolute joints, its axes shared by the rods or not."""
    points, axes = (BRICARD['parameters'][key] for key in ('joint_points', 'axes'))
    ends = {0, 5}
    moments = [BRICARD[kind]['I_axial'], *[BRICARD[kind]['I_transverse']] * 2]
    inertia = 'rod' if kind == 'slender' else f'{{about_com: {moments}}}'
    lines = ['mechanism:', '  alf: 1', '  space: spatial', '  points:']
    for k in range(6):
        lines.append(f'    P{k}: {{at: {points[k]}{", fixed: true" * (k in ends)}}}')
    if shared:
        lines.append('  vectors:')
        for k in range(6):
            lines.append(f'    u{k}: {{along: {axes[k]}{", fixed: true" * (k in ends)}}}')
    lines.append('  bodies:')
    for k in range(5):
        vectors = f', vectors: [u{k}, u{k + 1}]' * shared
        lines.append(
            f'    rod{k}: {{points: [P{k}, P{k + 1}], mass: 1, inertia: {inertia}{vectors}}}'
        )
    lines.append('  joints:')
    for k in range(6):
        pair = ('ground' if k in ends else f'rod{k - 1}', 'rod4' if k == 5 else f'rod{k}')
        axis = f'u{k}' if shared else axes[k]
        between = f'between: [{pair[0]}, {pair[1]}]'
        lines.append(f'    j{k}: {{type: revolute, {between}, at: P{k}, axis: {axis}}}')
    return '\n'.join([*lines, 'effects: {gravity: {acceleration: [0, -9.81, 0]}}'])


@pytest.mark.parametrize(
    ('penalty', 'kind', 'shared'),
    combined([1e5, 1e8, 1e10], ['slender', 'square_section'], [True, False]),
)
def test_bricard(kind: str, shared: bool, penalty: float) -> None:
    """IFToMM A04: one row depends on the others, and which is which makes no difference."""
    scene = scene_from_text(bricard(kind, shared))
    sim = Simulation(scene, integrator='dop853', step=1e-2, penalty=penalty)
    wanted = BRICARD[kind]['samples']
    assert sim.model.n == (24 if shared else 42)
    for sample, exact in zip(
        sim.run(10.0, at=[each['t'] for each in wanted]), wanted, strict=True
    ):
        assert sample.points['P2'] == pytest.approx(exact['P3'], abs=1e-9)
        assert sample.velocities['P2'] == pytest.approx(exact['P3d'], abs=1e-8)
        assert sample.energy == pytest.approx(BRICARD[kind]['energy'], abs=1e-9)
    assert sample.diagnostics.redundant == 1
    assert not sample.diagnostics.singular
    assert any(reaction.indeterminate for reaction in sample.reactions.values())


ZOO = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [1, 0.1, 0.2]}
    B: {at: [1.5, 1, 0.3]}
    C: {at: [1.2, 1.5, 1.1]}
    C4: {at: [1.2, 1.5, 1.1]}
    D: {at: [0.3, 1.7, 1.4]}
    D5: {at: [0.3, 1.7, 1.4]}
    E: {at: [-0.4, 1.1, 1.0]}
    F: {at: [-0.8, 0.4, 1.3]}
    F7: {at: [-0.8, 0.4, 1.3]}
    G: {at: [-1.1, 0.2, 0.4]}
    H: {at: [-1.3, -0.5, 0.2]}
    X: {at: [-1, -1, -1], fixed: true}
  bodies:
    one: {points: [O, A], mass: 1.0, inertia: {about_com: [0.1, 0.2, 0.15]}, com: [0.4, 0.1, 0]}
    two: {points: [A, B], mass: 0.8, inertia: {about_com: [0.1, 0.12, 0.2, 0.01, -0.02, 0.005]},
          com: [0.3, -0.1, 0.2]}
    three: {points: [B, C], mass: 0.6, inertia: rod}
    four: {points: [C4, D], mass: 1.2, inertia: {about_com: [0.2, 0.2, 0.3]}, com: [0.5, 0, 0.1]}
    five: {points: [D5, E], mass: 0.5, inertia: {about_com: [0.05, 0.06, 0.07]}, com: [0.2, 0, 0]}
    six: {points: [E, F], mass: 0.7, inertia: {about_com: [0.05, 0.06, 0.07]}, com: [0.3, 0.1, 0]}
    seven: {points: [F7, G], mass: 0.9, inertia: {about_com: [0.06, 0.06, 0.07]}, com: [0.2, 0, 0]}
    eight: {points: [G, H], mass: 0.4, inertia: {about_com: [0.02, 0.03, 0.03]}, com: [0.3, 0, 0]}
  joints:
    hinge: {type: revolute, between: [ground, one], at: O, axis: [0.2, 0, 1]}
    ball: {type: spherical, between: [one, two], at: A}
    cross: {type: universal, between: [two, three], at: B, axes: [[1, 0, 0], [0, 0.6, 0.8]]}
    sleeve: {type: cylindrical, between: [three, four], at: C, axis: [0, 1, 1]}
    rail: {type: prismatic, between: [four, five], at: D, axis: [1, 2, 0]}
    glue: {type: weld, between: [five, six], at: E}
    table: {type: planar, between: [six, seven], at: F, axis: [0, 0, 1]}
    pin: {type: revolute, between: [seven, eight], at: G, axis: [1, -1, 0]}
    bar: {type: distance, between: [ground, eight], points: [X, H]}
effects: {gravity: {acceleration: [0.5, -1, -9.81]}}
initial: {velocities: {A: [~, 1, ~], C: [~, ~, 0.2]}}
"""


def value(f: Form, blocks: Floats) -> Floats:
    return f.constant + sum(C @ blocks[b] for b, C in f.parts.items())


def newton_euler(sim: Simulation, sample: Sample) -> dict[str, Floats]:
    """The load that each body needs from its joints: force, and torque about the origin (6,).

    From accelerations of places on the body alone: d/dt ∫ r × ṙ dm = ∫ r × r̈ dm, with the mass at
    the places of seven point masses that have the body's mass, com and inertia. World frame.
    """
    layout, state = sim.model.layout, sim.state
    q = state.q.reshape(-1, layout.dimension)
    qdd = sample._accelerated[0].qdd.reshape(-1, layout.dimension)
    gravity = np.array([0.5, -1.0, -9.81])
    needs: dict[str, Floats] = {}
    for body in layout.bodies:
        J = np.array(body.inertia)
        spread, directions = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
        places = [(0.4 * body.mass, np.array(body.com))]
        for moment, axis in zip(spread, directions.T, strict=True):
            arm = np.sqrt(max(moment, 0.0) / (0.2 * body.mass)) * axis
            places += [(0.1 * body.mass, np.array(body.com) + s * arm) for s in (1.0, -1.0)]
        total = np.zeros(6)
        for m, local in places:
            f = layout.place(body.name, tuple(local))
            force = m * (value(Form(f.parts, np.zeros(3)), qdd) - gravity)
            total += [*force, *np.cross(value(f, q), force)]
        needs[body.name] = total
    return needs


def test_reactions_balance_every_body() -> None:
    sim = Simulation(scene_from_text(ZOO), integrator='dop853', step=2e-3)
    sim.step(200)
    sample, layout = sim.sample(), sim.model.layout
    assert sample.diagnostics.redundant == 0
    balance = newton_euler(sim, sample)
    q = sim.state.q.reshape(-1, 3)
    for joint in layout.mechanism.joints:
        reaction = sample.reactions[joint.name]
        at = value(layout.place(joint.child, joint.frames[1].origin), q)
        wrench = np.array([*reaction.force, *(reaction.torque + np.cross(at, reaction.force))])
        balance[joint.child] -= wrench
        if joint.parent != GROUND:
            balance[joint.parent] += wrench
    for name, left in balance.items():
        assert left == pytest.approx(0.0, abs=1e-9), name


def test_joints_leave_and_take_what_they_should() -> None:
    """Torques only where a joint holds an orientation; nothing along a free axis."""
    sim = Simulation(scene_from_text(ZOO), integrator='dop853', step=2e-3)
    sim.step(100)
    sample, layout = sim.sample(), sim.model.layout
    q = sim.state.q.reshape(-1, 3)

    def axis(name: str, n: int) -> Floats:
        joint = next(j for j in layout.mechanism.joints if j.name == name)
        return value(layout.direction(joint.parent, joint.frames[0].axes[n]), q)

    forces = {name: reaction.force for name, reaction in sample.reactions.items()}
    torques = {name: reaction.torque for name, reaction in sample.reactions.items()}
    assert torques['ball'] == pytest.approx(0.0, abs=1e-9)
    assert torques['bar'] == pytest.approx(0.0, abs=1e-9)
    assert torques['hinge'] @ axis('hinge', 2) == pytest.approx(0.0, abs=1e-9)
    assert torques['sleeve'] @ axis('sleeve', 2) == pytest.approx(0.0, abs=1e-9)
    assert forces['sleeve'] @ axis('sleeve', 2) == pytest.approx(0.0, abs=1e-9)
    assert forces['rail'] @ axis('rail', 2) == pytest.approx(0.0, abs=1e-9)
    assert forces['table'] @ axis('table', 0) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(torques['rail']).max() > 0.1 and np.abs(torques['glue']).max() > 0.1
    assert np.abs(forces['table'] @ axis('table', 2)) > 0.1


def test_energy_and_constraints_of_every_joint() -> None:
    sim = Simulation(scene_from_text(ZOO), integrator='dop853', step=1e-3)
    first = sim.sample()
    sim.step(2000)
    last = sim.sample()
    assert last.energy == pytest.approx(first.energy, abs=1e-8)
    assert last.diagnostics.position_violation < 1e-13
    assert last.diagnostics.velocity_violation < 1e-11


def test_conical_pendulum() -> None:
    """Steady cone: ω² = g / (h), h = 2/3 L cos β for a slender rod."""
    cone, g = 0.5, 9.81
    rate = np.sqrt(g / (2.0 / 3.0 * np.cos(cone)))
    at = [float(np.sin(cone)), 0.0, float(-np.cos(cone))]
    text = f"""
mechanism:
  alf: 1
  space: spatial
  points: {{O: {{at: [0, 0, 0], fixed: true}}, A: {{at: {at}}}}}
  bodies: {{rod: {{points: [O, A], mass: 2, inertia: rod}}}}
  joints: {{ball: {{type: spherical, between: [ground, rod], at: O}}}}
effects: {{gravity: {{acceleration: [0, 0, -{g}]}}}}
initial: {{velocities: {{A: [0, {rate * np.sin(cone)}, 0]}}}}
"""
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-2)
    assert sim.model.n == 3  # a slender rod needs no more
    for sample in sim.run(10.0, every=50):
        angle = rate * sample.t
        wanted = np.sin(cone) * np.cos(angle), np.sin(cone) * np.sin(angle), -np.cos(cone)
        assert sample.points['A'] == pytest.approx(wanted, abs=1e-9)


def test_free_symmetric_top() -> None:
    """Torque-free: the axis goes round the angular momentum at the rate L / J, and spins on."""
    J, J3, w1, w3 = 0.2, 0.3, 1.0, 2.0
    text = f"""
mechanism:
  alf: 1
  space: spatial
  points: {{A: {{at: [0, 0, 0]}}, O: {{at: [1, 1, 1], fixed: true}}}}
  vectors: {{x: {{along: [1, 0, 0]}}, y: {{along: [0, 1, 0]}}, z: {{along: [0, 0, 1]}}}}
  bodies:
    top: {{points: [A], vectors: [x, y, z], mass: 1, inertia: {{about_com: [{J}, {J}, {J3}]}}}}
initial: {{velocities: {{A: [0, 0, 0], x: [0, {w3}, 0], z: [0, {-w1}, 0]}}}}
"""
    sim = Simulation(scene_from_text(text), integrator='dop853', step=1e-2)
    L = np.array([J * w1, 0.0, J3 * w3])
    about, rate = L / np.linalg.norm(L), np.linalg.norm(L) / J
    start = np.array([0.0, 0.0, 1.0])
    for sample in sim.run(5.0, every=25):
        x, y, z, w = sample.body_poses[0, 3:]
        axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        angle = rate * sample.t
        along = (start @ about) * about
        turned = np.cos(angle) * (start - along) + np.sin(angle) * np.cross(about, start)
        assert axis == pytest.approx(along + turned, abs=1e-9)


def test_power_of_a_wrench_in_space() -> None:
    """Force and torque, of the world and of the body, do the work that the energy gains."""
    for frame in ('world', 'body'):
        sim = Simulation(scene_from_text(ZOO), integrator='dop853', step=1e-3)
        sim.apply_wrench('four', [1.0, -2.0, 3.0], (0.5, 0.4, -0.3), at='D', frame=frame)
        sim.apply_effort('hinge', 0.7)
        sim.apply_effort('rail', -0.4)
        sim.step(100)
        before, work = sim.sample().energy, 0.0
        steps = 50
        for k in range(steps + 1):
            sample = sim.sample()
            layout, state = sim.model.layout, sim.state
            q, qd = state.q.reshape(-1, 3), state.qd.reshape(-1, 3)
            axes = [layout.direction('four', tuple(e)) for e in np.eye(3)]
            R = np.array([value(a, q) for a in axes]).T
            Rd = np.array([value(Form(a.parts, np.zeros(3)), qd) for a in axes]).T
            W = Rd @ R.T
            spin = np.array([W[2, 1], W[0, 2], W[1, 0]])
            turn = R if frame == 'body' else np.eye(3)
            power = (turn @ [1.0, -2.0, 3.0]) @ sample.velocities['D']
            power += (turn @ [0.5, 0.4, -0.3]) @ spin
            power += 0.7 * sample.joints['hinge'].velocity
            power -= 0.4 * sample.joints['rail'].velocity
            # Simpson
            weight = 1.0 if k in (0, steps) else (4.0 if k % 2 else 2.0)
            work += float(power) * weight * 1e-3 / 3.0
            if k < steps:
                sim.step()
        assert sim.sample().energy - before == pytest.approx(work, abs=1e-9)


@pytest.mark.parametrize('axis, speed', [('first', '[-1, ~, ~]'), ('second', '[~, ~, 1]')])
def test_angles_of_a_universal_joint_turn_right_handed(axis: str, speed: str) -> None:
    """About +z of the ground first, then about +x of the body: its y axis rises."""
    sim = Simulation(
        scene_from_text(
            'mechanism:\n  alf: 1\n  space: spatial\n'
            '  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [0, 1, 0]}}\n'
            '  bodies: {b: {points: [O, A], mass: 1, inertia: {about_com: [1, 1, 1]}}}\n'
            '  joints: {u: {type: universal, between: [ground, b], at: O, '
            'axes: [[0, 0, 1], [1, 0, 0]]}}\n'
            f'initial: {{velocities: {{A: {speed}}}}}\n'
        )
    )
    sim.step(200)
    joints = sim.sample().joints
    other = 'second' if axis == 'first' else 'first'
    assert joints[f'u_{axis}'].velocity == pytest.approx(1.0, abs=1e-9)
    assert joints[f'u_{axis}'].position == pytest.approx(0.2, abs=1e-9)
    assert joints[f'u_{other}'].position == pytest.approx(0.0, abs=1e-9)
