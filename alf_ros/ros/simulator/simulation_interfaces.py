"""The standard services of simulators (simulation_interfaces), where that package is installed.

They use the same state machine as the services of std_srvs. Only services of the installed release
are offered; all features that `~/get_simulator_features` reports work.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from simulation_interfaces import action, srv
from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures

from alf_ros import resources
from alf_ros.errors import AlfError, InputError
from alf_ros.ros.messages.templates import WORLD
from alf_ros.ros.parameter_services import Change
from alf_ros.ros.simulator.control import Control
from alf_ros.ros.simulator.entities import entity_state, wanted_pose, wanted_twist

if TYPE_CHECKING:
    from rclpy.node import Node

# Feature codes by the interface that makes them true.
_FEATURES = {
    'GetEntityState': ('ENTITY_STATE_GETTING',),
    'SetEntityState': ('ENTITY_STATE_SETTING',),
    'ResetSimulation': ('SIMULATION_RESET', 'SIMULATION_RESET_STATE'),
    'GetSimulationState': ('SIMULATION_STATE_GETTING',),
    'SetSimulationState': ('SIMULATION_STATE_SETTING', 'SIMULATION_STATE_PAUSE'),
    'StepSimulation': ('STEP_SIMULATION_SINGLE', 'STEP_SIMULATION_MULTIPLE'),
    'SimulateSteps': ('STEP_SIMULATION_ACTION',),
    'LoadWorld': ('WORLD_LOADING',),
    'GetCurrentWorld': ('WORLD_INFO_GETTING',),
    'GetAvailableWorlds': ('AVAILABLE_WORLDS',),
}
_SUFFIXES = ('.yaml', '.yml')


class SimulationServices:
    """Offers the interfaces below the node's name, such as `~/get_simulator_features`."""

    def __init__(self, node: Node, control: Control, change: Change) -> None:
        """`change` sets parameters of the node."""
        self._node, self._control, self._change = node, control, change
        self._paused_in = -1  # the run, by its number, that was paused without a step
        self._features: list[int] = []
        waiting = ReentrantCallbackGroup()
        offered: dict[str, Callable[..., Any]] = {
            'GetSimulatorFeatures': self._on_features,
            'GetSimulationState': self._on_get_state,
            'SetSimulationState': self._on_set_state,
            'StepSimulation': self._on_step,
            'ResetSimulation': self._on_reset,
            'LoadWorld': self._on_load,
            'GetCurrentWorld': self._on_current,
            'GetAvailableWorlds': self._on_available,
            'GetEntities': self._on_entities,
            'GetEntityState': self._on_entity,
            'GetEntitiesStates': self._on_entities_states,
            'SetEntityState': self._on_set_entity,
        }
        for name, serve in offered.items():
            if hasattr(srv, name):
                kind = getattr(srv, name)
                group = waiting if name == 'StepSimulation' else None
                node.create_service(kind, f'~/{_snake(name)}', serve, callback_group=group)
                self._report(name)
        self._steps = ActionServer(
            node,
            action.SimulateSteps,
            '~/simulate_steps',
            self._simulate_steps,
            callback_group=waiting,
            cancel_callback=self._on_cancel,
            # Feedback comes for every step, and steps come in bursts.
            feedback_pub_qos_profile=QoSProfile(depth=100),
        )
        self._report('SimulateSteps')

    def _report(self, name: str) -> None:
        for feature in _FEATURES.get(name, ()):
            if hasattr(SimulatorFeatures, feature):
                self._features.append(getattr(SimulatorFeatures, feature))

    def _on_features(self, _: Any, response: Any) -> Any:
        response.features.features = self._features
        response.features.custom_info = f'alf_ros {resources.version()}; entities are bodies'
        return response

    # -------------------------------------------------------------------------------------- state

    @property
    def _state(self) -> int:
        if not self._control.paused:
            return int(SimulationState.STATE_PLAYING)
        run = self._control.run
        at_start = run.simulation.step_index == run.first_step == 0
        if at_start and self._paused_in != run.number and not self._control.stepping:
            return int(SimulationState.STATE_STOPPED)
        return int(SimulationState.STATE_PAUSED)

    def _on_get_state(self, _: Any, response: Any) -> Any:
        response.state.state = self._state
        response.result.result = Result.RESULT_OK
        return response

    def _on_set_state(self, request: Any, response: Any) -> Any:
        target, kind = request.state.state, srv.SetSimulationState.Response
        acts = {
            SimulationState.STATE_PLAYING: self._control.play,
            SimulationState.STATE_PAUSED: self._pause,
            SimulationState.STATE_STOPPED: self._stop,
            SimulationState.STATE_QUITTING: self._control.quit,
        }
        if target not in acts:
            return _failed(response, kind.INCORRECT_TRANSITION, 'no such state to go to')
        if target == self._state:
            return _failed(response, kind.ALREADY_IN_TARGET_STATE, 'already in this state')
        return _tried(response, acts[target], kind.STATE_TRANSITION_ERROR)

    def _pause(self) -> str:
        self._paused_in = self._control.run.number
        return self._control.pause()

    def _stop(self) -> str:
        self._control.pause()
        return self._control.reset(keep_time=False)

    def _on_reset(self, request: Any, response: Any) -> Any:
        kind = srv.ResetSimulation.Request
        scope = request.scope or kind.SCOPE_ALL
        if scope & kind.SCOPE_STATE:
            keep_time = not scope & kind.SCOPE_TIME
            return _tried(response, lambda: self._control.reset(keep_time))
        if scope & kind.SCOPE_TIME:
            text = 'time cannot be reset alone: it goes back with the state'
            return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, text)
        return _tried(response, lambda: 'no entity was spawned')

    # -------------------------------------------------------------------------------------- steps

    async def _on_step(self, request: Any, response: Any) -> Any:
        try:
            await self._control.step(request.steps)
            response.result.result = Result.RESULT_OK
        except AlfError as error:
            _failed(response, Result.RESULT_OPERATION_FAILED, str(error))
        return response

    async def _simulate_steps(self, goal: Any) -> Any:
        result, feedback = action.SimulateSteps.Result(), action.SimulateSteps.Feedback()
        count = goal.request.steps

        def tell(made: int) -> None:
            feedback.completed_steps, feedback.remaining_steps = made, count - made
            goal.publish_feedback(feedback)

        try:
            await self._control.step(count, tell)
            result.result.result = Result.RESULT_OK
            goal.succeed()
        except AlfError as error:
            _failed(result, Result.RESULT_OPERATION_FAILED, str(error))
            if goal.is_cancel_requested:
                goal.canceled()
            else:
                goal.abort()
        return result

    def _on_cancel(self, _: Any) -> CancelResponse:
        self._control.pause()
        return CancelResponse.ACCEPT

    # -------------------------------------------------------------------------------------- world

    async def _on_load(self, request: Any, response: Any) -> Any:
        kind = srv.LoadWorld.Response
        # Releases before 2.1 have another name for it; 2.0 has the two fields themselves.
        resource = _first(request, 'world_resource', 'level_resource') or request
        if not resource.uri:
            if resource.resource_string:
                return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, 'give a uri')
            return _failed(response, kind.NO_RESOURCE, 'neither uri nor resource_string')
        source = _scene(resource.uri)
        if source is None:
            text = f'{resource.uri}: not a scene (.yaml), nor the name of one'
            return _failed(response, kind.UNSUPPORTED_FORMAT, text)
        result = await self._change([Parameter('scene', value=source)])
        if not result.successful:
            return _failed(response, kind.RESOURCE_PARSE_ERROR, result.reason)
        self._describe(response.world)
        return _tried(response, lambda: 'loaded')

    def _on_current(self, _: Any, response: Any) -> Any:
        self._describe(response.world)
        return _tried(response, lambda: '')

    def _describe(self, world: Any) -> None:
        scene = self._control.run.setup.scene
        world.name = scene.name
        resource = _first(world, 'world_resource', 'level_resource')
        resource.uri = Path(scene.file).resolve().as_uri() if scene.file else ''
        resource.resource_string = scene.text

    def _on_available(self, request: Any, response: Any) -> Any:
        if request.additional_sources or request.filter.tags:
            text = 'neither other sources nor tags'
            return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, text)
        kind = type(srv.LoadWorld.Response().world)
        for name, path in sorted(resources.library('scenes').items()):
            world = kind(name=name)
            _first(world, 'world_resource', 'level_resource').uri = path.resolve().as_uri()
            response.worlds.append(world)
        return _tried(response, lambda: '')

    # ----------------------------------------------------------------------------------- entities

    def _on_entities(self, request: Any, response: Any) -> Any:
        return self._filtered(request.filters, response)

    def _on_entities_states(self, request: Any, response: Any) -> Any:
        self._filtered(request.filters, response)
        if response.result.result != Result.RESULT_OK:
            return response
        run = self._control.run

        def read() -> str:
            sample = run.simulation.sample()
            names = response.entities
            response.states = [entity_state(sample, name, run.stamp) for name in names]
            return ''

        return _tried(response, read)

    def _filtered(self, filters: Any, response: Any) -> Any:
        if filters.categories or filters.tags.tags or filters.bounds.points:
            text = 'filters other than by name'
            return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, text)
        try:
            wanted = re.compile(filters.filter)
        except re.error as error:
            text = f'{filters.filter}: not a regular expression: {error}'
            return _failed(response, Result.RESULT_OPERATION_FAILED, text)
        names = self._control.run.simulation.model.body_names
        response.entities = [name for name in names if wanted.search(name)]
        return _tried(response, lambda: '')

    def _on_entity(self, request: Any, response: Any) -> Any:
        run, body = self._control.run, request.entity
        if not self._is_body(body, response):
            return response

        def read() -> str:
            response.state = entity_state(run.simulation.sample(), body, run.stamp)
            return ''

        return _tried(response, read)

    def _on_set_entity(self, request: Any, response: Any) -> Any:
        """Accelerations follow from the forces: they are ignored, as the standard allows."""
        body, state = request.entity, request.state
        if not self._is_body(body, response):
            return response
        if state.header.frame_id not in ('', WORLD):
            text = f'{state.header.frame_id}: frames other than {WORLD}'
            return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, text)
        # Releases before 2.1 have no flags: all is set.
        with_pose, with_twist = (getattr(request, f'set_{k}', True) for k in ('pose', 'twist'))
        if not with_pose and not with_twist:
            text = 'no field to set: neither set_pose nor set_twist'
            return _failed(response, Result.RESULT_FEATURE_UNSUPPORTED, text)
        dimension = self._control.run.simulation.model.layout.dimension
        try:
            pose = wanted_pose(state, dimension) if with_pose else None
        except InputError as error:
            code = getattr(response, 'INVALID_POSE', Result.RESULT_OPERATION_FAILED)  # since 1.1
            return _failed(response, code, str(error))

        def place() -> str:
            twist = wanted_twist(state, dimension) if with_twist else None
            told = self._control.place(body, pose, twist)
            self._paused_in = self._control.run.number  # no longer the start of the scene
            return told

        return _tried(response, place)

    def _is_body(self, name: str, response: Any) -> bool:
        known = name in self._control.run.simulation.model.body_names
        if not known:
            _failed(response, Result.RESULT_NOT_FOUND, f'{name}: no such body')
        return known


def _snake(name: str) -> str:
    return re.sub(r'(?<!^)(?=[A-Z])', '_', name).lower()


def _first(message: Any, *names: str) -> Any:
    """The first field that this release of the message has, or None."""
    return next((getattr(message, name) for name in names if hasattr(message, name)), None)


def _failed(response: Any, code: int, text: str) -> Any:
    response.result.result, response.result.error_message = code, text
    return response


def _tried(response: Any, act: Callable[[], str], code: int = 4) -> Any:
    """Act; a refusal becomes `code` (RESULT_OPERATION_FAILED) with its reason."""
    try:
        act()
    except AlfError as error:
        return _failed(response, code, str(error))
    response.result.result = Result.RESULT_OK
    return response


def _scene(uri: str) -> str | None:
    """The value of the parameter `scene`: a path, or a name; None for neither."""
    parts = urlsplit(uri)
    if parts.scheme == 'package':
        roots = [folder.parents[1] for folder in resources.folder('scenes')]
        path = parts.path.lstrip('/')
        found = next((root / path for root in roots if (root / path).is_file()), None)
        if parts.netloc != 'alf_ros' or found is None:
            return None
        return str(found)
    if parts.scheme == 'file':
        uri = unquote(parts.path)
    elif parts.scheme:
        return None
    plain = re.fullmatch(r'\w+', uri)
    return uri if plain or uri.endswith(_SUFFIXES) else None
