"""How well joints follow their trajectories, with the tolerances of ros2_controllers.

The error of a joint is the distance between its position and the position on its trajectory, rad
or m. On the way it may be `path`; `goal_time` (s) after the end of the last trajectory it may be
`goal`. A tolerance of 0 is not checked. A violated tolerance is reported and does not stop the
motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from alf_ros.effects.contract.trajectory import Curve
from alf_ros.simulation.sample import Sample


@dataclass(frozen=True)
class Error:
    """The error (rad or m) of the joint that is furthest off, at a time (s)."""

    value: float = 0.0
    joint: str = ''
    t: float = 0.0


class Tracking:
    """The joints that follow trajectories, and their largest errors since the first began."""

    def __init__(self) -> None:
        self.path = self.goal = self.goal_time = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget all of it: nothing follows."""
        self._curves: dict[str, tuple[int, Curve]] = {}
        self.joints = 0
        self.end = 0.0  # s, of the last trajectory
        self.worst, self.at_goal = Error(), None

    at_goal: Error | None  # None before the goal

    @property
    def active(self) -> bool:
        """Whether there is something to look at."""
        return bool(self._curves)

    def follow(self, curves: Mapping[str, Curve], names: Sequence[str]) -> None:
        """Follow these positions by joint; `names` of all joint coordinates, in their order."""
        if not curves:
            return
        if not self._curves:
            self.clear()
        self.at_goal = None
        self._curves |= {name: (names.index(name), curve) for name, curve in curves.items()}
        self.joints = len(self._curves)
        self.end = max(curve.end for _, curve in self._curves.values())

    def leave(self, names: Iterable[str]) -> None:
        """Other targets were given to these joints."""
        for name in names:
            self._curves.pop(name, None)

    def look(self, sample: Sample) -> None:
        """To be called after every tick while it is `active`."""
        positions = sample.joint_positions
        value, joint = max(
            (abs(float(positions[n]) - curve.at(sample.t)[0]), name)
            for name, (n, curve) in self._curves.items()
        )
        error = Error(value, joint, sample.t)
        # the grid of ticks rounds
        if sample.t < self.end + self.goal_time - 1e-9:
            self.worst = max(self.worst, error, key=lambda each: each.value)
        else:
            self.at_goal = error
            self._curves.clear()

    @property
    def state(self) -> str:
        """One word: none, following, reached, missed."""
        if self.at_goal is not None:
            return 'missed' if 0.0 < self.goal < self.at_goal.value else 'reached'
        return 'following' if self.active else 'none'

    @property
    def trouble(self) -> str:
        """Which tolerance was not kept, by which joint; '' if they were."""
        found = []
        if 0.0 < self.path < self.worst.value:
            text = f'{self.worst.joint} was {self.worst.value:.3g} off its path'
            found.append(f'{text} at {self.worst.t:.9g} s, tolerance {self.path:g}')
        if self.state == 'missed' and self.at_goal is not None:
            text = f'{self.at_goal.joint} is {self.at_goal.value:.3g} off its goal'
            found.append(f'{text}, tolerance {self.goal:g}')
        return '; '.join(found)
