"""Data for the readings of a sample: joint coordinates, free axes, the cut mechanism."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Floats, Indices, Integers
from alf_ros.kernel.data.forces import Effects
from alf_ros.kernel.data.motion import Modes
from alf_ros.kernel.data.system import Mass, Rows
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class Forms(Struct):
    """Affine functions of the blocks, Σ C_b q_b + c: places on bodies, directions in them."""

    constant = True

    first: Indices  # (forms + 1,) parts of a form: first[n] .. first[n + 1]
    block: Indices  # (parts,)
    C: Floats  # (parts D D,)
    c: Floats  # (forms D,)


@dataclass(frozen=True, eq=False)
class JointCoordinates(Struct):
    """Joint coordinates: an angle that is counted, less another one or none, or a length."""

    constant = True

    place: Indices  # (coordinates,) among the angles, and behind them among the lengths
    less: Integers  # (coordinates,) the angle that is taken from it, or -1
    lengths: Rows


@dataclass(frozen=True, eq=False)
class BallAngles(Struct):
    """Balls that stand for three revolutes in a row."""

    constant = True

    axes: Rows  # (9 balls,) x, y, z on the parent of x, y and the last axis of the child
    tilt: Floats  # (balls,) rad, from the first to the last axis about the middle one, as drawn


@dataclass(frozen=True, eq=False)
class BlockSums(Struct):
    """Signed sums of blocks, one for each joint."""

    constant = True

    first: Indices  # (joints + 1,) blocks of a sum: first[n] .. first[n + 1]
    block: Indices  # (…,)
    sign: Floats  # (…,)


@dataclass(frozen=True, eq=False)
class Cut(Struct):
    """The cut mechanism, where each body has blocks of its own, and what sums to the wrenches of
    the joints there: needs of shared blocks, and entries of the joints' own rows."""

    constant = True

    mass: Mass  # cut
    rows: Rows  # cut
    source: Indices  # (cut blocks,) the block that each is a copy of
    source_row: Indices  # (cut rows,) the row that each is a copy of
    points: BlockSums  # shared points whose needs sum to a force
    vectors: BlockSums  # shared vectors, whose moments sum to a torque
    first: Indices  # (joints + 1,) own entries at the child's blocks: first[n] .. first[n + 1]
    entry: Indices  # (…,) of the cut rows
    row: Indices  # (…,) row of each, in the assembled mechanism
    block: Indices  # (…,) cut block of each
    is_point: Floats  # (…,) 1, or 0 where the block is a vector
    origins: Forms  # (joints,) place of the joint on its child


@dataclass(frozen=True, eq=False)
class CutWork(Struct):
    """Workspace on the cut mechanism."""

    q: Floats  # (cut blocks D,)
    qd: Floats  # (cut blocks D,)
    qdd: Floats  # (cut blocks D,)
    Q: Floats  # (cut blocks D,) forces there
    needed: Floats  # (cut blocks D,) force that joints must exert on each block, N
    y: Floats  # (cut rows,) λ
    g: Floats  # (cut distance rows D,)
    g2: Floats  # (cut entries D,)


@dataclass(frozen=True, eq=False)
class Shares(Struct):
    """How far each component of the reactions is open (`open_shares`), and memory for that."""

    part: Floats  # (joints times D + 1 or 3,)
    whole: Floats  # (joints times D + 1 or 3,) of which it is a part, in the norm of α
    w: Floats  # (rows,)
    back: Floats  # (rows,)
    x: Floats  # (blocks D,)


@dataclass(frozen=True, eq=False)
class Axes(Struct):
    """Free axes of joints on which effects act, and how the child alone moves along each."""

    constant = True

    coordinate: Indices  # (axes,) joint coordinate
    is_angle: Indices  # (axes,) 1, or 0 of a length
    first_effect: Indices  # (axes + 1,) effects of an axis, which are in the order of the axes
    first: Indices  # (axes + 1,) blocks of the child: first[n] .. first[n + 1]
    block: Indices  # (…,) cut block
    is_point: Floats  # (…,) 1, or 0 where the block is a vector
    directions: Forms  # (axes,) of length 1; of an angle in the plane nothing
    origins: Forms  # (axes,) place of the joint on its child


@dataclass(frozen=True, eq=False)
class HeldForces(Struct):
    """The forces of an instant as readings need them: on the cut mechanism and on free axes."""

    constant = True

    on_cut: Effects
    axes: Axes
    on_axes: Effects
    axis_loads: Indices  # (…,) the load of each effect on an axis with friction under loads
    efforts: Floats  # (joint coordinates,) N m or N, held from outside


@dataclass(frozen=True, eq=False)
class ReadOut(Struct):
    """Index arrays and memory of `read_out`, and the memory of its results."""

    joints: JointCoordinates
    balls: BallAngles
    cut: Cut
    there: CutWork
    modes: Modes  # none where the distance to a singular position is not read
    mode_start: Floats  # (modes, rows) where their iteration begins
    inverse: Floats  # (movable D D,) A⁻¹ on the pattern, where the rank is counted
    inverse_off: Floats  # (blocks D D,)
    row: Indices  # (rows,) in the order of the file: place in the kernel
    coordinate: Indices  # (movable,) in the order of the file: block
    angles: Floats  # (angles,) rad, with their turns
    spins: Floats  # (angles,) rad/s
    near: Floats  # (angles,) rad, to a quarter turn
    phi: Floats  # (rows,) Φ; velocity rows have none
    rate: Floats  # (rows,) Φ̇
    axis_load: Floats  # (…,) N, as `axis_loads` says
    force: Floats  # (joints D,) N
    torque: Floats  # (joints, in space times 3) N m
    momenta: Floats  # (movable D,) M q̇
    told: Floats  # (3,) potential energy, J; σ of the softest mode; rank of Φ_q, not rounded
    # results, (0,) where nobody reads them
    position: Floats  # (joint coordinates and angles of balls,) rad or m
    velocity: Floats  # likewise, rad/s or m/s
    effort: Floats  # likewise, N m or N
    wrench: Floats  # (joints, 6) force and torque on the child, N and N m
    violation: Floats  # (rows,) Φ
    violation_rate: Floats  # (rows,) Φ̇
    multiplier: Floats  # (rows,) λ
    number: Floats  # (numbers of the state,)
    number_rate: Floats  # (numbers of the state,)
    work: Floats  # (accounts,) J
