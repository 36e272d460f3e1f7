"""Every scene that comes along: it loads, closes, runs, keeps its energy, and moves as it must.

The exact motions of slider_crank, double_four_bar, n_four_bar and change_point are tested in
test_exact_solutions and test_singular_passes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from alf_ros import Sample, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.resources import folder
from alf_ros.scene.scene import scene_from_text

DATA = Path(__file__).parent / 'data'
SCENES = sorted(path.stem for path in folder('scenes')[0].glob('*.yaml'))
MECHANISMS = sorted(path.stem for path in folder('mechanisms')[0].glob('*.yaml'))
G = 9.81

# rows that depend on the others, where there are any
REDUNDANT = {
    'bricard': 1,
    'differential_drive_cart': 1,
    'double_wishbone': 2,
    'planetary_gear': 2,
    'scissor_lift': 18,
}
FREEDOMS = {
    'delta_robot': 3,
    'differential_drive_cart': 2,
    'double_pendulum': 2,
    'chaplygin_sleigh': 2,
    'coin': 3,
    'governor': 2,
    'rolling_disk': 2,
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
    # the forces of the one turn with it, the motors of the others give what they take
    if name not in ('differential_drive_cart', 'wiper', 'screw_jack'):
        tolerance = 1e-10 if sim.solver.integrator == 'dop853' else 1e-7
        gained = [s.energy - first.energy - work(sim, first, s) for s in samples]
        assert np.abs(gained).max() < tolerance * max(1.0, abs(first.energy))
    moved = max(np.abs(last.points[p] - first.points[p]).max() for p in first.points)
    assert moved > (0.02 if name == 'coin' else 0.05)


# ------------------------------------------------------------------------- one freedom, by energy


def elapsed(inertia: Callable[[float], float], lift: Callable[[float], float], state: Iterable):  # type: ignore[no-untyped-def, type-arg]
    """s from θ0 to θ1, started at the rate θ̇0: ∫ dθ / θ̇ with ½ J θ̇² + V = E."""
    start, end, rate = state
    energy = 0.5 * inertia(start) * rate**2 + lift(start)

    def slowness(theta: float) -> float:
        return float(np.sqrt(inertia(theta) / (2.0 * (energy - lift(theta)))))

    return quad(slowness, start, end, epsabs=1e-13, epsrel=1e-13, limit=400)[0] * np.sign(rate)


def of_rods(  # type: ignore[no-untyped-def]
    places: Callable[[complex], Mapping[str, np.ndarray]],  # type: ignore[type-arg]
    rods: Iterable[tuple[str, str, float]],
    up: Floats | None = None,
):
    """J(θ) and V(θ) of slender rods between places, by complex steps."""
    rods = list(rods)

    def inertia(theta: float) -> float:
        v = {name: np.imag(p) * 1e30 for name, p in places(theta + 1e-30j).items()}
        return sum(m / 3.0 * (v[a] @ v[a] + v[a] @ v[b] + v[b] @ v[b]) for a, b, m in rods)

    def lift(theta: float) -> float:
        if up is None:
            return 0.0
        p = {name: np.real(each) for name, each in places(theta + 0j).items()}
        return sum(0.5 * m * G * (p[a] + p[b]) @ up for a, b, m in rods)

    return inertia, lift


def meet(a: np.ndarray, ra: float, b: np.ndarray, rb: float) -> np.ndarray:  # type: ignore[type-arg]
    """Where circles about a and b meet, on the left of a -> b; complex numbers go through."""
    d2 = (b - a) @ (b - a)
    along = (ra**2 - rb**2 + d2) / (2.0 * d2)
    across = np.sqrt(ra**2 / d2 - along**2)
    d = b - a
    return a + along * d + across * np.array([-d[1], d[0]])


def circle(radius: float, theta: complex) -> np.ndarray:  # type: ignore[type-arg]
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

    def places(phi: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
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

    def places(theta: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
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
    inertia, lift = of_rods(places, rods, np.array([0.0, 1.0]))  # type: ignore[arg-type]
    turned = (0.0, sample.joints['crank_pin'].position, 12.0)
    assert turned[1] > 1.5 * np.pi
    assert elapsed(lambda x: inertia(x) + 0.05, lift, turned) == pytest.approx(1.0, abs=1e-9)


def test_scissor_lift() -> None:
    N, L, m, load = 3, 0.5, 2.0, 5.0

    def places(theta: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
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

    def places(theta: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
        A = circle(a, theta)
        return {'O': ORIGIN, 'C': C, 'A': A, 'B': meet(A, b, C, c)}

    rods = [('O', 'A', 0.54 * a), ('A', 'B', 0.54 * b), ('C', 'B', 0.54 * c)]
    first, last = one_second('four_bar')
    turned = first.joints['crank_pin'].position, last.joints['crank_pin'].position, 30.0
    assert last.points['B'] == pytest.approx(places(turned[1])['B'].real, abs=1e-12)
    model = of_rods(places, rods, np.array([0.0, 1.0]))  # type: ignore[arg-type]
    assert elapsed(*model, turned) == pytest.approx(1.0, abs=1e-7)


def test_spatial_slider_crank() -> None:
    r, length, y, z = 0.08, 0.30, 0.10, 0.12

    def places(theta: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
        A = np.array([0.0, y - r * np.sin(theta), z + r * np.cos(theta)])
        return {'A': A, 'B': np.array([np.sqrt(length**2 - A @ A), 0.0, 0.0])}

    first, last = one_second('spatial_slider_crank')
    end = last.joints['crank_pin'].position
    assert first.joints['crank_pin'].position == 0.0 and end > 4.0 * np.pi
    assert last.points['B'] == pytest.approx(places(end)['B'].real, abs=1e-12)
    moved = last.points['B'][0] - first.points['B'][0]
    assert last.joints['guide'].position == pytest.approx(moved, abs=1e-12)
    rod, lift = of_rods(places, [('A', 'B', 0.5)], np.array([0.0, 0.0, 1.0]))  # type: ignore[arg-type]

    def inertia(theta: float) -> float:
        slider = float(np.imag(places(theta + 1e-30j)['B'][0]) * 1e30)
        return float(0.01 + rod(theta) + 2.0 * slider**2)

    assert elapsed(inertia, lift, (0.0, end, 40.0)) == pytest.approx(1.0, abs=1e-9)


def test_spatial_four_bar() -> None:
    a, b, c, d = 0.10, 0.45, 0.30, 0.35

    def places(theta: complex) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
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
    model = of_rods(places, rods, np.array([0.0, 0.0, 1.0]))  # type: ignore[arg-type]
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


# ------------------------------------------------------------------------------ closed forms


def test_planetary_gear() -> None:
    """Willis: ω_c = ω_s rs / (rs + rr), planets ω_p = ω_c - ω_c rr / rp; constant acceleration."""
    rs, rr = 0.03, 0.09
    rp, rc = 0.5 * (rr - rs), 0.5 * (rr + rs)
    carrier = rs / (rs + rr)
    planet = carrier * (1.0 - rr / rp)
    inertia = 5e-4 + carrier**2 * (1e-3 + 3 * 0.2 * rc**2) + 3 * planet**2 * 1e-4
    sim = Simulation(load_scene('planetary_gear'))
    start, spin = sim.sample().joints['pin1'].position, planet - carrier
    for sample in sim.run(1.0, every=50):
        angle = 0.5 * 0.02 / inertia * sample.t**2
        assert sample.joints['shaft'].position == pytest.approx(angle, abs=1e-9)
        assert sample.joints['output'].position == pytest.approx(carrier * angle, abs=1e-9)
        assert sample.joints['pin1'].position - start == pytest.approx(spin * angle, abs=1e-9)
    assert angle > 10.0  # rad
    flags = {name for name, reaction in sample.reactions.items() if reaction.indeterminate}
    assert {'mesh0', 'mesh1', 'mesh2', 'ring0', 'ring1', 'ring2'} <= flags


def test_one_planet_is_determinate() -> None:
    """Its tooth forces: T = F rs drives the sun, and each mesh is tangential."""
    text = load_scene('planetary_gear').text.replace('k: [0, 2]', 'k: [0, 0]')
    scene = scene_from_text(text.replace('[O, P0, P1, P2]', '[O, P0]'))
    assert len(scene.mechanism.bodies) == 3
    sim = Simulation(scene, step=2e-3, integrator='dop853')
    sim.step(100)
    sample = sim.sample()
    assert sample.diagnostics.redundant == 0
    out = sample.points['P0'] / np.linalg.norm(sample.points['P0'])
    for joint in ('mesh0', 'ring0'):
        assert sample.reactions[joint].force @ out == pytest.approx(0.0, abs=1e-10)
    # the sun: J α = T - F rs, F on the planet
    rs, rr, rp, rc = 0.03, 0.09, 0.03, 0.06
    carrier = rs / (rs + rr)
    planet = carrier * (1.0 - rr / rp)
    alpha = 0.02 / (5e-4 + carrier**2 * (1e-3 + 0.2 * rc**2) + planet**2 * 1e-4)
    force = sample.reactions['mesh0'].force @ [-out[1], out[0]]
    assert force * rs == pytest.approx(0.02 - 5e-4 * alpha, abs=1e-9)
    # the planet: J α_p = -F rp + G rp, about its centre (F on the inner side, G on the outer)
    other = sample.reactions['ring0'].force @ [-out[1], out[0]]
    assert (other - force) * rp == pytest.approx(1e-4 * planet * alpha, abs=1e-9)
    torques = [sample.reactions[joint].torque for joint in ('mesh0', 'ring0')]
    assert torques == pytest.approx([-force * rp, other * rp], abs=1e-9)


def test_rack_and_pinion() -> None:
    """a (m + J / r²) = 2 m."""
    r, J, m = 0.05, 0.002, 1.5
    a = 2.0 * m / (m + J / r**2)
    for sample in Simulation(load_scene('rack_and_pinion')).run(1.0, every=20):
        moved = 0.5 * a * sample.t**2
        assert sample.joints['guide'].position == pytest.approx(moved, abs=1e-10)
        # the rack below moves to the right: the pinion turns counter-clockwise
        assert sample.joints['axle'].position == pytest.approx(moved / r, abs=1e-9)
        tooth = sample.reactions['mesh'].force
        assert tooth == pytest.approx([J * a / r**2, 0.0], abs=1e-9)


def test_pendulum() -> None:
    """IFToMM A01, 10 s."""
    exact = json.loads((DATA / 'A01_simple_pendulum.json').read_text())
    sim = Simulation(load_scene('pendulum'))
    times = [each['t'] for each in exact['samples']]
    for sample, wanted in zip(sim.run(10.0, at=times), exact['samples'], strict=True):
        assert sample.points['A'] == pytest.approx(wanted['q'], abs=1e-10)
        assert sample.velocities['A'] == pytest.approx(wanted['qd'], abs=1e-9)
        assert sample.qdd == pytest.approx(wanted['qdd'], abs=1e-8)
        # Φ = ½ (|q|² - L²), so that λ is the pull of the bar over L
        assert sample.lam == pytest.approx(wanted['lambda'], abs=1e-8)


def test_bricard() -> None:
    exact = json.loads((DATA / 'A04_bricard.json').read_text())['slender']['samples'][:11]
    sim = Simulation(load_scene('bricard'))
    for sample, wanted in zip(sim.run(1.0, at=[s['t'] for s in exact]), exact, strict=True):
        assert sample.points['P2'] == pytest.approx(wanted['P3'], abs=1e-10)


def test_double_pendulum() -> None:
    """Two angles, by Lagrange."""
    a, b = 1.0, 0.8

    def rate(_: float, state: Floats) -> Floats:
        one, two, w, v = state
        c, s = np.cos(one - two), np.sin(one - two)
        M = np.array([[a * a / 3 + a * a, a * b * c / 2], [a * b * c / 2, b * b / 3]])
        Q = [-a * b / 2 * s * v * v - 1.5 * G * a * np.cos(one)]
        Q += [a * b / 2 * s * w * w - 0.5 * G * b * np.cos(two)]
        return np.array([w, v, *np.linalg.solve(M, Q)])

    start = [0.0, 0.5 * np.pi, 0.0, 0.0]
    exact = solve_ivp(rate, (0.0, 2.0), start, 'DOP853', rtol=1e-13, atol=1e-13).y[:, -1]
    sim = Simulation(load_scene('double_pendulum'))
    sim.step(400)
    sample = sim.sample()
    assert sample.joints['shoulder'].position == pytest.approx(exact[0], abs=1e-9)
    assert sample.joints['elbow'].position == pytest.approx(exact[1] - exact[0], abs=1e-9)
    assert sample.joints['shoulder'].velocity == pytest.approx(exact[2], abs=1e-9)


def test_governor() -> None:
    """At its steady rate the balls stay where they are; faster, the angular momentum is kept."""
    L, m, M, J, phi = 0.2, 0.5, 1.0, 0.01, np.radians(35)
    rate = np.sqrt((m + M) * G / (m * L * np.cos(phi)))
    for sample in Simulation(load_scene('governor', {'faster': 1.0})).run(1.0, every=50):
        assert sample.points['S'] == pytest.approx([0.0, 0.0, -2 * L * np.cos(phi)], abs=1e-9)
        assert sample.joints['bearing'].position == pytest.approx(rate * sample.t, abs=1e-8)
        assert sample.points['B1'][:2] == pytest.approx(
            L * np.sin(phi) * np.array([np.cos(rate * sample.t), np.sin(rate * sample.t)]),
            abs=1e-9,
        )

    def momentum(sample: Sample) -> float:
        radius = sample.points['B1'][:2]
        return float((J + 1e-3 + 2 * m * radius @ radius) * sample.joints['bearing'].velocity)

    samples = list(Simulation(load_scene('governor')).run(1.0, every=25))
    assert np.ptp([momentum(s) for s in samples]) < 1e-11
    assert np.ptp([s.points['S'][2] for s in samples]) > 0.02


def test_delta_robot_moves_without_turning() -> None:
    rb, a, length, rp = 0.20, 0.25, 0.45, 0.06
    sim = Simulation(load_scene('delta_robot'))
    plate = sim.model.body_names.index('plate')
    start = Rotation.from_quat(sim.sample().body_poses[plate, 3:])
    for sample in sim.run(1.0, every=20):
        turn = Rotation.from_quat(sample.body_poses[plate, 3:]) * start.inv()
        assert turn.magnitude() < 1e-12
        for k in range(3):
            out = np.array([np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3), 0.0])
            theta = np.radians(30) + sample.joints[f'motor{k}'].position
            elbow = (rb - rp + a * np.cos(theta)) * out - [0.0, 0.0, a * np.sin(theta)]
            rod = np.linalg.norm(sample.points['C'] - elbow)
            assert rod == pytest.approx(length, abs=1e-12)


@pytest.mark.parametrize('name', ['delta_robot', 'stewart_platform'])
def test_actuators_hold_the_weight(name: str) -> None:
    """The efforts of the scene are those of virtual work: started at rest, it stays at rest."""
    sim = Simulation(replace(load_scene(name), velocities={}))
    first = sim.sample()
    sim.step(100)
    assert sim.sample().points['C'] == pytest.approx(first.points['C'], abs=1e-10)
    assert first.qdd == pytest.approx(0.0, abs=1e-9)


def test_double_wishbone() -> None:
    """Where the lower ball joint is, the wheel is, by another way of closing the loops."""
    sim = Simulation(load_scene('double_wishbone'))
    drawn = {p.name: np.array(p.at) for p in sim.model.mechanism.points}
    hinge = drawn['UF'] - drawn['UR']
    rod = np.linalg.norm(drawn['S'] - drawn['T'])

    def place(name: str, x: Floats, D: Floats) -> Floats:
        return np.asarray(D + Rotation.from_rotvec(x[:3]).apply(drawn[name] - drawn['D']))

    def gaps(x: Floats, D: Floats) -> list[float]:
        swing = Rotation.from_rotvec(x[3] * hinge / np.linalg.norm(hinge))
        upper = drawn['UR'] + swing.apply(drawn['U'] - drawn['UR'])
        return [*(place('U', x, D) - upper), np.linalg.norm(place('S', x, D) - drawn['T']) - rod]

    for sample in sim.run(1.0, every=20):
        D = sample.points['D']
        x = fsolve(gaps, np.zeros(4), args=(D,), xtol=1e-14)
        for name in 'WUS':
            assert sample.points[name] == pytest.approx(place(name, x, D), abs=1e-10)
        assert D[0] == pytest.approx(0.0, abs=1e-12)  # its wishbone swings about x
    assert sample.points['W'][2] > 0.4
    flags = {name for name, reaction in sample.reactions.items() if reaction.indeterminate}
    assert flags == {'lower_front', 'lower_rear', 'upper_front', 'upper_rear'}


def test_rolling_disk() -> None:
    roll, yaw, R = 3.0, 0.8, 0.5
    for sample in Simulation(load_scene('rolling_disk')).run(1.0, every=20):
        angle, radius = yaw * sample.t, R * roll / yaw
        wanted = radius * np.sin(angle), radius * (1.0 - np.cos(angle)), R
        assert sample.points['C'] == pytest.approx(wanted, abs=1e-10)


def path(speed: Callable[[float], float], heading: Callable[[float], float], t: float) -> Floats:
    """m: where something is that moves the way it points."""
    parts = [lambda s: speed(s) * np.cos(heading(s)), lambda s: speed(s) * np.sin(heading(s))]
    return np.array([quad(f, 0.0, t, epsabs=1e-13, epsrel=1e-13)[0] for f in parts])


def test_differential_drive_cart() -> None:
    """m v̇ = F_l + F_r, J ψ̈ = w (F_r - F_l)."""
    m, J, w, left, right = 8.0, 0.3, 0.2, 6.0, 8.0
    a, spin = (left + right) / m, w * (right - left) / J
    for sample in Simulation(load_scene('differential_drive_cart')).run(1.0, every=20):
        where = path(lambda t: a * t, lambda t: 0.5 * spin * t * t, sample.t)
        assert sample.points['C'] == pytest.approx(where, abs=1e-10)
        assert sample.body_poses[0, 2] == pytest.approx(0.5 * spin * sample.t**2, abs=1e-10)
        kinetic = 0.5 * (m * a**2 + J * spin**2) * sample.t**2
        assert sample.energy == pytest.approx(kinetic, abs=1e-10)


def test_chaplygin_sleigh_turns_round() -> None:
    """v = c tanh(τ), ω = (c / k) sech(τ), τ = a c (t - t0) / k², k² = J / m + a²."""
    m, J, a, speed, turn = 1.5, 0.2, 0.4, -1.0, 0.2
    k = np.sqrt(J / m + a**2)
    c = np.hypot(speed, k * turn)
    start = np.arctanh(speed / c)

    def tau(t: float) -> float:
        return float(start + a * c * t / k**2)

    def heading(t: float) -> float:
        return float(
            2.0 * k / a * (np.arctan(np.tanh(tau(t) / 2)) - np.arctan(np.tanh(start / 2)))
        )

    for sample in Simulation(load_scene('chaplygin_sleigh')).run(5.0, every=100):
        where = path(lambda t: c * np.tanh(tau(t)), heading, sample.t)
        assert sample.points['A'] == pytest.approx(where, abs=1e-9)
        assert sample.body_poses[0, 2] == pytest.approx(heading(sample.t), abs=1e-9)
    assert c * np.tanh(tau(5.0)) > 0.9 * c  # forwards in the end
