"""The live view as a ROS node: data from a simulator, as a picture.

The simulator publishes at every tick. A page needs thirty pictures a second, so topics are read
best effort with a queue of one, when the view has time: messages in between are never unpacked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros.logs.report.solid_bodies import HINT, three_js
from alf_ros.resources import library
from alf_ros.ros.messages.shape_markers import shape_outline
from alf_ros.ros.messages.topics import BEST_EFFORT, LATCHED
from alf_ros.ros.parameter_services import ParameterServices
from alf_ros.ros.simulator.parameters import check_names
from alf_ros.ros.view.mesh_library import MeshLibrary
from alf_ros.ros.view.shown_scene import ShownScene
from alf_ros.simulation.display_geometry import POINTS_PER_ARROW

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# A simulator that said nothing for this long (s) is gone: paused it speaks once a second.
SILENCE = 3.0

Json = dict[str, Any]


class ViewNode(Node):
    """Hears the simulator of that name in its own namespace. `meshes`: of its scenes. Raises
    InputError for parameters, of which it has none of its own.

    `picture`: the data to draw, None without news; `about`: data that change rarely. `look`
    replaces both and never changes them.
    """

    def __init__(self, simulator: str, meshes: MeshLibrary) -> None:
        super().__init__('view', start_parameter_services=False)
        ParameterServices(self)
        check_names(self)
        self.picture: Json | None = None
        self.about: Json = {}
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._simulator, self._meshes = simulator, meshes
        self._flat = '' if three_js() else f'outlines only: {HINT}'
        # As in the status names of its diagnostics.
        self._task = f'{self.get_namespace()}/{simulator}: '.lstrip('/')
        self._scenes = list(library('scenes'))
        self._listening: list[Subscription] = []
        self._forget()

    def _forget(self) -> None:
        self._heard: Json = {}
        self._last = -math.inf
        self._new = False
        self._state, self._runs = 'away', 0
        self._scene = ShownScene('')
        self._joints: list[str] = []
        self._reacting: list[str] = []
        self._drives: list[str] = []
        self._reports: list[tuple[str, int, str]] = []

    def follow(self, wanted: bool) -> None:
        """Subscribe while somebody looks on: what nobody asks for is not computed."""
        if wanted and not self._listening:
            # Several nodes report: a queue of one would lose the simulator's.
            reports = QoSProfile(depth=10)
            topics: list[tuple[str, type, Callable[[Any], None], QoSProfile]] = [
                ('~/markers', MarkerArray, self._on_markers, BEST_EFFORT),
                ('joint_states', JointState, self._on_joints, BEST_EFFORT),
                ('~/reactions', MultiDOFJointState, self._on_reactions, BEST_EFFORT),
                ('~/constraints', JointState, self._on_constraints, BEST_EFFORT),
                ('~/drives', JointState, self._on_drives, BEST_EFFORT),
                ('~/energy', Float64, self._on_energy, BEST_EFFORT),
                ('~/scene', String, self._on_scene, LATCHED),
                ('/diagnostics', DiagnosticArray, self._on_reports, reports),
            ]
            self._listening = [
                self.create_subscription(kind, name.replace('~', self._simulator), hear, qos)
                for name, kind, hear, qos in topics
            ]
        elif not wanted and self._listening:
            for subscription in self._listening:
                self.destroy_subscription(subscription)
            self._listening = []
            self._forget()

    def look(self) -> None:
        """Take the received messages, at most one from each source, and make the picture of
        them."""
        for _ in range(len(self._listening) + sum(1 for _ in self.clients)):
            self._executor.spin_once(timeout_sec=0.0)
        if time.monotonic() - self._last > SILENCE:
            self._state = 'away'
        self.picture = dict(self._heard) if self._new else None
        self._new = False
        self.about = {
            'simulator': self._simulator,
            'state': self._state,
            'run': self._runs,
            'scene': self._scene.name,
            'spatial': self._scene.spatial,
            'flat': self._flat,
            'joints': self._joints,
            'units': [self._scene.units.get(name, '') for name in self._joints],
            'driven': self._scene.driven,
            'balls': self._scene.balls,
            'drives': self._drives,
            'drive_units': [self._scene.drive_units.get(name, '') for name in self._drives],
            'reacting': self._reacting,
            'reports': self._reports,
            'scenes': self._scenes,
        }

    def show_state(self, state: str) -> None:
        """The state that a service just answered, until the next report."""
        self._state = state

    def _note(self, **heard: Any) -> None:
        self._heard.update(heard)
        self._last, self._new = time.monotonic(), True
        if self._state == 'away':
            self._state = 'playing'  # the next report knows better

    def _on_scene(self, message: String) -> None:
        """A run begins: another simulator, another scene, or this one from its start.

        If only numbers of its effects differ, the run continues.
        """
        before, self._scene = self._scene, ShownScene(message.data)
        if self._scene.continues(before):
            return
        self._runs += 1
        self._heard.clear()
        self._joints, self._reacting, self._drives = [], [], []
        self._note()

    def _on_joints(self, message: JointState) -> None:
        self._joints = list(message.name)
        self._note(
            t=_seconds(message.header),
            position=_short(message.position),
            velocity=_short(message.velocity),
            effort=_short(message.effort),
        )

    def _on_reactions(self, message: MultiDOFJointState) -> None:
        self._reacting = list(message.joint_names)
        forces = (wrench.force for wrench in message.wrench)
        self._note(force=_short(math.hypot(f.x, f.y, f.z) for f in forces))

    def _on_drives(self, message: JointState) -> None:
        self._drives = list(message.name)
        self._note(drives=_short(message.effort))

    def _on_constraints(self, message: JointState) -> None:
        error, rate = (max(map(abs, v), default=0.0) for v in (message.position, message.velocity))
        self._note(t=_seconds(message.header), violation=_short([error, rate]))

    def _on_energy(self, message: Float64) -> None:
        # All digits: what matters is how little it changes.
        self._note(energy=message.data if math.isfinite(message.data) else None)

    def _on_markers(self, message: MarkerArray) -> None:
        drawn: Json = {'shapes': [], 'shape_points': [], 'missing': 0}
        for marker in message.markers:
            points = marker.points
            if marker.ns == 'shapes':
                self._draw_shape(marker, drawn)
                continue
            if marker.ns in ('reactions', 'applied'):  # tail and tip: the page draws the rest
                starts = range(0, len(points), POINTS_PER_ARROW)
                points = [points[at + end] for at in starts for end in (0, 1)]
            drawn[marker.ns] = _short(x for p in points for x in (p.x, p.y, p.z))
        if message.markers:
            drawn['t'] = _seconds(message.markers[0].header)
        self._note(**drawn)

    def _draw_shape(self, marker: Marker, drawn: Json) -> None:
        is_mesh = marker.type == Marker.MESH_RESOURCE
        # Anybody may publish markers: only files that the scene itself names are read.
        file = self._scene.meshes.get(marker.mesh_resource) if is_mesh else None
        name, mesh = (self._meshes.find(file) if file else None) or (None, None)
        outlined = shape_outline(marker, mesh)
        if outlined is None:
            drawn['missing'] += is_mesh
            return
        about, ends = outlined
        drawn['shapes'].append(about | {'mesh': name} if is_mesh else about)
        drawn['shape_points'] += _short(ends.ravel().tolist())

    def _on_reports(self, message: DiagnosticArray) -> None:
        found = [status for status in message.status if status.name.startswith(self._task)]
        if not found:
            return
        self._note()
        names = (status.name[len(self._task) :] for status in found)
        self._reports = [
            (name, status.level[0], status.message)
            for name, status in zip(names, found, strict=True)
        ]
        for status in found:
            if status.name == f'{self._task}solver':
                values = {value.key: value.value for value in status.values}
                self._state = values.get('state', self._state)


def _seconds(header: Any) -> float:
    return float(header.stamp.sec + 1e-9 * header.stamp.nanosec)


def _short(numbers: Iterable[float]) -> list[float | None]:
    """Six digits, for a screen; what JSON cannot say is None."""
    return [float(f'{x:.6g}') if math.isfinite(x) else None for x in numbers]
