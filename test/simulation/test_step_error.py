"""Steps that are too long: estimated errors, warnings, steps that would do, no false alarms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros import Scene, Simulation, StepError, load_scene
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.resolution import Resolution, nice
from alf_ros.simulation.stiffness import stiffest
from support.effect_scenes import MASS, ROTOR
from support.some_scenes import SOME_SCENES
from support.thorough import LONG, thinned

# three legs that slide, hinged to the ground above and balled to a plate that falls on the floor
RPS = """
mechanism:
  alf: 1
  space: spatial
  parameters: {rb: 0.5, rp: 0.3, H: 0.6}
  points:
    B<j>: {for: {j: [0, 2]}, at: [rb*cos(2*pi*j/3), rb*sin(2*pi*j/3), H], fixed: true}
    P<j>: {for: {j: [0, 2]}, at: [rp*cos(2*pi*j/3), rp*sin(2*pi*j/3), 0]}
    C: {at: [0, 0, 0]}
  vectors:
    u<j>:
      for: {j: [0, 2]}
      along: [(rb - rp)*cos(2*pi*j/3), (rb - rp)*sin(2*pi*j/3), H]
  bodies:
    low<j>:
      for: {j: [0, 2]}
      points: [B<j>]
      vectors: [u<j>]
      mass: 1
      inertia: {about_com: [0.01, 0.05, 0.05]}
      com: [-0.1, 0, 0]
    up<j>:
      for: {j: [0, 2]}
      points: [P<j>]
      vectors: [u<j>]
      mass: 1
      inertia: {about_com: [0.01, 0.05, 0.05]}
      com: [0.1, 0, 0]
    top:
      points: [C, P0, P1, P2]
      mass: 4
      inertia: {about_com: [0.1, 0.1, 0.2]}
      com: [0, 0, 0]
  joints:
    hinge<j>:
      for: {j: [0, 2]}
      type: revolute
      between: [ground, low<j>]
      at: B<j>
      axis: [-sin(2*pi*j/3), cos(2*pi*j/3), 0]
    leg<j>: {for: {j: [0, 2]}, type: prismatic, between: [low<j>, up<j>], at: P<j>, axis: u<j>}
    ball<j>: {for: {j: [0, 2]}, type: spherical, between: [up<j>, top], at: P<j>}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  ground_contact:
    c0: {on: P0, stiffness: 3.0e+7, exponent: 1, damping: 0.05, through: [0, 0, -0.001]}
    c1: {on: P1, stiffness: 3.0e+7, exponent: 1, damping: 0.05, through: [0, 0, -0.001]}
    c2: {on: P2, stiffness: 3.0e+7, exponent: 1, damping: 0.05, through: [0, 0, -0.001]}
initial: {velocities: {P0: [~, ~, -0.12], P1: [~, ~, -0.1], P2: [~, ~, -0.1]}}
"""
BLOCK = f"""{MASS}
effects:
  gravity: {{acceleration: [0, -9.81]}}
  ground_contact: {{on: P, stiffness: 1.0e+4, exponent: 1, friction: 0.5, slip: 1.0e-3}}
initial: {{positions: {{P: [~, -1.962e-3]}}, velocities: {{P: [1, 0]}}}}
"""


def limit(scene: Scene, integrator: str, duration: float) -> float:
    """The stability limit (s) that the effects of a scene set on the way."""
    sim = Simulation(scene, integrator='dop853_adaptive', step=duration / 40, tolerance=1e-6)
    _, whole = stiffest(list(sim.run(duration)))
    return whole.step(integrator)


def run(scene: Scene, integrator: str, step: float, duration: float) -> Simulation:
    """A run that may end in an error."""
    sim = Simulation(scene, integrator=integrator, step=step)
    try:
        sim.step(math.ceil(duration / step))
    except StepError as error:
        assert 'too long' in error.reason or 'closed' in error.reason
    return sim


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
@pytest.mark.parametrize('z', [1j, -1.0])
def test_the_estimate_is_the_error_of_the_method(integrator: str, z: complex) -> None:
    """On ẏ = λ y, almost up to the stability limit. dop853 at hλ = -5.4: 0 by chance."""
    tableau = TABLEAUX[integrator]
    high, low = tableau.estimate
    far = 2.7 if integrator == 'rk4' else 5.0
    for size in np.linspace(0.25 * far, far, 40):
        value = size * z
        k = np.linalg.solve(
            np.eye(tableau.b.size) - value * tableau.a, np.full(tableau.b.size, value)
        )
        exact = abs(1.0 + tableau.b @ k - np.exp(value))
        a, b = abs(high @ k), abs(low @ k)
        estimate = a**3 / (a * a + b * b)
        assert estimate > 0.15 * exact
        if z == 1j:
            assert estimate < 3.0 * exact


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
def test_errors_that_outlast_their_step_are_counted(integrator: str) -> None:
    """On ẍ = -ω² x, with short steps: the displacement that the error of a step becomes."""
    tableau = TABLEAUX[integrator]
    high, low = tableau.estimate
    for size in np.linspace(0.25, 1.0, 16):
        value = 1j * size
        k = np.linalg.solve(
            np.eye(tableau.b.size) - value * tableau.a, np.full(tableau.b.size, value)
        )
        exact = abs(1.0 + tableau.b @ k - np.exp(value))
        a, b = abs(high @ k), abs(low @ k)
        moved = size * max(a, tableau.lasting * b) * a * a / (a * a + b * b)
        assert 0.75 * exact < moved < 1.35 * exact


@pytest.mark.parametrize('name', SOME_SCENES)
def test_no_alarm_in_the_library(name: str) -> None:
    sim = Simulation(load_scene(name))
    sim.step(round(5.0 / sim.h))
    assert sim.step_error < 1e-6
    assert not sim.resolution.too_long and not sim.sample().diagnostics.trouble
    assert sim.sample().diagnostics.adequate_step == sim.h


@pytest.mark.parametrize(
    'name, integrator, step, adequate',
    [
        ('slider_crank', 'rk4', 0.05, (0.005, 0.02)),
        ('slider_crank', 'rk4', 0.1, (0.005, 0.02)),
        ('slider_crank', 'dop853', 0.2, (0.005, 0.05)),
        ('slider_crank', 'esdirk43', 0.2, (0.01, 0.05)),
        ('double_pendulum', 'rk4', 0.05, (0.002, 0.01)),
        ('double_pendulum', 'rk4', 0.1, (0.002, 0.01)),
        ('n_four_bar', 'rk4', 0.2, (0.02, 0.1)),
    ],
)
def test_energy_that_drains_is_told(
    name: str, integrator: str, step: float, adequate: tuple[float, float]
) -> None:
    scene = load_scene(name)
    sim = Simulation(scene, integrator=integrator, step=step)
    before = sim.sample().energy
    sim.step(round(20.0 / step))
    lost = abs(sim.sample().energy - before)
    found = sim.sample().diagnostics
    assert found.resolution.too_long and sim.step_error > 0.001
    assert f'steps of {step:g} s are too long' in found.trouble
    assert f'take {found.adequate_step:g} s or less' in found.trouble
    assert adequate[0] <= found.adequate_step <= adequate[1]
    better = Simulation(scene, integrator=integrator, step=found.adequate_step)
    before = better.sample().energy
    better.step(round(20.0 / better.h))
    assert not better.resolution.too_long
    assert abs(better.sample().energy - before) < 0.05 * lost


@pytest.mark.parametrize(
    'name, integrator, step',
    [
        ('change_point', 'rk4', 0.05),
        ('change_point', 'esdirk43', 0.05),
        ('double_four_bar', 'esdirk43', 0.2),
        ('double_pendulum', 'esdirk43', 0.05),
        ('four_bar', 'esdirk43', 0.01),
        ('jansen_leg', 'dop853', 0.05),
        ('rack_and_pinion', 'esdirk43', 0.1),
    ],
)
def test_what_is_off_by_a_hundredth_of_the_size_is_told(
    name: str, integrator: str, step: float
) -> None:
    """Motions that multiply the errors of their steps, within two seconds."""
    scene = load_scene(name)
    found = Simulation(scene, integrator=integrator, step=step)
    exact = Simulation(scene, integrator='dop853_adaptive', step=0.05, tolerance=1e-10)
    (*_, here), (*_, there) = found.run(2.0), exact.run(2.0)
    off = max(np.abs(here.points[each] - there.points[each]).max() for each in here.points)
    assert off > 0.01 * found.model.system.size
    assert found.resolution.too_long


@pytest.mark.parametrize('name', ['slider_crank', 'double_pendulum'])
def test_an_error_where_nothing_is_left(name: str) -> None:
    sim = Simulation(load_scene(name), integrator='rk4', step=0.2)
    with pytest.raises(StepError, match='the steps are far too long') as failure:
        sim.step(100)
    assert f'smaller step, {sim.resolution.adequate:g} s or less' in failure.value.remedy
    assert failure.value.t == sim.t > 0.0
    good = sim.state
    with pytest.raises(StepError, match='far too long'):  # it does not go on as if nothing was
        sim.step()
    assert sim.state.step == good.step and np.array_equal(sim.state.q, good.q)
    sim.reset()
    assert sim.step_error == 0.0
    sim.step()


@pytest.mark.parametrize('integrator', thinned(['rk4', 'dop853'], keep=['rk4']))
def test_contact_beyond_its_stability_limit(integrator: str) -> None:
    """A 3-RPS that lands: no alarm at a small part of the limit, beyond it one, and a step that
    would do.

    At a quarter of it `rk4` is off by 0.3 % of the size after half a second, and `dop853` by 0.1 %
    after the first 150 steps: an alarm is right.
    """
    scene = scene_from_text(RPS)
    longest = limit(scene, integrator, 0.5)
    assert 1e-4 < longest < 2e-3
    assert not run(scene, integrator, 0.15 * longest, 0.5).resolution.too_long
    assert not run(scene, integrator, 0.4 * longest, 0.5).resolution.chatters
    for part in (1.2, 2.0, 4.0) if LONG else (1.2, 4.0):
        sim = Simulation(scene, integrator=integrator, step=part * longest)
        said = ''
        try:
            sim.step(math.ceil(0.5 / sim.h))
        except StepError as error:
            said = str(error)
        if part == 4.0 and sim.step_index <= 2 and 'moves too far in one' in said:
            assert 'take a smaller step' in said  # the first one on the ground: none to judge
            continue
        assert sim.resolution.too_long
        found = sim.sample().diagnostics.adequate_step
        again = run(scene, integrator, found, 0.5)
        if part == 4.0 and again.resolution.too_long:  # in flight, where nothing is stiff
            found = again.sample().diagnostics.adequate_step
            again = run(scene, integrator, found, 0.5)
        assert not again.resolution.too_long
        assert found > 0.05 * longest


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
def test_friction_that_chatters_at_rest(integrator: str) -> None:
    """Too little to be seen in the motion, but forces come out with the wrong sign."""
    scene = scene_from_text(BLOCK)
    longest = limit(scene, integrator, 1.0)
    assert not run(scene, integrator, 0.5 * longest, 1.5).resolution.too_long
    for part in (1.2, 3.0):
        sim = run(scene, integrator, part * longest, 2000 * part * longest)
        found = sim.sample().diagnostics
        assert found.resolution.chatters and 'beyond the stability limit' in found.trouble
        assert 0.15 * longest < found.adequate_step <= 0.5 * longest
        assert not run(scene, integrator, found.adequate_step, 1.5).resolution.too_long


@pytest.mark.parametrize('step', [2e-3 / 1.3, 2e-3])
def test_no_alarm_at_singular_positions(step: float) -> None:
    for name in ('slider_crank', 'double_four_bar', 'change_point'):
        for integrator, h in (('rk4', step), ('dop853', 5.0 * step)):
            sim = Simulation(load_scene(name), integrator=integrator, step=h)
            sim.step(round(5.0 / h))
            assert sim.step_error < 1e-4


def test_one_impact_is_no_alarm() -> None:
    """A rotor that is thrown back by a stop, some steps long."""
    stop = 'joint_stop: {joint: pin, upper: 0.3, stiffness: 1.0e+5, damping: 0.2}'
    text = f'{ROTOR}\neffects: {{{stop}}}\ninitial: {{velocities: {{A: [~, 3]}}}}\n'
    sim = Simulation(scene_from_text(text), integrator='rk4', step=2e-3)
    sim.step(200)
    assert 0.0 < sim.step_error < 1e-3 and not sim.resolution.too_long


def test_what_is_looked_at_aside_does_not_count() -> None:
    runs = []
    for at in ((0.05, 1.0), np.arange(0.0, 1.0, 0.013)):
        sim = Simulation(load_scene('slider_crank'), step=0.01)
        list(sim.run(1.0, at=list(at)))
        runs.append((sim.step_index, sim.step_error))
    watched = Simulation(load_scene('slider_crank'), step=0.01, watch=True)
    watched.step(100)
    assert watched.passes
    assert runs[0] == runs[1] == (100, watched.step_error)


def test_one_call_or_many() -> None:
    one, many = (Simulation(load_scene('double_pendulum'), step=0.02) for _ in range(2))
    one.step(50)
    for _ in range(50):
        many.step()
    assert one.step_error == many.step_error > 0.0


@pytest.mark.parametrize(
    'settings', [{'integrator': 'dop853_adaptive'}, {'formulation': 'alf1', 'integrator': 'rk4'}]
)
def test_nothing_is_told_where_nothing_is_measured(settings: dict[str, str]) -> None:
    sim = Simulation(load_scene('slider_crank'), step=1e-2, **settings)  # type: ignore[arg-type]
    sim.step(20)
    found = sim.sample().diagnostics
    assert math.isnan(sim.step_error) and math.isnan(found.adequate_step)
    assert not found.trouble


def test_nice_steps() -> None:
    assert [nice(x) for x in (1e-3, 1.99e-3, 0.0021, 0.49, 0.7, 1e-9)] == [
        1e-3,
        1e-3,
        2e-3,
        0.2,
        0.5,
        1e-9,
    ]
    assert Resolution(0.1, 0.02, 0.0, 1000.0, True).adequate == 0.02


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive'])
def test_steps_in_which_a_body_turns_too_far(integrator: str) -> None:
    """A rotor of 0.5 kg m² under 200 N m: after a second at 400 rad/s, and after 200 rad."""
    text = f'{ROTOR}\neffects: {{joint_effort: {{joint: pin, effort: 200}}}}\n'
    for step, lost in ((2e-3, False), (0.01, integrator != 'dop853_adaptive')):
        sim = Simulation(scene_from_text(text), integrator=integrator, step=step)
        sim.step(round(1.0 / step))
        found = sim.sample()
        turned = found.joints['pin'].position
        assert (abs(turned - 200.0) > 6.0) == lost
        assert ('a body turns by 4 rad in a step' in found.diagnostics.trouble) == lost
        if lost:
            assert 'take 0.002 s or less' in found.diagnostics.trouble
