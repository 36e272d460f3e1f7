"""The topics that say what a sample says: their names, types, QoS and writers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from alf_ros.model.compile import Model
from alf_ros.ros.messages import templates
from alf_ros.ros.messages.markers import markers
from alf_ros.ros.messages.templates import Write
from alf_ros.ros.messages.tf import transforms
from alf_ros.simulation.display_geometry import Display
from alf_ros.simulation.sensors import Sensors
from alf_ros.simulation.simulation import Simulation

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels: only a ROS 2 installation brings it
    TFMessage = None


# Reliable publishers match both reliable and best-effort readers.
RELIABLE = QoSProfile(depth=10)
# As rclcpp::ClockQoS: an old clock message is worth nothing.
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


Make = Callable[['Simulation', Display], 'Write | None']


@dataclass(frozen=True)
class Topic:
    """A topic of the simulator; `name` is the name that a user writes, `make(simulation, display)`
    gives its writer, or None without content: a free body has no joints. A topic that is only
    `shown` is not published at every tick. `mode`: the default publication."""

    name: str
    type: type
    qos: QoSProfile
    make: Make
    shown: bool = False
    mode: str = 'auto'

    @property
    def key(self) -> str:
        """The name without '~/': what stands behind `publish.` in the parameters."""
        return self.name.rpartition('/')[2]


def _plain(make: Callable[[Model], Write | None]) -> Make:
    return lambda simulation, display: make(simulation.model)


def _shown(make: Callable[[Model, Display], Write | None]) -> Make:
    return lambda simulation, display: make(simulation.model, display)


def _energy_parts(simulation: Simulation, display: Display) -> Write | None:
    return templates.energy_parts(tuple(simulation.sample().stored))


def _work(simulation: Simulation, display: Display) -> Write | None:
    return templates.work(simulation.accounts)


def _frames(simulation: Simulation, display: Display) -> Write | None:
    return transforms(simulation.model, display, Sensors(simulation.scene))


# tf and clock are relative, so that simulators in namespaces of their own each have their own. tf
# is off until asked for: a robot_state_publisher beside it would say the same frames.
TF = 'tf'
TOPICS = (
    Topic('joint_states', JointState, RELIABLE, _plain(templates.joint_states)),
    Topic('~/reactions', MultiDOFJointState, RELIABLE, _plain(templates.reactions)),
    Topic('~/constraints', JointState, RELIABLE, _plain(templates.constraints)),
    Topic('~/drives', JointState, RELIABLE, _plain(templates.drives)),
    Topic('~/state', JointState, RELIABLE, _plain(templates.StateMessage)),
    Topic('~/energy', Float64, RELIABLE, _plain(templates.energy)),
    Topic('~/energy_stamped', JointState, RELIABLE, _energy_parts),
    Topic('~/work', JointState, RELIABLE, _work),
    Topic('clock', Clock, BEST_EFFORT, _plain(templates.clock)),
    Topic('~/markers', MarkerArray, RELIABLE, _shown(markers), shown=True),
    *([Topic(TF, TFMessage, RELIABLE, _frames, shown=True, mode='off')] if TFMessage else []),
)
