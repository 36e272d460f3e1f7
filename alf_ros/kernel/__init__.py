"""The compiled mathematics: A = M + Φ_qᵀαΦ_q and its LDLᵀ, augmented solves, the step.

Equation numbers follow Bayo & Avello, Nonlinear Dynamics 5 (1994); doc/method.md derives the
differences from the printed equations. `data` defines the data that pass between the files.
"""

from alf_ros.kernel.adaptive import advance_adaptively
from alf_ros.kernel.adjoint_implicit import take_implicit_steps_back
from alf_ros.kernel.adjoint_step import take_steps_back
from alf_ros.kernel.applied_forces import (
    add_friction,
    applied_forces,
    chosen_forces,
    force_change,
    potential_energy,
    sides,
)
from alf_ros.kernel.augmented_solve import accelerate, augmented, finish, restore_reactions
from alf_ros.kernel.ball_angles import ball_angles
from alf_ros.kernel.constraints import (
    add_transposed,
    convective,
    jacobian,
    jacobian_rate,
    times_jacobian,
    violation,
)
from alf_ros.kernel.data import (
    EVERY_MODE,
    FREE,
    ORIGIN,
    SOLVED,
    Adjoint,
    Arms,
    Axes,
    BallAngles,
    Bearings,
    BlockSums,
    Chart,
    Cut,
    CutWork,
    Departures,
    Effects,
    FollowedStage,
    ForceColumns,
    ForceDirection,
    Forces,
    ForceTrace,
    Forms,
    HeldForces,
    Integrals,
    JointCoordinates,
    Kinks,
    Ledger,
    Mass,
    Method,
    Modes,
    Pattern,
    Phase,
    Prescribed,
    Problem,
    ReadOut,
    Rows,
    Shares,
    Soft,
    Span,
    StepEnd,
    StepRecord,
    System,
    Tangents,
    Tape,
    Trail,
    Until,
    Watch,
    Work,
)
from alf_ros.kernel.fixed_steps import advance
from alf_ros.kernel.implicit import advance_implicitly
from alf_ros.kernel.inverse_trace import mass_trace
from alf_ros.kernel.joint_coordinates import counted_angles, joint_coordinates
from alf_ros.kernel.joint_efforts import add_joint_efforts
from alf_ros.kernel.joint_wrenches import joint_wrenches, place_on_cut
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.open_shares import OPEN, open_shares
from alf_ros.kernel.prescribed import prescribed_at
from alf_ros.kernel.readout import read_out
from alf_ros.kernel.singularity_monitor import follow, turning
from alf_ros.kernel.slip import integral_values, slips
from alf_ros.kernel.softest_modes import carried_over, softest
from alf_ros.kernel.status import Status
from alf_ros.kernel.triangular_solve import solve
from alf_ros.kernel.unwrapping import nearby

__all__ = [
    'EVERY_MODE',
    'FREE',
    'OPEN',
    'ORIGIN',
    'SOLVED',
    'Adjoint',
    'Arms',
    'Axes',
    'BallAngles',
    'Bearings',
    'BlockSums',
    'Chart',
    'Cut',
    'CutWork',
    'Departures',
    'Effects',
    'ForceDirection',
    'ForceColumns',
    'ForceTrace',
    'FollowedStage',
    'Forces',
    'Forms',
    'HeldForces',
    'Integrals',
    'ReadOut',
    'JointCoordinates',
    'Kinks',
    'Ledger',
    'Mass',
    'Method',
    'Modes',
    'Pattern',
    'Phase',
    'Prescribed',
    'Problem',
    'Rows',
    'Shares',
    'Soft',
    'Span',
    'Status',
    'StepEnd',
    'StepRecord',
    'System',
    'Tangents',
    'Tape',
    'Trail',
    'Until',
    'Watch',
    'Work',
    'accelerate',
    'add_friction',
    'add_joint_efforts',
    'add_mass_times',
    'add_transposed',
    'advance',
    'advance_adaptively',
    'advance_implicitly',
    'applied_forces',
    'augmented',
    'carried_over',
    'chosen_forces',
    'convective',
    'ball_angles',
    'counted_angles',
    'finish',
    'follow',
    'integral_values',
    'force_change',
    'jacobian',
    'jacobian_rate',
    'joint_coordinates',
    'joint_wrenches',
    'linearise',
    'mass_trace',
    'nearby',
    'open_shares',
    'place_on_cut',
    'potential_energy',
    'prescribed_at',
    'read_out',
    'restore_reactions',
    'sides',
    'slips',
    'softest',
    'solve',
    'take_implicit_steps_back',
    'take_steps_back',
    'times_jacobian',
    'turning',
    'violation',
]
