"""A robot on wheels: exact accelerations, and a real node that follows cmd_vel."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from alf_ros import Simulation, load_scene
from alf_ros.__main__ import main
from alf_ros.errors import InputError
from alf_ros.simulation.sensors.body_motion import body_motion
from support.ros_node import Diagnostics, SimulatorProcess

W, R, M, J, MW = 0.2, 0.08, 6.0, 0.15, 0.4  # of the mechanism
FOLLOWS = {'left': 'left_hub', 'right': 'right_hub', 'wheel_radius': R, 'wheel_separation': 2 * W}


def twist(forward: float = 0.0, turn: float = 0.0, **linear: float) -> Twist:
    return Twist(linear=Vector3(x=forward, **linear), angular=Vector3(z=turn))


def test_efforts_of_the_hubs_accelerate_it_exactly() -> None:
    """Both rates grow linearly: the wheels turn with the way, and with the turn."""
    left, right = 0.3, 0.5  # N m
    motors = {'left': {'joint': 'left_hub', 'effort': left}}
    motors['right'] = {'joint': 'right_hub', 'effort': right}
    scene = load_scene({'mechanism': 'wheeled_robot', 'effects': {'motor': motors}})
    simulation = Simulation(scene)
    *_, sample = simulation.run(1.0)
    spin = 0.5 * MW * R**2  # of a wheel about its axle
    mass = M + 2.0 * MW + 2.0 * spin / R**2
    inertia = J + 2.0 * MW * (W**2 + 0.25 * R**2) + 2.0 * spin * W**2 / R**2
    motion = body_motion(sample, 'chassis')
    assert motion.to_body(motion.velocity) == pytest.approx(
        [(left + right) / R / mass, 0, 0], abs=1e-9
    )
    assert motion.omega == pytest.approx([0.0, 0.0, (right - left) * W / R / inertia], abs=1e-9)


def test_it_follows_a_twist_and_refuses_what_wheels_cannot_do(tmp_path: Path, peer: Any) -> None:
    heard: list[Odometry] = peer.listen('/simulator/odometry', Odometry)
    found = Diagnostics(peer)
    with SimulatorProcess(tmp_path, scene='wheeled_robot').wait_running() as node:
        command = peer.talk('/cmd_vel', Twist)
        command.publish(twist(0.6, 0.9))

        def settled() -> bool:
            if not heard:
                return False
            now = heard[-1].twist.twist
            return abs(now.linear.x - 0.6) < 1e-6 and abs(now.angular.z - 0.9) < 1e-6

        peer.until(settled, 'the commanded twist')
        refusals = Counter[str]()
        for wrong, reason in (
            (twist(math.nan), 'not_finite'),
            (twist(0.1, y=0.1), 'out_of_plane'),
            (twist(1e308), 'not_finite'),  # of the wheels
        ):
            command.publish(wrong)
            refusals[reason] += 1
            key, count = f'refused_{reason}', str(refusals[reason])
            peer.until(lambda k=key, n=count: found.value('commands', k) == n, key)
        assert settled()
        assert node.stop() == 0, node.output
    assert main(['verify', str(node.logs[0])]) == 0


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'left': 'hub'}, 'left_hub'),
        ({'left': 'right_hub'}, 'two joints'),
        ({'wheel_radius': 0}, 'wheel_radius must be positive'),
        ({'wheel_separation': -1}, 'wheel_separation must be positive'),
    ],
)
def test_what_cannot_be_a_drive_is_one_line(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        load_scene({'mechanism': 'wheeled_robot', 'diff_drive': {**FOLLOWS, **change}})
    assert '\n' not in str(refused.value)


def test_a_length_is_no_wheel() -> None:
    drive = {**FOLLOWS, 'left': 'knee', 'right': 'guide'}
    with pytest.raises(InputError, match='not an angle'):
        load_scene({'mechanism': 'slider_crank', 'diff_drive': drive})
