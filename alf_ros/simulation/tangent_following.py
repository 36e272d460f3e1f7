"""Tangents of a run: the derivatives of its motion by numbers of its scene, which follow it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.errors import InputError
from alf_ros.kernel import FollowedStage, Forces, Kinks, Ledger, Problem, Tangents, Work
from alf_ros.kernel.data.tangents import DIRECTIONS
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.kernel.numba_ext.lane_structs import aligned
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.model.compile import Model
from alf_ros.model.prescribed import program_apart
from alf_ros.model.struct_memory import changed
from alf_ros.scene.scene import Scene, Solver
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.effect_slopes import EffectSlopes
from alf_ros.simulation.input_places import InputPlaces
from alf_ros.simulation.input_slopes import InputSlopes, Slopes, is_input
from alf_ros.simulation.neighbour import MASSES, ROWS, Neighbour
from alf_ros.simulation.parameter_slopes import ParameterSlopes
from alf_ros.simulation.singular_passes import Pass
from alf_ros.simulation.start import Start
from alf_ros.simulation.state_direction import StateDirection, is_direction

_OF_GROUPS = (
    *('first_q', 'first_qd', 'first_qdd', 'q', 'qd', 'qdd', 'begun_q', 'begun_qd'),
    *('whole_q', 'whole_qd', 'whole_qdd', 'pushed'),
)

_UNFOLDS = 1e-5  # part of nᵀ ∂Φ/∂θ that is left where a position is found


def checked_names(tangents: object) -> tuple[str, ...]:
    """Names of numbers of a scene, each once. Raises InputError."""
    if isinstance(tangents, str) or not isinstance(tangents, Sequence):
        raise InputError(
            'no list of names', key='tangents', value=tangents, expected="['coupler.mass', …]"
        )
    for n, name in enumerate(tangents):
        if not isinstance(name, str) or not name:
            raise InputError('no name', key=f'tangents.{n}', value=name, expected='coupler.mass')
        if name in tangents[:n]:
            raise InputError('named twice', key=f'tangents.{n}', value=name)
    return tuple(tangents)


class TangentFollowing:
    """The data of the tangents of a run, for all its states.

    Raises InputError, with the name, for a number that the motion cannot be differentiated by, an
    effect without a derivative, and settings that tangents do not follow.
    """

    def __init__(
        self,
        names: Sequence[str],
        scene: Scene,
        solver: Solver,
        start: Start,
        before: TangentFollowing | None = None,
    ) -> None:
        """`before`: of the scene with other numbers, whose slopes are kept where they hold."""
        known = {each.name: each for each in before.slopes} if before is not None else {}
        self.names = tuple(names)
        check_settings(solver)
        _check_start(start)
        here = Neighbour(start, scene)
        self.slopes: list[Slopes] = [
            _slopes(name, here, solver, known.get(name)) for name in names
        ]
        for each in self.slopes:
            _check_slopes(each, start)
        self._start = start
        self.places = InputPlaces(start.model, self.slopes)
        self._effects = EffectSlopes(start.model, self.slopes, self.places)

    @property
    def initial(self) -> Floats:
        """(K 2 blocks D,) of q and q̇ where the scene starts."""
        each = [part for s in self.slopes for part in (s.arrays['q'], s.arrays['qd'])]
        return np.concatenate([np.zeros(0), *each])

    @cached_property
    def lengths(self) -> tuple[str, ...]:
        """The parameters that change lengths or places."""
        return tuple(s.name for s in self.slopes if s.changes_rows)

    @cached_property
    def placing(self) -> tuple[str, ...]:
        """The parameters that change lengths, places or the motion of a drive: these may unfold a
        singular position."""
        return tuple(s.name for s in self.slopes if s.name in self.lengths or s.changes_drives)

    def unfolded_by(self, passed: Pass) -> list[str]:
        """The parameters that unfold a singular position: nᵀ ∂Φ/∂θ ≠ 0, with n the combination of
        rows that vanishes there. With such a parameter changed by a little, the motion turns off
        there: its derivative does not exist behind it."""
        found, model = [], self._start.model
        for each in self.slopes:
            if each.name in self.placing:
                opened = each.opening(model, passed.q, passed.t)
                parts = np.abs(passed.lost * opened).sum()
                if not abs(passed.lost @ opened) <= _UNFOLDS * parts:
                    found.append(each.name)
        return found

    def check(self, applied: Applied) -> None:
        """Raises InputError for an effect without a derivative."""
        dual_forces(self.places.applied(applied), _lanes_for(len(self.names)))

    def tangents(
        self,
        applied: Applied,
        problem: Problem,
        work: Work,
        acting: Floats,
        before: Tangents | None = None,
    ) -> Tangents:
        """For the kernel: `problem` of the run, `work` for the stages of the tangents alone.
        acting (K,): 1 of the parameters that act, 0 of the others. `before`: with other inputs,
        whose memory is used again if it fits."""
        W = _lanes_for(len(self.names))
        placed = self.places.applied(applied)
        if placed is not applied:
            applied, problem = placed, changed(problem, forces=placed.assembled)
        slopes = self._effects.at(applied.inputs) * acting[:, np.newaxis]
        params = _in_groups(slopes, W)
        if before is not None and before.params.shape == params.shape:
            known, now = before.problem.forces.effects, problem.forces.effects
            if np.array_equal(known.force, now.force):
                before.params[:] = params
                own = changed(problem, forces=_alone(problem.forces), work=work)
                return changed(before, problem=own)
        force = dual_forces(applied, W)
        changes: dict[str, Any] = {
            name: _in_groups(np.array([each.arrays[name] for each in self.slopes]), W)
            for name in (*MASSES, *ROWS)
        }
        changes['mass_changes'] = _any_of_group(_any(self.slopes, MASSES), W)
        moved = np.array([n in self.lengths for n in self.names], dtype=np.int64)
        changes['rows_change'] = _any_of_group(moved, W)
        changes['params'] = params
        if self.changes_drives:
            numbers = np.array([each.arrays['prescribed'] for each in self.slopes])
            changes.update(drives_of(self._start.model, W, len(changes['mass_changes'])))
            changes['drive_changes'] = _in_groups(numbers, W)
        model, count = self._start.model, len(self.names)
        return replace(tangents_of(model, problem, work, count, force, W), **changes)

    @cached_property
    def changes_drives(self) -> bool:
        """Whether a number changes the motion of a drive."""
        return any(each.changes_drives for each in self.slopes)


def drives_of(model: Model, W: int, groups: int) -> dict[str, Any]:
    """The fields of `Tangents` for motions that change, in W lanes."""
    from alf_ros.model.dual_time_program import dual_run

    slots, params = program_apart(model.layout)
    registers = 3 * int(slots[0])
    return {
        'drive': np.array([dual_run(W).address], dtype=np.uint64),
        'drive_slots': slots,
        'drive_params': params,
        'drive_registers': np.zeros(registers),
        'drive_slopes': aligned(registers, W),
        'drive_qdd': aligned(groups * model.q.size, W),
    }


def tangents_of(
    model: Model, problem: Problem, work: Work, count: int, force: Addresses, W: int
) -> Tangents:
    """Tangents of `count` parameters that change nothing. force: of each effect, for dual
    numbers in W lanes."""
    D, n, whole = model.layout.dimension, model.n, model.q.size
    rows, mass, stages = problem.system.rows, problem.system.mass, problem.method.b.size
    effects, groups = problem.forces.effects, -(-count // W)
    lanes = {
        'mass_diagonal': groups * mass.diagonal.size,
        'mass_k': groups * mass.k.size,
        'mass_w': groups * mass.w.size,
        'length2': groups * rows.length2.size,
        'b': groups * rows.b.size,
        'term': groups * rows.term.size,
        'c': groups * rows.c.size,
        'params': groups * effects.params.size,
        **dict.fromkeys(('drive_changes', 'drive_slopes', 'drive_qdd'), 0),
        **dict.fromkeys(('start', 'xi'), 2 * groups * n),
        'axes': 2 * groups * n if D == 2 else 0,
        'bend': groups * n // D if D == 2 else 0,
        'rates': 2 * groups * stages * n,
        **dict.fromkeys(_OF_GROUPS, groups * whole),
        'f': whole,
        'search': 2 * DIRECTIONS * whole if groups and problem.method.guess.size else 0,
        'kept': 1,
    }
    T = rows.term.reshape(-1, D, D)
    even = (T == T[:, :1, :1] * np.eye(D)).all(axis=(1, 2))
    sizes = {
        'lam': rows.alpha.size,
        'g2d': rows.block.size * D,
        **dict.fromkeys(('term_qd', 'term_qdd'), rows.term_block.size * D),
        'place': n if D == 2 else 0,
        **dict.fromkeys(('Q', 'lane_f', 'lane_x'), whole),
        **dict.fromkeys(('drive_params', 'drive_registers'), 0),
    }
    solve = {'delta': whole, 'r2': rows.alpha.size, 'y': rows.alpha.size}
    shared = {name: aligned(size, W) for name, size in solve.items()}
    return Tangents(
        unit=model.unit,
        problem=replace(problem, forces=_alone(problem.forces), work=work),
        count=np.uint64(count),
        groups=np.uint64(groups),
        force=force,
        mass_changes=np.zeros(groups, dtype=np.int64),
        rows_change=np.zeros(groups, dtype=np.int64),
        here=_followed_stage(problem.work, shared),
        behind=_followed_stage(work, shared),
        drive=np.zeros(0, dtype=np.uint64),
        drive_slots=np.zeros(0, dtype=np.int64),
        along=np.zeros(1, dtype=np.int64),
        followed=np.zeros(2, dtype=np.int64),
        even=np.where(even, T[:, 0, 0], np.nan),
        **{name: aligned(size, W) for name, size in lanes.items()},
        **{name: np.zeros(size) for name, size in sizes.items()},
    )


def _alone(forces: Forces) -> Forces:
    """Without the ledger of works and the kinks, which tangents do not ask for."""
    return Forces(forces.effects, forces.bearings, *_nothing())


@cache
def _nothing() -> tuple[Ledger, Kinks]:
    return Ledger.empty(), Kinks.empty()


def _followed_stage(work: Work, shared: Mapping[str, Floats]) -> FollowedStage:
    read = ('diagonal', 'off', 'g', 'g2', 'gf', 'g2f')
    return FollowedStage(work=work, **{name: getattr(work, name) for name in read}, **shared)


def _lanes_for(count: int) -> int:
    """How many of so many parameters are taken at once: a register of them, or two, or three of 4
    numbers."""
    if 8 < count <= 12 and width() == 4:
        return 12
    return width() if count <= width() else 2 * width()


def _in_groups(slopes: Floats, W: int) -> Floats:
    """(groups numbers, W) of the slopes (K, numbers) of an array by each parameter."""
    K, groups = len(slopes), -(-len(slopes) // W)
    whole = slopes.reshape(K, -1)
    found = aligned(groups * whole.shape[1], W)
    grouped = found.reshape(groups, -1, W)
    for g in range(groups):
        own = whole[g * W : (g + 1) * W]
        grouped[g, :, : len(own)] = own.T
    return found


def seeds(numbers: int, W: int) -> Floats:
    """(groups numbers, W) of slopes by the numbers themselves, W at a time."""
    return _in_groups(np.eye(numbers), W) if numbers else aligned(0, W)


def _any_of_group(flags: Integers, W: int) -> Integers:
    """(groups,) whether a flag of the W parameters of a group is set."""
    return np.array([flags[k : k + W].any() for k in range(0, flags.size, W)], dtype=np.int64)


def _slopes(name: str, here: Neighbour, solver: Solver, before: Slopes | None) -> Slopes:
    """By a parameter; `before`: by the one of its name in the scene with other numbers."""
    if is_direction(name):
        return StateDirection(name, here)
    if is_input(name, here.scene):
        return InputSlopes(name, here)
    numbered = before if isinstance(before, ParameterSlopes) else None
    return ParameterSlopes(name, here, solver, numbered)


def _any(slopes: Sequence[Slopes], names: Sequence[str]) -> Integers:
    return np.array([any(each.arrays[n].any() for n in names) for each in slopes], dtype=np.int64)


def check_settings(solver: Solver) -> None:
    """Raises InputError for settings that tangents do not follow."""
    if PLAIN:
        raise InputError(
            'tangents need compiled code', key='tangents', expected='no NUMBA_DISABLE_JIT'
        )
    if solver.formulation != 'alf2':
        raise InputError('tangents follow alf2 alone', key='formulation', value=solver.formulation)


def _check_start(start: Start) -> None:
    if start.near or start.singular is not None:
        raise InputError(
            'no tangents: the scene starts in a singular position, where the motion need not be '
            'differentiable',
            key='tangents',
            expected='a start beside it',
        )


def _check_slopes(slopes: Slopes, start: Start) -> None:
    if isinstance(slopes, ParameterSlopes):
        slopes.params()  # refused here, not at the first step
        jump = slopes.moved_jump()
        if jump is not None:
            what = 'the acceleration of a drive' if slopes.changes_drives else 'a force'
            raise InputError(
                f'no tangent: {what} jumps at t = {jump:g} s, which moves with it',
                key=slopes.name,
                value=slopes.value,
            )
        if slopes.moves_kink:
            raise InputError(
                'no tangent: abs, min or max in the motion of a drive depends on it',
                key=slopes.name,
                value=slopes.value,
            )
    arrays = slopes.arrays
    if start.adjustment is not None and any(arrays[name].any() for name in ROWS):
        raise InputError(
            'no tangent: redundant lengths are adjusted there, so none is free',
            key=slopes.name,
            value=slopes.value,
        )


def dual_forces(applied: Applied, W: int) -> Addresses:
    """(effects,) the address of each force for dual numbers of W lanes, in the order of the
    kernel."""
    # it teaches numba new types: only where somebody asks
    from alf_ros.effects.contract.dual_force import dual_force

    return forces_for(applied, partial(dual_force, lanes=W))


def forces_for(applied: Applied, compiled: Callable[..., Any]) -> Addresses:
    """(effects,) the address of each force as `compiled` makes it, in the order of the kernel.

    Raises InputError for an effect without a derivative.
    """
    effects = applied.assembled.effects
    found: list[int] = []
    for kind, friction in zip(applied.kinds, effects.friction.tolist(), strict=True):
        if friction:
            raise InputError(
                'no tangents: its friction depends on reactions',
                key=f'effects.{kind}',
                expected='a load that is given',
            )
        try:
            found.append(compiled(registry.load(kind).force._pyfunc).address)
        except TypeError as error:
            raise InputError(f'no tangents: {error}', key=f'effects.{kind}') from None
    return np.array(found, dtype=np.uint64)


class Followed(NamedTuple):
    """The tangents of a run as a sample has them. `refused`: the tangents that do not exist there,
    by name, each with its reason; quantity: the derivative, in a sample, of a named quantity by
    parameter k."""

    following: TangentFollowing
    refused: Mapping[str, str]
    quantity: Callable[[Any, int, str], float | Floats]

    def slopes(self, name: str) -> Slopes:
        """Of a parameter. Raises InputError for one without a derivative there."""
        if name in self.refused:
            raise InputError(f'no tangent: {self.refused[name]}', key=name)
        return self.following.slopes[self.following.names.index(name)]
