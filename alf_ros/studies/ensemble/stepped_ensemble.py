"""`alf_ros.Ensemble`: members that are stepped together, with inputs of their own each time."""

from __future__ import annotations

import copy
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.kernel.lanes.observing import JOINT, JOINT_RATE, PLACE, VELOCITY, Observing, observe
from alf_ros.scene.scene import SceneSource, load_scene
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.one_thread import by_one_thread
from alf_ros.simulation.side_by_side import SideBySide, no_place
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.ensemble.study_reading import study_of

_AXES = 'xyz'
MOST_MEMBERS = 1_000_000  # all of them are in memory; a study takes more
_ALIKE = 'nothing is drawn: all members are alike'
_DIFFER = 'members differ in structure'


class Ensemble:
    """Members of one mechanism, with other numbers each, stepped together as a controller needs.

    scene: as of `alf_ros.ensemble`; vary, seed, sampling: likewise, nothing varies by default.
    efforts: the joint coordinates on which `step` puts efforts (N m or N). observations: names of
    the numbers that `step` returns: 'joints.crank.position', 'joints.crank.velocity' (rad, m,
    turns counted), 'points.tip.x', 'velocities.tip.x' (m, world frame); by default positions and
    velocities of all joint coordinates. steps: of the solver in a step of the ensemble. settings:
    keywords of `Simulation`, as `step` (s) and `integrator`, an explicit one.

    A member has the bits of a Simulation alone. `copy.copy` makes an ensemble at the same states
    that moves by itself, and so does `pickle`, in another process too. One thread at a time uses
    it: a second one raises BusyError. Raises InputError for what cannot be used, AssemblyError if
    a member cannot be assembled.
    """

    _BOUND = '_together', '_params', '_joints', '_observing', '_first', '_lock'

    def __init__(
        self,
        scene: SceneSource,
        members: int | None = None,
        *,
        vary: Mapping[str, Any] | str | Path | None = None,
        seed: int = 0,
        sampling: str | None = None,
        efforts: Sequence[str] = (),
        observations: Sequence[str] | None = None,
        steps: int = 1,
        **settings: Any,
    ) -> None:
        self.steps = check.whole(steps, 'steps', 1)
        loaded = load_scene(scene)
        self._varied = vary is not None
        drawn: list[str] = []
        if vary is not None:
            given = study_of(loaded, vary, members=members, seed=seed, sampling=sampling, chunk=1)
            count = check.whole(given.members, 'members', 1, MOST_MEMBERS)
            drawn = [name for name, _ in given.vary]
            for name in settings:
                if f'solver.{name}' in drawn:
                    raise InputError('varied too', key=name, value=settings[name])
            scenes = [given.scene_of(k) for k in range(count)]
            self._members = [Simulation(each, **settings) for each in scenes]
        else:
            sampling = 'random' if sampling is None else sampling
            for key, value, idle in (('seed', seed, 0), ('sampling', sampling, 'random')):
                if not isinstance(value, (int, np.integer, str)) or value != idle:
                    raise InputError(_ALIKE, key=key, value=value, expected='vary beside it')
            count = check.whole(members, 'members', 1, MOST_MEMBERS)
            first = Simulation(loaded, **settings)
            self._members = [first, *(copy.copy(first) for _ in range(count - 1))]
        self.inputs = check.texts(efforts, 'efforts')
        if len(set(self.inputs)) < len(self.inputs):
            raise InputError('a joint is named twice', key='efforts', value=list(self.inputs))
        self._efforts = np.zeros((len(self._members), len(self.inputs)))
        self._together = self._side_by_side()
        if self._together.patterns > 1:
            raise InputError(_DIFFER, key='vary', value=drawn)
        self._failed: dict[int, str] = {}
        for each in self._members:
            for name in self.inputs:
                self._allow(each, name)
        self._params = self._own_params()
        self._unit_efforts = [self._units(name) for name in self.inputs]
        self._begin = [each.state for each in self._members]
        model = self._members[0].model
        if observations is None:
            names = model.coordinate_names
            found = [f'joints.{name}.position' for name in names]
            observations = [*found, *(f'joints.{name}.velocity' for name in names)]
        self.observations = check.texts(observations, 'observations')
        self._observing = self._reading()
        self._bind()
        self._lock = threading.Lock()

    @by_one_thread
    def __getstate__(self) -> dict[str, Any]:
        # members stand in memory whose addresses the compiled step has: a copy has its own
        saved = {name: value for name, value in vars(self).items() if name not in self._BOUND}
        self._together.settle()
        return {
            **saved,
            '_members': [copy.copy(each) for each in self._members],
            '_efforts': self._efforts.copy(),
            '_failed': self.failed,
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        vars(self).update(saved)
        self._together = self._side_by_side()
        self._params = self._own_params()
        self._give(self._efforts)
        self._observing = self._reading()
        self._bind()
        self._lock = threading.Lock()

    def __copy__(self) -> Ensemble:
        other = type(self).__new__(type(self))
        other.__setstate__(self.__getstate__())
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Ensemble:
        return self.__copy__()

    # ---------------------------------------------------------------------------------- set-up

    def _side_by_side(self) -> SideBySide:
        """The members in registers. Raises InputError, about what the caller gave."""
        for k, each in enumerate(self._members):
            why = no_place(each)
            if why:
                implicit = each.yields or each._run.stepper.is_implicit
                key, value = (
                    ('integrator', each.solver.integrator) if implicit else ('scene', None)
                )
                raise InputError(f'member {k}: {why}', key=key, value=value)
        try:
            return SideBySide(self._members)
        except InputError as error:  # of members that vary in their solver
            raise error.about('vary') from None

    @staticmethod
    def _allow(member: Simulation, name: str) -> None:
        """Raises InputError, about what the caller gave, for a joint without efforts."""
        try:
            member.apply_effort(name, 0.0)
        except InputError as error:
            raise error.about('efforts') from None

    def _own_params(self) -> Floats:
        """(members, numbers) the numbers of the effects of all members in one array, into which
        inputs are written."""
        packed = [each._run.present.applied.assembled for each in self._members]
        if len({forces.effects.params.size for forces in packed}) > 1:
            raise InputError(_DIFFER, key='vary')
        params = np.array([forces.effects.params for forces in packed])
        for each, forces, own in zip(self._members, packed, params, strict=True):
            effects = replace(forces.effects, params=own)
            applied = copy.copy(each._run.present.applied)
            vars(applied)['assembled'] = replace(forces, effects=effects)
            each._run.present = replace(each._run.present, applied=applied)
        return params

    def _units(self, name: str) -> tuple[NDArray[np.int64], Floats]:
        """Where an effort is in these numbers, and the numbers (members, places) of 1 N m or N."""
        found: list[Floats] = []
        for each in self._members[: len(self._members) if self._varied else 1]:
            applied = each._run.present.applied
            efforts = {**applied.inputs.efforts, name: 1.0}
            pushed = applied.holding(replace(applied.inputs, efforts=efforts))
            found.append(pushed.assembled.effects.params)
        own = self._params[: len(found)]
        with np.errstate(invalid='ignore'):  # no limit is an infinite one
            units = np.where(np.array(found) == own, 0.0, np.array(found) - own)
        (places,) = np.nonzero(units.any(axis=0))
        return places, units[:, places]

    def _reading(self) -> Observing:
        model = self._members[0].model
        joints, points, D = model.coordinate_names, model.point_names, model.layout.dimension
        known: dict[str, tuple[np.uint64, int]] = {}
        for n, name in enumerate(joints):
            known[f'joints.{name}.position'] = JOINT, n
            known[f'joints.{name}.velocity'] = JOINT_RATE, n
        for n, name in enumerate(points):
            for a in range(D):
                at = int(model.point_block[n]) * D + a
                known[f'points.{name}.{_AXES[a]}'] = PLACE, at
                known[f'velocities.{name}.{_AXES[a]}'] = VELOCITY, at
        for name in self.observations:
            if name not in known:
                raise InputError(
                    'no such number', key='observations', value=name, choices=tuple(known)
                )
        found = [known[name] for name in self.observations]
        count, angles = len(self._members), model.system.angles.c.size // 2
        self._joints = [each._run.stepper.instruments.coordinates for each in self._members]
        return Observing(
            problem=np.zeros(count, dtype=np.uint64),
            phase=np.zeros(count, dtype=np.uint64),
            joints=np.array([each._address for each in self._joints], dtype=np.uint64),
            kind=np.array([kind for kind, _ in found], dtype=np.uint32),
            which=np.array([at for _, at in found], dtype=np.uint32),
            **{name: np.zeros(angles) for name in ('angles', 'spins', 'near')},
            **{name: np.zeros(len(joints)) for name in ('values', 'rates')},
            numbers=np.zeros((count, len(found))),
        )

    def __repr__(self) -> str:
        name = self._members[0].scene.name if self._members else ''
        return f'<Ensemble of {len(self)} members of {name}>'

    # ------------------------------------------------------------------------------------ steps

    def __len__(self) -> int:
        return len(self._members)

    @property
    def t(self) -> Floats:
        """(members,) s."""
        return np.array([each.t for each in self._members])

    @property
    def efforts(self) -> Floats:
        """(members, inputs) the efforts that are held, N m or N, to read: `step` gives others."""
        held = self._efforts.view()
        held.flags.writeable = False
        return held

    @property
    def failed(self) -> dict[int, str]:
        """The members whose steps have failed since they were reset, with the reasons. They stand
        at the end of their last whole step."""
        return dict(self._failed)

    @property
    def trouble(self) -> dict[int, str]:
        """The members whose fixed steps are too long for their motion since they were reset, with
        `Diagnostics.trouble` of each. This reads a sample of every member."""
        return self._trouble()

    @by_one_thread
    def _trouble(self) -> dict[int, str]:
        self._together.settle()
        said = {k: each.sample().diagnostics.trouble for k, each in enumerate(self._members)}
        return {k: text for k, text in said.items() if text}

    @by_one_thread
    def step(self, inputs: ArrayLike | None = None) -> Floats:
        """`steps` steps of all members that have not failed, with these efforts (members, inputs)
        held; with those before if absent. Returns the observations (members, observations).

        Raises InputError, and changes nothing, for inputs of another shape or that are not finite.
        """
        if inputs is not None:
            try:
                array = np.asarray(inputs)
                # numpy would drop imaginary parts and masks, read text, and count days
                if array.dtype.kind not in 'biufO' or np.ma.isMaskedArray(inputs):
                    raise TypeError
                if array.dtype.kind == 'O' and any(isinstance(x, str) for x in array.flat):
                    raise TypeError
                with np.errstate(over='ignore'):  # what is too large is refused below
                    given = np.asarray(array, dtype=float)
            except (TypeError, ValueError, OverflowError):
                raise InputError(
                    'no array of numbers', key='inputs', value=inputs, expected='real numbers'
                ) from None
            if given.shape != self._efforts.shape:
                expected = f'shape {self._efforts.shape}'
                raise InputError('not usable', key='inputs', value=given.shape, expected=expected)
            if not np.isfinite(given).all():
                first = float(given[~np.isfinite(given)][0])
                raise InputError('not finite', key='inputs', value=first)
            self._give(given)
        for k, error in self._together.advance(self.steps, self._failed).items():
            self._failed[k] = str(error)
        return self._observe()

    def _give(self, efforts: Floats) -> None:
        self._efforts[:] = efforts
        for n, (places, units) in enumerate(self._unit_efforts):
            self._params[:, places] = efforts[:, n, None] * units

    @by_one_thread
    def observe(self) -> Floats:
        """The observations (members, observations) now."""
        return self._observe()

    def _observe(self) -> Floats:
        observe(*self._first, self._joints[0], self._observing)
        return self._observing.numbers.copy()

    def _bind(self) -> None:
        """Take the members as they are now."""
        self._together.bind()
        problems = [each._run.stepper.problem_of(each._run.present) for each in self._members]
        phases = [each._run.present.phase for each in self._members]
        self._observing.problem[:] = [each._address for each in problems]
        self._observing.phase[:] = [each._address for each in phases]
        self._first = problems[0], phases[0]

    @by_one_thread
    def reset(self, which: Any = None) -> Floats:
        """Members back to their start, without efforts: all, or those that `which` selects, as an
        index of numpy does. Returns the observations."""
        chosen = np.arange(len(self._members))
        if which is not None:
            try:
                chosen = np.atleast_1d(chosen[which]).ravel()
            except (IndexError, TypeError, ValueError):
                raise InputError('no such members', key='which', value=which) from None
        for k in chosen:
            self._members[k].restore(self._begin[k])
            self._failed.pop(int(k), None)
            self._efforts[k] = 0.0
        self._give(self._efforts)
        self._together.settle()
        self._bind()
        return self._observe()

    @by_one_thread
    def simulation(self, k: int) -> Simulation:
        """A copy of member k, at its state and with the efforts that it is given: for all that a
        Simulation can be asked."""
        return self._simulation(check.whole(k, 'k', 0, len(self._members) - 1))

    def _simulation(self, k: int) -> Simulation:
        self._together.settle()
        other = copy.copy(self._members[k])
        for name, effort in zip(self.inputs, self._efforts[k].tolist(), strict=True):
            other.apply_effort(name, effort)
        return other
