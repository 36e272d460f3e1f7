"""A controller as a node of its own: keeps a joint where it is drawn, by efforts on another topic.

    python test/support/balance.py <joint> <position> <k_p> <k_v>

Every joint state is answered with an effort: at the rate of the simulator. Ends with SIGTERM.
"""

from __future__ import annotations

import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Balance(Node):
    """τ = k_p (x* - x) - k_v ẋ."""

    def __init__(self, joint: str, position: float, kp: float, kv: float) -> None:
        super().__init__('balance')
        self._joint, self._position, self._kp, self._kv = joint, position, kp, kv
        self._efforts = self.create_publisher(JointState, 'joint_commands', 10)
        self.create_subscription(JointState, 'joint_states', self._answer, NEWEST)

    def _answer(self, state: JointState) -> None:
        n = state.name.index(self._joint)
        effort = self._kp * (self._position - state.position[n]) - self._kv * state.velocity[n]
        self._efforts.publish(JointState(name=[self._joint], effort=[effort]))


def main() -> None:
    joint, *numbers = sys.argv[1:]
    rclpy.init()
    try:
        rclpy.spin(Balance(joint, *map(float, numbers)))
    except (Exception, KeyboardInterrupt):  # a signal ends the context wherever it is just used
        if rclpy.ok():
            raise
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
