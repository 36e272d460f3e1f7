"""A scene: which mechanism, which effects and sensors, the initial state, how accurate.

Whatever a file gets wrong is refused here, with its line, before anything is computed.
`Scene.text` is one document without references to others: it is what gets logged, and it loads to
an equal scene.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from numbers import Integral, Real
from pathlib import Path
from typing import Any, cast

from alf_ros import html_table, paths, resources
from alf_ros.effects import Effect
from alf_ros.errors import InputError
from alf_ros.gc_pause import paused
from alf_ros.kernel import Method
from alf_ros.mechanism import Mechanism, Point, Vector
from alf_ros.model.tableaux import TABLEAUX, method
from alf_ros.scene.diff_drive_section import DiffDrive, read_diff_drive
from alf_ros.scene.effects_section import read_effects, with_rotors
from alf_ros.scene.mechanism_file import read_mechanism
from alf_ros.scene.references import WHOLE, References
from alf_ros.scene.sensors_section import Sensor, read_sensors
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.repetition import title
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry as as_entry

INTEGRATORS = tuple(TABLEAUX)
FORMULATIONS = (
    'alf2',
    'alf1',
    'alf2_as_printed',
    'canonical',
    'penalty',
    'baumgarte',
    'lagrange_canonical',
    'independent',
)
RENAMED = {'alf2_literal': 'alf2_as_printed'}  # old names, which files may still give

KEYS = (
    'name',
    'description',
    'mechanism',
    'parameters',
    'drives',
    'effects',
    'diff_drive',
    'sensors',
    'initial',
    'solver',
)
REQUIRED = ('mechanism',)
INITIAL = ('positions', 'velocities', 'branch')

_SUFFIXES = ('.yaml', '.yml')
_OF_ROBOTS = (
    '.urdf',
    '.xacro',
    '.sdf',
    '.world',
    '.xml',
    '.mjcf',
    '.usd',
    '.usda',
    '.usdc',
    '.usdz',
)
PICKED = ('integrator', 'tolerance')  # by an accuracy
CHOICES = {'integrator': INTEGRATORS, 'formulation': FORMULATIONS}
NUMBERS = {  # smallest, largest, whole, expected value
    'step': (1e-12, 1e6, False, 's, from 1e-12 to 1e6'),
    # its rounding is ε penalty of the reactions: above 1e12 it reaches the motion
    'penalty': (yaml_document.SMALLEST, 1e12, False, 'a number from 1e-60 to 1e12'),
    'iterations': (1, 1000, True, 'a whole number from 1 to 1000'),
    'tolerance': (0.0, 1.0, False, 'a number from 0 to 1'),
    'accuracy': (1e-60, 1e6, False, 'm, from 1e-60 to 1e6'),
}

Components = tuple[float | None, ...]


@dataclass(frozen=True)
class Solver:
    """Settings of the solver.

    step: h (s). penalty: α relative to the scale of the masses, without dimension. The iterations
    of a solve stop after `iterations`. tolerance: relative error of a step that an adaptive
    integrator allows; it makes as many as needed in each `step`. accuracy: a position error (m)
    for which a simulation chooses integrator and tolerance. Raises InputError.
    """

    step: float = 1e-3
    integrator: str = 'rk4'
    formulation: str = 'alf2'
    penalty: float = 1e8
    iterations: int = 10
    tolerance: float = 1e-8
    accuracy: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.formulation, str):
            renamed = RENAMED.get(self.formulation, self.formulation)
            object.__setattr__(self, 'formulation', renamed)
        for name in (each.name for each in dataclasses.fields(self)):
            value = getattr(self, name)
            fault = None if value is None else _setting_fault(name, value)
            if fault:
                raise InputError(key=name, value=value, **fault)
            if name in NUMBERS and value is not None:  # compiled code takes no others
                kind = int if NUMBERS[name][2] else float
                object.__setattr__(self, name, kind(value))

    @property
    def settings(self) -> dict[str, Any]:
        """The section of a scene that has these settings."""
        given = dict(vars(self))
        if self.accuracy is None:
            del given['accuracy']
        return joined(given, {})

    @property
    def method(self) -> Method:
        """The values that the kernel needs."""
        return method(self.integrator, self.iterations, self.tolerance)


def joined(settings: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a solver with changes: an accuracy picks again, and what it picks ends it."""
    found = {**settings, **changes}
    if 'accuracy' not in changes and not changes.keys().isdisjoint((*PICKED, 'formulation')):
        found.pop('accuracy', None)
    elif found.get('accuracy') is not None:
        found = {k: v for k, v in found.items() if k not in PICKED or k in changes}
    return found


@dataclass(frozen=True)
class Scene:
    """All that is needed to run.

    `positions` (m) and `velocities` (m/s) are by movable point, world frame; a component that is
    None is free, as is every point that is not named. `branch`: the number of the branch that the
    velocities fit in a singular start position; None for any. `says_solver`: whether the section
    says anything; otherwise `solver` is `UNSAID`, unless a simulation is given settings.
    """

    name: str
    mechanism: Mechanism
    effects: tuple[Effect, ...]
    positions: Mapping[str, Components]
    velocities: Mapping[str, Components]
    solver: Solver
    document: SceneDocument
    file: str | None = field(default=None, compare=False)
    says_solver: bool = field(default=True, compare=False)
    sensors: tuple[Sensor, ...] = ()
    diff_drive: DiffDrive | None = None
    branch: int | None = None

    def at_rest(self) -> Scene:
        """The same scene without velocities, and so without a branch on which they begin."""
        return replace(self, velocities={}, branch=None)

    @property
    def text(self) -> str:
        """The YAML text: one document without references to others."""
        return self.document.text

    @property
    def hash(self) -> str:
        """SHA-256 of the text, hexadecimal."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def __repr__(self) -> str:
        parts = len(self.mechanism.bodies), len(self.mechanism.joints), len(self.effects)
        return '<Scene {}: {} bodies, {} joints, {} effects>'.format(self.name, *parts)

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        mechanism, solver = self.mechanism, self.solver
        judged = {'accuracy': f'{solver.accuracy} m'} if solver.accuracy else {}
        settings = {'integrator': solver.integrator, 'step': f'{solver.step:g} s', **judged}
        space = 'planar' if mechanism.dimension == 2 else 'spatial'
        effects = ', '.join(effect.label for effect in self.effects)
        about = [
            ('mechanism', f'{mechanism.name}, {space}'),
            ('bodies', f'{len(mechanism.bodies)}: {_names(mechanism.bodies)}'),
            ('drives', _names(mechanism.drives) or 'none'),
            ('effects', effects or 'none'),
            ('sensors', ', '.join(sensor.label for sensor in self.sensors) or 'none'),
            ('initial velocities of', ', '.join(self.velocities) or 'none'),
            ('solver', ', '.join(f'{name} {value}' for name, value in settings.items())),
        ]
        if self.file:
            about.append(('file', self.file))
        joints = ((j.name, j.kind, f'{j.parent}, {j.child}') for j in mechanism.joints)
        return ''.join(
            (
                html_table.heading(f'Scene {self.name}'),
                html_table.pairs(about),
                html_table.table(('joint', 'type', 'between'), joints, len(mechanism.joints)),
            )
        )


def _names(parts: Collection[Any]) -> str:
    return ', '.join(part.name for part in islice(parts, html_table.MOST_ROWS))


# what a scene is loaded from, or one
SceneSource = Scene | str | os.PathLike[str] | Mapping[str, Any]


@paused()
def load_scene(
    source: SceneSource,
    parameters: Mapping[str, float] | None = None,
    code: bool = True,
) -> Scene:
    """The scene of a name under config/scenes, a YAML file, or a mapping with a scene's keys; a
    Scene itself.

    `parameters` replaces parameters of the mechanism, also those that the scene sets. `code`
    False: refused if it names an effect in a file that has not run in this process before.
    Raises InputError.
    """
    if not isinstance(parameters, (Mapping, type(None))):
        raise InputError(
            'no parameters by name', key='parameters', value=parameters, expected='a mapping'
        )
    if isinstance(source, Scene):
        if parameters:
            names = ', '.join(parameters)
            expected = 'its name, file or mapping'
            raise InputError('it is loaded', key='parameters', value=names, expected=expected)
        return source
    if isinstance(source, Mapping):
        return _read_scene(as_entry(source), 'scene', References(code=code), parameters)
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(
            'not a scene', key='scene', value=source, expected='a name, a path or a mapping'
        )
    known = str(source)
    path = _path(known)
    if path is None:
        scenes = resources.library('scenes')
        if known not in scenes:
            raise _no_scene(known, scenes)
        path = scenes[known]
    references = References(path.parent, code)
    return _read_scene(yaml_document.read(path), _stem(path), references, parameters)


@paused()
def scene_within(root: Entry, folder: Path) -> Scene:
    """The scene that is a part of another YAML file; its paths begin in `folder`. Raises
    InputError, with lines of that file."""
    return _read_scene(root, 'scene', References(folder), None)


@paused()
def scene_from_text(
    text: str,
    file: str = '<text>',
    parameters: Mapping[str, float] | None = None,
    references: References | None = None,
) -> Scene:
    """The scene in a YAML text; errors name it `file`.

    `references`: which files it may name (by default files of the present folder). Raises
    InputError.
    """
    root = yaml_document.parse(text, file)
    return _read_scene(root, 'scene', references or References(), parameters)


def effect_names(text: str, file: str) -> tuple[str, ...]:
    """The effects that a scene's YAML text names, as written; none is imported.

    Raises InputError if it is no mapping.
    """
    fields = yaml_document.parse(text, file).mapping()
    return tuple(fields['effects'].mapping()) if 'effects' in fields else ()


@paused()
def whole_scene(fields: Mapping[str, Any], file: str | None = None) -> Scene:
    """The scene of the fields of a `Scene.text`, of which some may be others; it reads no file.

    Raises InputError.
    """
    return _read_scene(as_entry(fields, file), 'scene', WHOLE, None)


def _read_scene(
    root: Entry, name: str, references: References, parameters: Mapping[str, float] | None
) -> Scene:
    fields = root.mapping(KEYS, REQUIRED)
    nothing = as_entry({})
    if 'name' in fields:
        name = title(fields['name'])
    given = fields.get('parameters', nothing).mapping()
    given |= {key: as_entry(v, path=f'parameters.{key}') for key, v in (parameters or {}).items()}
    source, mechanism_name = _mechanism(fields['mechanism'], name, references)
    found = read_mechanism(source, mechanism_name, given, references, fields.get('drives'))
    mechanism, values = found.layout.mechanism, found.values

    positions, velocities, branch = read_initial(fields.get('initial', nothing), mechanism, values)
    asked = fields.get('solver', nothing)
    says_solver = bool(asked.mapping())
    solver = read_solver(asked, values) if says_solver else UNSAID
    acting = fields.get('effects', nothing)
    effects, section = read_effects(acting, found.layout, values, references)
    mechanism = with_rotors(mechanism, effects)
    sensors = read_sensors(fields.get('sensors', nothing), mechanism, values, references)
    diff_drive = None
    if 'diff_drive' in fields:
        wheels = fields['diff_drive']
        diff_drive = read_diff_drive(wheels, mechanism, values, references)

    whole: dict[str, object] = {
        **fields,
        'name': name,
        'mechanism': _with(found.root, mechanism.name, given),
    }
    if found.drives is not None:
        whole['drives'] = found.drives
    whole['solver'] = solver.settings
    if 'effects' in fields:
        whole['effects'] = section
    whole.pop('parameters', None)
    document = SceneDocument({key: whole[key] for key in KEYS if key in whole})
    return Scene(
        name,
        mechanism,
        effects,
        positions,
        velocities,
        solver,
        document,
        root.file,
        says_solver,
        sensors,
        diff_drive,
        branch,
    )


def _with(source: Entry, name: str, given: Mapping[str, Entry]) -> dict[str, object]:
    """The mapping of a mechanism with its name and the `given` parameters in it."""
    fields: dict[str, object] = {'alf': None, 'name': name, **source.mapping()}
    if given and 'parameters' in fields:
        fields['parameters'] = {**source.mapping()['parameters'].mapping(), **given}
    return fields


def _mechanism(entry: Entry, name: str, references: References) -> tuple[Entry, str]:
    """The mapping that a scene's `mechanism` stands for, and the name it has without saying so."""
    if isinstance(entry.value, dict):
        return entry, name
    if references.folder is None:
        raise entry.error('a mechanism elsewhere: files are not read here')
    text = entry.text()
    path = _path(text)
    if path is None:
        known = resources.library('mechanisms')
        if text not in known:
            raise entry.error('no mechanism of this name', choices=known)
        path = known[text]
    else:
        path = references.folder / path
        if not os.path.isfile(path):
            raise entry.error('no such file', value=str(path))
    return yaml_document.read(path), _stem(path)


def _path(source: str) -> Path | None:
    """The path that `source` is, or None for a name. Raises InputError for a robot file."""
    if source.lower().endswith(_OF_ROBOTS):
        message, expected = (
            'a robot file',
            f'`python -m alf_ros import {source} --scene -o OUT.yaml`',
        )
        raise InputError(message, file=source, expected=f'a scene, which {expected} makes of it')
    is_path = source.endswith(_SUFFIXES) or '/' in source or os.sep in source
    return paths.named(source) if is_path else None


def _stem(path: Path) -> str:
    """The name of a file that does not name itself."""
    return re.sub(r'[^\w.-]', '_', path.stem)[:100]


def _no_scene(name: str, scenes: Collection[str]) -> InputError:
    if name in resources.library('mechanisms'):
        message = f'a mechanism, not a scene; write a scene file with "mechanism: {name}"'
        return InputError(message, key='scene', value=name)
    return InputError('no scene of this name', key='scene', value=name, choices=scenes)


def read_initial(
    section: Entry, mechanism: Mechanism, names: Mapping[str, float]
) -> tuple[dict[str, Components], dict[str, Components], int | None]:
    """Positions, velocities and branch of a section `initial`; `names`: numbers that expressions
    may name. Raises InputError."""
    known = {item.name: item for item in mechanism.blocks}
    parts = section.mapping(INITIAL)
    number = parts.pop('branch', None)
    branch = None if number is None or number.is_null else number.integer(names)
    if number is not None and branch is not None and branch < 1:
        raise number.error('not a branch', value=branch, expected='1 or more, as `check` counts')
    found: dict[str, dict[str, Components]] = {'positions': {}, 'velocities': {}}
    for which, part in parts.items():
        for name, entry in part.mapping().items():
            if name not in known:
                what = 'point' if mechanism.dimension == 2 else 'point or vector'
                raise entry.error(f'no such {what}', value=name, choices=known)
            if known[name].fixed:
                raise entry.error(f'this {_kind(known[name])} is fixed', value=name)
            found[which][name] = tuple(
                None if item.is_null else item.number(names)
                for item in entry.sequence(mechanism.dimension)
            )
    return found['positions'], found['velocities'], branch


def _kind(item: Point | Vector) -> str:
    return 'vector' if isinstance(item, Vector) else 'point'


def read_solver(section: Entry, names: Mapping[str, float]) -> Solver:
    """The settings of a section `solver`, likewise. Raises InputError."""
    settings: dict[str, Any] = {}
    entries = section.mapping((*NUMBERS, *CHOICES))
    for key, entry in entries.items():
        if key in CHOICES:
            settings[key] = entry.text()
        else:
            settings[key] = entry.integer(names) if NUMBERS[key][2] else entry.number(names)
        fault = _setting_fault(key, settings[key])
        if fault:
            raise entry.error(**fault)
    for key in PICKED if 'accuracy' in settings else ():
        if key in settings:
            raise entries[key].error('accuracy chooses it', expected='one or the other')
    if 'accuracy' in settings and settings.get('formulation', 'alf2') != 'alf2':
        raise entries['accuracy'].error('only alf2 supports it')
    return Solver(**settings)


def _setting_fault(name: str, value: object) -> dict[str, Any] | None:
    """The error in one setting of the solver, as keywords of an InputError."""
    if name in CHOICES:
        if isinstance(value, str) and (value in CHOICES[name] or value in RENAMED):
            return None
        return {'message': f'unknown {name}', 'choices': CHOICES[name]}
    low, high, whole, expected = NUMBERS[name]
    kind = Integral if whole else Real
    usable = isinstance(value, kind) and not isinstance(value, bool)
    if usable and low <= cast(float, value) <= high:
        return None
    return {'message': 'not usable', 'expected': expected}


# Of a scene that says nothing of its solver: holds 1e-6 m for 10 s in every mechanism of the
# library that is not chaotic, as `accuracy` would, without seconds of trials at the start.
UNSAID = Solver(integrator='dop853_adaptive')
