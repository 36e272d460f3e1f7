"""A scene with another value of one number, as the arrays of the kernel that depend on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from alf_ros import effects as registry
from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import Effect
from alf_ros.kernel import Effects
from alf_ros.model.prescribed import prescribe, program_apart
from alf_ros.scene.scene import Scene
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.input_values import NO_INPUTS, Inputs
from alf_ros.simulation.reactions import ReactionsOf
from alf_ros.simulation.start import Start

_BESIDE, _JUMP = 1e-9, 1e-6  # s from an instant, and part of the values that they jump by there
MASSES = ('mass_diagonal', 'mass_k', 'mass_w')
ROWS = ('length2', 'b', 'term', 'c')
SHAPES = (
    *ROWS,
    'angle_b',
    'angle_c',
    'angle_term',
    'length_b',
    'length_c',
    'length_term',
    'prescribed',
)
ARRAYS = (*MASSES, *SHAPES, 'q', 'qd')


@dataclass(frozen=True, eq=False)
class Neighbour:
    """The scene with another value of one number."""

    start: Start
    scene: Scene
    _efforts: dict[str, Floats] = field(default_factory=dict, repr=False)

    def arrays(self) -> tuple[Floats, ...]:
        """In the order of `ARRAYS`."""
        model, system = self.start.model, self.start.model.system
        mass, rows, angles, lengths = system.mass, system.rows, system.angles, model.lengths
        return (
            mass.diagonal,
            mass.k,
            mass.w,
            rows.length2,
            rows.b,
            rows.term,
            rows.c,
            angles.b,
            angles.c,
            angles.term,
            lengths.b,
            lengths.c,
            lengths.term,
            self.motions[1],
            self.start.q,
            self.start.qd,
        )

    @property
    def structure(self) -> tuple[Integers, ...]:
        """The indices, which must not depend on the number."""
        system, lengths = self.start.model.system, self.start.model.lengths
        mass, rows, angles = system.mass, system.rows, system.angles
        whole = (mass.i, mass.j, mass.skew, rows.i, rows.j, rows.first, rows.movable, rows.block)
        return (
            *(each.astype(np.int64) for each in whole),
            rows.term_block.astype(np.int64),
            rows.full.astype(np.int64),
            angles.block.astype(np.int64),
            lengths.block.astype(np.int64),
            self.motions[0],
        )

    @cached_property
    def motions(self) -> tuple[Integers, Floats]:
        """The program of the drives, whose form does not depend on values, and its numbers."""
        return program_apart(self.start.model.layout)

    @cached_property
    def _applied(self) -> Applied:
        model = self.start.model
        return Applied(model, self.scene.effects, NO_INPUTS, ReactionsOf(model))

    def effects(self, inputs: Inputs) -> Effects:
        """Its effects, with inputs held."""
        if inputs == NO_INPUTS:
            return self._applied.assembled.effects
        return self._applied.holding(inputs).assembled.effects

    @property
    def instants(self) -> Floats:
        """The times of kinks over time of its effects, s, ascending."""
        return self._applied.instants

    @cached_property
    def _unlimited(self) -> Effects:
        """Its effects without limits: at its limit a force does not jump in the state of the
        start, and in another state it does."""
        given, model = [_without_limits(each) for each in self.scene.effects], self.start.model
        return Applied(model, given, NO_INPUTS, ReactionsOf(model)).assembled.effects

    def jumps_at(self, t: float) -> bool:
        """Whether the forces in the state of the start, without limits, jump at t (s), or the
        drives do."""
        model, q, qd = self.start.model, self.start.q, self.start.qd
        effects, xy = self._unlimited, np.zeros(model.system.angles.c.size)
        turns = np.zeros(xy.size // 2, dtype=np.int64)
        near, aside = np.zeros(turns.size), _BESIDE * max(1.0, abs(t))
        kernel.violation(model.unit, model.system.angles, q, xy)
        kernel.nearby(xy, turns, near)
        before, after = np.zeros(q.size), np.zeros(q.size)
        kernel.applied_forces(effects, t - aside, q, qd, near, before)
        kernel.applied_forces(effects, t + aside, q, qd, near, after)
        driven_before, driven_after = np.zeros((2, 3, q.size))
        prescribe(model.system, t - aside, *driven_before)
        prescribe(model.system, t + aside, *driven_after)
        return _jump(before, after) or _jump(driven_before[2], driven_after[2])

    def form(self, inputs: Inputs) -> tuple[Integers, ...]:
        """The meaning of the data of the effects, with inputs held."""
        effects = self.effects(inputs)
        each = effects.slots, effects.slots_at, effects.params_at
        return tuple(part.astype(np.int64) for part in each)

    def effort(self, joint: str) -> Floats:
        """The data of an effort of 1 N m or 1 N on a joint, behind the data of its effects."""
        if joint not in self._efforts:
            whole = self.effects(Inputs({}, {joint: 1.0})).params
            self._efforts[joint] = whole[self.effects(NO_INPUTS).params.size :]
        return self._efforts[joint]


def _without_limits(effect: Effect) -> Effect:
    unlimited = getattr(registry.load(effect.kind), 'unlimited', None)
    return (
        effect if unlimited is None else replace(effect, parameters=unlimited(effect.parameters))
    )


def _jump(before: Floats, after: Floats) -> bool:
    largest = max(np.abs(before).max(initial=0.0), np.abs(after).max(initial=0.0))
    return bool(np.abs(after - before).max(initial=0.0) > _JUMP * largest)
