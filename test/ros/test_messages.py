"""Messages say what the sample says: values against mechanics, stamps, what a reader gets back."""

import copy
import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from alf_ros import Simulation, equilibrium, load_scene
from alf_ros.errors import StepError
from alf_ros.logs.stamps import period_of, stamp_ns
from alf_ros.model.softest_modes import near as near_level
from alf_ros.ros.messages.templates import to_time
from alf_ros.ros.messages.topics import TOPICS
from alf_ros.ros.simulator import diagnostics
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation import state_vector
from alf_ros.simulation.display_geometry import Display
from support.ball_scene import BALLS, NAMES

HANGING_ROD: dict[str, Any] = {
    'name': 'hanging_rod',
    'mechanism': {
        'alf': 1,
        'space': 'planar',
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0, -2]}},
        'bodies': {'rod': {'points': ['O', 'A'], 'mass': 3, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
    },
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
}


def messages(simulation):
    """Every topic of the present state, as ROS reads the bytes."""
    sample = simulation.sample()
    made = [(topic, topic.make(simulation, Display())) for topic in TOPICS]
    return {
        topic.key: deserialize_message(write(sample, stamp_ns(sample.t)), topic.type)
        for topic, write in made
        if write is not None and topic.name != 'tf'
    }


@pytest.fixture(scope='module')
def slider_crank():
    simulation = Simulation(load_scene('slider_crank'))
    simulation.step(1234)
    return simulation


def test_zero_is_no_stamp():
    assert stamp_ns(0.0) == 1


@pytest.mark.parametrize('step', [1, 7, 999_999, 123_456_789])
def test_stamps_are_the_nearest_nanosecond(step):
    assert stamp_ns(step * 1e-3) == step * 1_000_000


@pytest.mark.parametrize('rate', [100, 3000, 6000, 7000, 60_000])
@pytest.mark.parametrize('first', [0, 100_000])
def test_each_tick_is_in_a_period_of_its_own(rate, first):
    """Of the rate of the ticks: stamps are rounded, and a third of them lost their period."""
    ticks = range(first * rate, first * rate + 3000)
    assert [period_of(stamp_ns(tick / rate), rate) for tick in ticks] == list(ticks)


def test_a_stamp_is_split_into_seconds_and_nanoseconds():
    stamp = to_time(3_000_000_007)
    assert (stamp.sec, stamp.nanosec) == (3, 7)


def test_all_messages_of_a_sample_carry_its_stamp(slider_crank):
    made = messages(slider_crank)
    stamps = [made[key].header.stamp for key in ('joint_states', 'reactions', 'constraints')]
    stamps.append(made['clock'].clock)
    assert {(stamp.sec, stamp.nanosec) for stamp in stamps} == {(1, 234_000_000)}


def test_joint_states_are_those_of_the_sample(slider_crank):
    sample, message = slider_crank.sample(), messages(slider_crank)['joint_states']
    assert list(message.name) == ['crank_pin', 'knee', 'guide']
    assert list(message.position) == [sample.joints[name].position for name in message.name]
    assert list(message.velocity) == [sample.joints[name].velocity for name in message.name]
    # against the points: crank angle, travel of the slider along +x
    ax, ay = sample.points['A']
    assert np.tan(message.position[0]) == pytest.approx(ay / ax, rel=1e-12)
    assert message.position[2] == sample.points['B'][0]


def test_angles_of_balls_are_joint_states_too():
    simulation = Simulation(scene_from_text(BALLS))
    simulation.step(20)
    sample, message = simulation.sample(), messages(simulation)['joint_states']
    assert tuple(message.name) == NAMES
    told = [sample.ball_angles[name] for name in NAMES[1:]]
    assert list(message.position)[1:] == [angle for angle, _ in told]
    assert list(message.velocity)[1:] == [rate for _, rate in told]


def test_joint_effort_is_the_command_and_not_the_reaction():
    simulation = Simulation(load_scene(HANGING_ROD))
    simulation.apply_effort('pin', 2.5)
    assert list(messages(simulation)['joint_states'].effort) == [2.5]


def test_a_reaction_is_the_force_of_parent_on_child_in_the_world():
    message = messages(Simulation(load_scene(HANGING_ROD)))['reactions']
    assert message.header.frame_id == 'world' and list(message.joint_names) == ['pin']
    force, torque = message.wrench[0].force, message.wrench[0].torque
    # the ground holds the rod up with its weight
    assert (force.x, force.y, force.z) == pytest.approx((0.0, 3 * 9.81, 0.0), abs=1e-12)
    assert (torque.x, torque.y, torque.z) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_constraints_give_violation_rate_and_multiplier_by_row(slider_crank):
    sample, message = slider_crank.sample(), messages(slider_crank)['constraints']
    assert list(message.name) == ['crank_length', 'coupler_length', 'guide']
    assert list(message.position) == list(sample.phi)
    assert list(message.velocity) == list(sample.phi_dot)
    assert list(message.effort) == [sample.multipliers[name] for name in message.name]
    assert max(map(abs, message.effort)) > 0.1


def test_energy_is_that_of_the_rods_at_the_start():
    # Bayo & Avello 6.2: rods of 1 kg and 1 m at 45 degrees, B at 4 m/s to the left. A moves across
    # the crank so fast that the coupler keeps its length; a rod has m/6 (u·u + u·v + v·v).
    c = np.sqrt(0.5)
    slider, across, arm = np.array([-4.0, 0.0]), np.array([-c, c]), np.array([c, -c])
    knee = (slider @ arm) / (across @ arm) * across
    kinetic = (2.0 * knee @ knee + knee @ slider + slider @ slider) / 6.0
    potential = 2 * 9.81 * c / 2
    simulation = Simulation(load_scene('slider_crank'))
    assert messages(simulation)['energy'].data == pytest.approx(kinetic + potential, rel=1e-12)


def test_messages_are_written_anew_each_time_and_stay_as_they_were():
    simulation = Simulation(load_scene('slider_crank'))
    write = TOPICS[0].make(simulation, Display())
    first = write(simulation.sample(), 1)
    kept = bytes(bytearray(first))
    simulation.step(100)
    second = deserialize_message(write(simulation.sample(), 2), JointState)
    assert first == kept
    assert list(second.position) == list(simulation.sample().joint_positions)
    assert (second.header.stamp.sec, second.header.stamp.nanosec) == (0, 2)


@pytest.mark.parametrize('length', range(1, 9))
def test_numbers_find_their_place_whatever_the_names(length):
    # names of every length, so of every alignment of what follows them
    scene = copy.deepcopy(HANGING_ROD)
    scene['mechanism']['joints'] = {'p' * length: scene['mechanism']['joints']['pin']}
    scene['initial'] = {'velocities': {'A': [1.5, 0]}}
    simulation = Simulation(load_scene(scene))
    simulation.apply_effort('p' * length, 0.25)
    made = messages(simulation)
    joints, forces = made['joint_states'], made['reactions']
    assert (joints.name, forces.joint_names) == (['p' * length],) * 2
    state = joints.position[0], joints.velocity[0], joints.effort[0]
    assert state == pytest.approx((-np.pi / 2, 0.75, 0.25))
    # weight, and the centripetal force of the centre of mass at half the speed
    wrench = forces.wrench[0]
    assert wrench.force.y == pytest.approx(3 * 9.81 + 3 * 0.75**2 / 1.0)
    assert (wrench.force.z, wrench.torque.x, wrench.torque.y, wrench.torque.z) == (0, 0, 0, 0)


@pytest.mark.parametrize('scene', ['slider_crank', 'stewart_platform', 'delta_robot'])
@pytest.mark.parametrize('formulation', ['alf2', 'alf1'])
def test_the_message_of_a_state_is_that_state(scene, formulation):
    simulation = Simulation(load_scene(scene), formulation=formulation)
    initial = simulation.state
    simulation.step(50)
    state, message = simulation.state, messages(simulation)['state']
    numbers, rates = np.array(message.position), np.array(message.velocity)
    assert len(set(message.name)) == len(message.name) == numbers.size
    read = state_vector.state(simulation.model, initial, numbers, rates, state.inputs)
    for field in dataclasses.fields(state):
        there, here = getattr(state, field.name), getattr(read, field.name)
        assert np.array_equal(there, here) if isinstance(there, np.ndarray) else there == here
    with pytest.raises(ValueError, match='no state of this mechanism'):
        state_vector.state(simulation.model, initial, numbers[1:], rates[1:], state.inputs)


def test_work_names_accounts():
    simulation = Simulation(load_scene(HANGING_ROD), ledger=True)
    simulation.apply_effort('pin', 3.0)
    simulation.step(50)
    message, sample = messages(simulation)['work'], simulation.sample()
    turned = sample.joints['pin'].position + math.pi / 2.0
    assert list(message.name) == ['gravity', 'inputs', 'drives']
    assert list(message.position) == list(sample.works.values())
    assert message.position[1] == pytest.approx(3.0 * turned, rel=1e-6)
    names = list(messages(simulation)['state'].name)
    assert names[-4:] == ['works[gravity]', 'works[inputs]', 'works[drives]', 'step']
    report = diagnostics.work(sample, 0.0)
    assert list(report.values) == ['gravity_j', 'inputs_j', 'drives_j', 'missing_j']
    assert abs(float(str(report.values['missing_j']))) < 1e-9
    plain = Simulation(load_scene(HANGING_ROD))
    assert 'work' not in messages(plain) and diagnostics.balance(plain.sample()) == 0.0


def test_what_has_no_joints_says_nothing_of_joints():
    bob = {'bob': {'points': ['A'], 'mass': 1, 'inertia': 'point'}}
    mechanism = {'alf': 1, 'space': 'planar', 'points': {'A': {'at': [0, 0]}}, 'bodies': bob}
    free = Simulation(load_scene({'mechanism': mechanism}))
    made = [topic.name for topic in TOPICS if topic.make(free, Display()) is not None]
    # and tf where tf2_msgs is installed
    assert made[:5] == ['~/state', '~/energy', '~/energy_stamped', 'clock', '~/markers']
    assert made[5:] in ([], ['tf'])


@pytest.mark.parametrize(
    ('integrator', 'tolerance', 'level'),
    [
        ('esdirk43_adaptive', 1e-2, diagnostics.WARN),
        ('esdirk43_adaptive', 1e-5, diagnostics.OK),
        ('dop853_adaptive', 1e-5, diagnostics.OK),
    ],
)
def test_energy_that_adaptive_steps_lose_is_a_warning(integrator, tolerance, level):
    """Each step keeps its tolerance, and their errors add up."""
    options = {'integrator': integrator, 'tolerance': tolerance, 'step': 0.05}
    simulation = Simulation(load_scene('double_pendulum'), ledger=True, **options)
    first = simulation.sample()
    simulation.step(1000)
    sample = simulation.sample()
    report = diagnostics.work(sample, diagnostics.balance(first))
    missing, lost = report.values['missing_j'], sample.energy - first.energy
    assert missing == pytest.approx(lost, rel=0.05, abs=1e-3)
    assert report.level == level
    assert ('take a smaller tolerance' in report.message) == (level == diagnostics.WARN)


def test_rounding_at_rest_is_no_loss_of_energy():
    simulation = Simulation(equilibrium(load_scene('four_bar')).simulation.scene, ledger=True)
    simulation.restore(equilibrium(simulation).state)
    begun = diagnostics.balance(simulation.sample())
    simulation.step(200)
    assert diagnostics.work(simulation.sample(), begun).level == diagnostics.OK


def test_diagnostics_have_fixed_keys_with_units(slider_crank):
    sample = slider_crank.sample()
    reports = [
        diagnostics.solver(slider_crank, 'playing', None),
        diagnostics.constraints(sample),
        diagnostics.energy(sample, 13.0),
        diagnostics.record(None),
    ]
    message = diagnostics.array('simulator', 'slider_crank', Time(), reports)
    keys = {status.name: [entry.key for entry in status.values] for status in message.status}
    assert keys['simulator: constraints'] == [
        'position_violation_m',
        'velocity_violation_m_per_s',
        'rank',
        'redundant',
        'indeterminate_reactions',
        'indeterminate_efforts',
        'singular',
        'distance_to_singular',
    ]
    assert keys['simulator: energy'] == ['energy_j', 'initial_energy_j', 'change_j']
    assert {status.hardware_id for status in message.status} == {'slider_crank'}
    assert all(status.level == diagnostics.OK for status in message.status)
    failed = diagnostics.solver(
        slider_crank, 'failed', StepError('bent', 'take a smaller step', 1.0)
    )
    assert failed.level == diagnostics.ERROR and 'smaller step' in failed.message
    assert list(failed.values) == keys['simulator: solver']


def test_a_singular_position_is_a_warning_and_passing_near_one_too():
    # rods of equal length upright: the slider is on the crank's pin
    positions = {'A': [0, 1], 'B': [0, 0]}
    velocities = {'A': [1, 0], 'B': [2, 0]}
    initial = {'positions': positions, 'velocities': velocities}
    there = Simulation(load_scene({'mechanism': 'slider_crank', 'initial': initial})).sample()
    report = diagnostics.constraints(there)
    assert (report.level, report.values['singular']) == (diagnostics.WARN, True)
    assert float(str(report.values['distance_to_singular'])) < 1e-6

    simulation = Simulation(load_scene('slider_crank'))
    far = simulation.sample()
    assert diagnostics.constraints(far).level == diagnostics.OK
    assert far.diagnostics.distance > 0.1
    assert diagnostics.constraints(far, closest=0.001).level == diagnostics.WARN
    # nothing is computed for it alone
    assert simulation.sample().diagnostics.distance_if_known == math.inf
    # in its 10 s it passes 11 times: every pass is seen at a tick of 2 ms
    passes, near = 0, False
    for sample in simulation.run(10.0, every=2):
        sample.reaction_forces  # noqa: B018
        was, near = near, sample.diagnostics.distance_if_known < near_level(sample.model)
        passes += near and not was
    assert passes == 11


def test_drives_give_what_they_prescribe_and_the_effort_it_takes():
    mechanism = {**HANGING_ROD['mechanism'], 'points': {'O': {'at': [0, 0]}, 'A': {'at': [0, -2]}}}
    mechanism['joints'] = {}
    mechanism['drives'] = {
        'pivot': {'point': 'O', 'at': [None, '0.3*t']},
    }
    simulation = Simulation(load_scene({**HANGING_ROD, 'mechanism': mechanism}))
    simulation.step(100)
    sample, message = simulation.sample(), messages(simulation)['drives']
    assert list(message.name) == ['pivot_y']
    assert list(message.position) == pytest.approx([0.03])
    assert list(message.velocity) == pytest.approx([0.3])
    assert list(message.effort) == pytest.approx([3 * 9.81])  # it hangs, and goes up steadily
    simulation = Simulation(load_scene('wiper'))
    simulation.step(100)
    sample, message = simulation.sample(), messages(simulation)['drives']
    joint = sample.joints['motor_shaft']
    assert list(message.name) == ['motor']
    assert (message.position[0], message.velocity[0]) == (joint.position, joint.velocity)
    assert message.effort[0] == sample.drive_efforts['motor'][0] != 0.0


def test_steps_that_are_too_long_are_a_warning_with_one_that_would_do():
    simulation = Simulation(load_scene('slider_crank'), step=0.1, integrator='rk4')
    simulation.step()
    assert diagnostics.solver(simulation, 'playing', None).level == diagnostics.OK
    simulation.step(100)
    report = diagnostics.solver(simulation, 'playing', None)
    assert report.level == diagnostics.WARN
    assert report.message.startswith('steps of 0.1 s are too long: ')
    assert report.values['step_error'] == simulation.step_error > 0.001
    assert f'take {report.values["adequate_step_s"]:g} s or less' in report.message

    adaptive = Simulation(load_scene('slider_crank'), step=0.1, integrator='dop853_adaptive')
    values = diagnostics.solver(adaptive, 'playing', None).values
    assert values['step_error'] == values['adequate_step_s'] == 'unknown'
