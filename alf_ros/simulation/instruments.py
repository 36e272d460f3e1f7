"""Tools for the samples of a simulation: analyses of the model, and work memory.

An analysis is made when it is first asked for. Memory is lent to a sample while it exists, and
then to the next one. The order of use changes no number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cached_property, partial
from operator import setitem
from typing import Any, Generic, TypeAlias, TypeVar
from weakref import ref

import numpy as np

from alf_ros.kernel import BallAngles, CutWork, Forces, JointCoordinates, Modes, Problem
from alf_ros.model.compile import Model, allocate
from alf_ros.model.constraints.ball_axes import ball_angles
from alf_ros.model.constraints.packing import indices
from alf_ros.model.softest_modes import begun
from alf_ros.scene.scene import Solver
from alf_ros.simulation.bearing_shares import BearingShares, has_bearings
from alf_ros.simulation.reactions import ReactionsOf

_KEPT = 4  # workspaces that wait, at most, when another one is asked for


class Workspace:
    """Memory that one sample at a time computes in: while it does the simulation may step, and
    other samples be computed, in other threads."""

    def __init__(self, model: Model) -> None:
        self.system = model.apart().system
        self.work = allocate(model, self.system, 0)
        self._model, self._unit = model, model.unit
        self._modes: dict[int, Modes | None] = {}
        self._forces: Forces | None = None
        self._solver: Solver | None = None
        self._problem: Problem

    def modes(self, redundant: int) -> Modes | None:
        """Memory for the softest modes where so many rows depend on others; None without any."""
        if redundant not in self._modes:
            self._modes[redundant] = begun(self._model, redundant)
        return self._modes[redundant]

    def problem(self, forces: Forces, solver: Solver) -> Problem:
        """All that accelerations follow from; what friction writes is as in `forces`."""
        if forces is not self._forces or solver is not self._solver:
            rub = forces.bearings
            own = forces
            if _rubs(forces):
                copies = {name: array.copy() for name, array in _numbers(rub)}
                own = replace(forces, bearings=replace(rub, **copies))
            self._problem = Problem(self._unit, self.system, own, solver.method, self.work)
            self._forces, self._solver = forces, solver
        elif _rubs(forces):
            for name, array in _numbers(forces.bearings):
                getattr(self._problem.forces.bearings, name)[:] = array
        return self._problem


T = TypeVar('T')
Idle: TypeAlias = dict[T, object]  # workspaces that wait, and what has brought them back


class Lent(Generic[T]):
    """A workspace in use; it goes back when nobody has this any more.

    Code in C takes it back, as a callback of a weak reference: Python drops exceptions of a
    finalizer, also the KeyboardInterrupt of a Ctrl-C that happens to come there.
    """

    def __init__(self, workspace: T, back: Idle[T]) -> None:
        self.workspace = workspace
        self._loan = ref(self, partial(setitem, back, workspace))


class Instruments:
    """Of a model: its cut mechanism, its joint coordinates as the kernel has them, workspaces."""

    def __init__(self, model: Model, reactions: ReactionsOf) -> None:
        self.reactions = reactions
        self._model = model
        self._idle: Idle[Workspace] = {}
        self._idle_cut: Idle[CutWork] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return Instruments, (self._model, self.reactions)

    def lend(self) -> Lent[Workspace]:
        """A workspace, to be kept as long as its content is needed."""
        return _lent(self._idle, lambda: Workspace(self._model))

    def lend_cut(self) -> Lent[CutWork]:
        """One on the cut mechanism."""
        return _lent(self._idle_cut, lambda: self.reactions().workspace())

    @cached_property
    def shares(self) -> BearingShares | None:
        """How bearings share redundant reactions; None if all joints are rigid."""
        if not has_bearings(self._model):
            return None
        return BearingShares(self._model, self.reactions())

    @cached_property
    def coordinates(self) -> JointCoordinates:
        """The joint coordinates."""
        model = self._model
        angles = model.system.angles.c.size // 2
        each = [(c.place if c.is_angle else angles + c.place, c.less) for c in model.coordinates]
        place, less = np.array(each, dtype=np.int64).reshape(-1, 2).T
        return JointCoordinates(indices(place), less.copy(), model.lengths)

    @cached_property
    def balls(self) -> BallAngles:
        """The balls that have angles."""
        return ball_angles(self._model.layout)


def _lent(idle: Idle[T], make: Callable[[], T]) -> Lent[T]:
    try:  # another thread may take the last one
        while len(idle) > _KEPT:
            idle.popitem()
        return Lent(idle.popitem()[0], idle)
    except KeyError:
        return Lent(make(), idle)


def _rubs(forces: Forces) -> bool:
    return bool(forces.bearings.settle.size)


def _numbers(bearings: Any) -> list[tuple[str, Any]]:
    """The arrays of a struct that hold no addresses, by name."""
    each = ((field.name, getattr(bearings, field.name)) for field in fields(bearings))
    return [(n, x) for n, x in each if isinstance(x, np.ndarray) and n not in bearings.addresses]
