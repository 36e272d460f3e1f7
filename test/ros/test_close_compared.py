"""The node `close` in a namespace, with a topic under another name: as `Closure` in Python."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState
from test_close_node import ClosingProcess, message

from alf_ros import Closure
from support.ros_node import Peer

MOTORS = ('motor0', 'motor1', 'motor2')
MS = 1_000_000  # ns


def angles(n: int) -> dict[str, float]:
    return {name: 0.2 * math.sin(0.3 * n + k) for k, name in enumerate(MOTORS)}


def test_it_publishes_what_closure_computes(tmp_path: Path, peer: Peer) -> None:
    """Names in any order, joints that are missing, NaN and stamps that go back; with velocities
    in some of the messages. Its values equal the same calls, bit for bit."""
    arguments = ['--scene', 'delta_robot', '--active', *MOTORS, '--ros-args', '-r', '__ns:=/cell']
    with ClosingProcess(tmp_path, *arguments, '-r', 'active_joint_states:=/plc/motors') as node:
        heard = peer.listen('/cell/joint_states', JointState)
        talker = peer.talk('/plc/motors', JointState)
        peer.known_to('/cell/close')
        closure, first = Closure('delta_robot', MOTORS), 10**18
        given, last, rates = dict[str, float](), -1, dict[str, float]()
        told = list[JointState]()
        for n in range(30):
            now = first + 10 * n * MS
            now -= 25 * MS if n == 7 else 10_000 * MS if n >= 20 else 0  # a clock set back
            said = angles(n)
            names = sorted(said, key=lambda name: hash((n, MOTORS.index(name))))
            if n % 5 == 3:
                names = names[:2]  # the third one keeps its values
            speeds = [0.1 * k for k in range(len(names))] if n % 3 else []
            positions = [math.nan if n == 11 and k == 1 else said[a] for k, a in enumerate(names)]
            sent = message(now, speeds, **dict(zip(names, positions, strict=True)))
            talker.publish(sent)
            for k, name in enumerate(names):
                if math.isfinite(positions[k]):
                    given[name] = positions[k]
                    rates.pop(name, None)
                    rates |= {name: speeds[k]} if speeds else {}
            t = (now - first) * 1e-9 if now > last else None
            whole = rates if len(rates) == len(MOTORS) else None
            expected = closure.close(given, whole, t)
            last = now
            told.append(sent)
            peer.until(lambda: len(heard) == len(told), f'answer {n}')
            got = heard[-1]
            assert got.header.stamp == sent.header.stamp
            order = list(expected.joints)
            assert list(got.name) == order
            assert list(got.position) == [expected.joints[name] for name in order]
            velocities = [expected.joint_rates[name] for name in order]
            assert list(got.velocity) == pytest.approx(velocities if whole else [], abs=0.0)
        assert node.stop() == 0 and 'Traceback' not in node.output, node.output
