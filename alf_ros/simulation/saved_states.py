"""Saved states: by name, in memory and in files, exact to the last bit."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene
from alf_ros.simulation.applied import Inputs, Target, Wrench
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State

FORMAT = 1


def as_data(state: State) -> dict[str, Any]:
    """The state as lists, numbers and text: JSON writes it so that it reads back exactly."""
    fields = {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
    inputs = fields.pop('inputs')
    data = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}
    wrenches = {name: dataclasses.asdict(wrench) for name, wrench in inputs.wrenches.items()}
    held = {
        'wrenches': wrenches,
        'efforts': {name: _plain(effort) for name, effort in inputs.efforts.items()},
        'targets': {
            name: {'position': _plain(target.position), 'velocity': target.velocity}
            for name, target in inputs.targets.items()
        },
    }
    return {**data, 'inputs': held}


def _plain(value: float | Curve | None) -> Any:
    return value.pieces if isinstance(value, Curve) else value


def read_curve(value: Any) -> Any:
    """What `as_data` and the journal write of a number, a curve or nothing.

    Raises ValueError if it is no curve.
    """
    return Curve(tuple(map(tuple, value))) if isinstance(value, (list, tuple)) else value


def from_data(data: dict[str, Any], like: State) -> State:
    """What `as_data` wrote, for the scene of the state `like`.

    Raises KeyError, TypeError or ValueError if it is not such a state.
    """
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(like):
        if field.name not in ('inputs', 'works', 'loads'):
            fields[field.name] = _like(data[field.name], getattr(like, field.name))
    wrenches = {}
    for name, wrench in data['inputs']['wrenches'].items():
        held: dict[str, Any] = dict(wrench)
        held.update({key: tuple(value) for key, value in held.items() if type(value) is list})
        wrenches[name] = Wrench(**held)
    efforts = {name: read_curve(effort) for name, effort in data['inputs']['efforts'].items()}
    # A state of an earlier version knows no targets, no works and no loads.
    targets = {
        name: Target(read_curve(target['position']), target['velocity'])
        for name, target in data['inputs'].get('targets', {}).items()
    }
    works = {name: float(work) for name, work in data.get('works', {}).items()}
    loads = _like(data['loads'], like.loads) if data.get('loads') else np.zeros_like(like.loads)
    return State(**fields, inputs=Inputs(wrenches, efforts, targets), works=works, loads=loads)


def _like(value: Any, present: Any) -> Any:
    if not isinstance(present, np.ndarray):
        return type(present)(value)
    array = np.array(value, dtype=present.dtype)
    if array.shape != present.shape:
        raise ValueError(f'{array.shape} instead of {present.shape} numbers')
    return array


class SavedStates:
    """States by name: those of this process in memory, and in `<folder>/<scene>/<name>.json`.

    Without a folder they last as long as the process.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._kept: dict[tuple[str, str], dict[str, Any]] = {}

    def save(self, name: str, scene: Scene, simulation: Simulation) -> str:
        """Keep the present state; says where. Raises InputError if the file cannot be written,
        the state is then in memory all the same."""
        document = {
            'alf_ros_state': FORMAT,
            'scene': scene.name,
            'mechanism_sha256': _digest(scene),
            'step_s': simulation.h,
            't': simulation.t,
            'state': as_data(simulation.state),
            # In the order of the file: shows whether the state is read as it was written.
            'q': simulation.sample().q.tolist(),
        }
        self._kept[scene.name, name] = document
        path = self._path(scene, name)
        if path is None:
            return 'in memory'
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            unfinished = path.with_suffix('.unfinished')
            unfinished.write_text(json.dumps(document) + '\n', 'utf-8')
            os.replace(unfinished, path)
        except OSError as error:
            text = f'in memory only: cannot be written: {error.strerror}'
            raise InputError(text, key='state.folder', value=str(path)) from None
        return f'in {path}'

    def find(self, name: str, scene: Scene, like: State) -> tuple[State, float, list[float]]:
        """The state, the step (s) it was reached with, and its coordinates in the order of the
        file. Raises InputError if there is none of this name for this mechanism."""
        path = self._path(scene, name)
        document = self._kept.get((scene.name, name))
        if document is None and path is not None and path.is_file():
            try:
                document = json.loads(path.read_text('utf-8'))
            except (OSError, ValueError) as error:
                raise InputError(f'not a saved state: {error}', file=str(path)) from None
        if document is None:
            raise InputError(
                'no state saved under this name',
                key='state.name',
                value=name,
                choices=self._names(scene),
            )
        try:
            if document['alf_ros_state'] != FORMAT:
                raise ValueError('of another format')
            if document['mechanism_sha256'] != _digest(scene):
                raise ValueError('of another mechanism')
            state = from_data(document['state'], like)
            return state, float(document['step_s']), list(document['q'])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f'not a state of this scene: {error}', key='state.name', value=name
            ) from None

    def _names(self, scene: Scene) -> list[str]:
        names = {name for kept, name in self._kept if kept == scene.name}
        if self._folder is not None:
            names |= {path.stem for path in (self._folder / scene.name).glob('*.json')}
        return sorted(names)

    def _path(self, scene: Scene, name: str) -> Path | None:
        return self._folder / scene.name / f'{name}.json' if self._folder else None


def _digest(scene: Scene) -> str:
    """Of the mechanism alone: a state outlives a change of the effects."""
    return hashlib.sha256(repr(scene.mechanism).encode()).hexdigest()
