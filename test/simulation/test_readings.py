"""Compiled readings against the formulas they stand for, joint by joint in plain Python."""

from __future__ import annotations

import threading
import weakref

import numpy as np
import pytest

from alf_ros import Simulation, kernel, load_scene
from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.mechanism import Coordinate
from alf_ros.mechanism.natural_coordinates import TURN
from alf_ros.model.constraints.joint_coordinates import length_row
from alf_ros.model.constraints.row import Row
from alf_ros.model.constraints.rows import joint_rows
from alf_ros.simulation.observables import READINGS, Reading
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sample_limits import Place
from support import effect_examples, joint_cases
from support.cut_blocks import on_cut_blocks
from support.paths import ROOT

MECHANISMS = sorted(path.stem for path in (ROOT / 'config/mechanisms').glob('*.yaml'))
ROUNDING = 1e-13  # of the largest number of a reading


def gradient(row: Row, block: int, places: Floats) -> Floats:
    terms = row.terms.get(block, {}).items()
    return row.b[block] + sum((T @ places[b] for b, T in terms), np.zeros(places.shape[1]))


def moment(arms: Floats, forces: Floats) -> Floats:
    if arms.shape[1] == 3:
        return np.asarray(np.cross(arms, forces), dtype=float)
    return (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0])[:, None]


def wrenches(sample: Sample, place: Place) -> Floats:
    """(joints, D + 1 or 3): f = M q̈ + Φᵀλ - Q of each body alone, summed joint by joint."""
    cut, model = sample._reactions(), sample.model
    D, work = model.layout.dimension, place.work
    state, near, effects = sample.state, sample._near, sample._applied.on(cut.cut)
    Q, t = np.zeros(cut.source.size * D), sample.t
    q, qd = on_cut_blocks(cut, state.q), on_cut_blocks(cut, state.qd)
    kernel.applied_forces(effects, t, q, qd, near, Q)
    q, qd = on_cut_blocks(cut, work.q), on_cut_blocks(cut, work.qd)
    if place.loads.size:
        kernel.add_friction(effects, t, q, qd, near, place.loads, Q)
    needed, rows = -Q, cut.rows
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian(model.unit, rows, q, g, g2)
    kernel.add_mass_times(model.unit, cut.mass, 1.0, on_cut_blocks(cut, work.qdd), needed)
    kernel.add_transposed(model.unit, rows, g, g2, work.y[cut.source_row], needed)
    f, places = needed.reshape(-1, D), q.reshape(-1, D)
    force = cut._shared_points @ f
    torque = cut._shared_vectors @ moment(places, f)
    at = dict(zip(model.row_names, model.row.tolist(), strict=True))
    for n, joint in enumerate(model.mechanism.joints):
        own = cut.cut.of_body[joint.child]
        points = own[: len(cut.cut.body[joint.child].points)]
        origin = cut.cut.place(joint.child, joint.frames[1].origin).value(places)
        for row in joint_rows(joint, cut.cut):
            for block in set(row.b) & set(own):
                h = -work.y[at[row.name]] * gradient(row, block, places)
                arm = places[block] - (origin if block in points else 0.0)
                force[n] += h if block in points else 0.0
                torque[n] += moment(arm[None], h[None])[0]
    return np.column_stack([force, torque])


def unit_motion(coordinate: Coordinate, sample: Sample, places: Floats) -> Floats:
    """(cut blocks, D) the velocity of the child that makes ẋ = 1."""
    cut, joint = sample._reactions().cut, coordinate.joint
    D, velocity = cut.dimension, np.zeros_like(places)
    blocks = list(cut.of_body[joint.child])
    points = blocks[: len(cut.body[joint.child].points)]
    base, tip = joint.frames
    axis = cut.direction(joint.parent, base.axes[0 if D == 2 else 2]).value(places)
    if not coordinate.is_angle:
        velocity[points] = axis
        return velocity
    if coordinate.freedom.on_child:
        axis = cut.direction(joint.child, tip.axes[0]).value(places)
    arms = places.copy()
    arms[points] -= cut.place(joint.child, tip.origin).value(places)
    turned = arms @ TURN.T if D == 2 else np.cross(axis, arms)
    velocity[blocks] = turned[blocks]
    return velocity


def efforts(sample: Sample) -> Floats:
    """(joint coordinates,) each from the effects that name it alone."""
    applied, model, cut = sample._applied, sample.model, sample._reactions()
    D, found = model.layout.dimension, np.zeros(len(model.coordinates))
    for name, held in applied.inputs.efforts.items():
        n = model.coordinate_names.index(name)
        found[n] = held.at(sample.t)[0] if isinstance(held, Curve) else held
    q, qd = on_cut_blocks(cut, sample.state.q), on_cut_blocks(cut, sample.state.qd)
    for n, coordinate in enumerate(model.coordinates):
        group = [effect for effect in applied.effects if coordinate.name in effect.coordinates]
        for effect in group:
            Q, part = np.zeros(q.size), applied._scene._part(cut.cut, [effect])
            sample._act(part, q, qd, Q)
            if len(effect.coordinates) > 1:
                found[n] += share(effect, coordinate.name, sample, float(Q @ qd))
                continue
            motion = unit_motion(coordinate, sample, q.reshape(-1, D))
            found[n] += Q @ motion.ravel()
    for drive in model.mechanism.drives:
        if drive.kind in ('angle', 'length'):
            n = model.coordinate_names.index(drive.of[0])
            found[n] += sample.drive_efforts[drive.name][0]
    return found


def share(effect: Effect, coordinate: str, sample: Sample, power: float) -> float:
    """Of a tendon over joints, whose effort along its length has this power."""
    names, speeds = sample.model.coordinate_names, sample.joint_velocities
    factors = dict(effect.parameters.joints)
    rate = sum(factor * speeds[names.index(name)] for name, factor in factors.items())
    return float(factors[coordinate] * power / rate)


def coordinates(sample: Sample) -> tuple[Floats, Floats]:
    """(joint coordinates,) and their rates, by the rows of the angles and lengths."""
    model, state, unit = sample.model, sample.state, sample.model.unit
    rows, D = model.system.angles, model.layout.dimension
    xy, rates, g2 = np.zeros(rows.c.size), np.zeros(rows.c.size), np.zeros(rows.b.size)
    kernel.violation(unit, rows, state.q, xy)
    kernel.jacobian(unit, rows, state.q, g2[:0], g2)
    kernel.times_jacobian(unit, rows, g2[:0], g2, state.qd, rates)
    (x, y), (xd, yd) = xy.reshape(-1, 2).T, rates.reshape(-1, 2).T
    angles = np.arctan2(y + 0.0, x) + 2.0 * np.pi * state.turns
    spins = (x * yd - y * xd) / (x * x + y * y)
    q, qd = state.q.reshape(-1, D), state.qd.reshape(-1, D)
    values, speeds = np.zeros((2, len(model.coordinates)))
    for n, each in enumerate(model.coordinates):
        if each.is_angle:
            values[n], speeds[n] = angles[each.place], spins[each.place]
        else:
            row = length_row(each.joint, model.layout)
            values[n] = row.c
            for block, b in row.b.items():
                g = gradient(row, block, q)
                values[n] += q[block] @ (0.5 * (g + b))
                speeds[n] += qd[block] @ g
        if each.less >= 0:
            values[n] -= angles[each.less]
            speeds[n] -= spins[each.less]
    return values, speeds


def compare(got: Floats, wanted: Floats) -> None:
    assert got.shape == wanted.shape and np.array_equal(np.isnan(got), np.isnan(wanted))
    scale = max(1.0, np.nanmax(np.abs(wanted), initial=0.0))
    assert np.nanmax(np.abs(got - wanted), initial=0.0) <= ROUNDING * scale


def check(sample: Sample) -> None:
    for got, wanted in zip(
        (sample.joint_positions, sample.joint_velocities), coordinates(sample), strict=True
    ):
        compare(got, wanted)
    compare(sample.joint_efforts, efforts(sample))
    wanted = sample._read(lambda place: wrenches(sample, place))
    compare(np.column_stack([sample.reaction_forces, sample.reaction_torques]), wanted)


@pytest.mark.parametrize('name', MECHANISMS)
def test_readings_of_the_library(name: str) -> None:
    sim = Simulation(load_scene({'mechanism': name, 'effects': {}}))
    for _ in range(3):
        sim.step(7)
        check(sim.sample())


@pytest.mark.parametrize('dimension, kind', joint_cases.CASES)
def test_readings_of_every_joint(dimension: int, kind: str) -> None:
    sim = joint_cases.simulation(dimension, kind)
    sim.step(20)
    check(sim.sample())


@pytest.mark.parametrize('kind, which', effect_examples.CASES)
def test_readings_under_every_effect(kind: str, which: str) -> None:
    """Friction that depends on reactions among them."""
    sim = effect_examples.simulation(kind, which)
    sim.step(130)
    sample = sim.sample()
    check(sample)
    if kind in ('joint_effort', 'motor', 'torsion_spring', 'joint_friction', 'joint_stop'):
        assert np.abs(sample.joint_efforts).max() > 0.1


def test_readings_of_what_is_held_and_driven() -> None:
    sim = Simulation(load_scene('slider_crank_controlled'))
    sim.apply_effort('crank_pin', 3.0)
    sim.apply_wrench('coupler', [1.0, 2.0], 0.5)
    sim.step(20)
    check(sim.sample())
    assert sim.sample().joint_efforts[sim.model.coordinate_names.index('crank_pin')] != 0.0


def test_limits_in_a_singular_position() -> None:
    """Eight places beside it, each by the formulas."""
    positions, velocities = {'A': [0, 1], 'B': [0, 0]}, {'A': [-2, 0], 'B': [-4, 0]}
    sim = Simulation(
        load_scene(
            {
                'mechanism': 'slider_crank',
                'effects': {'gravity': {'acceleration': [1.0, -9.81]}},
                'initial': {'positions': positions, 'velocities': velocities},
            }
        )
    )
    sample = sim.sample()
    assert sample._limits is not None
    check(sample)


def test_what_was_read_stays_as_it_is() -> None:
    """The next samples compute where it was computed."""
    sim = Simulation(load_scene('delta_robot'))
    sim.step(5)
    sample = sim.sample()
    read = [array for reading in READINGS.values() for array in values(reading, sample)]
    kept = [array.copy() for array in read]
    del sample
    for _ in range(5):
        sim.step(3)
        for reading in READINGS.values():
            values(reading, sim.sample())
    assert all(a.tobytes() == b.tobytes() for a, b in zip(read, kept, strict=True))


@pytest.mark.parametrize('name', ['delta_robot', 'slider_crank'])
def test_a_workspace_that_others_have_used_changes_no_bit(name: str) -> None:
    """Of a sample that is read late, or with others alive, or first of all."""
    used, first = (Simulation(load_scene(name), ledger=False) for _ in range(2))
    alive = []
    for k in range(6):
        used.step(4)
        alive += [used.sample()] if k % 2 else []
        for reading in READINGS.values():
            values(reading, used.sample())
    first.restore(used.state)
    late = used.sample()
    used.step(7)
    for reading in READINGS.values():
        a, b = values(reading, late), values(reading, first.sample())
        assert [x.tobytes() for x in a] == [x.tobytes() for x in b], reading.name
    assert len(used._run.stepper.instruments._idle) <= 4


def test_one_sample_read_by_two_threads() -> None:
    sim = Simulation(load_scene('delta_robot'))
    for _ in range(20):
        sim.step(1)
        sample, alone = sim.sample(), sim.sample()
        found: dict[str, Floats] = {}

        def read(name: str, sample: Sample = sample, found: dict[str, Floats] = found) -> None:
            found[name] = getattr(sample, name)

        names = ('reaction_forces', 'joint_efforts', 'reaction_torques')
        threads = [threading.Thread(target=read, args=(name,)) for name in names]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for name in names:
            assert found[name].tobytes() == getattr(alone, name).tobytes()


def test_a_sample_is_gone_when_nobody_has_it() -> None:
    """So that its workspace is lent again: nothing waits for the collector of cycles."""
    sim = Simulation(load_scene('slider_crank'))
    sample = sim.sample()
    assert sample.diagnostics.position_violation < 1e-8 and sample.lam.size
    gone = weakref.ref(sample)
    del sample
    assert gone() is None and len(sim._run.stepper.instruments._idle) == 1


def values(reading: Reading, sample: Sample) -> tuple[Floats, ...]:
    return () if reading.key == 'work' else reading.values(sample)


def test_the_distance_to_singular_positions_in_used_memory() -> None:
    sim = Simulation(load_scene('slider_crank'))
    for _ in range(5):
        sim.step(40)
        a, b = sim.sample(), Simulation(sim.scene)
        b.restore(sim.state)
        assert a.diagnostics.distance == b.sample().diagnostics.distance
        assert a.diagnostics.distance_error == b.sample().diagnostics.distance_error
