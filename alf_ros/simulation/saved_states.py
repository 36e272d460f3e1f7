"""Saved states: by name, in memory and in files, exact to the last bit."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import paths
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene
from alf_ros.simulation.formulations import check_going_on
from alf_ros.simulation.input_checks import MOST_STEPS, is_number
from alf_ros.simulation.input_values import Inputs, Target, Wrench
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State

FORMAT = 1
_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}')
_ROOM = 2**26  # bytes of a file, in addition to the numbers of a state
_DIGITS = 32  # bytes of one of them


def as_data(state: State) -> dict[str, Any]:
    """The state as lists, numbers and text: JSON writes it so that it reads back exactly."""
    fields = {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
    inputs = fields.pop('inputs')
    fields.pop('h')  # files and logs have it among their settings
    data = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}
    held = {
        'wrenches': {name: _as_lists(wrench) for name, wrench in inputs.wrenches.items()},
        'efforts': {name: _plain(effort) for name, effort in inputs.efforts.items()},
        'targets': {
            name: {'position': _plain(target.position), 'velocity': target.velocity}
            for name, target in inputs.targets.items()
        },
    }
    if inputs.added:
        held['added'] = {name: _as_lists(wrench) for name, wrench in inputs.added.items()}
    return {**data, 'inputs': held}


def _as_lists(wrench: Wrench) -> dict[str, Any]:
    fields = vars(wrench)
    return {name: list(x) if isinstance(x, tuple) else x for name, x in fields.items()}


def _plain(value: float | Curve | None) -> Any:
    return value.pieces if isinstance(value, Curve) else value


def read_curve(value: Any) -> Any:
    """The form of a number, a curve or None in `as_data` and the journal.

    Raises ValueError if it is no curve.
    """
    if not isinstance(value, (list, tuple)):
        return value
    try:
        return Curve(tuple(map(tuple, value)))
    except (TypeError, OverflowError):
        raise ValueError('a curve has pieces of 7 numbers') from None


def from_data(data: Any, like: State) -> State:
    """A state from the output of `as_data`, for the scene of the state `like`. Raises ValueError,
    in a line, if it is not such a state."""
    fields = _mapping(data, 'state')
    inputs = _mapping(fields.get('inputs'), 'inputs')
    wrenches, added = (
        {name: _wrench(x) for name, x in _mapping(each).items()}
        for each in (inputs.get('wrenches'), inputs.get('added', {}))
    )
    efforts = {
        name: _number_or_curve(x, f'effort on {name}')
        for name, x in _mapping(inputs.get('efforts')).items()
    }
    # A state of an earlier version knows no targets, no works, no loads or no sense, and no sums.
    targets = {name: _target(x) for name, x in _mapping(inputs.get('targets', {})).items()}
    loads, works = fields.get('loads'), _mapping(fields.get('works', {}), 'works')
    if isinstance(loads, list) and len(loads) == like.loads.size - 1:
        loads = [*loads, 0.0]
    sums = fields.get('sums')
    return State(
        step=_whole(fields.get('step'), 'step'),
        q=_array(fields.get('q'), like.q, 'q'),
        qd=_array(fields.get('qd'), like.qd, 'qd'),
        turns=_array(fields.get('turns'), like.turns, 'turns'),
        pace=_number(fields.get('pace'), 'pace', 0.0),
        carried=_array(fields.get('carried'), like.carried, 'carried'),
        inputs=Inputs(wrenches, efforts, targets, added),
        works={name: _number(work, f'work of {name}') for name, work in works.items()},
        loads=_array(loads, like.loads, 'loads') if loads else np.zeros_like(like.loads),
        sums=_array(sums, like.sums, 'sums') if sums else np.zeros(0),
    )


def _mapping(value: Any, name: str = 'what is held') -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f'{name} is no mapping')
    return value


def _whole(value: Any, name: str) -> int:
    if type(value) is not int or not 0 <= value <= MOST_STEPS:
        raise ValueError(f'{name} is no whole number from 0 to {MOST_STEPS}')
    return value


def _number(value: Any, name: str, least: float = -math.inf) -> float:
    if not is_number(value) or value < least:
        raise ValueError(f'{name} is no finite number' + (' from 0 on' if least == 0.0 else ''))
    return float(value)


def _array(value: Any, like: np.ndarray[Any, Any], name: str) -> np.ndarray[Any, Any]:
    """Numbers (like,), all of them finite, whole if those are."""
    if not isinstance(value, list) or len(value) != like.size:
        many = f'{len(value)} numbers' if isinstance(value, list) else 'no list'
        raise ValueError(f'{name} is {many} instead of {like.size} numbers')
    is_whole = like.dtype.kind == 'i'
    for each in value:
        if not is_number(each) or (is_whole and (type(each) is not int or abs(each) >= 2**63)):
            raise ValueError(f'{name} has what is no {"whole" if is_whole else "finite"} number')
    return np.array(value, dtype=like.dtype)


def _wrench(value: Any) -> Wrench:
    held = _mapping(value, 'a wrench')
    if not {'force'} <= set(held) <= {field.name for field in dataclasses.fields(Wrench)}:
        raise ValueError('a wrench has force, torque, at and frame')
    force, torque = held['force'], held.get('torque', 0.0)
    at, frame = held.get('at'), held.get('frame', 'world')
    if not isinstance(force, list) or not isinstance(frame, str):
        raise ValueError('a wrench has a list of forces and the name of a frame')
    if at is not None and not isinstance(at, str):
        raise ValueError('a wrench acts at the name of a point')
    moment: float | tuple[float, ...]
    if isinstance(torque, list):
        moment = tuple(_number(x, 'a torque') for x in torque)
    else:
        moment = _number(torque, 'a torque')
    return Wrench(tuple(_number(x, 'a force') for x in force), moment, at, frame)


def _target(value: Any) -> Target:
    target = _mapping(value, 'a target')
    position, velocity = target.get('position'), target.get('velocity')
    return Target(
        None if position is None else _number_or_curve(position, 'a target'),
        None if velocity is None else _number(velocity, 'the velocity of a target'),
    )


def _number_or_curve(value: Any, name: str) -> float | Curve:
    read = read_curve(value)
    return read if isinstance(read, Curve) else _number(read, name)


class SavedStates:
    """States by name: in the memory of this process, and in `<folder>/<scene>/<name>.json`.

    Without a folder they last as long as the process.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._kept: dict[tuple[str, str], dict[str, Any]] = {}

    def save(self, name: str, scene: Scene, simulation: Simulation) -> str:
        """Keep the present state; returns the place. Raises InputError if the file cannot be
        written (the state is then still in memory) or if the name is invalid."""
        path = self._path(scene, name)
        document = {
            'alf_ros_state': FORMAT,
            'scene': scene.name,
            'mechanism_sha256': _digest(scene),
            'formulation': simulation.solver.formulation,
            'step_s': simulation.h,
            't': simulation.t,
            'state': as_data(simulation.state),
            # In the order of the file: shows whether the state is read as it was written.
            'q': simulation.sample().q.tolist(),
        }
        self._kept[scene.name, name] = document
        if path is None:
            return 'in memory'
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            paths.put(path, json.dumps(document) + '\n')
        except OSError as error:
            text = f'in memory only: cannot be written: {error.strerror}'
            raise InputError(text, key='state.folder', value=str(path)) from None
        return f'in {path}'

    def find(
        self, name: str, scene: Scene, like: State, formulation: str | None = None
    ) -> tuple[State, float, list[float]]:
        """The state, the step (s) it was reached with, and its coordinates in the order of the
        file. Raises InputError if there is none of this name for this mechanism, or one from which
        `formulation` cannot continue."""
        path = self._path(scene, name)
        document = self._kept.get((scene.name, name))
        if document is None and path is not None and path.is_file():
            document = _read(path, like)
        if document is None:
            raise InputError(
                'no state saved under this name',
                key='state.name',
                value=name,
                choices=self._names(scene),
            )
        try:
            whole = document
            if whole.get('alf_ros_state') != FORMAT:
                raise ValueError('of another format')
            if whole.get('mechanism_sha256') != _digest(scene):
                raise ValueError('of another mechanism')
            known = whole.get('formulation')  # files of earlier versions have none
            if formulation is not None and known is not None:
                check_going_on(str(known), formulation)
            state = from_data(whole.get('state'), like)
            q = whole.get('q')
            if not isinstance(q, list) or not all(map(is_number, q)):
                raise ValueError('q is no list of finite numbers')
            step = _number(whole.get('step_s'), 'step_s')
            if not step > 0.0:
                raise ValueError('step_s is not greater than zero')
            return state, step, q
        except ValueError as error:
            raise InputError(
                f'not a state of this scene: {error}', key='state.name', value=name
            ) from None

    def _names(self, scene: Scene) -> list[str]:
        names = {name for kept, name in self._kept if kept == scene.name}
        if self._folder is not None:
            names |= {path.stem for path in (self._folder / scene.name).glob('*.json')}
        return sorted(names)

    def _path(self, scene: Scene, name: str) -> Path | None:
        """Raises InputError for a name that no file of the folder can have."""
        if not _NAME.fullmatch(name):
            raise InputError(
                'cannot be the name of a state',
                key='state.name',
                value=name,
                expected='up to 100 letters, digits and . _ -, the first no point or dash',
            )
        return self._folder / scene.name / f'{name}.json' if self._folder else None


def _digest(scene: Scene) -> str:
    """Of the mechanism alone: a state outlives a change of the effects."""
    return hashlib.sha256(repr(scene.mechanism).encode()).hexdigest()


def _read(path: Path, like: State) -> dict[str, Any]:
    """The content of a file. Raises InputError if it is no JSON, or larger than a state can be."""
    numbers = 4 * like.q.size + like.turns.size + like.carried.size + like.loads.size
    numbers += like.sums.size
    most = _ROOM + _DIGITS * numbers
    try:
        with open(path, 'rb') as stream:
            text = stream.read(most + 1)
        if len(text) > most:
            raise ValueError(f'more than {most} bytes')
        return _mapping(json.loads(text), 'it')
    except RecursionError:
        raise InputError('not a saved state: nested too deeply', file=str(path)) from None
    except OSError as error:
        raise InputError(f'cannot be read: {error.strerror}', file=str(path)) from None
    except ValueError as error:
        raise InputError(f'not a saved state: {error}', file=str(path)) from None
