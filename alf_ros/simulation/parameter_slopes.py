"""How a scene, read and closed, changes with one of its numbers.

From a number θ of the text to the arrays of the kernel (masses, rows, data of effects) and to the
state where the motion begins it is a chain of formulas of the user, of shapes of bodies, and of
solves, which end at rounding. Three scenes around this one show whether all arrays are quadratic
in θ, as masses, gravity and most numbers of effects make them: then a central difference is exact.
Otherwise the slope of each array is taken by central differences of eighth order, at two lengths,
from sixteen scenes, or more where it bends much. It is off by about 1e-13 of the largest number,
and for the start of a drawing that does not close by up to 1e-7. Where the two lengths differ by
more than `_AGREE`, the scene has a kink in θ, and the parameter is refused. A parameter beside
which all scenes have another form than this one is refused too. All that follows, the motion, is
differentiated exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.mechanism.orientation import orientation
from alf_ros.model.compile import Model
from alf_ros.scene import overrides
from alf_ros.scene.scene import Solver
from alf_ros.simulation.input_values import NO_INPUTS, Inputs
from alf_ros.simulation.neighbour import ARRAYS, MASSES, ROWS, SHAPES, Neighbour
from alf_ros.simulation.start import started

_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)  # of the eighth order
_BETWEEN = (4.0 / 5.0, -2.0 / 5.0, 4.0 / 35.0, -1.0 / 70.0)  # of the value in the middle
_TURNED_OVER = 0.9  # cosine of half the angle between two orientations
LONGEST = 2.5e-3  # step of a difference, in parts of the number or of 1
_FINER = (0.25 * LONGEST, 0.06 * LONGEST)  # where arrays bend too much for it
_SHORTER, _MOST, _FEW_LENGTHS = 0.7, 12, 4  # shorter ones that are tried
_TWO = 2  # of them are used
_FEW = (-2, 2, 4)  # steps at which arrays show whether they are quadratic
_NEARER = (1.0, 0.03, 1e-3, 1e-4)  # parts of these steps, where scenes further away are refused
_QUADRATIC = 1e-14  # of the size of a number, by which a quadratic one may be off there
_ASIDE = 1e-6  # how far aside a number is proposed that has a tangent
_AGREE = 1e-9  # of the largest slope, and
_ROUNDED = 1e-12  # of the size of a number a step, by which the slopes of two lengths may differ
_CLOSED = 1e-9  # likewise of the start, where a drawing does not close: rounding moves it more
_SAME = 1e-5  # part of the changes by which neighbours may miss the scene in their middle


class _NotSmoothError(Exception):
    """Two lengths of the step disagree about this array."""


class AnotherFormError(InputError):
    """The equations of scenes beside this one have another form."""


class ParameterSlopes:
    """The slopes of a scene by one of its numbers.

    Raises InputError for a name that is not of one number, a number beside which there is no
    scene, and one in which the scene is not smooth.
    """

    def __init__(
        self,
        name: str,
        here: Neighbour,
        solver: Solver,
        before: ParameterSlopes | None = None,
    ) -> None:
        """`here`: the scene itself; `before`: the slopes by this number in the scene with other
        numbers."""
        self.name, self._before = name, before
        if name.partition('.')[0] == 'solver':
            raise InputError('no tangent by a number of the solver', key='tangents', value=name)
        self.value = overrides.number(here.scene, name)
        self._here, self._solver = here, replace(solver, accuracy=None)
        self._beside: dict[float, Neighbour] = {}
        self._around: dict[float, dict[float, list[Neighbour]]] = {}
        self._by_effort: dict[str, Floats] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Without the neighbours, which are made again if they are needed."""
        kept = {n: value for n, value in vars(self).items() if n not in ('_few', '_kept')}
        return {**kept, '_before': None, '_beside': {}, '_around': {}}

    @cached_property
    def _is_of_effects(self) -> bool:
        """Whether the number changes nothing but the data of effects, unlike an armature, which
        is a mass of the mechanism."""
        if overrides.section(self._here.scene, self.name) != 'effects':
            return False
        if self._before is not None:
            return self._before._is_of_effects
        changed = repr(self.value + LONGEST * (abs(self.value) or 1.0))
        try:
            beside = overrides.with_changes(self._here.scene, {self.name: changed})
        except InputError:
            return False  # refused by name where the scenes around are read
        return bool(beside.mechanism == self._here.scene.mechanism)

    @cached_property
    def _kept(self) -> ParameterSlopes | None:
        """The slopes from before, if they still hold: the number changes masses and effects alone,
        and the difference to a neighbour agrees. So their arrays are linear in the number, and
        one scene is read for each."""
        before = self._before
        if before is None:
            return None
        if not self._is_of_effects and any(before.arrays[name].any() for name in SHAPES):
            return None
        step = LONGEST * (abs(self.value) or 1.0)
        try:
            beside = self._neighbour(step)
        except InputError:
            return None
        if not self._have_form([beside]):
            return None
        here, there = ([each.effects(NO_INPUTS).params] for each in (self._here, beside))
        slopes = {'effects': before.params()}
        if not self._is_of_effects:
            here += self._here.arrays()
            there += beside.arrays()
            slopes |= before.arrays
        for (what, slope), low, high in zip(slopes.items(), here, there, strict=True):
            if not low.shape == high.shape == slope.shape:
                return None
            if not self._agree(what, slope, low, high, step):
                return None
        return before._kept or before

    @cached_property
    def _few(self) -> tuple[float, list[Neighbour]] | None:
        """Half of the distance of the outer two, and the scenes there and at twice as much, if
        they have the form of this one."""
        for part in _NEARER:  # a product of inertia of 0 is small beside the moments, not beside 1
            step = part * LONGEST * (abs(self.value) or 1.0)
            try:
                beside = [self._neighbour(k * step) for k in _FEW]
            except InputError:
                continue  # the number may be near its limit, or at it
            # lengths that differ by as little may count as equal
            if part < 1.0 and not all(map(self._has_shapes, beside)):
                return None
            if self._have_form(beside):
                return _FEW[1] * step, beside
            if part < 1.0:
                raise self._another_form()  # scenes further away, which could tell, are refused
            return None
        return None

    def _sizes(self, what: str, values: Sequence[Floats]) -> Floats:
        """For each number of an array, beside what its rounding is small, from the values of the
        array around.

        Numbers of an array are alike, so the largest of all counts. But numbers of effects are
        lengths beside stiffnesses: each has its own size, or the size of lengths and angles.
        """
        sizes = np.max([np.where(np.isfinite(x), np.abs(x), 0.0) for x in values], axis=0)
        if what != 'effects':
            return np.full_like(sizes, sizes.max(initial=0.0))
        return np.asarray(sizes + min(1.0, self._here.start.model.size))

    def _quadratic(
        self, names: Sequence[str], values: Callable[[Neighbour], Sequence[Floats]]
    ) -> list[Floats] | None:
        """The slopes of arrays that are quadratic in the number; None if one of them is not."""
        if self._few is None:
            return None
        step, beside = self._few
        here = values(self._here)
        found = []
        around = zip(names, here, *map(values, beside), strict=True)
        for what, middle, less, more, twice in around:
            if not middle.shape == less.shape == more.shape == twice.shape:
                return None
            still = (less == more) & (more == twice) & (less == middle)
            with np.errstate(invalid='ignore'):  # no limit is an infinite one
                off = np.where(still, 0.0, 3.0 * (more - middle) + (less - twice))
                change = np.where(still, 0.0, more - less)
            most = _QUADRATIC * self._sizes(what, (middle, less, more, twice))
            if not (np.abs(off) <= most).all():
                return None
            found.append(np.asarray(change / (2.0 * step)))
        return found

    def _neighbours(self, longest: float) -> dict[float, list[Neighbour]]:
        """For two lengths of the step, `longest` parts of the number at most, the scenes around
        this one.

        They must have its form. Where a number of a row is zero but for rounding, some have an
        entry more: then other lengths are taken, few if the scene can be begun again with all
        entries.
        """
        if longest in self._around:
            return self._around[longest]
        found = {}
        step = longest * (abs(self.value) or 1.0)
        whole = self._here.start.model.layout.asked.whole
        for _ in range(_MOST if whole else _FEW_LENGTHS):
            beside = [self._neighbour(k * step) for k in _offsets()]
            if self._have_form(beside):
                found[step] = beside
                if len(found) == _TWO:
                    self._around[longest] = found
                    return found
            step *= _SHORTER
        raise self._another_form()

    def _have_form(self, beside: Sequence[Neighbour]) -> bool:
        """Whether scenes have the form of this one."""
        if self._is_of_effects:
            return True
        here = self._here.structure
        return all(all(map(np.array_equal, each.structure, here)) for each in beside)

    def _has_shapes(self, beside: Neighbour) -> bool:
        """Whether a scene has the shapes and drives of this one, and differs by masses alone."""
        pairs = zip(ARRAYS, beside.arrays(), self._here.arrays(), strict=True)
        return all(np.array_equal(there, here) for what, there, here in pairs if what in SHAPES)

    def _none(self, why: str, expected: str | None = None) -> InputError:
        return InputError(f'no tangent: {why}', key=self.name, value=self.value, expected=expected)

    def _another_form(self, what: str = '') -> InputError:
        """Beside this value there is an entry more, as beside a place or a torque of 0."""
        expected = f'{_ASIDE:g}, say' if self.value == 0.0 else None
        parts = 'effects' if what == 'effects' else 'equations'
        why = f'no tangent: beside this value the {parts} have another form'
        kind = AnotherFormError if parts == 'equations' else InputError
        return kind(why, key=self.name, value=self.value, expected=expected)

    def _neighbour(self, change: float) -> Neighbour:
        if change in self._beside:
            return self._beside[change]
        text = repr(self.value + change)
        try:
            other = overrides.with_changes(self._here.scene, {self.name: text})
            start = self._here.start
            if not self._is_of_effects:
                with form_of(start.model.layout.form):
                    start = started(other, self._solver)
            found = Neighbour(start, other)
        except AlfError as error:
            raise self._none(f'with {text} the scene is refused ({error})') from None
        if start.dependent_rows != self._here.start.dependent_rows:
            raise self._none(f'with {text} another number of constraints is redundant')
        self._beside[change] = found
        return found

    @cached_property
    def arrays(self) -> dict[str, Floats]:
        """The slope of each of `ARRAYS`, per unit of the number."""
        if self._is_of_effects:
            here = zip(ARRAYS, self._here.arrays(), strict=True)
            return {name: np.zeros_like(each) for name, each in here}
        if self._kept is not None:
            return self._kept.arrays
        quadratic = self._quadratic(ARRAYS, Neighbour.arrays)
        if quadratic is not None:
            return dict(zip(ARRAYS, quadratic, strict=True))
        return dict(zip(ARRAYS, self._slopes(ARRAYS, Neighbour.arrays), strict=True))

    def params(self, inputs: Inputs = NO_INPUTS) -> Floats:
        """The slope of the data of the effects, with inputs held."""
        if self._kept is not None and not inputs.all_wrenches:  # these may act where a mass is
            return self._kept.params(inputs)
        return self._still if inputs == NO_INPUTS else self._params(inputs)

    @cached_property
    def _still(self) -> Floats:
        return self._params(NO_INPUTS)

    def by_effort(self, joint: str) -> Floats:
        """The slope of the data of an effort of 1 N m or 1 N on a joint."""
        if self._is_of_effects:
            return np.zeros_like(self._here.effort(joint))
        if self._kept is not None:
            return self._kept.by_effort(joint)
        if joint not in self._by_effort:
            self._by_effort[joint] = self._of_effects(lambda each: each.effort(joint))
        return self._by_effort[joint]

    def _params(self, inputs: Inputs) -> Floats:
        found = self._of_effects(lambda each: each.effects(inputs).params)
        here = self._here.form(inputs)
        sides = {change > 0.0: each for change, each in self._beside.items()}  # the last ones
        for each in sides.values():
            if not all(map(np.array_equal, each.form(inputs), here)):
                raise self._another_form('effects')
        return found

    def _of_effects(self, data: Callable[[Neighbour], Floats]) -> Floats:
        """The slope of such data."""
        quadratic = self._quadratic(['effects'], lambda each: [data(each)])
        if quadratic is not None:
            return quadratic[0]
        return self._slopes(['effects'], lambda each: [data(each)])[0]

    def moved_jump(self) -> float | None:
        """An instant (s) that moves with the number, and at which forces or accelerations of
        drives jump."""
        if not (self._is_of_effects or self.changes_drives) or not self._here.instants.size:
            return None
        beside = self._neighbour(LONGEST * (abs(self.value) or 1.0)).instants
        moved = np.setdiff1d(self._here.instants, beside).tolist()
        return next((t for t in moved if self._here.jumps_at(t)), None)

    def placed(self, model: Model, t: float) -> tuple[Floats, Floats]:
        """The slopes of the fixed and the driven blocks at t (s), and of their velocities (blocks
        D); 0 of all others."""
        dq, dqd = np.zeros(model.q.size), np.zeros(model.q.size)
        dq[model.n :] = self.arrays['q'][model.n :]
        if self.changes_drives:
            from alf_ros.model.dual_time_program import put_slopes

            put_slopes(*self._here.motions, self.arrays['prescribed'], t, dq, dqd)
        return dq, dqd

    @cached_property
    def changes_rows(self) -> bool:
        """Whether the number changes lengths or places."""
        fixed = self.arrays['q'][self._here.start.model.n :]
        return bool(fixed.any()) or any(self.arrays[name].any() for name in ROWS)

    @property
    def changes_drives(self) -> bool:
        """Whether the number changes the motion of a drive."""
        return bool(self.arrays['prescribed'].any())

    @property
    def moves_kink(self) -> bool:
        """Whether abs, min or max in the motion of a drive depends on it."""
        if not self.changes_drives:
            return False
        from alf_ros.model.time_program import moves_kink

        return moves_kink(self._here.motions[0], self.arrays['prescribed'])

    def opening(self, model: Model, q: Floats, t: float) -> Floats:
        """(rows,) ∂Φ/∂θ at q (blocks D, m) and t (s), per unit of the number, where the free
        blocks stay."""
        of, rows = self.arrays, model.system.rows
        own = replace(rows, length2=of['length2'], b=of['b'], term=of['term'], c=of['c'])
        still = replace(own, length2=np.zeros_like(rows.length2))
        opened, gaps = np.zeros(rows.alpha.size), np.zeros(rows.alpha.size)
        kernel.violation(model.unit, still, q, opened)
        m1 = rows.i.size
        opened[:m1] = -0.5 * of['length2']
        g, g2 = np.zeros(m1 * model.layout.dimension), np.zeros(rows.b.size)
        kernel.jacobian(model.unit, rows, q, g, g2)
        kernel.times_jacobian(model.unit, rows, g, g2, self.placed(model, t)[0], gaps)
        return opened + gaps

    def _agree(self, what: str, slope: Floats, less: Floats, more: Floats, step: float) -> bool:
        """Whether a slope agrees with the difference of an array here and a step away."""
        with np.errstate(invalid='ignore'):  # no limit is an infinite one
            change = np.where(less == more, 0.0, more - less)
        most = _AGREE * self._sizes(what, [slope])
        most += _ROUNDED * self._sizes(what, [less, more]) / step
        return bool((np.abs(change / step - slope) <= most).all())

    @property
    def acts(self) -> bool:
        """Whether the number changes more than where the motion begins."""
        return (
            any(self.arrays[name].any() for name in (*MASSES, *SHAPES))
            or bool(self.params().any())
            or not any(self.arrays[name].any() for name in ('q', 'qd'))
        )

    def _slopes(
        self, names: Sequence[str], values: Callable[[Neighbour], Sequence[Floats]]
    ) -> list[Floats]:
        """The slopes of arrays, with shorter steps where they bend much."""
        here = values(self._here)
        for longest in (LONGEST, *_FINER):
            around = {
                step: [values(each) for each in beside]
                for step, beside in self._neighbours(longest).items()
            }
            try:
                return [
                    self._slope(
                        what, here[n], {step: [v[n] for v in x] for step, x in around.items()}
                    )
                    for n, what in enumerate(names)
                ]
            except _NotSmoothError as error:
                what = str(error)
        raise self._none(self._kink(what, self._neighbours(_FINER[-1])))

    def _kink(self, what: str, around: Mapping[float, Sequence[Neighbour]]) -> str:
        """The reason why an array is not smooth, as its name does not tell it."""
        model, q = self._here.start.model, self._here.start.q.reshape(-1, 3)
        for body in model.layout.body if model.layout.dimension == 3 else ():
            if not model.layout.turns(body):
                continue
            own = orientation(model.layout, body, q)
            for each in (each for beside in around.values() for each in beside):
                start = each.start
                other = orientation(start.model.layout, body, start.q.reshape(-1, 3))
                if abs(own @ other) < _TURNED_OVER:
                    return (
                        f'with other values the frame of {body} turns over, in which its mass '
                        'and its joints are given'
                    )
        return 'the data of an effect have a kink' if what == 'effects' else 'the scene has a kink'

    def _slope(self, what: str, here: Floats, values: Mapping[float, Sequence[Floats]]) -> Floats:
        """Of an array that is `here`, and has these values at the offsets of each step."""
        found = []
        for step, each in values.items():
            if {array.shape for array in each} != {here.shape}:
                raise self._another_form(what)
            weights = [np.sign(k) * _WEIGHTS[abs(k) - 1] for k in _offsets()]
            with np.errstate(invalid='ignore'):  # no limit is an infinite one
                changes = [np.where(x == each[0], 0.0, x - each[0]) for x in each]
            slope = sum(w * x for w, x in zip(weights, changes, strict=True))
            found.append(np.asarray(slope) / step)
        slope, finer = found
        sizes = self._sizes(what, [here, *next(iter(values.values()))])
        least = (_CLOSED if what in ('q', 'qd') else _ROUNDED) * sizes / min(values)
        most = _AGREE * self._sizes(what, [slope]) + least
        if not (np.abs(slope - finer) <= most).all():
            raise _NotSmoothError(what)
        # neighbours may agree with each other and not with the scene in their middle
        for step, each in values.items():
            weights = [_BETWEEN[abs(k) - 1] for k in _offsets()]
            with np.errstate(invalid='ignore'):  # no limit is an infinite one
                off = [np.where(x == here, 0.0, x - here) for x in each]
            apart = np.abs(sum(w * x for w, x in zip(weights, off, strict=True)))
            bent = np.max(np.abs(off), axis=0)
            if not (apart <= _SAME * bent + least * step).all():
                raise self._another_form(what)
        return slope


def _offsets() -> tuple[int, ...]:
    return (-4, -3, -2, -1, 1, 2, 3, 4)
