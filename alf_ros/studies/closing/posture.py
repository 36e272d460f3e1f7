"""A posture: the positions of all joints and bodies of a mechanism at given active coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.kept import kept
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.named_values import NamedValues
from alf_ros.simulation.state import State


@dataclass(frozen=True)
class Ways:
    """How the properties of a posture are computed that cost more than itself."""

    rates: Callable[[], Floats]
    distance: Callable[[], float]
    branch: Callable[[], int]
    travel: Callable[[str, bool], tuple[float, float]]


class Posture(Kinematics):
    """The mechanism with its loops closed. Arrays are read-only, SI, world frame.

    From `Kinematics`: `points`, `velocities` of points, `body_poses`, `q`, `qd`, `phi`,
    `joint_positions` and `joint_velocities` (joint coordinates,). Velocities are zero where the
    call had no rates.
    """

    def __init__(
        self,
        model: Model,
        t: float,
        state: State,
        instruments: Instruments,
        missed_by: float,
        ambiguous: bool,
        ways: Ways,
    ) -> None:
        super().__init__(model, t, state, instruments)
        self._missed_by, self._ambiguous, self._ways = missed_by, ambiguous, ways

    def __repr__(self) -> str:
        count = len(self.model.coordinate_names)
        ends = f'closed to {self.closed_to:.2g} m, missed by {self.missed_by:.2g}'
        return f'<Posture of {count} joint coordinates, {ends}>'

    @property
    def missed_by(self) -> float:
        """By how much the active coordinate that is furthest off misses the value given, rad or m.

        Rounding, if the loops allow the values. Else of one active coordinate the distance to the
        end of its travel; of several, how far they were from the values where the straight line to
        them leaves what the loops allow.
        """
        return self._missed_by

    @property
    def ambiguous(self) -> bool:
        """Whether the branch is a guess, since some call up to now; `Closure.restart` ends it.

        With noise: two branches passed each other closer than the noise tells, or one active joint
        went over a gap that the loops do not allow. With times: calls stopped for long in or
        beside a position where branches meet. Beside a dead point: the motion is not steady, as
        behind a rest or values out of reach, or if calls come twice."""
        return self._ambiguous

    @property
    def joints(self) -> Mapping[str, float]:
        """Position of each joint coordinate, rad (turns counted) or m."""
        return NamedValues(self.model.coordinate_names, lambda n: float(self.joint_positions[n]))

    @property
    def joint_rates(self) -> Mapping[str, float]:
        """Velocity of each joint coordinate, rad/s or m/s; zero where the call had no rates, NaN
        where the posture cannot move at these rates, as in a dead point."""
        return NamedValues(self.model.coordinate_names, lambda n: float(self.joint_velocities[n]))

    @property
    def closed_to(self) -> float:
        """Largest distance by which a constraint of the mechanism is open, m."""
        return float(abs(self.phi * self._scale).max(initial=0.0))

    @kept
    def rates(self) -> Floats:
        """G = ∂x/∂x_a (joint coordinates, active): ẋ = G ẋ_a. The unit of an entry is the
        unit of the joint coordinate over the unit of the active one (rad or m). The rows of active
        coordinates form the identity. In a dead point G does not exist (NaN); near it G is
        large."""
        return self._ways.rates()

    @property
    def effort_map(self) -> Floats:
        """Gᵀ (active, joint coordinates): τ_a = Gᵀ τ. Efforts τ (N m or N, each on the child along
        its joint coordinate) on any joints have the same power as the efforts τ_a on the active
        ones, τ·ẋ = τ_a·ẋ_a in all motions. So -Gᵀ τ on the active joints holds loads τ."""
        return self.rates.T

    @kept
    def distance(self) -> float:
        """Distance to the nearest position where the active coordinates do not determine the
        others: the least singular value σ of the scaled Φ_q, with the rows of the active
        coordinates, as `Sample.diagnostics.distance`. 0 in a dead point."""
        return self._ways.distance()

    @kept
    def branch(self) -> int:
        """+1 or -1: the sign of the determinant of Φ_q (rows independent at the start), over that
        at the start. It changes as the mechanism passes a dead point, or a position where
        branches cross."""
        return self._ways.branch()

    def travel(self, joint: str, stops: bool = True) -> tuple[float, float]:
        """The interval (rad or m) of an active joint coordinate with the loops closed, the others
        resting at their present values: the branch is followed on either side to a dead point, or
        to the place where a joint, active or passive, reaches a stop (`joint_stop`) of the scene.

        stops: False for the loops alone. Where a joint is beyond a stop, there is no way on.

        (-inf, inf) for an angle that goes round; inf for a length beyond four times the size of
        the mechanism, and for an angle, as gears, threads or couplings count it, that ends beyond
        1000 turns or beyond postures 100 times the size away.
        Raises InputError for another name.
        """
        return self._ways.travel(joint, stops)
