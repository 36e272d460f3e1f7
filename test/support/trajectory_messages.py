"""Messages of trajectories, with times and stamps in seconds."""

from __future__ import annotations

from collections.abc import Sequence

from builtin_interfaces.msg import Duration, Time
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def point(
    t: float,
    positions: Sequence[float] = (),
    velocities: Sequence[float] = (),
    accelerations: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> JointTrajectoryPoint:
    """Where joints are at a time."""
    seconds, nanoseconds = divmod(round(t * 1e9), 10**9)
    return JointTrajectoryPoint(
        positions=list(positions),
        velocities=list(velocities),
        accelerations=list(accelerations),
        effort=list(effort),
        time_from_start=Duration(sec=seconds, nanosec=nanoseconds),
    )


def message(
    *points: JointTrajectoryPoint, names: Sequence[str] = ('pin',), start: float = 0.0
) -> JointTrajectory:
    """Points of the joints, from a stamp on."""
    found = JointTrajectory(joint_names=list(names), points=list(points))
    seconds, nanoseconds = divmod(round(start * 1e9), 10**9)
    found.header.stamp = Time(sec=seconds, nanosec=nanoseconds)
    return found
