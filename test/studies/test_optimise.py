"""optimise against closed forms: gradients, recovered linkages, limits, failing starts."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, load_scene, optimise
from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError, StoppedError
from alf_ros.studies.optimisation.design_goal import DesignGoal, design_goal
from alf_ros.studies.optimisation.design_numbers import DesignNumbers, design_numbers
from alf_ros.studies.optimisation.design_quantity import design_quantity
from alf_ros.studies.optimisation.designs import Designs
from alf_ros.studies.optimisation.driven_design import DrivenDesign
from alf_ros.studies.optimisation.free_design import FreeDesign
from alf_ros.studies.optimisation.instants import DesignMotion
from support.arm import arm
from support.design_scenes import BARS, coupler_point, four_bar, sprung_block, whirled_bob
from support.thorough import LONG, thinned

SIXTH = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))  # central differences
NEAR = [[0.1, 0.2], [0.0, 0.15], [0.15, 0.1]]
GOALS: list[Any] = [
    'max(norm(knee.force))',
    'min(transmission(A, B))',
    'rms(drives.motor.effort)',
    'mean(points.P.x)',
    'integral(energy)',
    'final(rocker_pin.velocity)',
    'max(abs(drives.motor.effort))',
    {'at': 0.21, 'of': 'wrist.position'},
    {'crossing': 'points.P.y', 'value': 0.11, 'direction': 'down'},
    {'path': 'P', 'through': NEAR, 'at': [0.11, 0.37, 0.5]},
    {'path': 'P', 'through': NEAR},
]
FREE: list[Any] = [
    'max(norm(knee.force))',
    'final(energy)',
    'rms(crank_pin.effort)',
    {'crossing': 'points.P.x', 'value': 0.1},
    {'path': 'P', 'through': NEAR[:2], 'at': [0.05, 0.13]},
]


def check_gradients(
    numbers: DesignNumbers, goals: list[Any], made: Callable[[Floats], DesignMotion], error: float
) -> None:
    """Against differences of sixth order of whole motions."""
    motion = made(numbers.before)
    each: list[DesignGoal] = [
        design_goal(goal, 'minimise', motion.samples[0], 1.0) for goal in goals
    ]
    found = np.array([goal.of(motion).gradient for goal in each])
    for k, value in enumerate(numbers.before.tolist()):
        h, slopes = 2e-4 * abs(value), np.zeros(len(goals))
        for n, weight in SIXTH:
            for sign in (1.0, -1.0):
                values = numbers.before.copy()
                values[k] += sign * n * h
                there = made(values)
                slopes += sign * weight / h * np.array([goal.value(there) for goal in each])
        size = np.maximum(np.abs(slopes), 1e-2 * np.abs(found).max(axis=1))
        assert (np.abs(found[:, k] - slopes) <= error * size).all(), numbers.names[k]


def test_gradients_where_drives_decide() -> None:
    """Lengths, an angle of the ground and a mass, of every kind of number."""
    scene = load_scene(four_bar({'g': 0.1}))
    vary = {'a': [0.05, 0.15], 'c': [0.1, 0.4], 'g': [-1, 1], 'coupler.mass': [0.5, 2]}
    numbers = design_numbers(scene, vary)
    check_gradients(numbers, GOALS, lambda v: DrivenDesign(numbers, v, 1.0, 1 / 60), 2e-8)


def test_gradients_where_forces_decide() -> None:
    """A length and a friction: the tangents of the run, and reactions and energy from them."""
    scene = load_scene(four_bar(driven=False, step=1e-3))
    numbers = design_numbers(scene, {'b': [0.2, 0.4], 'pin.viscous': [0.01, 1]})
    check_gradients(numbers, FREE, lambda v: FreeDesign(numbers, v, 0.15, 0.005), 2e-7)


def test_gradients_in_space() -> None:
    """A spatial linkage with directions: the size of its drawing has kinks, its motion has not."""
    scene = load_scene(
        {
            'mechanism': 'spatial_slider_crank',
            'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
            'drives': {'motor': {'joint': 'crank_pin', 'angle': '0.4*t'}},
            'solver': {'step': 0.05, 'integrator': 'rk4'},
        }
    )
    numbers = design_numbers(scene, {'r': [0.05, 0.1], 'l': [0.25, 0.4]})
    goals = ['max(norm(knee.force))', 'max(abs(drives.motor.effort))', 'final(points.B.x)']
    check_gradients(numbers, goals, lambda v: DrivenDesign(numbers, v, 0.5, 0.05), 2e-8)


def test_a_linkage_is_recovered_from_a_bad_start() -> None:
    """Nine places of a known four-bar, with their instants: six numbers, 20 to 40 % off."""
    t = np.arange(9) / 9
    goal = {'path': 'P', 'through': coupler_point({}, t), 'at': t}
    start = {'a': 0.08, 'b': 0.36, 'c': 0.3, 'd': 0.33, 'u': 0.1, 'v': 0.14}
    vary = {name: [0.5 * BARS[name], 1.7 * BARS[name]] for name in start}
    found = optimise(four_bar(start), vary, goal, duration=1.0, period=1 / 9)
    assert found.settled and found.objective_before > 0.05
    assert np.allclose(found.values, [BARS[name] for name in start], rtol=1e-9)


def test_a_published_path_from_a_bad_start() -> None:
    """Six points of a vertical line without instants: case 1 of Cabrera, Simon, Prado, Mechanism
    and Machine Theory 37 (2002) 1165, with its bounds of the lengths. From a linkage whose path is
    17 away on average, the error falls below 0.1 % of the line."""
    places = [[20.0, 20.0 + 5.0 * k] for k in range(6)]
    start = {'a': 10.0, 'b': 40.0, 'c': 40.0, 'd': 45.0, 'u': 20.0, 'v': 20.0}
    vary: dict[str, Any] = {name: [5, 60] for name in 'abcd'}
    vary |= {name: [-60, 60] for name in 'uvxy'} | {'g': [-math.pi, math.pi]}
    found = optimise(
        four_bar(start),
        vary,
        {'path': 'P', 'through': places},
        duration=1.0,
        period=0.02,
        designs=14,
    )
    assert found.objective_before > 15.0
    numbers = dict(zip(found.names, found.values.tolist(), strict=True))
    times = np.arange(20_001) / 2e4
    path, away = coupler_point(numbers, times), []
    for place in places:
        nearest = times[np.linalg.norm(path - place, axis=1).argmin()]
        around = coupler_point(numbers, nearest + np.linspace(-1e-4, 1e-4, 2001))
        away.append(np.linalg.norm(around - place, axis=1).min())
    assert found.objective_after == pytest.approx(
        float(np.sqrt(np.mean(np.square(away)))), rel=1e-4
    )
    assert found.objective_after < 1e-3 * 25.0


def test_a_limit_on_a_reaction() -> None:
    """A bob on a bar of length L, whirled at 5 rad/s: its pin holds m (g + 25 L) at the lowest
    place. As long as possible with at most 60 N: L = (60 / m - g) / 25."""
    goal = {'path': 'B', 'through': [[3.0, 0.0]], 'at': [0.0]}
    limits = {'max(norm(pin.force))': [None, 60.0]}
    found = optimise(
        whirled_bob(), {'L': [0.1, 2]}, goal, subject_to=limits, duration=1.3, period=0.02
    )
    assert found['L'] == pytest.approx((30.0 - 9.81) / 25.0, rel=1e-8)
    assert found.active == ('max(norm(pin.force))',) and found.is_feasible and found.settled


def test_a_limit_of_zero_has_the_size_of_its_quantity() -> None:
    """A motor holds 0.2 µN m against an effort that it cannot lose: half of it is left. To a
    millionth of 1 N m all of it would be none."""
    scene = whirled_bob()
    scene['effects'] = {'joint_effort': {'push': {'joint': 'pin', 'effort': -2e-7}}}
    found = optimise(
        scene,
        {'push.effort': [-3e-7, -1e-7]},
        'rms(drives.motor.effort)',
        subject_to={'final(drives.motor.effort)': [None, 0.0]},
        duration=0.4,
        period=0.02,
    )
    assert found['push.effort'] == pytest.approx(-1e-7, rel=1e-6)
    assert not found.is_feasible and found.active == ('push.effort',)
    assert found.starts[0].outside == pytest.approx(0.5, rel=1e-6)
    assert 'no design within the limits was found: 50.00% outside' in found.notes


def test_a_limit_on_the_transmission_angle() -> None:
    """The least angle of a four-bar is between coupler and rocker, with the crank along the
    ground: (d - a)² = b² + c² - 2 b c cos μ."""
    limits = {'least': {'of': 'min(transmission(A, B))', 'between': [math.radians(40), None]}}
    found = optimise(
        four_bar(), {'d': [0.1, 0.5]}, 'final(points.C.x)', subject_to=limits, duration=1.0
    )
    square = 0.3**2 + 0.25**2 - 2.0 * 0.3 * 0.25 * math.cos(math.radians(40))
    assert found['d'] == pytest.approx(0.1 + math.sqrt(square), rel=1e-8)
    assert found.is_feasible


@pytest.mark.parametrize('beyond', [-1e-3, 1e-9, 1e-5])
def test_a_transmission_angle_beside_its_fold(beyond: float) -> None:
    """Between coupler and rocker the angle is π/2 + `beyond`, and the transmission angle folds:
    (d² + a² - 2 a d cos θ) = b² + c² - 2 b c cos μ."""
    a, b, c, d = 0.1, 0.3, 0.25, 0.3
    angle = math.pi / 2.0 + beyond
    square = b**2 + c**2 - 2.0 * b * c * math.cos(angle)
    theta = math.acos((a**2 + d**2 - square) / (2.0 * a * d))
    end = (theta - math.pi / 3.0) / (2.0 * math.pi)
    numbers = design_numbers(load_scene(four_bar()), {'d': [0.1, 0.5]})
    motion = DrivenDesign(numbers, numbers.before, end, end / 8)
    goal = design_goal('final(transmission(A, B))', 'minimise', motion.samples[0], end)
    slope = (d - a * math.cos(theta)) / (b * c * math.sin(angle))
    found = goal.of(motion)
    assert found.value == pytest.approx(math.pi / 2.0 - abs(beyond), abs=1e-12)
    assert found.gradient[0] == pytest.approx(-math.copysign(slope, beyond), rel=1e-8)


def test_two_limits_of_one_number_are_told_apart() -> None:
    label, places = 'min(transmission(A, B))', [[0.1, 0.2], [0.0, 0.2]]
    limits = {
        'least': {'of': label, 'between': [math.radians(40), None]},
        'loose': {'of': label, 'between': [math.radians(10), None]},
        'near': {'of': {'path': 'B', 'through': places}, 'between': [None, 9.0]},
        'far': {'of': {'path': 'B', 'through': [[9, 9]]}, 'between': [10.0, None]},
    }
    found = optimise(
        four_bar(), {'d': [0.1, 0.5]}, 'final(points.C.x)', subject_to=limits, duration=1.0
    )
    assert found.active == (f'{label} (least)',)
    told = [line.partition(':')[0] for line in found.lines() if line.endswith(', at its limit')]
    assert told == [f'{label} (least)']
    assert 'path error of B (near)' in str(found) and 'path error of B (far)' in str(found)


def test_the_shortest_time_under_a_limit_of_speed() -> None:
    """A block on a spring: x = 0.4 cos ω t, ω² = k / m. It is at x = 0.2 after π / 3 ω, and its
    greatest speed is 0.4 ω."""
    found = optimise(
        sprung_block(),
        {'main.stiffness': [10, 200]},
        {'crossing': 'rail.position', 'value': 0.2},
        subject_to={'max(abs(rail.velocity))': [None, 3.0]},
        duration=0.6,
        period=0.01,
    )
    assert found['main.stiffness'] == pytest.approx(2.0 * (3.0 / 0.4) ** 2, rel=1e-7)
    assert found.objective_after == pytest.approx(math.pi / 3.0 / 7.5, rel=1e-7)
    assert found.settled and found.is_feasible


def test_an_optimum_where_the_scenes_end() -> None:
    """Without friction the block comes first; friction below zero is refused."""
    scene = sprung_block()
    scene['effects']['joint_friction'] = {'joint': 'rail', 'viscous': 0.5}
    found = optimise(
        scene,
        {'joint_friction.viscous': [0, 5], 'main.stiffness': [10, 60]},
        {'crossing': 'rail.position', 'value': 0.2},
        duration=0.6,
        period=0.01,
    )
    assert found.settled and set(found.active) == set(found.numbers.names)
    assert 0.0 < found['joint_friction.viscous'] <= 1e-3
    exact = math.pi / 3.0 / math.sqrt(60.0 / 2.0)
    assert exact < found.objective_after < exact + 1e-4


def test_a_start_outside_the_bounds_asked_for_is_refused() -> None:
    """Also where the search keeps a little inwards of them."""
    scene = sprung_block()
    scene['effects']['joint_friction'] = {'joint': 'rail', 'viscous': 5.0005}
    with pytest.raises(InputError, match=r'outside the bounds, got 5\.0005; expected 0 to 5$'):
        optimise(scene, {'joint_friction.viscous': [0, 5]}, 'final(energy)', duration=0.1)


def test_steps_to_impossible_designs_are_refused() -> None:
    """The shorter its ground, the better; where a + b = c + d the crank no longer goes round."""
    found = optimise(four_bar(), {'d': [0.1, 0.5]}, 'final(points.C.x)', duration=1.0)
    assert not found.settled and 'beyond lie designs that cannot be' in str(found)
    assert 0.15 < found['d'] < 0.1502
    assert 'it cannot be between its samples: t = 0.8' in str(found)  # nor run there
    assert np.isnan(found.starts[found.best].tried).any()
    assert all(each.end is not None or each.reason for each in found.starts)


@pytest.mark.parametrize('minimise', ['max(velocities.P.x)', {'path': 'P', 'through': NEAR}])
def test_a_stop_is_no_impossible_design(minimise: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that ends has no result. The search would continue and call the scene the best."""
    whole, left = Designs._motion, [1]

    def stopped(self: Designs, values: Floats, period: float | None = None) -> DesignMotion:
        left[0] -= 1
        if left[0] < 0:
            raise StoppedError
        return whole(self, values, period)

    monkeypatch.setattr(Designs, '_motion', stopped)
    with pytest.raises(StoppedError):
        optimise(four_bar(), {'a': [0.05, 0.15]}, minimise, duration=1.0, period=0.1)
    assert left[0] == -1


def test_starts_that_fail_are_rows() -> None:
    goal = {'path': 'P', 'through': coupler_point({'c': 0.27}, np.zeros(1)), 'at': [0.0]}
    found = optimise(
        four_bar(),
        {'c': [0.02, 0.45]},
        goal,
        duration=1.0,
        period=0.25,
        starts=8,
        seed=3,
        workers=0,
    )
    failed = [each for each in found.starts if each.end is None]
    assert failed and len(failed) < len(found.starts)
    assert all(each.reason and math.isnan(each.objective) for each in failed)
    assert found['c'] == pytest.approx(0.27, rel=1e-9)


def test_the_same_seed_has_the_same_bits() -> None:
    """Here and in a worker process."""

    def run(seed: int, workers: int) -> Any:
        vary, goal = {'c': [0.2, 0.3], 'd': [0.25, 0.35]}, 'max(drives.motor.effort)'
        return optimise(
            four_bar(),
            vary,
            goal,
            duration=1.0,
            period=0.1,
            starts=2,
            seed=seed,
            designs=2,
            workers=workers,
        )

    one, other = run(1, 0), run(1, 1)
    assert one.values.tobytes() == other.values.tobytes()
    for a, b in zip(one.starts, other.starts, strict=True):
        assert a.begin.tobytes() == b.begin.tobytes()
        assert np.array(a.tried).tobytes() == np.array(b.tried).tobytes()
    if LONG:
        assert one.starts[1].begin.tobytes() != run(2, 0).starts[1].begin.tobytes()


def test_the_new_scene_repeats_the_objective(tmp_path: Path) -> None:
    vary = {'a': [0.08, 0.12], 'coupler.mass': [0.5, 2.0]}
    found = optimise(four_bar(), vary, 'final(energy)', duration=1.0, period=0.1)
    folder = found.save(tmp_path / 'out')
    scene = load_scene(folder / 'linkage.yaml')
    *_, last = Simulation(scene).run(1.0)
    assert last.energy == pytest.approx(found.objective_after, rel=1e-12)
    assert 'a' in found.active and found['coupler.mass'] == pytest.approx(0.5)
    report = (folder / 'report.html').read_text('utf-8')
    assert 'minimise final(energy)' in report and 'nan' not in report


def test_steps_that_are_too_long_are_told() -> None:
    """Of the run of the best design."""
    for step, told in ((1e-3, False), (5e-2, True)):
        best = optimise(
            four_bar(driven=False, step=step),
            {'pin.viscous': [0.01, 1.0]},
            'final(energy)',
            duration=0.5,
            period=0.1,
        )
        (note,) = best.notes or ('',)
        assert ('its run is not resolved: steps of 0.05 s are too long' in note) == told


@pytest.mark.parametrize(
    ('period', 'told'), thinned([(None, True), (1e-3, False)], keep=[(None, True)])
)
def test_too_few_samples_are_told(period: float | None, told: bool) -> None:
    """A bob on a circle, 24 times around: the period without one has four samples each turn. The
    largest height is the length of the bar exactly."""
    scene = whirled_bob()
    scene['drives']['motor'] = {'joint': 'pin', 'angle': '40*pi*t + 0.3'}
    best = optimise(scene, {'L': [0.4, 0.7]}, 'max(points.B.y)', duration=1.2, period=period)
    assert told == any('has too few samples: with samples each 0.0' in n for n in best.notes)
    assert told == (abs(best.objective_after - best['L']) > 1e-4)


@pytest.mark.parametrize(('every', 'denser'), [(1, 1), (2, 1), (9, 3), (10, 5), (7, 1)])
def test_denser_samples_are_whole_steps(every: int, denser: int) -> None:
    """Where forces decide. Every step is the densest."""
    numbers = design_numbers(load_scene(four_bar(driven=False)), {'a': [0.05, 0.15]})
    goal: Any = None  # no design is computed
    assert Designs(numbers, goal, (), 1.0, 0.01 * every, False)._denser(0.01) == pytest.approx(
        0.01 * denser
    )


def test_two_equal_peaks_are_told() -> None:
    """A motor turns a bob of weight m g against a steady effort T: its peak m g L + |T| has a kink
    at 0, its optimum, where the peaks on both sides are equal."""
    scene = whirled_bob()
    scene['effects']['joint_effort'] = {'push': {'joint': 'pin', 'effort': 0.0}}
    vary, peak = {'push.effort': [-2.0, 3.0]}, 'max(abs(drives.motor.effort))'
    found = optimise(scene, vary, peak, duration=1.26, period=0.02, designs=6)
    assert abs(found['push.effort']) < 1e-3
    assert found.objective_after == pytest.approx(2.0 * 9.81 * 0.5, abs=1e-3)
    assert any('two equal peaks' in note for note in found.notes)


def test_numbers_without_an_effect_are_told() -> None:
    """Masses change no place of a driven mechanism."""
    vary = {'coupler.mass': [0.5, 2.0], 'a': [0.05, 0.15]}
    found = optimise(four_bar(), vary, 'max(points.P.y)', duration=1.0, period=0.1, designs=4)
    said = [note for note in found.notes if 'changes neither' in note]
    assert said == ['coupler.mass changes neither the objective nor a limited number there']


@pytest.mark.filterwarnings('error')
def test_a_path_that_no_number_changes_has_settled() -> None:
    """Its gradient is 0, or as small as rounding makes it."""
    goal, vary = {'path': 'P', 'through': NEAR}, {'gravity.acceleration.1': [-12.0, -8.0]}
    found = optimise(four_bar(), vary, goal, duration=1.0, period=0.1, designs=4)
    assert found.settled and found.objective_after == found.objective_before
    assert found['gravity.acceleration.1'] == -9.81


BAD: list[tuple[dict[str, Any], str]] = [
    ({'vary': {}}, 'vary: nothing varies'),
    ({'vary': {'e': [0, 1]}}, 'vary.e'),
    ({'vary': {'a': [0.2]}}, 'vary.a: not two bounds'),
    ({'vary': {'a': [0.2, 0.1]}}, 'least < largest'),
    ({'vary': {'a': [0.2, 0.3]}}, 'the scene begins outside the bounds'),
    ({'vary': {'solver.step': [0.01, 0.3]}}, 'no number of the design'),
    ({'minimise': 'energy'}, 'expected max(NAME)'),
    (
        {'minimise': 'max(energy'},
        "nothing closes the '(' behind 'max', got 'max(energy'; expected",
    ),
    ({'minimise': 'min(transmission(A, B)'}, "expected 'min(transmission(A, B))'"),
    ({'minimise': 'max(energy))'}, "the ')' behind 'max(energy)' closes nothing"),
    ({'minimise': {'at': 0.1, 'of': 'transmission(A, B))'}}, "minimise.of: the ')' behind"),
    ({'minimise': 'maximum(energy)'}, "did you mean 'max'"),
    ({'minimise': 'max(enrgy)'}, "did you mean 'energy'"),
    ({'minimise': 'max(knee.force)'}, 'norm(knee.force)'),
    ({'minimise': 'max(size(knee.force))'}, 'no such function'),
    ({'minimise': 'max(transmission(A, C))'}, 'no body has both points'),
    ({'minimise': 'max(diagnostics.distance)'}, 'has no derivative'),
    ({'minimise': {'path': 'O', 'through': [[0, 0]]}}, 'no movable point'),
    ({'minimise': {'path': 'P', 'through': [[0, 0, 0]]}}, 'minimise.through.0'),
    ({'minimise': {'path': 'P', 'through': [[0, 0]], 'at': [2]}}, 'outside of the motion'),
    ({'minimise': {'path': 'P', 'through': [[0, 0]], 'at': 1}}, 'minimise.at: not usable, got 1'),
    ({'minimise': {'crossing': 'energy', 'direction': None}}, 'minimise.direction: nothing given'),
    ({'minimise': {'path': 'P', 'thru': [[0, 0]]}}, "did you mean 'through'"),
    ({'subject_to': {'max(energy)': [None, None]}}, 'not two limits'),
    ({'subject_to': {'max(energy)': 3}}, 'not two limits'),
    ({'starts': 0}, 'starts: not usable'),
    ({'sampling': 'grid'}, 'no such sampling'),
    ({'sampling': None}, 'sampling: nothing given; known: '),
    ({'duration': 0}, 'duration: not usable'),
    ({'period': 2}, 'longer than the duration'),
    ({'period': 1e-300}, 'period: too many samples'),
    ({'period': 0.07}, 'period: not a whole part of the duration, got 0.07; expected 1 / n'),
]


@pytest.mark.parametrize(('change', 'told'), BAD, ids=[told for _, told in BAD])
def test_errors_are_one_line(change: dict[str, Any], told: str) -> None:
    given: dict[str, Any] = {
        'vary': {'a': [0.05, 0.15]},
        'minimise': 'final(energy)',
        'duration': 1.0,
        **change,
    }
    with pytest.raises(InputError) as caught:
        optimise(four_bar(), **given)
    assert told in str(caught.value) and '\n' not in str(caught.value)


def test_a_length_that_unfolds_a_singular_position_is_refused() -> None:
    """The slider-crank with two equal rods passes through one after 0.39 s; one rod alone unfolds
    it."""
    vary = {'mechanism.points.A.at.0': [0.6, 0.8]}
    with pytest.raises(InputError, match='unfolds the singular position') as caught:
        optimise('slider_crank', vary, 'final(energy)', duration=0.5)
    assert 'mechanism.points.A.at.0' in str(caught.value)


def test_what_tangents_refuse_is_refused_by_name() -> None:
    scene = four_bar(driven=False, step=1e-3)
    scene['effects']['joint_friction']['pin'] = {
        'joint': 'crank_pin',
        'dynamic': 0.1,
        'radius': 0.01,
    }
    with pytest.raises(AlfError, match='joint_friction'):
        optimise(scene, {'a': [0.05, 0.15]}, 'final(energy)', duration=0.1)


@pytest.mark.thorough
def test_implicit_integrators_find_the_same() -> None:
    found = []
    for integrator in ('dop853', 'esdirk43'):
        scene = four_bar(driven=False, step=1e-3)
        scene['solver']['integrator'] = integrator
        found.append(optimise(scene, {'a': [0.05, 0.15]}, 'final(points.P.y)', duration=0.1))
    assert found[0].values == pytest.approx(found[1].values, rel=1e-6)
    assert found[0].objective_after == pytest.approx(found[1].objective_after, rel=1e-6)


def test_a_limit_that_no_design_holds_is_not_active() -> None:
    found = optimise(
        four_bar(),
        {'a': [0.05, 0.15]},
        'rms(drives.motor.effort)',
        subject_to={'min(points.P.y)': [10.0, None]},
        duration=1.0,
        period=0.05,
        designs=5,
    )
    assert not found.is_feasible and found.active in ((), ('a',))


def test_a_limit_that_cannot_be_met_is_told_before_all_designs_are_spent() -> None:
    """Beside a number that does not change it, SLSQP never ends by itself."""
    scene = whirled_bob()
    scene['effects'] = {'joint_effort': {'push': {'joint': 'pin', 'effort': 1.0}}}
    found = optimise(
        scene,
        {'push.effort': [-1.0, 3.0]},
        'rms(drives.motor.effort)',
        subject_to={'max(points.B.x)': [None, 0.1]},
        duration=0.2,
        period=0.05,
    )
    assert not found.is_feasible and len(found.starts[0].tried) < 150
    told = 'the search has not settled: designs come no nearer to the limits of max(points.B.x)'
    assert told in found.notes


# ---------------------------------------------------------------------------- quantities that jump

ARM = arm(3.0)


def asked(motion: DesignMotion, goals: dict[Any, float]) -> None:
    """The goals have these values, to their last digits but for polynomials."""
    for text, expected in goals.items():
        data = dict(text) if isinstance(text, tuple) else text
        found = design_goal(data, 'minimise', motion.samples[0], 1.0).value(motion)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9), text


@pytest.mark.parametrize('jump', [0.3, 0.3333])
@pytest.mark.parametrize('period', [0.1, 1 / 60])
def test_an_effort_that_jumps_with_the_acceleration_of_a_drive(jump: float, period: float) -> None:
    """The effort is 0 and then 1 + t - jump, of an inertia of 1 kg m²."""
    angle = f'max(t - {jump}, 0)**2/2 + max(t - {jump}, 0)**3/6'
    scene = load_scene({**ARM, 'drives': {'motor': {'joint': 'pin', 'angle': angle}}})
    numbers, of = design_numbers(scene, {'bar.mass': [1, 5]}), 'drives.motor.effort'
    motion, left = DrivenDesign(numbers, numbers.before, 1.0, period), 1.0 - jump
    integral = left + left**2 / 2
    goals: dict[Any, float] = {
        f'max({of})': 1.0 + left,
        f'min({of})': 0.0,
        f'integral({of})': integral,
        f'mean({of})': integral,
        f'rms({of})': math.sqrt(((1.0 + left) ** 3 - 1.0) / 3.0),
        (('at', jump - 1e-3), ('of', of)): 0.0,
        (('at', jump + 1e-3), ('of', of)): 1.001,
        (('crossing', of), ('value', 0.5)): jump,
        (('crossing', of), ('value', 1.2)): jump + 0.2,
    }
    asked(motion, goals)
    text = f'integral({of})'
    found = design_goal(text, 'minimise', motion.samples[0], 1.0).of(motion)
    assert found.gradient[0] == pytest.approx(integral / 3.0, rel=1e-9)


def test_a_jump_that_moves_with_a_number_has_no_derivative() -> None:
    """The peak behind it has one."""
    mechanism = {**ARM['mechanism'], 'parameters': {'T': 0.31}}
    angle = 'max(t - T, 0)**2/2 + max(t - T, 0)**3/6'
    drives = {'motor': {'joint': 'pin', 'angle': angle}}
    scene = load_scene({**ARM, 'mechanism': mechanism, 'drives': drives})
    numbers, of = design_numbers(scene, {'T': [0.1, 0.5]}), 'drives.motor.effort'
    motion = DrivenDesign(numbers, numbers.before, 1.0, 1 / 60)
    for goal in (f'integral({of})', {'crossing': of, 'value': 0.5}):
        with pytest.raises(InputError, match=r'effort jumps at t = 0.31 s, which moves with it'):
            design_goal(goal, 'minimise', motion.samples[0], 1.0).of(motion)
    peak = design_goal(f'max({of})', 'minimise', motion.samples[0], 1.0).of(motion)
    assert peak.gradient[0] == pytest.approx(-1.0, rel=1e-9)


def test_an_effort_that_jumps_at_a_row_of_a_table() -> None:
    """Of a motor that follows the slopes of a table, in a run that forces decide on."""
    row, fast = 0.1234, 1e-4  # s: the table turns, and rad/s
    table = [[0.0, 0.0], [row, fast * row], [1.0, fast * (2.0 * row - 1.0)]]
    gains = {'position_gain': 1e-9, 'velocity_gain': 1e-3}
    motor = {'servo': {'joint': 'pin', 'position': table, **gains}}
    scene = load_scene({**ARM, 'effects': {'motor': motor}, 'solver': {'step': 0.01}})
    numbers, of = design_numbers(scene, {'bar.mass': [1, 5]}), 'reactions.pin.force.y'
    motion = FreeDesign(numbers, numbers.before, 0.5, 0.01)
    force = 1.5 * fast * 1e-3  # 3/2 of the effort over the length, while the arm hardly moves
    y = design_quantity(of, 'of', motion.samples[0]).values(motion.samples)
    for fold, expected in (('max', force), ('min', -force), ('integral', force * (2 * row - 0.5))):
        found = design_goal(f'{fold}({of})', 'minimise', motion.samples[0], 1.0).value(motion)
        assert found * np.sign(y[0]) == pytest.approx(expected, rel=1e-3), fold
