"""Whether a second node has the name of this one, and publishes on its topics.

ROS permits it. Both then answer each message, and readers take the two motions for one. The graph
alone does not tell: a node that was killed stays there for the time of its lease, 20 s by default,
beside the one that was started in its place. So a second node counts only while it reports.
"""

from __future__ import annotations

import os
import platform
import time
from collections import deque
from datetime import datetime, timezone

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.subscription import Subscription

from alf_ros.ros.messages.topics import RELIABLE

KEY = 'process'  # of the value that tells two nodes of one name apart
_RECENT = 5.0  # s: five reports
_ENOUGH = 2  # recent reports: one may be the last of a node that ends just now


class Namesake:
    """Listens for a node of the same name where this one reports.

    `process`: what this node reports as its KEY. `other`: the one of a second node, '' without
    one. The own topic is heard only while the graph has a second publisher of this name there.
    """

    def __init__(self, node: Node, reports: str, named: str) -> None:
        """reports: topic of the diagnostics; named: how the statuses of the node begin: no other
        name has the same text."""
        started = datetime.now(timezone.utc).isoformat(timespec='milliseconds')
        self.process = f'{os.getpid()} on {platform.node()}, started {started}'
        self._node, self._reports, self._named = node, reports, named
        self._ear: Subscription | None = None
        self._heard: deque[tuple[float, str]] = deque(maxlen=_ENOUGH)  # steady s, process

    @property
    def other(self) -> str:
        """The process of a second node that reports, '' if there is none."""
        if len(self._heard) < _ENOUGH or time.monotonic() - self._heard[0][0] > _RECENT:
            return ''
        return self._heard[-1][1]

    def look(self) -> None:
        """Look at the graph: to be called about once a second."""
        if not self._is_in_graph():
            if self._ear is not None:
                self._node.destroy_subscription(self._ear)
                self._ear = None
            self._heard.clear()
        elif self._ear is None:
            self._ear = self._node.create_subscription(
                DiagnosticArray, self._reports, self._hear, RELIABLE
            )

    def _hear(self, report: DiagnosticArray) -> None:
        if not report.status or not report.status[0].name.startswith(self._named):
            return
        pairs = (each for status in report.status for each in status.values)
        process = next((each.value for each in pairs if each.key == KEY), 'unknown')
        if process != self.process:
            self._heard.append((time.monotonic(), process))

    def _is_in_graph(self) -> bool:
        """Whether a second publisher of reports has the name of this node."""
        own = self._node.get_name(), self._node.get_namespace()
        publishers = self._node.get_publishers_info_by_topic(self._reports)
        return sum((each.node_name, each.node_namespace) == own for each in publishers) > 1
