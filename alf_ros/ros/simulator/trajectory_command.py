"""trajectory_msgs/JointTrajectory -> curves, as the joint_trajectory_controller has it.

From where the joint is wanted to be (or is, if nothing is wanted of it) to the first point, from
point to point, then held. A new trajectory follows the one before up to its own start. Positions
need a motor that controls them; efforts, linear between the points, any joint takes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from alf_ros.effects.contract.trajectory import Curve, Knot, through
from alf_ros.ros.simulator.command_messages import Controlled, Refused, check_names
from alf_ros.simulation.sample import Sample

if TYPE_CHECKING:
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

MOST_POINTS = 10_000
_DAY = 86_400.0  # s: what begins later has stamps of another clock


@dataclass(frozen=True)
class Trajectory:
    """Knots by joint at `times` (s from the start); `start` (ns) is a stamp, 0: at once."""

    start: int
    times: tuple[float, ...]
    positions: Mapping[str, Sequence[Knot]]
    efforts: Mapping[str, Sequence[Knot]]

    def curves(self, sample: Sample, ahead: int) -> tuple[dict[str, Curve], dict[str, Curve]]:
        """Positions and efforts over the simulated time, from the sample on; stamps are `ahead`
        (ns) of it. Raises Refused if all its points lie in the past, or more than a day ahead, or
        if there is no finite curve through them."""
        begin = (self.start - ahead) * 1e-9 if self.start else sample.t
        times = [begin + t for t in self.times]
        past = sum(t < sample.t for t in times)
        if past == len(times):
            raise Refused('wrong_time', 'joint_trajectory: all its points lie in the past')
        if begin - sample.t > _DAY:  # it would be held for years, and nothing moves
            ahead_by = f'{begin - sample.t:.3g} s ahead: stamps are of clock'
            raise Refused('wrong_time', f'joint_trajectory: it begins {ahead_by}')
        if any(b <= a for a, b in zip(times, times[1:], strict=False)):  # late, if at all
            text = f'two points fall together at t = {sample.t:.9g} s, by rounding'
            raise Refused('wrong_time', f'joint_trajectory: {text}')
        times, first = times[past:], max(begin, sample.t)
        places = dict(zip(sample.model.coordinate_names, sample.joint_positions, strict=True))
        speeds = dict(zip(sample.model.coordinate_names, sample.joint_velocities, strict=True))
        positions, efforts = {}, {}
        for joint, knots in self.positions.items():
            target = sample.inputs.targets.get(joint)
            before = target.position if target else None
            if before is None:
                # Until it starts the joint is held where it is.
                speed = float(speeds[joint]) if first == sample.t else 0.0
                present: Knot = (float(places[joint]), speed, 0.0)
            else:
                present = before.at(first) if isinstance(before, Curve) else (before, 0.0, 0.0)
            positions[joint] = _curve(joint, first, present, times, knots[past:], before)
        for joint, knots in self.efforts.items():
            held = sample.inputs.efforts.get(joint, 0.0)
            present = held.at(first)[:1] if isinstance(held, Curve) else (held,)
            efforts[joint] = _curve(joint, first, present, times, knots[past:], held)
        return positions, efforts


def _curve(
    joint: str,
    first: float,
    present: Knot,
    times: list[float],
    knots: Sequence[Knot],
    before: float | Curve | None,
) -> Curve:
    if times[0] > first:
        times, knots = [first, *times], [present, *knots]
    try:
        return through(times, knots, before if isinstance(before, Curve) else None)
    except ValueError:  # finite points may be too far apart for numbers
        text = f'no finite curve leads {joint} from point to point'
        raise Refused('not_finite', f'joint_trajectory: {text}') from None


def read_trajectory(
    message: JointTrajectory, joints: Collection[str], controlled: Controlled
) -> Trajectory:
    """The message, if it can be followed. Raises Refused."""
    names, points = list(message.joint_names), message.points
    check_names('joint_trajectory', names, joints)
    if not points or not names:
        raise Refused('no_value', 'joint_trajectory without points or joints')
    if len(points) > MOST_POINTS:
        raise Refused('wrong_length', f'joint_trajectory: more than {MOST_POINTS} points')
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
    if times[0] < 0.0 or any(b <= a for a, b in zip(times, times[1:], strict=False)):
        raise Refused('wrong_time', 'joint_trajectory: time_from_start must ascend from 0 on')
    for field in ('positions', 'velocities', 'accelerations', 'effort'):
        for n, point in enumerate(points):
            values = getattr(point, field)
            if len(values) not in (0, len(names)):
                text = f'point {n}: {len(values)} {field} for {len(names)} joints'
                raise Refused('wrong_length', f'joint_trajectory: {text}')
            if not all(map(math.isfinite, values)):
                raise Refused('not_finite', f'joint_trajectory: point {n}: {field}')
    for n, point in enumerate(points):
        if point.accelerations and not point.velocities:
            text = f'point {n}: accelerations without velocities'
            raise Refused('no_value', f'joint_trajectory: {text}')
    positions = _given(points, 'positions')
    efforts = _given(points, 'effort')
    if not positions and not efforts:
        raise Refused('no_value', 'joint_trajectory with neither positions nor efforts')
    for name in names if positions else ():
        if not controlled[name][0]:
            raise Refused('not_controlled', f'joint_trajectory: no motor controls {name!r}')
    if positions and any(points[-1].velocities):
        raise Refused('moving_end', 'joint_trajectory: the last point must be at rest')
    return Trajectory(
        message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec,
        tuple(times),
        {name: [_knot(p, n) for p in points] for n, name in enumerate(names) if positions},
        {name: [(p.effort[n],) for p in points] for n, name in enumerate(names) if efforts},
    )


def _given(points: Sequence[JointTrajectoryPoint], field: str) -> bool:
    """Whether all points say it. Raises Refused if only some do."""
    said = {len(getattr(point, field)) > 0 for point in points}
    if len(said) > 1:
        raise Refused('wrong_length', f'joint_trajectory: {field} in some points only')
    return said == {True}


def _knot(point: JointTrajectoryPoint, n: int) -> Knot:
    """The values of the point for its n-th joint."""
    if not point.velocities:
        return (point.positions[n],)
    if not point.accelerations:
        return (point.positions[n], point.velocities[n])
    return (point.positions[n], point.velocities[n], point.accelerations[n])
