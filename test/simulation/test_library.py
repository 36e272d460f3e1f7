"""Every scene that comes along: it loads, closes, runs, keeps its energy, and moves as it must.

The exact motions of slider_crank, double_four_bar, n_four_bar and change_point are tested in
test_exact_solutions and test_singular_passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from alf_ros import Sample, Simulation, load_scene
from alf_ros.resources import folder

SCENES = sorted(path.stem for path in folder('scenes')[0].glob('*.yaml'))
MECHANISMS = sorted(path.stem for path in folder('mechanisms')[0].glob('*.yaml'))
G = 9.81

# rows that depend on the others, where there are any
REDUNDANT = {
    'bricard': 1,
    'differential_drive_cart': 1,
    'double_wishbone': 2,
    'planetary_gear': 2,
    'wheeled_robot': 1,
    'scissor_lift': 18,
}
FREEDOMS = {
    'actuator_leg': 5,
    'delta_robot': 3,
    'delta_robot_controlled': 3,
    'differential_drive_cart': 2,
    'wheeled_robot': 2,
    'double_pendulum': 2,
    'excavator': 3,
    'four_axis_delta': 4,
    'two_finger_gripper': 3,
    'chaplygin_sleigh': 2,
    'coin': 3,
    'governor': 2,
    'rolling_disk': 2,
    'spring_leg': 6,
    'stewart_platform': 6,
    'wiper': 0,  # driven
}


def test_the_library_has_a_scene_for_every_mechanism() -> None:
    assert {load_scene(name).mechanism.name for name in SCENES} == set(MECHANISMS)
    assert len(MECHANISMS) >= 16


def work(sim: Simulation, first: Sample, last: Sample) -> float:
    """J: what constant efforts and forces of the scene have put in."""
    done = 0.0
    for effect in sim.scene.effects:
        p = effect.parameters
        if effect.kind == 'joint_effort':
            done += p.effort * (last.joints[p.joint].position - first.joints[p.joint].position)
        if effect.kind == 'constant_wrench' and p.frame == 'world':
            at = p.at or sim.model.layout.body[p.on].points[0]
            done += float(np.dot(p.force, last.points[at] - first.points[at]))
    return done


@pytest.mark.parametrize('name', SCENES)
def test_every_scene_runs(name: str) -> None:
    """1 s with the solver settings of its own."""
    sim = Simulation(load_scene(name))
    every = max(1, round(0.05 / sim.h))
    samples = list(sim.run(1.0, every=every))
    first, last = samples[0], samples[-1]
    assert last.t == pytest.approx(1.0)
    assert max(sample.diagnostics.position_violation for sample in samples) < 1e-12
    assert max(sample.diagnostics.velocity_violation for sample in samples) < 1e-10
    assert last.diagnostics.redundant == REDUNDANT.get(name, 0)
    assert sim.model.n - last.diagnostics.rank == FREEDOMS.get(name, 1)
    open_ = any(reaction.indeterminate for reaction in last.reactions.values())
    assert open_ == (name in REDUNDANT)
    moved = max(np.abs(last.points[p] - first.points[p]).max() for p in first.points)
    if name.endswith('_controlled'):  # it stays as drawn until somebody commands it
        assert moved < 0.01
        return
    # the forces of the one turn with it, the motors of the others give what they take
    motors = any(effect.kind == 'motor' for effect in sim.scene.effects)
    if not motors and name not in ('differential_drive_cart', 'wiper', 'screw_jack'):
        tolerance = 1e-10 if sim.solver.integrator == 'dop853' else 1e-7
        gained = [s.energy - first.energy - work(sim, first, s) for s in samples]
        assert np.abs(gained).max() < tolerance * max(1.0, abs(first.energy))
    assert moved > (0.02 if name in ('coin', 'two_finger_gripper') else 0.05)


# ------------------------------------------------------------------------- one freedom, by energy


Array = np.ndarray[Any, np.dtype[Any]]  # also of complex numbers


def elapsed(
    inertia: Callable[[float], float],
    lift: Callable[[float], float],
    state: tuple[float, float, float],
) -> float:
    """s from θ0 to θ1, started at the rate θ̇0: ∫ dθ / θ̇ with ½ J θ̇² + V = E."""
    start, end, rate = state
    energy = 0.5 * inertia(start) * rate**2 + lift(start)

    def slowness(theta: float) -> float:
        return float(np.sqrt(inertia(theta) / (2.0 * (energy - lift(theta)))))

    return float(
        quad(slowness, start, end, epsabs=1e-13, epsrel=1e-13, limit=400)[0] * np.sign(rate)
    )


def of_rods(
    places: Callable[[complex], Mapping[str, Array]],
    rods: Iterable[tuple[str, str, float]],
    up: Array | None = None,
) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """J(θ) and V(θ) of slender rods between places, by complex steps."""
    rods = list(rods)

    def inertia(theta: float) -> float:
        v = {name: np.imag(p) * 1e30 for name, p in places(theta + 1e-30j).items()}
        return float(sum(m / 3.0 * (v[a] @ v[a] + v[a] @ v[b] + v[b] @ v[b]) for a, b, m in rods))

    def lift(theta: float) -> float:
        if up is None:
            return 0.0
        p = {name: np.real(each) for name, each in places(theta + 0j).items()}
        return float(sum(0.5 * m * G * (p[a] + p[b]) @ up for a, b, m in rods))

    return inertia, lift


def meet(a: Array, ra: float, b: Array, rb: float) -> Array:
    """Where circles about a and b meet, on the left of a -> b; complex numbers go through."""
    d2 = (b - a) @ (b - a)
    along = (ra**2 - rb**2 + d2) / (2.0 * d2)
    across = np.sqrt(ra**2 / d2 - along**2)
    d = b - a
    return a + along * d + across * np.array([-d[1], d[0]])


def circle(radius: float, theta: complex) -> Array:
    return radius * np.array([np.cos(theta), np.sin(theta)])


ORIGIN = np.zeros(2) + 0j


def one_second(name: str) -> tuple[Sample, Sample]:
    sim = Simulation(load_scene(name))
    first = sim.sample()
    sim.step(round(1.0 / sim.h))
    return first, sim.sample()


def test_peaucellier_draws_a_straight_line() -> None:
    arm, side, r = 0.35, 0.20, 0.15
    square = arm**2 - side**2

    def places(phi: complex) -> dict[str, Array]:
        P = np.array([r, 0.0]) + 0j
        A = P + circle(r, phi)
        B, C = meet(ORIGIN, arm, A, side), meet(A, side, ORIGIN, arm)
        D = square / (2.0 * r) * np.array([1.0, np.tan(0.5 * phi)])
        return {'O': ORIGIN, 'P': P, 'A': A, 'B': B, 'C': C, 'D': D}

    rods = [('P', 'A', 0.5 * r), ('O', 'B', 0.5 * arm), ('O', 'C', 0.5 * arm)]
    rods += [(a, b, 0.5 * side) for a in 'AD' for b in 'BC']
    sim = Simulation(load_scene('peaucellier'))
    rate = sim.sample().joints['crank_pin'].velocity
    start = sim.sample().joints['crank_pin'].position
    for sample in sim.run(1.0, every=10):
        assert sample.points['D'][0] == pytest.approx(square / (2.0 * r), abs=1e-12)
        exact = places(sample.joints['crank_pin'].position)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point].real, abs=1e-12)
    end = sample.joints['crank_pin'].position
    assert elapsed(*of_rods(places, rods), (start, end, rate)) == pytest.approx(1.0, abs=1e-9)


def test_jansen_leg() -> None:
    b, c, d, e, f, g = 0.415, 0.393, 0.401, 0.558, 0.394, 0.367
    h, i, j, k, m = 0.657, 0.490, 0.500, 0.619, 0.150
    Z = np.array([-0.38, -0.078]) + 0j

    def places(theta: complex) -> dict[str, Array]:
        X = circle(m, theta)
        Y, V = meet(Z, b, X, j), meet(X, k, Z, c)
        W = meet(Z, d, Y, e)
        U = meet(V, g, W, f)
        return {'O': ORIGIN, 'Z': Z, 'X': X, 'Y': Y, 'V': V, 'W': W, 'U': U, 'F': meet(V, i, U, h)}

    bars = {'XY': j, 'XV': k, 'ZY': b, 'ZW': d, 'YW': e, 'ZV': c, 'WU': f, 'VU': g}
    rods = [(*ends, 0.5 * length) for ends, length in {**bars, 'UF': h, 'VF': i}.items()]
    sim = Simulation(load_scene('jansen_leg'))
    for sample in sim.run(1.0, every=20):
        exact = places(sample.joints['crank_pin'].position)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point].real, abs=1e-12)
    inertia, lift = of_rods(places, rods, np.array([0.0, 1.0]))
    turned = (0.0, sample.joints['crank_pin'].position, 12.0)
    assert turned[1] > 1.5 * np.pi
    assert elapsed(lambda x: inertia(x) + 0.05, lift, turned) == pytest.approx(1.0, abs=1e-9)


def test_scissor_lift() -> None:
    N, L, m, load = 3, 0.5, 2.0, 5.0

    def places(theta: complex) -> dict[str, Array]:
        x, y = circle(L, theta)
        found = {f'A{k}': np.array([0.0, 2 * k * y]) for k in range(N + 1)}
        found |= {f'B{k}': np.array([2 * x, 2 * k * y]) for k in range(N + 1)}
        return found | {f'M{k}': np.array([x, (2 * k - 1) * y]) for k in range(1, N + 1)}

    rods = [(f'A{k}', f'B{k + 1}', 2 * m) for k in range(N)]
    rods += [(f'B{k}', f'A{k + 1}', 2 * m) for k in range(N)]
    sim = Simulation(load_scene('scissor_lift'))
    rate = sim.sample().joints['base'].velocity
    for sample in sim.run(1.0, every=10):
        exact = places(sample.joints['base'].position)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point].real, abs=1e-12)
    bars, _ = of_rods(places, rods)
    end = sample.joints['base'].position

    def inertia(theta: float) -> float:
        return float(bars(theta) + load * (2 * N * L * np.cos(theta)) ** 2)

    # the force balances the weight wherever the lift is
    time = elapsed(inertia, lambda _: 0.0, (np.radians(40), end, rate))
    assert time == pytest.approx(1.0, abs=1e-9)
    # front and rear share the load somehow; together they carry it
    jack = 9.81 * (2 * m * N + load)
    sim = Simulation(load_scene('scissor_lift'))
    sample = sim.sample()
    up = sample.reactions['base'].force[1] + sample.reactions['guide'].force[1]
    places_up = sample.qdd.reshape(-1, 2)
    names = [p.name for p in sim.model.mechanism.points if not p.fixed]
    a = dict(zip(names, places_up[:, 1], strict=True)) | {'A0': 0.0}
    needed = sum(0.5 * m * (a[p] + a[q]) for p, q, m in rods) + load * a[f'A{N}']
    assert up + jack - G * (4 * m * N + load) == pytest.approx(needed, abs=1e-8)


@pytest.mark.parametrize('penalty', [1e6, 1e8, 1e10])
def test_scissor_lift_through_its_singular_positions(penalty: float) -> None:
    """Let go, it rises till the bars stand, goes through, and falls: with 18 rows too many."""
    scene = load_scene('scissor_lift')
    weight = tuple(effect for effect in scene.effects if effect.kind == 'gravity')
    scene = replace(scene, effects=weight, velocities={'B0': (-2.5, 0.0)})
    sim = Simulation(scene, penalty=penalty, step=2e-3)
    first, last, passed = sim.sample(), sim.sample(), 0
    for sample in sim.run(1.0, every=2):
        before, now = last.points['B0'][0], sample.points['B0'][0]
        passed += before * now < 0.0
        assert sample.points['A3'][0] == pytest.approx(0.0, abs=1e-9)
        assert sample.points['B3'][0] == pytest.approx(now, abs=1e-9)
        assert sample.energy == pytest.approx(first.energy, abs=1e-6)
        last = sample
    assert passed == 2


def test_another_number_of_stages() -> None:
    sim = Simulation(load_scene('scissor_lift', {'N': 5}))
    sim.step(20)
    assert sim.sample().diagnostics.redundant == 30
    assert sim.sample().points['A5'][0] == pytest.approx(0.0, abs=1e-12)


def test_wiper() -> None:
    """The arms stay parallel and swing by the law of cosines, as the motor goes round."""
    sim = Simulation(load_scene('wiper'))
    shaft, lever, reach = np.array([0.18, -0.075]), 0.075, 0.045
    rod = np.hypot(0.18, reach)
    for sample in sim.run(2.0, every=125):
        t = sample.t
        crank = 1.5 * np.pi * (t - 0.1 * (1 - np.exp(-10 * t))) - np.pi / 2
        A = shaft + reach * np.array([np.cos(crank), np.sin(crank)])
        away = np.hypot(*A)
        between = np.arccos((lever**2 + away**2 - rod**2) / (2 * lever * away))
        angle = np.arctan2(A[1], A[0]) - between  # of P1-B1
        assert sample.joints['pivot1'].position == pytest.approx(angle, abs=1e-12)
        assert sample.points['T2'] - sample.points['T1'] == pytest.approx([0.5, 0.0], abs=1e-12)
        assert sample.joints['motor_shaft'].effort == sample.drive_efforts['motor'][0]


def test_four_bar() -> None:
    a, b, c, d = 0.10, 0.30, 0.25, 0.30
    C = np.array([d, 0.0]) + 0j

    def places(theta: complex) -> dict[str, Array]:
        A = circle(a, theta)
        return {'O': ORIGIN, 'C': C, 'A': A, 'B': meet(A, b, C, c)}

    rods = [('O', 'A', 0.54 * a), ('A', 'B', 0.54 * b), ('C', 'B', 0.54 * c)]
    first, last = one_second('four_bar')
    turned = first.joints['crank_pin'].position, last.joints['crank_pin'].position, 30.0
    assert last.points['B'] == pytest.approx(places(turned[1])['B'].real, abs=1e-12)
    model = of_rods(places, rods, np.array([0.0, 1.0]))
    assert elapsed(*model, turned) == pytest.approx(1.0, abs=1e-7)


def test_spatial_slider_crank() -> None:
    r, length, y, z = 0.08, 0.30, 0.10, 0.12

    def places(theta: complex) -> dict[str, Array]:
        A = np.array([0.0, y - r * np.sin(theta), z + r * np.cos(theta)])
        return {'A': A, 'B': np.array([np.sqrt(length**2 - A @ A), 0.0, 0.0])}

    first, last = one_second('spatial_slider_crank')
    end = last.joints['crank_pin'].position
    assert first.joints['crank_pin'].position == 0.0 and end > 4.0 * np.pi
    assert last.points['B'] == pytest.approx(places(end)['B'].real, abs=1e-12)
    moved = last.points['B'][0] - first.points['B'][0]
    assert last.joints['guide'].position == pytest.approx(moved, abs=1e-12)
    rod, lift = of_rods(places, [('A', 'B', 0.5)], np.array([0.0, 0.0, 1.0]))

    def inertia(theta: float) -> float:
        slider = float(np.imag(places(theta + 1e-30j)['B'][0]) * 1e30)
        return float(0.01 + rod(theta) + 2.0 * slider**2)

    assert elapsed(inertia, lift, (0.0, end, 40.0)) == pytest.approx(1.0, abs=1e-9)


def test_spatial_four_bar() -> None:
    a, b, c, d = 0.10, 0.45, 0.30, 0.35

    def places(theta: complex) -> dict[str, Array]:
        A = a * np.array([np.sin(theta), -np.cos(theta), 0.0])
        # |C + c (cos β, 0, sin β) - A| = b: (d - A_x) cos β = k, and the upper of both
        cosine = (b**2 - c**2 - (d - A[0]) ** 2 - A[1] ** 2) / (2.0 * c * (d - A[0]))
        B = np.array([d + c * cosine, 0.0, c * np.sqrt(1.0 - cosine**2)])
        zero = np.zeros(3) + 0j
        return {'O': zero, 'C': np.array([d, 0.0, 0.0]) + 0j, 'A': A, 'B': B}

    first, last = one_second('spatial_four_bar')
    end = last.joints['crank_pin'].position
    assert first.joints['crank_pin'].position == 0.0 and end > 4.0 * np.pi
    assert last.points['B'] == pytest.approx(places(end)['B'].real, abs=1e-12)
    rods = [('O', 'A', 0.5 * a), ('A', 'B', 0.5 * b), ('C', 'B', 0.5 * c)]
    model = of_rods(places, rods, np.array([0.0, 0.0, 1.0]))
    assert elapsed(*model, (0.0, end, 25.0)) == pytest.approx(1.0, abs=1e-9)


def test_stewart_platform_heaves() -> None:
    """Six equal legs move the plate along its axis: one freedom, in closed form."""
    rb, rp, H, plate, mass, across, half = 1.0, 0.6, 1.2, 20.0, 2.0, 0.1, 0.4
    angle = np.radians(40)
    flat = np.sqrt(rb**2 + rp**2 - 2.0 * rb * rp * np.cos(angle))
    thrust = G * (plate / 6.0 + mass) * np.hypot(flat, H) / H

    def inertia(h: float) -> float:
        s = np.hypot(flat, h)
        turn = flat / s**2  # rad per m of height
        side = flat / s  # of a unit of height, across the leg
        leg = mass * (half * turn) ** 2 + mass * ((side - half * turn) ** 2 + (h / s) ** 2)
        return float(plate + 6.0 * (leg + 2.0 * across * turn**2))

    def lift(h: float) -> float:
        return float(G * (plate + 6.0 * mass) * h - 6.0 * thrust * np.hypot(flat, h))

    first, last = one_second('stewart_platform')
    assert last.points['C'][:2] == pytest.approx(0.0, abs=1e-10)
    assert last.points['P3'][2] == pytest.approx(last.points['C'][2], abs=1e-10)
    legs = np.array([last.joints[f'leg{n}'].position for n in range(6)])
    h = last.points['C'][2]
    assert legs - np.hypot(flat, h) + np.hypot(flat, H) == pytest.approx(0.0, abs=1e-10)
    assert elapsed(inertia, lift, (H, h, 0.3)) == pytest.approx(1.0, abs=1e-9)
