"""Data for closing loops around given joint coordinates, on the branch of a motion."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Floats, Indices, Integers, Unit
from alf_ros.kernel.data.readings import JointCoordinates
from alf_ros.kernel.data.system import System
from alf_ros.kernel.data.work import Work
from alf_ros.kernel.numba_ext.structs import Struct

# `Closing.counts`: calls in the motion so far; corrections in the last call; which candidate it
# took; corrections of the last candidate or step, 0 if no factor belongs to it; 1 once the branch
# is a guess
CALLS, CORRECTIONS, TAKEN, FACTORED, GUESS = 0, 1, 2, 3, 4
AHEAD, ALONG, BEYOND = 0, 1, 2  # of TAKEN; the last: as far as the line reaches
# `Closing.trail`: correction of the last call, m; largest sharpness so far; 1 if the line ends
# beside a position where branches cross, or 0; sharpness of the last call, and of the one before;
# least sharpness on the last line
MISSED, SHARPEST, CROSSES, SHARP, SHARP_BEFORE, LEAST = 0, 1, 2, 3, 4, 5


@dataclass(frozen=True, eq=False)
class Closing(Struct):
    """A mechanism whose active joint coordinates have rows of their own, and the motion so far.

    The motion is a polynomial of second order in the calls: q at the last call, and its first and
    second derivative by calls.
    """

    unit: Unit
    tight: System  # with the rows of the active coordinates
    loose: System  # the same, with α and scale of nothing in these rows
    work: Work
    joints: JointCoordinates
    active: Indices  # (active,) joint coordinate
    block: Indices  # (active,) prescribed block that the row follows
    is_angle: Indices  # (active,) 1, or 0 of a length
    noise: Floats  # (active,) standard deviation of the values given, rad or m
    wanted: Floats  # (active,) rad or m: values of this call
    asked: Floats  # (active,) values where the posture is
    here: Floats  # (active,) values on the way
    turns: Integers  # (angles,) of the posture
    turned: Integers  # (angles,) on the way
    other_turns: Integers  # (angles,) of the other candidate
    counts: Integers  # (5,), see above
    q: Floats  # (all blocks D,) the posture
    other: Floats  # (all blocks D,) a candidate
    before: Floats  # (all blocks D,) where a step on the way began
    place: Floats  # (movable D,) of the motion, at the last call
    rate: Floats  # (movable D,) m per call
    bend: Floats  # (movable D,) m per call²
    ahead: Floats  # (movable D,) where the motion leads in this call
    way: Floats  # (movable D,) first correction of a position
    shift: Floats  # (movable D,) what closed the loops where the motion leads
    slope: Floats  # (movable D,) m: derivative by the part of the line of active values
    bow: Floats  # (movable D,) m: second derivative by it
    guess: Floats  # (movable D,) where they lead in a step
    places: Floats  # (8 movable D,) postures beside the values, two times two on either side
    line: Floats  # (all blocks D,) the candidate on the line
    line_turns: Integers  # (angles,) of it
    stride: Floats  # (active,) rad or m: the last line; 0 if it was not followed
    mode: Floats  # (all blocks D,) the softest mode of Φ_q where a step began
    image: Floats  # (rows,) its unit image
    trail: Floats  # (6,), see above
    ends: Floats  # (2 active,) of the line, while another one is followed
    held: Floats  # (all blocks D,) the last posture away from dead points
    held_turns: Integers  # (angles,) of it
    held_at: Floats  # (active,) values where it is, rad or m
    known: Floats  # (3,) m²: variance of the place, covariance, variance of the rate
    angles: Floats  # (angles,) rad, with turns
    spins: Floats  # (angles,) rad/s
    near: Floats  # (angles,) rad, to a quarter turn
    values: Floats  # (joint coordinates,) rad or m
    rates: Floats  # (joint coordinates,) rad/s or m/s
