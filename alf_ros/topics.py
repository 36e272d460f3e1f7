"""The topics that say what a sample says: their names, types, QoS and writers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64

from alf_ros import messages
from alf_ros.messages import Write

if TYPE_CHECKING:
    from alf_ros.model import Model

# Reliable publishers match both reliable and best-effort readers.
RELIABLE = QoSProfile(depth=10)
# As rclcpp::ClockQoS: an old clock message is worth nothing.
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True)
class Topic:
    """A topic of the simulator; `name` is what a user writes, `make(model)` gives its writer, or
    None if there is nothing to say: a free body has no joints."""

    name: str
    type: type
    qos: QoSProfile
    make: Callable[[Model], Write | None]

    @property
    def key(self) -> str:
        """The name without '~/': what stands behind `publish.` in the parameters."""
        return self.name.rpartition('/')[2]


TOPICS = (
    Topic('joint_states', JointState, RELIABLE, messages.joint_states),
    Topic('~/reactions', MultiDOFJointState, RELIABLE, messages.reactions),
    Topic('~/constraints', JointState, RELIABLE, messages.constraints),
    Topic('~/energy', Float64, RELIABLE, messages.energy),
    # Relative, so that several simulators in namespaces of their own each have their own time.
    Topic('clock', Clock, BEST_EFFORT, messages.clock),
)
