"""A scene at rest as a function of one number: of the scene, of an input held, or of the time.

Where the number belongs to an effect, the mechanism stays. Where it belongs to the mechanism, the
scene is read and closed again at each value, and its rows, masses and fixed points change.
"""

from __future__ import annotations

import copy
import difflib
from collections import OrderedDict
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.model.assembly import displaced
from alf_ros.model.prescribed import prescribe
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.named_inputs import NamedInput, named_inputs
from alf_ros.simulation.neighbour import Neighbour
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.start import started
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import Instant, Loads, counted

TIME = 't'
_INPUTS = ('joints', 'wrenches', 'targets')
_FIXED = ('solver', 'initial')  # sections that do not move the rest
_KEPT = 64  # values whose loads are kept
_TWO = 2
_ALIKE = 0.7  # of two words, as difflib has it
_STEP = 1e-4  # of a difference, in parts of the range


def _is_effort(word: str, others: Collection[str]) -> bool:
    """Whether it is `effort`, perhaps misspelt, and not a word that others are nearer to."""
    near = difflib.get_close_matches(word, (*others, 'effort'), 1, _ALIKE)
    return bool(near) and near[0] == 'effort'


@dataclass(frozen=True, eq=False)
class LoadedMechanism:
    """A mechanism with its loads at one value. `still` (blocks D - n,): where fixed and prescribed
    blocks are, m. `solves`: of this mechanism, by the blocks that effects bind."""

    loads: Loads
    t: float
    still: Floats
    solves: dict[tuple[tuple[int, ...], ...], ConstrainedSolve]

    @cached_property
    def solve(self) -> ConstrainedSolve:
        """Of this mechanism, with a factor that others may replace."""
        bound = tuple(self.loads.tangents.cliques)
        if bound not in self.solves:
            self.solves[bound] = ConstrainedSolve(self.loads.model, bound)
        return self.solves[bound]

    def instant(self, q: Floats, turns: Integers) -> Instant:
        """At rest at q (blocks D, m)."""
        return Instant(self.loads, self.t, q, np.zeros_like(q), turns)

    def moved(self, here: Instant, step: Floats) -> Instant:
        """The instant after a displacement (n,), m, closed again. Raises AssemblyError."""
        model = self.loads.model
        q = displaced(model, here.q, np.concatenate([step, self.still - here.q[model.n :]]))
        return self.instant(q, counted(model, here.q, here.turns, q))


@dataclass(frozen=True, eq=False)
class Slopes:
    """By the number, where the free blocks stay: of Q - Jᵀ λ (n,) and of Φ (rows,)."""

    force: Floats
    gap: Floats


class VariedScene:
    """The scene at any value of a number.

    Raises InputError for a name that no number and no input has, and for a number that does not
    move the rest.
    """

    def __init__(self, simulation: Simulation, over: str, t: float) -> None:
        """Of a simulation, whose inputs are held; t (s): where drives and signals are frozen."""
        self.over, self._base, self._t = over, simulation, t
        # the value in the scene; 0 of an input, which adds to the held one; the instant
        self.present = t
        self._input: NamedInput | None = None
        self._of_effects = False
        self.unit = 's' if over == TIME else ''
        self._known: OrderedDict[float, LoadedMechanism] = OrderedDict()
        self._solves: dict[tuple[tuple[int, ...], ...], ConstrainedSolve] = {}
        self._structure = Neighbour(simulation._start, simulation.scene).structure
        if over != TIME:
            self._find(over)

    def _find(self, over: str) -> None:
        first, last = over.partition('.')[0], over.rpartition('.')[2]
        if first in _FIXED:
            raise InputError('does not move the position of rest', key='over', value=over)
        if overrides.is_target(self._base.scene, over):  # added to the one that is held
            self._find_input(over)
            return
        try:
            self.present = overrides.number(self._base.scene, over)
            self._of_effects = overrides.section(self._base.scene, over) == 'effects'
        except InputError as error:
            if first in _INPUTS or _is_effort(last, error.choices or ()):
                self._find_input(over)
            else:
                raise error.about('over') from None

    def _find_input(self, over: str) -> None:
        try:
            loads = Loads(self._base)
            (self._input,) = named_inputs(loads.model, loads.effects, [over])
        except InputError as error:
            raise error.about('over') from None
        self.over, self.unit, self.present = self._input.name, self._input.unit, 0.0

    def scene(self, value: float) -> Scene:
        """The scene with this value. Raises InputError if it is refused."""
        scene = self._base.scene
        if self.over == TIME or self._input is not None:
            return scene
        return overrides.with_changes(scene, {self.over: repr(float(value))}, 'over ')

    def simulation(self, value: float) -> tuple[Simulation, float]:
        """A simulation of its own with this value, at rest where the base is, and its instant (s).
        Raises InputError if the scene is refused."""
        base, t = self._base, value if self.over == TIME else self._t
        if self.over == TIME or self._input is not None:
            found = copy.copy(base)
        else:
            found = Simulation(self.scene(value).at_rest())
        held = base.state.inputs
        if self._input is not None:
            held = self._input.added(held, value)
        found.restore(replace(found.state, inputs=held))
        return found, t

    def at(self, value: float) -> LoadedMechanism:
        """The mechanism and its loads. Raises InputError if the scene is refused there."""
        value = float(value)
        if value not in self._known:
            self._known[value] = self._made(value)
            if len(self._known) > _KEPT:
                self._known.popitem(last=False)
        return self._known[value]

    def _made(self, value: float) -> LoadedMechanism:
        base, model, t = self._base, self._base.model, self._t
        inputs, effects, q = base.state.inputs, base.scene.effects, np.array(base.state.q)
        if self.over == TIME:
            t = value
        elif self._input is not None:
            inputs = self._input.added(inputs, value)
        else:
            scene = self.scene(value)
            effects = scene.effects
            if not self._of_effects:
                start = started(scene, replace(base.solver, accuracy=None))
                self._check(value, Neighbour(start, scene), start.adjustment is not None)
                model, q = start.model, np.array(start.q)
        prescribe(model.system, t, q, np.zeros_like(q), np.zeros_like(q))
        loads = Loads(base, model=model, effects=effects, inputs=inputs)
        solves = self._solves if model is base.model else {}
        return LoadedMechanism(loads, t, q[model.n :], solves)

    def _check(self, value: float, there: Neighbour, adjusted: bool) -> None:
        """Raises InputError where the equations have another form than in the scene."""
        rows, own = there.start.model.system.rows, self._base.model.system.rows
        same = all(map(np.array_equal, there.structure, self._structure))
        if own.velocity:  # what they bind is no function of the position
            same = same and np.array_equal(rows.b, own.b) and np.array_equal(rows.term, own.term)
        if not same:
            raise InputError('the equations have another form there', key=self.over, value=value)
        if adjusted:
            raise InputError('redundant lengths are adjusted there', key=self.over, value=value)

    def slopes(self, instant: Instant, lam: Floats, value: float, size: float) -> Slopes:
        """The derivatives by the number at an instant with λ (rows,); size: of its range.

        Central differences of second order: the direction of a path and Newton's method need no
        more. Where the scene is refused on one side, differences to the other side.
        """
        found, reason, h = [], '', _STEP * size
        for change in (h, -h, 0.0):
            try:
                found.append((change, self._residual(instant, lam, value + change)))
            except InputError as error:
                reason = reason or error.message
                continue  # the scene is refused beside its last value
            if len(found) == _TWO:
                break
        if len(found) < _TWO:
            text = f'the scene is refused on both sides ({reason})'
            raise InputError(text, key=self.over, value=value)
        (more, ahead), (less, behind) = found
        force, gap, still = ((x - y) / (more - less) for x, y in zip(ahead, behind, strict=True))
        n = instant.model.n
        rates = lam.size - instant.model.system.rows.velocity  # these have no Φ
        gap[rates:] = (instant.J[:, n:] @ still)[rates:]
        return Slopes(force, gap)

    def _residual(
        self, instant: Instant, lam: Floats, value: float
    ) -> tuple[Floats, Floats, Floats]:
        """Q - Jᵀ λ (n,), Φ (rows,) where the free blocks stay, and where the others are."""
        there = self.at(value)
        model, n = there.loads.model, instant.model.n
        moved = there.instant(np.concatenate([instant.q[:n], there.still]), instant.turns)
        gap = np.zeros(lam.size)
        kernel.violation(model.unit, model.system.rows, moved.q, gap)
        force = moved.Q[:n] - moved.J[:, :n].T @ lam
        return force, gap, there.still
