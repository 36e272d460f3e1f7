"""Bodies put elsewhere by hand: the mechanism closes around them, on its branch, turns counted."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import AssemblyError, InputError, Simulation, StepError, load_scene
from alf_ros.arrays import Floats
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.ros.simulator.control import Control
from alf_ros.simulation import setup as settings
from alf_ros.simulation.placement import spin
from alf_ros.studies.exact import crossed_bars
from support.log_files import make
from support.paths import ROOT
from support.some_scenes import SOME_SCENES
from support.thorough import LONG, thinned

SCENES = sorted(path.stem for path in (ROOT / 'config/scenes').glob('*.yaml'))


def moving(scene: str, steps: int = 200, **solver: object) -> Simulation:
    simulation = Simulation(load_scene(scene), **solver)  # type: ignore[arg-type]
    simulation.step(steps)
    return simulation


def violations(simulation: Simulation) -> tuple[float, float]:
    """Largest of the constraints, m and m/s."""
    found = simulation.sample().diagnostics
    return found.position_violation, found.velocity_violation


def pose(simulation: Simulation, body: str) -> Floats:
    return simulation.sample().body_poses[simulation.model.body_names.index(body)]


def twist(simulation: Simulation, name: str) -> Floats:
    """Velocity of the frame of a body, from its points and vectors."""
    layout, state = simulation.model.layout, simulation.state
    body, D = layout.body[name], layout.dimension
    q, qd = (np.pad(x.reshape(-1, D), ((0, 0), (0, 3 - D))) for x in (state.q, state.qd))
    blocks, points = layout.of_body[name], len(body.points)
    d, rates = ([x[n] - x[blocks[0]] for n in blocks[1:points]] for x in (q, qd))
    d, rates = (y + [x[n] for n in blocks[points:]] for x, y in ((q, d), (qd, rates)))
    omega = spin(np.array(d).reshape(-1, 3), np.array(rates).reshape(-1, 3))
    return np.array([*qd[blocks[0]], *omega])[[0, 1, 5] if D == 2 else range(6)]


# ------------------------------------------------------------------------------------ slider-crank


def test_the_slider_crank_closes_around_its_crank() -> None:
    simulation = moving('slider_crank')
    step, inputs = simulation.step_index, simulation.sample().inputs
    simulation.place('crank', (0.0, 0.0, 0.3), (0.0, 0.0, 2.0))
    sample = simulation.sample()
    assert sample.points['B'] == pytest.approx([2.0 * math.cos(0.3), 0.0], abs=1e-12)
    assert sample.velocities['B'] == pytest.approx([-4.0 * math.sin(0.3), 0.0], abs=1e-12)
    assert sample.joint_positions[:2] == pytest.approx([0.3, -0.6], abs=1e-12)
    assert sample.joint_velocities[:2] == pytest.approx([2.0, -4.0], abs=1e-12)
    assert max(violations(simulation)) < 1e-12
    assert (simulation.step_index, sample.inputs) == (step, inputs)


def test_and_around_its_coupler() -> None:
    simulation, angle = moving('slider_crank'), 0.5
    place = math.cos(angle), math.sin(angle)
    simulation.place('coupler', (*place, -angle), (-place[1], place[0], -1.0))
    assert simulation.sample().joint_positions[0] == pytest.approx(angle, abs=1e-12)
    assert simulation.sample().joint_velocities[0] == pytest.approx(1.0, abs=1e-12)
    assert max(violations(simulation)) < 1e-12


def test_it_stays_on_its_branch_and_counts_its_turns() -> None:
    """Round and round, over the singular positions at 90 and 270 degrees, not into the other
    branch, where B stays on O."""
    simulation = moving('slider_crank', 0)
    way = 80, 89, 91, 150, 240, 265, 275, 360, 520, 690, 720, 600, 450.5, 300, 160, 89, 10
    for degrees in way:
        angle = math.radians(degrees)
        simulation.place('crank', (0.0, 0.0, angle), (0.0, 0.0, 0.0))
        sample = simulation.sample()
        assert sample.joint_positions[:2] == pytest.approx([angle, -2.0 * angle], abs=1e-10)
        assert sample.points['B'][0] == pytest.approx(2.0 * math.cos(angle), abs=1e-10)


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'esdirk43'])
def test_a_run_from_a_singular_position_is_that_of_a_scene_that_starts_there(
    integrator: str,
) -> None:
    """Before the first step too: the rank that is missing there was not counted."""
    scene = {'mechanism': 'slider_crank', 'initial': {'positions': {'A': [0, 1], 'B': [0, 0]}}}
    drawn = Simulation(load_scene(scene), step=1e-3, integrator=integrator)
    placed = Simulation(
        load_scene({'mechanism': 'slider_crank'}), step=1e-3, integrator=integrator
    )
    placed.place('crank', (0.0, 0.0, math.pi / 2), (0.0, 0.0, 0.0))
    for simulation in (drawn, placed):
        simulation.apply_effort('crank_pin', 1.0)
        simulation.step(300)
    assert placed.sample().q == pytest.approx(drawn.sample().q, abs=2e-12)


def test_a_rest_that_two_branches_may_leave_is_told() -> None:
    """As where a scene starts there, which is refused."""
    wrench = {'one': {'on': 'A', 'force': [2, 0]}, 'two': {'on': 'B', 'force': [1, 0]}}
    scene = {'mechanism': 'slider_crank', 'effects': {'constant_wrench': wrench}}
    simulation = Simulation(load_scene(scene))
    simulation.place('crank', (0.0, 0.0, math.pi / 2), (0.0, 0.0, 0.0))
    for each in (simulation, copy.copy(simulation)):
        told = each.sample().diagnostics.trouble
        assert told == each.resolution.unexamined
        assert 'on two branches: the motion that begins is not unique' in told
    simulation.place('crank', (0.0, 0.0, 0.5), (0.0, 0.0, 0.0))
    assert not simulation.resolution.unexamined


@pytest.mark.parametrize('rate', [None, 0.0, 2.0])
def test_a_singular_position_is_as_exact_as_others(rate: float | None) -> None:
    simulation = moving('slider_crank', 100)
    kept = simulation.sample().joint_velocities[0]
    simulation.place('crank', (0, 0, math.pi / 2), None if rate is None else (0, 0, rate))
    sample, rate = simulation.sample(), kept if rate is None else rate
    assert sample.points['B'] == pytest.approx([0.0, 0.0], abs=1e-11)
    assert sample.velocities['B'] == pytest.approx([-2.0 * rate, 0.0], abs=1e-10)
    assert max(violations(simulation)) < 1e-12
    if rate:
        simulation.step(500)
        now = simulation.sample()
        assert now.energy == pytest.approx(sample.energy, abs=1e-7)
        expected = 2.0 * math.cos(now.joint_positions[0])
        assert now.points['B'][0] == pytest.approx(expected, abs=1e-9)


def test_a_pose_of_few_digits_is_met_as_nearly_as_it_can_be() -> None:
    simulation = moving('slider_crank')
    simulation.place('crank', (1e-8, 0.0, 1.0), (0.0, 1e-8, 3.0))
    assert simulation.sample().joint_positions[0] == pytest.approx(1.0, abs=1e-6)
    assert simulation.sample().joint_velocities[0] == pytest.approx(3.0, abs=1e-6)
    assert max(violations(simulation)) < 1e-12


@pytest.mark.parametrize(
    ('body', 'pose', 'twist', 'told'),
    [
        ('crank', (0.1, 0.0, 0.3), None, 'crank cannot be there: O (x given) is off by 0.1 m'),
        ('coupler', (0.5, 0.5, -0.4), None, 'coupler cannot be there'),
        ('coupler', (1e9, 1e9, 0.0), None, 'coupler cannot be there'),
        ('crank', None, (0.1, 0.0, 1.0), 'crank cannot move like that: the given velocities'),
        ('crank', (0.0, 0.0, 0.3), (0.0, 0.5, 1.0), 'O (y given) is off by 0.5 m/s'),
        ('crank', (0.0, 0.0), None, 'pose: not usable'),
        ('crank', (0.0, 0.0, math.nan), None, 'expected 3 finite numbers'),
        ('crank', (1e200, 0.0, 0.0), None, 'expected 3 finite numbers'),
        ('crank', None, (0.0,) * 6, 'twist: not usable'),
        ('crnak', None, None, "did you mean 'crank'"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(
    body: str, pose: tuple[float, ...], twist: tuple[float, ...], told: str
) -> None:
    simulation = moving('slider_crank')
    before = simulation.state
    with pytest.raises(InputError) as refused:
        simulation.place(body, pose, twist)
    assert told in str(refused.value)
    after = simulation.state
    assert before.q.tobytes() == after.q.tobytes() and before.qd.tobytes() == after.qd.tobytes()
    assert before.turns.tobytes() == after.turns.tobytes()


# ----------------------------------------------------------------------------------- any mechanism


@pytest.mark.parametrize(
    'scene',
    thinned(
        [name for name in SCENES if name != 'wiper'], keep=[*SOME_SCENES, 'two_finger_gripper']
    ),
)
def test_a_body_goes_where_it_would_go_by_itself(scene: str) -> None:
    """Of each scene: where each body is after a quarter of a second, from the start."""
    simulation = Simulation(load_scene(scene))
    simulation.step(round(0.25 / simulation.h))
    # a pose says nothing of whole turns, of which a thread needs the number
    names = [name for name in simulation.model.body_names[:5] if name != 'spindle']
    wanted = [(pose(simulation, name).copy(), twist(simulation, name)) for name in names]
    for name, (there, going) in zip(names, wanted, strict=True):
        simulation.reset()
        simulation.place(name, there, going)
        found = pose(simulation, name).copy()
        if simulation.model.layout.dimension == 2:
            found[2] = there[2] + math.remainder(found[2] - there[2], math.tau)
        elif found[3:] @ there[3:] < 0.0:
            found[3:] = -found[3:]
        assert found == pytest.approx(there, abs=1e-12)
        assert twist(simulation, name) == pytest.approx(going, abs=1e-11)
        assert max(violations(simulation)) < 1e-12
        try:
            simulation.step(5)
        except StepError as error:  # a finger that is put 0.16 rad into a stop
            assert scene == 'two_finger_gripper' and 'stiff effect joint_stop' in str(error)


def test_a_stewart_platform_is_put_anywhere_in_its_reach() -> None:
    simulation = moving('stewart_platform', 3)
    turn = Rotation.from_rotvec([0.2, 0.1, -0.4])
    going = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    there = np.array([0.1, -0.1, 1.1, *turn.as_quat()])
    simulation.place('top', there, going)
    assert pose(simulation, 'top') == pytest.approx(there, abs=1e-12)
    assert twist(simulation, 'top') == pytest.approx(going, abs=1e-12)
    assert max(violations(simulation)) < 1e-12
    sample = simulation.sample()
    for n in range(6):  # the legs are as long as the distance of their ends
        drawn = load_scene('stewart_platform').mechanism
        at = {point.name: np.array(point.at) for point in drawn.points}
        long = np.linalg.norm(sample.points[f'P{n}'] - sample.points[f'B{n}'])
        length = long - np.linalg.norm(at[f'P{n}'] - at[f'B{n}'])
        assert sample.joints[f'leg{n}'].position == pytest.approx(length, abs=1e-12)
    with pytest.raises(InputError, match='quaternion: not a rotation'):
        simulation.place('top', (0, 0, 1.2, 0, 0, 0, 2.0))


def test_gears_and_racks_stay_in_mesh() -> None:
    simulation = moving('planetary_gear', 0)
    radii = 0.03, 0.09
    for angle in (0.4, 2.5, 5.0, 7.5, 6.0) if LONG else (2.5, 5.0, 7.5):
        simulation.place('sun', (0.0, 0.0, angle), (0.0, 0.0, 1.0))
        sample = simulation.sample()
        carrier = simulation.model.coordinate_names.index('output')
        willis = radii[0] / sum(radii)
        assert sample.joint_positions[carrier] == pytest.approx(willis * angle, abs=1e-11)
        assert sample.joint_velocities[carrier] == pytest.approx(willis, abs=1e-11)


def test_what_is_free_besides_is_dragged_and_does_not_go_on_by_itself() -> None:
    """The lower rod is turned as by many small moves of the upper one: each moves it least."""
    simulation = moving('double_pendulum', 400)
    start = simulation.state
    there, before = (pose(simulation, name).copy() for name in ('upper', 'lower'))
    for k in range(1, 201):
        simulation.place('upper', there + [0.0, 0.0, 0.01 * k])
    slowly = pose(simulation, 'lower')[2] - before[2]
    simulation.restore(start)
    simulation.place('upper', there + [0.0, 0.0, 2.0])
    assert pose(simulation, 'lower')[2] - before[2] == pytest.approx(slowly, rel=0.2)


def test_drives_have_the_last_word() -> None:
    simulation = moving('wiper', 100)
    there, going = pose(simulation, 'arm2').copy(), twist(simulation, 'arm2')
    simulation.place('arm2', there, going)
    assert pose(simulation, 'arm2') == pytest.approx(there, abs=1e-12)
    assert max(violations(simulation)) < 1e-12
    with pytest.raises(AssemblyError, match='arm2 cannot be there: .*motor is off by'):
        simulation.place('arm2', (*there[:2], there[2] + 0.2))
    with pytest.raises(AssemblyError, match='arm2 cannot move like that: .*motor'):
        simulation.place('arm2', None, 0.5 * going)


# -------------------------------------------------------------------------------------- velocities


def test_velocities_are_those_after_an_impulse_on_the_body() -> None:
    """Of two rods the upper one is struck: about the joint the lower one keeps its momentum."""
    simulation = moving('double_pendulum')
    before = simulation.state
    own = twist(simulation, 'upper')
    simulation.place('upper', None, own)
    assert simulation.state.qd == pytest.approx(before.qd, abs=1e-12)
    assert simulation.state.q.tobytes() == before.q.tobytes()
    simulation.place('upper', None, own + [0.0, 0.0, 3.0])
    layout = simulation.model.layout
    lower = layout.body['lower']
    assert lower.com == pytest.approx([lower.local[1][0] / 2, 0.0])

    def about_the_joint(state) -> float:
        first, last = (state.q.reshape(-1, 2)[layout.of_point[p]] for p in lower.points)
        v, w = (state.qd.reshape(-1, 2)[layout.of_point[p]] for p in lower.points)
        d, rate, mean = last - first, w - v, 0.5 * (v + w)
        spinning = float(lower.inertia) * (d[0] * rate[1] - d[1] * rate[0]) / (d @ d)  # type: ignore[arg-type]
        return float(spinning + 0.5 * lower.mass * (d[0] * mean[1] - d[1] * mean[0]))

    assert about_the_joint(simulation.state) == pytest.approx(about_the_joint(before), abs=1e-12)


def test_without_a_twist_a_body_keeps_its_own_where_it_can() -> None:
    simulation = moving('slider_crank')
    going = twist(simulation, 'crank')
    simulation.place('crank', (0.0, 0.0, -0.7))
    assert twist(simulation, 'crank') == pytest.approx(going, abs=1e-12)
    simulation.place('coupler', (math.cos(0.5), math.sin(0.5), -0.5))  # there it cannot
    assert max(violations(simulation)) < 1e-12


@pytest.mark.parametrize('formulation', ['alf1', 'baumgarte', 'canonical', 'lagrange_canonical'])
def test_other_formulations_go_on_from_there(formulation: str) -> None:
    """The integrated variables of a formulation start again from the new place."""
    one = moving('slider_crank', 50, formulation=formulation, integrator='rk4')
    one.place('crank', (0.0, 0.0, 0.5), (0.0, 0.0, 3.0))
    other = moving('slider_crank', 50)
    other.place('crank', (0.0, 0.0, 0.5), (0.0, 0.0, 3.0))
    for simulation in (one, other):
        simulation.step(200)
    assert one.sample().q == pytest.approx(other.sample().q, abs=1e-6)


def test_a_run_from_there_repeats_bit_for_bit(tmp_path: Path) -> None:
    _, simulation = make(tmp_path / 'before', 'four_bar')
    name = simulation.model.body_names[0]
    there = pose(simulation, name) + [0.0, 0.0, 7.0]
    simulation.place(name, there, (0.0, 0.0, 1.0))
    setup = settings.made(load_scene('four_bar'), {})
    run = LogRun(tmp_path / 'after', setup, state=simulation.state)
    run.send()
    for _ in range(100):
        setup.simulation.step(setup.steps)
        run.send()
    run.close()
    simulation.step(setup.simulation.step_index - simulation.step_index)
    assert simulation.sample().q.tobytes() == setup.simulation.sample().q.tobytes()
    result = compare(load(run.recorder.folder))
    assert result.equal, result


def test_the_node_does_it_between_two_ticks_and_begins_a_log_with_it() -> None:
    """The log that ends does not see the new state, nor does anything a refusal."""
    simulation, calls = moving('slider_crank'), Mock()
    calls.run.simulation = simulation
    seen: list[SimpleNamespace] = []
    calls.report.side_effect = lambda: seen.append(SimpleNamespace(state=simulation.state))
    names = 'run', 'pacer', 'inputs', 'saved', 'report', 'pace', 'end'
    control = Control(*(getattr(calls, name) for name in names))
    before, own = simulation.state, pose(simulation, 'crank').copy()
    with pytest.raises(AssemblyError):
        control.place('crank', own + [0.1, 0.0, 0.0], None)
    assert not calls.run.begin.called and not seen
    control.place('crank', own + [0.0, 0.0, 0.1], None)
    assert seen[0].state.q.tobytes() == before.q.tobytes() == simulation.state.q.tobytes()
    state, keep_time = calls.run.begin.call_args.args
    assert keep_time and state.step == before.step
    assert [call[0] for call in calls.mock_calls if call[0] != 'run.__str__'] == [
        *('run.end_tick', 'inputs.apply') * 2,
        'report',
        'pacer.start',
        'run.begin',
    ]
    simulation.restore(state)
    assert pose(simulation, 'crank')[2] == pytest.approx(own[2] + 0.1, abs=1e-12)


# ----------------------------------------------------------------------- beside singular positions


@pytest.mark.parametrize(
    ('crank', 'coupler', 'pattern', 'before', 'after'),
    [
        (0.47, 0.98, [False], -0.4, 1e-3),
        (0.75, 1.18, [True], -0.4, 6e-5),
        (1.0, 2.48, [True, True, False], 0.2, -0.01),
        (0.77, 1.34, [True, False, True], 0.2, -2e-4),
        (0.43, 0.61, [True, True, False], 0.3, 3e-3),
        (1.05, 1.6, [False, True, True], 0.2, 3e-4),
        (0.9, 1.43, [True, False, False], 0.2, -2.0),
    ],
)
def test_four_bars_stay_on_their_branch_and_move_on_it(
    crank: float, coupler: float, pattern: list[bool], before: float, after: float
) -> None:
    """Crossed and parallel ones, through the position in which all bars lie in a line."""
    alone = crossed_bars.crossed_four_bars(crank, coupler, pattern)
    places = alone.position(before).reshape(-1, 2).tolist()
    scene = {
        'mechanism': crossed_bars.crossed_mechanism(crank, coupler, pattern),
        'initial': {'positions': {f'B{k}': at for k, at in enumerate(places)}},
    }
    simulation = Simulation(load_scene(scene))
    simulation.place('crank0', (0.0, 0.0, after), (0.0, 0.0, 2.0))
    sample, rates = simulation.sample(), 2.0 * alone.tangent(after)
    assert sample.q == pytest.approx(alone.position(after), abs=1e-8)
    assert sample.qd == pytest.approx(rates, abs=1e-4 * np.abs(rates).max())
