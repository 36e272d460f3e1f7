"""The arm of the excavator: cylinders by the law of cosines, forces by Lagrange's equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from support.lagrange import Array, Reduced, distance, meet, planar, turned

CYLINDERS = ('boom_cylinder', 'stick_cylinder', 'bucket_cylinder')
FOOT, BASE = np.zeros(2), np.array([0.55, -0.65])  # O and C


def along(direction: Array, x: float, y: float) -> Array:
    """The place (x, y) of a frame with this unit vector as its x axis."""
    return x * direction + y * turned(direction)


def places(lengths: Array) -> dict[str, Array]:
    """All points for the lengths of the three cylinders, m."""
    P = meet(FOOT, np.hypot(2.35, 0.75), BASE, lengths[0])
    boom = (2.35 * P - 0.75 * turned(P)) / (2.35**2 + 0.75**2)
    Q, S = along(boom, 2.75, 1.25), 5.7 * boom
    T = meet(Q, lengths[1], S, 0.8)
    stick = (S - T) / 0.8
    K, L, B = S + along(stick, 0.35, 0.45), S + along(stick, 2.45, 0.05), S + 2.9 * stick
    M = meet(K, lengths[2], L, 0.62)
    N = meet(M, 0.60, B, 0.45)
    horn, open_ = (N - B) / 0.45, -np.radians(105)
    E = B + 1.5 * along(horn, np.cos(open_), np.sin(open_))
    found = {'O': FOOT, 'C': BASE, 'P': P, 'Q': Q, 'S': S, 'T': T}
    found |= {'K': K, 'L': L, 'B': B, 'M': M, 'N': N, 'E': E}
    for barrel, rod, length in (('C', 'P', 2.0), ('Q', 'T', 2.1), ('K', 'M', 1.6)):
        way = found[rod] - found[barrel]
        way = way / distance(found[barrel], found[rod])
        found[f'{barrel}1'] = found[barrel] + length * way
        found[f'{rod}1'] = found[rod] - length * way
    return found


def drawn() -> Floats:
    """(3,) lengths of the cylinders at which their joints are at 0, m."""
    at = {p.name: np.array(p.at) for p in load_scene('excavator').mechanism.points}
    return np.array([distance(at[a], at[b]) for a, b in ('CP', 'QT', 'KM')])


def reduced() -> Reduced:
    return planar(load_scene('excavator').mechanism.bodies, places)


def test_a_cycle_closes_by_the_law_of_cosines() -> None:
    sim, zero, moved = Simulation(load_scene('excavator')), drawn(), []
    for sample in sim.run(9.0, every=90):
        lengths = zero + [sample.joints[name].position for name in CYLINDERS]
        exact = places(lengths)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point], abs=1e-11), point
        moved.append(sample.points['E'])
    # the teeth dig below the tracks, and are lifted
    assert min(y for _, y in moved) < -2.5 and max(y for _, y in moved) > 2.0


def test_at_rest_the_cylinders_carry_the_weight_by_virtual_work() -> None:
    """F = ∂V/∂l: for each cylinder the weights of all that its length lifts."""
    zero, still = drawn(), np.zeros(3)
    for moved in ((0.0, 0.0, 0.0), (-0.3, -0.4, -0.2), (0.3, 0.4, 0.3)):
        efforts = Simulation(held([str(length) for length in moved])).sample().drive_efforts
        wanted = reduced().efforts(zero + moved, still, still)
        found = [efforts[f'pump_{name}'][0] for name in CYLINDERS]
        assert found == pytest.approx(wanted, rel=1e-10)


def held(motions: list[str]) -> Any:
    """The scene with cylinders that follow functions of time, and nothing but the weight."""
    each = zip(CYLINDERS, motions, strict=True)
    drives = {f'pump_{name}': {'joint': name, 'length': motion} for name, motion in each}
    return load_scene(
        {
            'mechanism': 'excavator',
            'drives': drives,
            'effects': {'gravity': {'acceleration': [0, -9.81]}},
            'solver': {'step': 5e-3, 'integrator': 'dop853'},
        }
    )


def test_forces_of_a_prescribed_motion() -> None:
    """Three cylinders at once: what they push, by Lagrange's equations of their lengths."""
    sizes, rates = np.array([0.25, 0.3, 0.2]), np.array([1.7, 2.3, 3.1])
    motions = [f'{size}*sin({rate}*t)' for size, rate in zip(sizes, rates, strict=True)]
    model, zero = reduced(), drawn()
    for sample in Simulation(held(motions)).run(2.0, every=20):
        phase = rates * sample.t
        wanted = model.efforts(
            zero + sizes * np.sin(phase),
            sizes * rates * np.cos(phase),
            -sizes * rates**2 * np.sin(phase),
        )
        found = [sample.drive_efforts[f'pump_{name}'][0] for name in CYLINDERS]
        assert found == pytest.approx(wanted, rel=1e-8, abs=1e-3)  # of 1e5 N


def test_a_motion_under_constant_forces() -> None:
    """Three freedoms: Lagrange's equations of the lengths, integrated to 1e-12."""
    pushes, model = np.array([2.2e5, -2.0e4, 1.5e3]), reduced()

    def rate(_: float, state: Floats) -> Floats:
        return np.concatenate([state[3:], model.acceleration(state[:3], state[3:], pushes)])

    start = np.concatenate([drawn(), np.zeros(3)])
    exact = solve_ivp(rate, (0.0, 0.5), start, 'DOP853', rtol=1e-12, atol=1e-12).y[:, -1]
    scene = load_scene('excavator')
    gravity = tuple(effect for effect in scene.effects if effect.kind == 'gravity')
    sim = Simulation(replace(scene, effects=gravity))
    for name, push in zip(CYLINDERS, pushes, strict=True):
        sim.apply_effort(name, push)
    sim.step(100)
    joints = sim.sample().joints
    found = [joints[name].position for name in CYLINDERS]
    assert np.abs(found).min() > 0.01
    assert found == pytest.approx(exact[:3] - drawn(), abs=1e-9)
    assert [joints[name].velocity for name in CYLINDERS] == pytest.approx(exact[3:], abs=1e-8)
