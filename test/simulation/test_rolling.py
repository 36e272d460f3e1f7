"""Rows that bind velocities only (38)-(41), against closed forms: skate, sleigh, rolling disk."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from alf_ros import Simulation, load_scene
from alf_ros.scene.scene import Scene, scene_from_text
from support.effect_scenes import SKATE, SKATE_DOWNHILL, SKATE_RATE

TIMES = [0.1 * k for k in range(51)]

MASS, INERTIA, AHEAD = 1.5, 0.2, 0.4
SPEED, TURN = 0.7, 2.0  # m/s of the blade, rad/s
SLEIGH = f"""
mechanism:
  alf: 1
  points: {{A: {{at: [0, 0]}}, B: {{at: [1, 0]}}}}
  bodies:
    sleigh:
      {{points: [A, B], mass: {MASS}, inertia: {{about_com: {INERTIA}}}, com: [{AHEAD}, 0]}}
  joints:
    blade: {{type: blade, between: [ground, sleigh], at: A, axis: [1, 0]}}
initial:
  velocities: {{A: [{SPEED}, 0], B: [{SPEED}, {TURN}]}}
"""

RADIUS, ROLL, YAW = 0.5, 3.0, 0.8
DISK = f"""
mechanism:
  alf: 1
  space: spatial
  points: {{C: {{at: [0, 0, {RADIUS}]}}, O: {{at: [0, 0, 0], fixed: true}}}}
  vectors: {{axle: {{along: [0, 1, 0]}}, spoke: {{along: [1, 0, 0]}}}}
  bodies:
    disk:
      points: [C]
      vectors: [axle, spoke]
      mass: 2
      inertia: {{about_com: [0.25, 0.125, 0.125]}}
  joints:
    rim: {{type: no_slip, between: [ground, disk], at: C, radius: {RADIUS},
           on: {{through: [0, 0, 0], normal: [0, 0, 1]}}}}
    upright: {{type: perpendicular, between: [ground, disk], axes: [[0, 0, 1], [0, 1, 0]]}}
effects:
  gravity: {{acceleration: [0, 0, -9.81]}}
initial:
  velocities: {{axle: [{-YAW}, 0, 0], spoke: [0, {YAW}, {-ROLL}]}}
"""


def run(scene: Scene, integrator: str, step: float) -> list:  # type: ignore[type-arg]
    sim = Simulation(scene, integrator=integrator, step=step, tolerance=1e-11)
    return list(sim.run(TIMES[-1], at=TIMES))


@pytest.fixture(
    params=[('rk4', 1e-3), ('dop853', 1e-2), ('dop853_adaptive', 0.1)], ids=lambda p: p[0]
)
def method(request: pytest.FixtureRequest) -> tuple[str, float]:
    return request.param


def energy_is_kept(samples: list) -> None:  # type: ignore[type-arg]
    energies = [sample.energy for sample in samples]
    assert np.ptp(energies) < 1e-9


def test_skate_on_an_incline(method: tuple[str, float]) -> None:
    """It does not slide down: it goes across, on a cycloid."""
    samples = run(scene_from_text(SKATE), *method)
    energy_is_kept(samples)
    for sample in samples:
        angle = SKATE_RATE * sample.t
        r = SKATE_DOWNHILL / (2.0 * SKATE_RATE**2)
        wanted = r * np.sin(angle) ** 2, r * (angle - 0.5 * np.sin(2.0 * angle))
        assert sample.points['A'] == pytest.approx(wanted, abs=1e-9)
        assert sample.body_poses[0, 2] == pytest.approx(angle, abs=1e-9)
        assert abs(sample.phi_dot[-1]) < 1e-12


def test_chaplygin_sleigh(method: tuple[str, float]) -> None:
    """v = c tanh(τ), ω = (c / k) sech(τ), τ = a c (t - t0) / k², k² = J / m + a²."""
    samples = run(scene_from_text(SLEIGH), *method)
    energy_is_kept(samples)
    k = np.sqrt(INERTIA / MASS + AHEAD**2)
    c = np.hypot(SPEED, k * TURN)
    start = np.arctanh(SPEED / c)

    def tau(t: float) -> float:
        return start + AHEAD * c * t / k**2

    def heading(t: float) -> float:
        return 2.0 * k / AHEAD * (np.arctan(np.tanh(tau(t) / 2)) - np.arctan(np.tanh(start / 2)))

    for sample in samples[::5]:
        assert sample._spins[0] == pytest.approx(c / k / np.cosh(tau(sample.t)), abs=1e-9)
        assert sample.body_poses[0, 2] == pytest.approx(heading(sample.t), abs=1e-9)
        wanted = [
            quad(
                lambda t, f=f: c * np.tanh(tau(t)) * f(heading(t)),
                0.0,
                sample.t,
                epsabs=1e-13,
                epsrel=1e-13,
            )[0]
            for f in (np.cos, np.sin)
        ]
        assert sample.points['A'] == pytest.approx(wanted, abs=1e-9)


def test_vertical_rolling_disk(method: tuple[str, float]) -> None:
    """It rolls on a circle, both rates constant, and nothing pushes it sideways."""
    samples = run(scene_from_text(DISK), *method)
    energy_is_kept(samples)
    for sample in samples:
        angle, r = YAW * sample.t, RADIUS * ROLL / YAW
        wanted = r * np.sin(angle), r * (1.0 - np.cos(angle)), RADIUS
        assert sample.points['C'] == pytest.approx(wanted, abs=1e-9)
        # what turns the velocity of the centre, and what carries the weight
        normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
        wanted_force = 2.0 * RADIUS * ROLL * YAW * normal + [0.0, 0.0, 2.0 * 9.81]
        assert sample.reactions['rim'].force == pytest.approx(wanted_force, abs=1e-6)
        assert sample.diagnostics.redundant == 0


def test_a_blade_cannot_be_started_sideways() -> None:
    from alf_ros import AssemblyError

    text = SLEIGH.replace(f'A: [{SPEED}, 0]', 'A: [0, 1]')
    with pytest.raises(AssemblyError, match='blade is off by'):
        Simulation(scene_from_text(text))


def test_assembly_may_move_what_cannot_slide() -> None:
    """Rough positions are closed sideways too: velocities are bound, not positions."""
    text = SLEIGH + '  positions: {A: [0, 2], B: [1, 2]}\n'
    sim = Simulation(scene_from_text(text))
    assert sim.sample().points['A'] == pytest.approx([0.0, 2.0], abs=1e-12)


PLANE_WHEEL = """
mechanism:
  alf: 1
  points: {C: {at: [0, 0.5]}, S: {at: [0.3, 0.5]}}
  bodies:
    wheel: {points: [C, S], mass: 2, inertia: {about_com: 0.25}, com: [0, 0]}
  joints:
    rim: {type: no_slip, between: [ground, wheel], at: C, radius: 0.5,
          on: {through: [0, 0], direction: [1, 0]}}
effects:
  gravity: {acceleration: [1.0, -9.81]}
"""


def test_wheel_rolls_down_in_the_plane() -> None:
    """a = g sin / (1 + J / m R²), and friction takes the rest."""
    sim = Simulation(scene_from_text(PLANE_WHEEL), step=1e-3)
    sim.step(2000)
    sample = sim.sample()
    acceleration = 1.0 / (1.0 + 0.25 / (2.0 * 0.25))
    assert sample.points['C'] == pytest.approx([0.5 * acceleration * 4.0, 0.5], abs=1e-9)
    assert sample.body_poses[0, 2] == pytest.approx(-acceleration * 4.0, abs=1e-9)
    push = [2.0 * (acceleration - 1.0), 2.0 * 9.81]
    assert sample.reactions['rim'].force == pytest.approx(push, abs=1e-8)


def test_a_leaning_coin_goes_round(method: tuple[str, float]) -> None:
    """Steadily: Ω² = m g R tan α / (m R ρ + A sin α + C ρ / R)."""
    integrator, step = method
    samples = run(load_scene('coin'), integrator, min(step, 5e-3) / 4)
    energy_is_kept(samples)
    R, around, lean = 0.0129, 0.05, np.radians(20.0)
    inertia = R * around + R**2 * np.sin(lean) / 4 + R * around / 2
    turn = np.sqrt(9.81 * R * np.tan(lean) / inertia)
    for sample in samples:
        angle = turn * sample.t
        outward = np.array([np.sin(-angle), np.cos(-angle)])
        wanted = [*(around * outward - [0.0, around]), R * np.cos(lean)]
        assert sample.points['C'] == pytest.approx(wanted, abs=1e-9)
        # inwards for the path of the centre, upwards for the weight
        inwards = -0.0085 * turn**2 * around * outward
        wanted_force = [*inwards, 0.0085 * 9.81]
        assert sample.reactions['rim'].force == pytest.approx(wanted_force, abs=1e-7)


def test_a_falling_coin_keeps_its_energy() -> None:
    """Started upright and slow it wobbles; contact and no slip hold all the way."""
    scene = load_scene('coin', parameters={'lean': 0.4, 'around': 0.01})
    sim = Simulation(scene, integrator='dop853', step=5e-4)
    sim.apply_wrench('coin', force=[0.0, 1e-2, 0.0])
    sim.step(100)
    sim.clear_inputs()
    samples = list(sim.run(1.0, every=40))
    assert np.ptp([sample.points['C'][2] for sample in samples]) > 1e-3
    energies = [sample.energy for sample in samples]
    assert np.ptp(energies) < 1e-9 * energies[0]
    assert max(np.abs(sample.phi).max() for sample in samples) < 1e-14
    assert max(np.abs(sample.phi_dot).max() for sample in samples) < 1e-12
