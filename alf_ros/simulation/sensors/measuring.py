"""Sensors of a scene and their measurements."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from alf_ros import effects
from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND, Coordinate
from alf_ros.scene.scene import Scene, SceneSource, load_scene
from alf_ros.scene.sensors_section import Sensor
from alf_ros.simulation.display_geometry import in_space
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sensors.body_motion import body_frame, body_motion
from alf_ros.simulation.sensors.sensor_noise import SensorNoise

Measurement = Mapping[str, Floats]
_SAME = 1e-9  # s


class Sensors:
    """The sensors of a scene, by label and in its order.

    A delayed encoder remembers positions: `follow` every sample, also those that are not read, and
    `forget` them where another run begins, as with `Simulation.restore`.
    """

    def __init__(self, scene: SceneSource) -> None:
        scene = load_scene(scene)
        self.sensors: Mapping[str, Sensor] = {each.label: each for each in scene.sensors}
        self._measures = {
            label: _MEASURES[sensor.kind](scene, sensor) for label, sensor in self.sensors.items()
        }
        self._delayed = [each for each in self._measures.values() if isinstance(each, _Encoder)]
        self._delayed = [each for each in self._delayed if each.delay]

    def in_scene(self, scene: Scene) -> Sensors:
        """The same sensors in a scene whose effects have other numbers: encoders remember."""
        found = Sensors(scene)
        for label, each in found._measures.items():
            before = self._measures.get(label)
            if isinstance(each, _Encoder) and isinstance(before, _Encoder):
                each.remember(before)
        return found

    @property
    def follows(self) -> bool:
        """Whether a sensor needs to see every sample."""
        return bool(self._delayed)

    def remembers(self, label: str) -> bool:
        """Whether a measurement of this sensor depends on the one before."""
        return isinstance(self._measures[label], _Encoder)

    def follow(self, sample: Sample) -> None:
        """Let delayed encoders remember the positions of a sample."""
        for each in self._delayed:
            each.follow(sample)

    def forget(self) -> None:
        """A run begins: encoders forget the time before it."""
        for each in self._measures.values():
            if isinstance(each, _Encoder):
                each.forget()

    def read(
        self, sample: Sample, labels: Collection[str] | None = None
    ) -> dict[str, Measurement]:
        """Measurements of a sample by label (`imu/torso`), each by quantity, in SI units.

        `labels`: of these sensors; of all by default. Each quantity is an array: (3,) for vectors,
        (4,) for an orientation (quaternion x y z w), (1,) for a position or a distance. Axes are
        given in `sensors_section`. Raises StepError if the sample cannot be evaluated, KeyError
        for an unknown label.
        """
        wanted = self._measures if labels is None else labels
        return {label: self._measures[label](sample) for label in wanted}

    @property
    def frames(self) -> dict[str, Callable[[Kinematics], Floats]]:
        """The frames of the sensors that have one of their own, by label: functions of a sample,
        (7,) x y z (m), quaternion x y z w, in the world."""
        every = self._measures.items()
        return {label: each.frame for label, each in every if isinstance(each, _Mounted)}


class _Measure(ABC):
    """Makes the measurements of one sensor."""

    def __init__(self, scene: Scene, sensor: Sensor) -> None:
        self._scene, self._said = scene, sensor.parameters
        seed = getattr(sensor.parameters, 'seed', None)
        self._noise = None if seed is None else SensorNoise(int(seed), sensor.label)

    @abstractmethod
    def __call__(self, sample: Sample) -> Measurement:
        """The measurement of a sample, with its errors."""

    def _with_errors(self, sample: Sample, found: dict[str, Floats]) -> Measurement:
        """The vectors (3,) of which the parameters give noise and bias, with errors."""
        said = self._said
        names = [name for name in found if hasattr(said, f'{name}_noise')]
        noise, bias = (
            np.repeat([getattr(said, f'{name}_{of}') for name in names], 3)
            for of in ('noise', 'bias')
        )
        if noise.any() or bias.any():
            assert self._noise is not None
            errors, at = self._noise.errors(sample.t, noise, bias), 0
            for name in names:
                found[name] = found[name] + errors[at : at + 3]
                at += 3
        return found


class _Mounted(_Measure):
    """With a frame of its own."""

    @abstractmethod
    def frame(self, sample: Kinematics) -> Floats:
        """(7,) in the world."""


class _ForceTorque(_Mounted):
    def __init__(self, scene: Scene, sensor: Sensor) -> None:
        super().__init__(scene, sensor)
        joints = {joint.name: joint for joint in scene.mechanism.joints}
        self._joint = joints[sensor.parameters.joint]
        coordinates = enumerate(scene.mechanism.coordinates)
        self._coordinates = [(n, each) for n, each in coordinates if each.joint is self._joint]

    def __call__(self, sample: Sample) -> Measurement:
        reaction = sample.reactions[self._joint.name]
        axes = body_frame(sample, self._joint.child)
        (force,) = in_space(np.array([reaction.force]))
        torque = np.zeros(3)
        torque[3 - np.size(reaction.torque) :] = reaction.torque
        for n, coordinate in self._coordinates:
            size = float(sample.joint_efforts[n] + sample.geared_efforts[n])
            effort = size * self._axis(sample, coordinate)
            if coordinate.is_angle:
                torque += effort
            else:
                force = force + effort
        found = {'force': axes.to_body(force), 'torque': axes.to_body(torque)}
        return self._with_errors(sample, found)

    def _axis(self, sample: Sample, coordinate: Coordinate) -> Floats:
        """(3,) in the world: the axes of a joint are perpendicular."""
        base, tip = self._joint.frames
        if coordinate.is_angle and len(tip.axes) == 2:
            return np.array([0.0, 0.0, 1.0])
        on_child = coordinate.is_angle and coordinate.freedom.on_child
        body = self._joint.child if on_child else self._joint.parent
        local = tip.axes[0] if on_child else base.axes[2 if len(base.axes) == 3 else 0]
        (along,) = in_space(np.array([local]))
        return along if body == GROUND else body_frame(sample, body).to_world(along)

    def frame(self, sample: Kinematics) -> Floats:
        body = body_frame(sample, self._joint.child)
        (arm,) = in_space(np.array([self._joint.frames[1].origin]))
        return np.concatenate([body.place + body.to_world(arm), body.orientation])


class _Inertial(_Mounted):
    def __init__(self, scene: Scene, sensor: Sensor) -> None:
        super().__init__(scene, sensor)
        said = sensor.parameters
        body = next(each for each in scene.mechanism.bodies if each.name == said.body)
        at = body.local[body.points.index(said.at)] if isinstance(said.at, str) else said.at
        self._arm = np.zeros(3) if at is None else in_space(np.array([at]))[0]
        self._fall = np.zeros(3)
        for effect in scene.effects:
            free_fall = getattr(effects.load(effect.kind), 'free_fall', None)
            if free_fall is not None:
                self._fall += in_space(np.array([free_fall(effect.parameters)]))[0]

    def __call__(self, sample: Sample) -> Measurement:
        motion = body_motion(sample, self._said.body)
        felt = motion.acceleration_at(motion.to_world(self._arm)) - self._fall
        found = {
            'orientation': motion.orientation,
            'angular_velocity': motion.to_body(motion.omega),
            'linear_acceleration': motion.to_body(felt),
        }
        return self._with_errors(sample, found)

    def frame(self, sample: Kinematics) -> Floats:
        body = body_frame(sample, self._said.body)
        return np.concatenate([body.place + body.to_world(self._arm), body.orientation])


class _Pose(_Measure):
    def __call__(self, sample: Sample) -> Measurement:
        frame = body_frame(sample, self._said.body)
        return {'position': frame.place, 'orientation': frame.orientation}


class _Odometry(_Measure):
    def __call__(self, sample: Sample) -> Measurement:
        motion = body_motion(sample, self._said.body)
        return {
            'position': motion.place,
            'orientation': motion.orientation,
            'linear_velocity': motion.to_body(motion.velocity),
            'angular_velocity': motion.to_body(motion.omega),
        }


class _Twist(_Measure):
    def __call__(self, sample: Sample) -> Measurement:
        motion = body_motion(sample, self._said.body)
        turn = motion.to_body if self._said.axes == 'body' else np.asarray
        return {
            'linear_velocity': turn(motion.velocity),
            'angular_velocity': turn(motion.omega),
        }


class _Acceleration(_Measure):
    def __call__(self, sample: Sample) -> Measurement:
        motion = body_motion(sample, self._said.body)
        turn = motion.to_body if self._said.axes == 'body' else np.asarray
        return {
            'linear_acceleration': turn(motion.acceleration),
            'angular_acceleration': turn(motion.alpha),
        }


class _Instant(NamedTuple):
    """The motion of a joint coordinate at t (s): rad or m, and per s."""

    t: float
    position: float
    velocity: float


class _Encoder(_Measure):
    def __init__(self, scene: Scene, sensor: Sensor) -> None:
        super().__init__(scene, sensor)
        self.delay: float = sensor.parameters.delay
        self._place: int | None = None
        self.forget()

    def forget(self) -> None:
        """Begin without a past."""
        self._past: deque[_Instant] = deque()  # of the last delay, and one before
        self._last = (math.nan, 0.0, 0.0)  # time and result of the last measurement

    def remember(self, before: _Encoder) -> None:
        """Continue with the past of another one."""
        self._past, self._last = before._past, before._last

    def follow(self, sample: Sample) -> None:
        """Remember a position; at an earlier time than the last one, forget those before."""
        if self._past and sample.t <= self._past[-1].t - _SAME:
            self._past.clear()
        if not self._past or sample.t > self._past[-1].t + _SAME:
            self._past.append(self._instant(sample))
        while len(self._past) > 1 and self._past[1].t <= sample.t - self.delay + _SAME:
            self._past.popleft()

    def __call__(self, sample: Sample) -> Measurement:
        position = self._instant(sample).position
        if self.delay:
            self.follow(sample)
            position = self._remembered(sample.t - self.delay)
        count = self._said.resolution
        position = position if count is None else _whole(position, count)
        before, last, rate = self._last
        if sample.t > before:
            rate = (position - last) / (sample.t - before)
        elif sample.t != before or position != last:  # else it is measured again
            rate = 0.0
        self._last = sample.t, position, rate
        return {'position': np.array([position]), 'velocity': np.array([rate])}

    def _remembered(self, t: float) -> float:
        """The position at t (s), between the first two instants of the past; or the first one."""
        first = self._past[0]
        return first.position if t <= first.t + _SAME else _between(first, self._past[1], t)

    def _instant(self, sample: Sample) -> _Instant:
        if self._place is None:
            self._place = sample.model.coordinate_names.index(self._said.joint)
        position, velocity = sample.joint_positions, sample.joint_velocities
        return _Instant(sample.t, float(position[self._place]), float(velocity[self._place]))


def _between(a: _Instant, b: _Instant, t: float) -> float:
    """The position at t (s), on the cubic of Hermite through both instants."""
    h = b.t - a.t
    u = (t - a.t) / h
    way = b.position - a.position
    bend = (1.0 - u) * (a.velocity * h - way) - u * (b.velocity * h - way)
    return a.position + u * (way + (1.0 - u) * bend)


def _whole(position: float, count: float) -> float:
    """The position in whole counts, as an encoder counts them: rounded down."""
    return count * math.floor(position / count)


class _Range(_Mounted):
    def __call__(self, sample: Sample) -> Measurement:
        distance = float(np.linalg.norm(self._way(sample)))
        said = self._said
        if said.noise:
            assert self._noise is not None
            noise = self._noise.errors(sample.t, np.array([said.noise]), np.zeros(1))
            distance += float(noise[0])
        if distance > said.max_range:
            distance = math.inf
        elif distance < said.min_range:
            distance = -math.inf
        return {'range': np.array([distance])}

    def _way(self, sample: Kinematics) -> Floats:
        points = sample.points
        return in_space(np.array([points[self._said.to] - points[self._said.at]]))[0]

    def frame(self, sample: Kinematics) -> Floats:
        """Its x axis points to the other point, by the shortest turn from the x axis of the
        world."""
        (place,) = in_space(np.array([sample.points[self._said.at]]))
        x, y, z = self._way(sample)
        length = math.sqrt(x * x + y * y + z * z)
        quaternion = np.array([0.0, -z, y, length + x])  # half way between both directions
        size = float(np.linalg.norm(quaternion))
        if size > 1e-12 * length:
            return np.concatenate([place, quaternion / size])
        return np.concatenate([place, [0.0, 0.0, 1.0, 0.0]])  # backwards, or no distance


_MEASURES: Mapping[str, Callable[[Scene, Sensor], Any]] = {
    'force_torque': _ForceTorque,
    'imu': _Inertial,
    'odometry': _Odometry,
    'pose': _Pose,
    'twist': _Twist,
    'acceleration': _Acceleration,
    'encoder': _Encoder,
    'range': _Range,
}
