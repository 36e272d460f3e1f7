"""The standard services of simulators. Needs simulation_interfaces: a ROS 2 installation."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from alf_ros import Simulation, load_scene
from alf_ros.logs import load
from alf_ros.logs.comparison import compare
from support.paths import ROOT
from support.ros_node import LIMIT, Peer, SimulatorProcess

pytest.importorskip('simulation_interfaces', reason='comes with a ROS 2 installation')
from simulation_interfaces import action, srv
from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures

from alf_ros.ros.simulator.entities import entity_state

STOPPED, PLAYING, PAUSED, QUITTING = 0, 1, 2, 3
FLAGS = 'set_pose', 'set_twist', 'set_acceleration'


@pytest.fixture(scope='module')
def peer():
    peer = Peer()
    yield peer
    peer.close()


class Standard:
    """The services of a running node."""

    def __init__(self, peer, node):
        self.peer, self.node = peer, node
        self.heard = peer.listen('joint_states', JointState)

    def call(self, kind, name, **request):
        return self.peer.call(kind, f'/simulator/{name}', **request)

    @property
    def state(self):
        answer = self.call(srv.GetSimulationState, 'get_simulation_state')
        assert answer.result.result == Result.RESULT_OK
        return answer.state.state

    def go(self, state):
        target = SimulationState(state=state)
        answer = self.call(srv.SetSimulationState, 'set_simulation_state', state=target)
        return answer.result.result

    def stamp(self):
        stamp = self.heard[-1].header.stamp if self.heard else None
        return stamp and stamp.sec * 1_000_000_000 + stamp.nanosec


@pytest.fixture(scope='module')
def standard(tmp_path_factory, peer):
    folder = tmp_path_factory.mktemp('standard')
    with SimulatorProcess(folder, '--no-record', start_paused='true').wait_running() as node:
        yield Standard(peer, node)


@pytest.fixture(autouse=True)
def stopped(standard):
    """Every test begins with the scene of the start, stopped."""
    standard.go(STOPPED)
    standard.peer.until(lambda: standard.stamp() == 1, 'the start')


def test_features_are_those_offered_and_no_others(standard):
    found = standard.call(srv.GetSimulatorFeatures, 'get_simulator_features').features
    services = dict(
        standard.peer.node.get_service_names_and_types_by_node('simulator', '/')
    ).values()
    offered = {kind.rpartition('/')[2] for kinds in services for kind in kinds}
    told = {
        'SIMULATION_RESET': 'ResetSimulation',
        'SIMULATION_RESET_STATE': 'ResetSimulation',
        'SIMULATION_STATE_GETTING': 'GetSimulationState',
        'SIMULATION_STATE_SETTING': 'SetSimulationState',
        'SIMULATION_STATE_PAUSE': 'SetSimulationState',
        'STEP_SIMULATION_SINGLE': 'StepSimulation',
        'STEP_SIMULATION_MULTIPLE': 'StepSimulation',
        'STEP_SIMULATION_ACTION': 'SimulateSteps_SendGoal',
        'ENTITY_STATE_GETTING': 'GetEntityState',
        'ENTITY_STATE_SETTING': 'SetEntityState',
        'WORLD_LOADING': 'LoadWorld',
        'WORLD_INFO_GETTING': 'GetCurrentWorld',
        'AVAILABLE_WORLDS': 'GetAvailableWorlds',
    }
    known = {name: kind for name, kind in told.items() if kind in offered}
    assert set(found.features) == {getattr(SimulatorFeatures, name) for name in known}
    assert list(found.spawn_formats) == [] and 'alf_ros' in found.custom_info


def test_states_and_transitions(standard):
    kind = srv.SetSimulationState.Response
    assert standard.state == STOPPED
    assert standard.go(STOPPED) == kind.ALREADY_IN_TARGET_STATE
    assert standard.go(PAUSED) == Result.RESULT_OK and standard.state == PAUSED
    assert standard.go(PLAYING) == Result.RESULT_OK and standard.state == PLAYING
    standard.peer.until(lambda: standard.stamp() > 10**8, 'motion')
    # one machine behind both sets of services
    assert standard.call(SetBool, 'pause', data=True).message == 'paused'
    assert standard.state == PAUSED and standard.stamp() > 1
    no_world = 4  # by name since 1.1
    assert standard.go(no_world) == kind.INCORRECT_TRANSITION
    assert standard.go(STOPPED) == Result.RESULT_OK and standard.state == STOPPED


def test_steps_are_published_when_the_answer_comes(standard):
    answer = standard.call(srv.StepSimulation, 'step_simulation', steps=40)
    assert answer.result.result == Result.RESULT_OK
    standard.peer.until(lambda: standard.stamp() == 80_000_000, 'forty ticks')
    assert standard.state == PAUSED
    standard.go(PLAYING)
    answer = standard.call(srv.StepSimulation, 'step_simulation', steps=1)
    assert answer.result.result == Result.RESULT_OPERATION_FAILED
    assert 'pause first' in answer.result.error_message


def test_resets_by_scope(standard):
    kind = srv.ResetSimulation.Request

    def reset(scope):
        return standard.call(srv.ResetSimulation, 'reset_simulation', scope=scope).result

    standard.call(srv.StepSimulation, 'step_simulation', steps=10)
    assert reset(kind.SCOPE_TIME).result == Result.RESULT_FEATURE_UNSUPPORTED
    assert reset(kind.SCOPE_STATE).result == Result.RESULT_OK
    standard.peer.until(lambda: standard.stamp() == 22_000_000, 'stamps that go on')
    assert reset(kind.SCOPE_SPAWNED).result == Result.RESULT_OK
    assert reset(kind.SCOPE_DEFAULT).result == Result.RESULT_OK
    standard.peer.until(lambda: standard.stamp() == 1, 'time zero')


def test_steps_as_an_action_with_feedback_and_cancelled(standard):
    peer = standard.peer
    client = ActionClient(
        peer.node,
        action.SimulateSteps,
        '/simulator/simulate_steps',
        feedback_sub_qos_profile=QoSProfile(depth=1000),
    )
    peer.until(client.server_is_ready, 'the action')

    def send(steps):
        """The goal, its result to come, and its feedback."""
        heard = []
        goal = action.SimulateSteps.Goal(steps=steps)
        asked = client.send_goal_async(goal, lambda m: heard.append(m.feedback))
        handle = peer.until(lambda: asked.done() and asked.result(), 'acceptance')
        assert handle.accepted
        return handle, handle.get_result_async(), heard

    # the server may find the reader of its feedback later than the client finds the server
    heard: list[Any] = []
    end = time.monotonic() + LIMIT
    while not heard and time.monotonic() < end:
        _, waiting, heard = send(1)
        peer.until(waiting.done, 'a step')
        peer.executor.spin_once(timeout_sec=0.1)
    _, waiting, heard = send(30)
    answer = peer.until(lambda: waiting.done() and waiting.result(), 'the result', LIMIT)
    assert answer.status == 4 and answer.result.result.result == Result.RESULT_OK
    # a client that has read of the end drops feedback it has not read yet
    assert [(f.completed_steps, f.remaining_steps) for f in heard] == [
        (k, 30 - k) for k in range(1, len(heard) + 1)
    ]
    handle, waiting, heard = send(10**9)
    peer.until(lambda: len(heard) > 100, 'progress')
    # a body put elsewhere meanwhile does not end them
    answer = standard.call(srv.SetEntityState, 'set_entity_state', **wanted('crank'))
    assert answer.result.result == Result.RESULT_OK
    before = len(heard)
    peer.until(lambda: len(heard) > before + 100, 'more progress')
    made = [f.completed_steps for f in heard]
    assert made == sorted(set(made)) and heard[-1].remaining_steps == 10**9 - made[-1]
    handle.cancel_goal_async()
    answer = peer.until(lambda: waiting.done() and waiting.result(), 'the end', LIMIT)
    assert answer.status == 5 and 'stopped after' in answer.result.result.error_message
    assert standard.state == PAUSED
    client.destroy()


def test_entities_are_bodies_with_pose_twist_and_acceleration(standard):
    def names(text):
        kind = srv.GetEntities.Request().filters
        kind.filter = text
        answer = standard.call(srv.GetEntities, 'get_entities', filters=kind)
        return answer.result.result, list(answer.entities)

    assert names('') == (Result.RESULT_OK, ['crank', 'coupler'])
    assert names('^cr') == (Result.RESULT_OK, ['crank'])
    assert names('(')[0] == Result.RESULT_OPERATION_FAILED
    standard.call(srv.StepSimulation, 'step_simulation', steps=100)
    simulation = Simulation(load_scene('slider_crank'))
    poses, rates = [], []
    for steps in (199, 1, 1):
        simulation.step(steps)
        sample = simulation.sample()
        poses.append(sample.body_poses[1].copy())
        rates.append((sample.velocities['A'], sample.joint_velocities[:2].sum()))
    answer = standard.call(srv.GetEntityState, 'get_entity_state', entity='coupler')
    assert answer.result.result == Result.RESULT_OK
    state = answer.state
    assert state.header.frame_id == 'world' and state.header.stamp.nanosec == 200_000_000
    assert (state.pose.position.x, state.pose.position.y) == tuple(poses[1][:2])
    angle = 2.0 * math.atan2(state.pose.orientation.z, state.pose.orientation.w)
    assert math.cos(angle - poses[1][2]) == pytest.approx(1.0, abs=1e-12)
    assert [state.twist.linear.x, state.twist.linear.y] == pytest.approx(rates[1][0])
    assert state.twist.angular.z == pytest.approx(rates[1][1])
    # against differences over two steps of 1 ms
    slopes = (np.array(rates[2][0]) - rates[0][0]) / 2e-3, (rates[2][1] - rates[0][1]) / 2e-3
    linear = [state.acceleration.linear.x, state.acceleration.linear.y]
    assert linear == pytest.approx(slopes[0], rel=1e-4)
    assert state.acceleration.angular.z == pytest.approx(slopes[1], rel=1e-4)
    unknown = standard.call(srv.GetEntityState, 'get_entity_state', entity='crnak')
    assert unknown.result.result == Result.RESULT_NOT_FOUND
    filters = srv.GetEntitiesStates.Request().filters
    both = standard.call(srv.GetEntitiesStates, 'get_entities_states', filters=filters)
    assert list(both.entities) == ['crank', 'coupler'] and both.states[1] == state


@pytest.mark.parametrize('scene', ['spatial_slider_crank', 'rolling_disk', 'delta_robot'])
def test_entities_in_space_against_differences(scene):
    """Twist against poses, acceleration against twists, over two small steps."""
    simulation, h = Simulation(load_scene(scene), step=1e-4, integrator='rk4'), 1e-4
    simulation.step(500)

    def xyz(vector):
        return np.array([vector.x, vector.y, vector.z])

    for name in simulation.model.body_names:
        start = simulation.state
        before, now, after = (entity_state(s, name, 1) for s in simulation.run(2 * h))
        turns = []
        for state in (before, after):
            q = state.pose.orientation
            turns.append(Rotation.from_quat([q.x, q.y, q.z, q.w]))
        places = xyz(after.pose.position) - xyz(before.pose.position)
        size = 1.0 + np.abs(xyz(now.acceleration.linear)).max()
        assert xyz(now.twist.linear) == pytest.approx(places / (2 * h), abs=1e-5 * size)
        spin = (turns[1] * turns[0].inv()).as_rotvec() / (2 * h)
        axis = turns[0].as_matrix()[:, 0]
        if len(simulation.model.layout.shape(name).ends) < 3:  # a rod: no turn about itself
            spin -= axis * (axis @ spin)
        size = 1.0 + np.abs(xyz(now.acceleration.angular)).max()
        assert xyz(now.twist.angular) == pytest.approx(spin, abs=1e-4 * size)
        for kind in ('linear', 'angular'):
            rates = [xyz(getattr(state.twist, kind)) for state in (before, after)]
            found = xyz(getattr(now.acceleration, kind))
            size = 1.0 + np.abs(found).max()
            assert found == pytest.approx((rates[1] - rates[0]) / (2 * h), abs=1e-3 * size)
        simulation.restore(start)


def wanted(entity, place=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0), v=(), omega=(), **flags):
    """A request of SetEntityState; flags that a release does not have are left out."""
    request = srv.SetEntityState.Request(entity=entity)
    state = request.state
    for vector, values in (
        (state.pose.position, place),
        (state.pose.orientation, turn),
        (state.twist.linear, v),
        (state.twist.angular, omega),
    ):
        for axis, value in zip('xyzw', values, strict=False):
            setattr(vector, axis, value)
    state.header.frame_id = flags.pop('frame', '')
    for name in FLAGS:
        if hasattr(request, name):
            setattr(request, name, flags.get(name, name != 'set_acceleration'))
    return {name: getattr(request, name) for name in request.get_fields_and_field_types()}


def about_z(angle):
    return 0.0, 0.0, math.sin(angle / 2.0), math.cos(angle / 2.0)


def test_an_entity_is_put_elsewhere_and_the_mechanism_closes_around_it(standard):
    def put(*what, **more):
        return standard.call(
            srv.SetEntityState, 'set_entity_state', **wanted(*what, **more)
        ).result

    def is_there(angle, rate):
        """The published joints and the pose of GetEntityState agree with `angle` and `rate`."""

        def found():
            crank, knee, *_ = standard.heard[-1].position
            return abs(crank - angle) < 1e-9 and abs(knee + 2.0 * angle) < 1e-9

        standard.peer.until(found, f'the crank at {angle} rad')
        crank, knee, *_ = standard.heard[-1].velocity
        assert (crank, knee) == pytest.approx((rate, -2.0 * rate), abs=1e-9)
        told = standard.call(srv.GetEntityState, 'get_entity_state', entity='crank').state
        turned = 2.0 * math.atan2(told.pose.orientation.z, told.pose.orientation.w)
        assert math.cos(turned - angle) == pytest.approx(1.0, abs=1e-12)
        assert told.twist.angular.z == pytest.approx(rate, abs=1e-9)
        return told

    before = standard.stamp()
    assert put('crank', turn=about_z(0.3), omega=(0.0, 0.0, 2.0)).result == Result.RESULT_OK
    is_there(0.3, 2.0)
    assert standard.stamp() > before and standard.state == PAUSED
    # over the singular positions, on as a motion would, and into one
    for angle in (2.8, 5.0, 7.0, 2.5 * math.pi):
        assert put('crank', turn=about_z(angle), frame='world').result == Result.RESULT_OK
        told = is_there(angle, 0.0)
    # what is told can be asked for
    fields = wanted('crank') | {'state': told}
    answer = standard.call(srv.SetEntityState, 'set_entity_state', **fields)
    assert answer.result.result == Result.RESULT_OK
    is_there(2.5 * math.pi, 0.0)
    put('crank', turn=about_z(6.9))
    coupler = (math.cos(7.0), math.sin(7.0), 0.0)
    assert put('coupler', coupler, about_z(-7.0)).result == Result.RESULT_OK
    is_there(7.0, 0.0)
    assert standard.call(srv.StepSimulation, 'step_simulation', steps=5).result.result == 1
    assert standard.go(STOPPED) == Result.RESULT_OK


@pytest.mark.skipif(
    not hasattr(srv.SetEntityState.Request(), 'set_pose'), reason='a release without flags'
)
def test_pose_and_twist_are_set_alone_if_asked(standard):
    def put(**more):
        fields = wanted('crank', turn=about_z(1.2), omega=(0.0, 0.0, 3.0), **more)
        return standard.call(srv.SetEntityState, 'set_entity_state', **fields).result

    simulation = Simulation(load_scene('slider_crank'))
    rate = simulation.sample().joint_velocities[0]
    assert put(set_twist=False).result == Result.RESULT_OK
    standard.peer.until(lambda: abs(standard.heard[-1].position[0] - 1.2) < 1e-9, 'the pose')
    assert standard.heard[-1].velocity[0] == pytest.approx(rate, abs=1e-9)
    standard.go(STOPPED)
    angle = simulation.sample().joint_positions[0]
    assert put(set_pose=False, set_acceleration=True).result == Result.RESULT_OK
    standard.peer.until(lambda: abs(standard.heard[-1].velocity[0] - 3.0) < 1e-9, 'the twist')
    assert standard.heard[-1].position[0] == pytest.approx(angle, abs=1e-12)
    nothing = put(set_pose=False, set_twist=False, set_acceleration=True)
    assert nothing.result == Result.RESULT_FEATURE_UNSUPPORTED


def test_what_an_entity_cannot_do_is_refused_and_changes_nothing(standard):
    def put(*what, **more):
        result = standard.call(srv.SetEntityState, 'set_entity_state', **wanted(*what, **more))
        return result.result.result, result.result.error_message

    before = standard.call(srv.GetEntityState, 'get_entity_state', entity='crank').state
    failed = Result.RESULT_OPERATION_FAILED
    invalid = getattr(srv.SetEntityState.Response, 'INVALID_POSE', failed)
    assert put('crnak') == (Result.RESULT_NOT_FOUND, 'crnak: no such body')
    assert put('crank', frame='coupler')[0] == Result.RESULT_FEATURE_UNSUPPORTED
    assert put('crank', turn=(0.0, 0.0, 0.0, 0.0))[0] == invalid
    assert put('crank', (0.0, math.nan, 0.0))[0] == invalid
    assert put('crank', (0.0, 0.0, 0.1))[0] == invalid
    assert put('crank', turn=(0.0, math.sin(0.1), 0.0, math.cos(0.1)))[0] == invalid
    assert put('crank', v=(0.0, 0.0, 1.0))[0] == failed
    code, text = put('crank', (0.1, 0.0, 0.0))
    assert code == failed and 'O (x given) is off by 0.1 m' in text
    code, text = put('crank', v=(0.1, 0.0, 0.0))
    assert code == failed and 'O (x given) is off by 0.1 m/s' in text
    after = standard.call(srv.GetEntityState, 'get_entity_state', entity='crank').state
    assert after == before and standard.state == STOPPED


def test_logs_with_entities_put_elsewhere_repeat_bit_for_bit(tmp_path, peer):
    """In space, while it plays: the log before ends there, and another one begins."""

    def call(kind, name, **request):
        return peer.call(kind, f'/moved/simulator/{name}', **request)

    heard = peer.listen('/moved/joint_states', JointState)
    options = '--scene', 'stewart_platform', '--ros-args', '-r', '__ns:=/moved'
    with SimulatorProcess(tmp_path, *options).wait_running() as node:
        for k in range(3):
            held = len(heard)
            peer.until(lambda held=held: len(heard) > held + 20, 'motion')
            there = wanted('top', (0.1 * k, 0.0, 1.2), about_z(0.2 * k), v=(0.1, 0.0, 0.0))
            answer = call(srv.SetEntityState, 'set_entity_state', **there)
            assert answer.result.result == Result.RESULT_OK, answer.result.error_message
        held = len(heard)
        peer.until(lambda: len(heard) > held + 20, 'motion from there')
        assert node.stop() == 0, node.output
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in heard]
    assert stamps == sorted(set(stamps))
    logs = [load(path) for path in node.logs]
    assert len(logs) == 4 and ['state' in log.info for log in logs] == [False, True, True, True]
    for log in logs:
        result = compare(log)
        assert result.equal and result.compared > 20, result


@pytest.mark.skipif(not hasattr(srv, 'LoadWorld'), reason='a release without worlds')
def test_worlds_are_scenes(standard):
    kind = srv.LoadWorld.Response

    def load(uri='', text=''):
        request = srv.LoadWorld.Request()
        field = next(n for n in ('world_resource', 'level_resource', 'uri') if hasattr(request, n))
        resource = request if field == 'uri' else getattr(request, field)
        resource.uri, resource.resource_string = uri, text
        fields = {name: getattr(request, name) for name in request.get_fields_and_field_types()}
        return standard.call(srv.LoadWorld, 'load_world', **fields)

    assert load().result.result == kind.NO_RESOURCE
    assert load(text='mechanism: four_bar').result.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert load('https://example.org/world.yaml').result.result == kind.UNSUPPORTED_FORMAT
    assert load('world.sdf').result.result == kind.UNSUPPORTED_FORMAT
    broken = load((ROOT / 'config/mechanisms/four_bar.yaml').as_uri())
    assert broken.result.result == kind.RESOURCE_PARSE_ERROR and broken.result.error_message
    scene = 'package://alf_ros/config/scenes/four_bar.yaml'
    answer = load(scene)
    assert (answer.result.result, answer.world.name) == (Result.RESULT_OK, 'four_bar')
    assert standard.state == STOPPED
    current = standard.call(srv.GetCurrentWorld, 'get_current_world').world
    assert current.world_resource.resource_string == load_scene('four_bar').text
    assert Path(current.world_resource.uri.removeprefix('file://')).samefile(
        ROOT / 'config/scenes/four_bar.yaml'
    )
    request = srv.GetAvailableWorlds.Request()
    worlds = standard.call(
        srv.GetAvailableWorlds, 'get_available_worlds', offline_only=request.offline_only
    ).worlds
    found = {world.name: world.world_resource.uri for world in worlds}
    assert set(found) == {path.stem for path in (ROOT / 'config/scenes').glob('*.yaml')}
    assert load(found['slider_crank']).result.result == Result.RESULT_OK


def test_quitting_closes_the_log(tmp_path, peer):
    with SimulatorProcess(tmp_path, '--ros-args', '-r', '__ns:=/quitting').wait_running() as node:
        clock = peer.listen('/quitting/clock', Clock, 1)
        assert clock == []
        answer = peer.call(
            srv.SetSimulationState,
            '/quitting/simulator/set_simulation_state',
            state=SimulationState(state=QUITTING),
        )
        assert answer.result.result == Result.RESULT_OK
        assert node.wait(LIMIT) == 0, node.output
    assert 'stopped at' in node.output and (node.logs[0].parent / 'metadata.yaml').is_file()
