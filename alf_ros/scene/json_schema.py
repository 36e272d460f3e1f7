"""JSON schemas (draft 7) of mechanism and scene files, made from what the loader reads.

Keys, types of joints, parameters of effects and ranges come from the loader's own tables; here is
only of what shape each key's value is and what it means. A schema is for editors: they complete,
explain and underline while one writes. It says less than the loader, which also knows what the
names refer to; whatever the loader accepts, it accepts.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

from alf_ros import effects
from alf_ros.model import joints as joint_types
from alf_ros.model.joints.contract import Key
from alf_ros.scene import mechanism_file, scene, sensors_section
from alf_ros.scene.diff_drive_section import DiffDrive
from alf_ros.scene.mechanism_file import (
    bearings,
    bodies,
    couplings,
    drives,
    joints,
    shapes_section,
)
from alf_ros.scene.text.repetition import NAME, TITLE

Schema = dict[str, Any]

_DRAFT = 'http://json-schema.org/draft-07/schema#'
_NOTHING: Schema = {'type': 'null'}
_TEXT: Schema = {'type': ['string', 'number', 'boolean']}
_NUMBER: Schema = {'$ref': '#/definitions/number'}
_NAME: Schema = {'$ref': '#/definitions/name'}
_NAME_OF: Schema = {'allOf': [_NAME]}
_SHOWN: Schema = {'allOf': [{'$ref': '#/definitions/shapes'}]}
_DEFINITIONS: Schema = {
    'number': {
        'description': 'a number, or an expression of parameters',
        'anyOf': [
            {'type': 'number'},
            {'type': 'string', 'pattern': r'^[0-9A-Za-z_.+\-*/%(), ]+$'},
        ],
    },
    'name': {
        'description': 'a letter, then letters, digits or _; indices of `for` as <k+1>',
        'type': 'string',
        'pattern': r'^([A-Za-z]|<[^<>]*>)([A-Za-z0-9_]|<[^<>]*>)*$',
    },
    'for': {
        'description': 'one of these for each value of an index: {k: [first, last]}',
        'type': 'object',
        'minProperties': 1,
        'propertyNames': {'pattern': f'^{NAME.pattern}$'},
        'additionalProperties': {
            'type': 'array',
            'items': _NUMBER,
            'minItems': 2,
            'maxItems': 2,
        },
    },
}


_TITLE: Schema = {
    'description': 'letters, digits, _ . -; the name of the file if absent',
    **_TEXT,
    'pattern': f'^{TITLE.pattern}$',
}
_DESCRIPTION: Schema = {'description': 'text, not read'}
_INITIAL = {
    'positions': 'by point or vector (m), world frame; ~ leaves a component free',
    'velocities': 'by point or vector (m/s), world frame: any consistent ones; ~ leaves one free',
    'branch': 'number of the branch of a singular start position, as `check` counts them',
}
_SETTINGS = {  # of the solver
    'step': 'time step',
    'integrator': 'method of integration',
    'formulation': 'formulation of the equations of motion',
    'penalty': 'penalty without dimension',
    'iterations': 'iterations of a solve, at most',
    'tolerance': 'relative error of a step, for an adaptive integrator',
    'accuracy': 'requested position error; it chooses integrator and tolerance',
}


def _list(items: Schema, least: int | None = None, most: int | None = None) -> Schema:
    bounds = {'minItems': least, 'maxItems': least if most is None else most}
    return {'type': 'array', 'items': items} | {k: n for k, n in bounds.items() if n is not None}


def _any(*shapes: Schema) -> Schema:
    return {'anyOf': list(shapes)}


def _mapping(fields: Mapping[str, Schema], required: Iterable[str], **more: Any) -> Schema:
    """A mapping with these keys and no others; where none is required, it may be empty."""
    required = list(required)
    shape: Schema = {'type': 'object' if required else ['object', 'null']}
    shape |= {'properties': dict(fields), 'additionalProperties': False, **more}
    return shape | ({'required': required} if required else {})


def _by_name(item: Schema) -> Schema:
    names = {'pattern': _DEFINITIONS['name']['pattern']}
    return {'type': ['object', 'null'], 'propertyNames': names, 'additionalProperties': item}


def _vector(D: int) -> Schema:
    return _list(_NUMBER, D)


def _shapes() -> Schema:
    """A list of shapes, each of one kind."""
    forms = {'size': _list(_NUMBER, 3), 'scale': _any(_NUMBER, _list(_NUMBER, 3)), 'file': _TEXT}
    pose: dict[str, tuple[str, Schema]] = {
        'at': (
            'its middle, of a mesh its origin (m); 2 numbers in the plane',
            _list(_NUMBER, 2, 3),
        ),
        'rpy': ('roll, pitch, yaw about fixed x, y, z (rad)', _list(_NUMBER, 3)),
        'color': ('red, green, blue, opacity if wanted; 0 to 1', _list(_NUMBER, 3, 4)),
    }
    placed = {key: {'description': pose[key][0], **pose[key][1]} for key in shapes_section.POSE}
    cases = []
    for kind, docs in shapes_section.KINDS.items():
        fields = {
            key: {'description': doc, 'allOf': [forms.get(key, _NUMBER)]}
            for key, doc in docs.items()
        }
        shape = _mapping(fields, [key for key in docs if key != 'scale'])
        cases.append(_mapping({kind: shape, **placed}, [kind]))
    return _list(_any(*cases))


_DEFINITIONS[shapes_section.KEY] = _shapes()
_TABLE = _any(_list(_list(_NUMBER)), {'type': 'string'})

# ------------------------------------------------------------------------------------- mechanism

_TENSOR = _any(_list(_NUMBER, 3), _list(_NUMBER, 6), _list(_list(_NUMBER, 3), 3))
_POINT: dict[str, tuple[str, Callable[[int], Schema]]] = {
    'at': ('where it is drawn, world frame (m)', _vector),
    'along': ('its direction as drawn, world frame; of any length', _vector),
    'fixed': ('whether it is fixed; false if absent', lambda D: {'type': 'boolean'}),
}
_BODY: dict[str, tuple[str, Callable[[int], Schema]]] = {
    'points': ('the points it carries', lambda D: {**_list(_NAME), 'minItems': 1}),
    'vectors': ('the vectors it carries', lambda D: _list(_NAME)),
    'mass': ('mass (kg), zero or more', lambda D: _NUMBER),
    'inertia': (
        'rod, point, or {about_com: J} (kg m^2); required if it has mass',
        lambda D: _any(
            {'enum': list(bodies.INERTIAS)},
            _mapping({'about_com': _NUMBER if D == 2 else _TENSOR}, ['about_com']),
        ),
    ),
    'com': ('centre of mass, body frame (m)', _vector),
    'length': ('distance of its two points (m); as drawn if absent', lambda D: _NUMBER),
    shapes_section.KEY: ('what viewers show, body frame', lambda D: _SHOWN),
}


def _bearing(_D: int) -> Schema:
    fields = {key: {'description': doc, **_NUMBER} for key, doc in bearings.KEYS.items()}
    return {**_mapping(fields, ()), 'type': 'object', 'minProperties': 1}


_BETWEEN = Key('between', 'points', 'parent and child: bodies, or ground first')
_SHAPES: dict[str, Callable[[int], Schema]] = {  # of the keys of joints
    'point': lambda D: _NAME,
    'points': lambda D: _list(_NAME, 2),
    'axis': lambda D: _axis(D),
    'axes': lambda D: _list(_axis(D), 2),
    'three axes': lambda D: {**_by_name(_axis(D)), 'minProperties': 3, 'maxProperties': 3},
    'number': lambda D: _NUMBER,
    'numbers': lambda D: _list(_NUMBER, 2),
    'boolean': lambda D: {'type': 'boolean'},
    'on': lambda D: _on(D),
}


def _axis(D: int) -> Schema:
    return _vector(D) if D == 2 else _any(_vector(D), _NAME)


def _on(D: int) -> Schema:
    keys = joints.LINE if D == 2 else joints.PLANE
    moving = joints.MOVING_LINE if D == 2 else joints.MOVING_PLANE
    through, along = keys
    shapes = {through: _vector(D), along: _axis(D)}
    return _mapping(shapes | {key: _MOTION[key] for key in moving}, keys)


_MOTION: dict[str, Schema] = {
    'speed': {'description': 'of a belt on it: m/s, of t', 'allOf': [_NUMBER]},
    'velocity': {
        'description': 'of the point itself, world frame: m/s, of t',
        **_list(_NUMBER, 3),
    },
    'spin': {'description': 'about the normal at `through`: rad/s, of t', 'allOf': [_NUMBER]},
}


def _drive(D: int) -> Schema:
    """A motion is an expression of t, or a table; of a point one for each axis."""
    table = _mapping({'table': _TABLE}, ['table'])
    motion = _any(_NUMBER, table)
    shapes: dict[str, Schema] = {
        'joint': {'description': 'a joint coordinate', **_NAME_OF},
        'angle': {'description': 'rad, of t', **motion},
        'length': {'description': 'm, of t', **motion},
        'point': {'description': 'a point', **_NAME_OF},
        'at': {'description': 'm, of t', **_any(_list(_any(_NOTHING, _NUMBER), D), table)},
        'points': {'description': 'two points; the drive sets their distance', **_list(_NAME, 2)},
    }
    keys = {key: shapes[key] for key in drives.KEYS}
    cases = [
        _mapping({'for': {'$ref': '#/definitions/for'}, of: keys[of], how: keys[how]}, [of, how])
        for of, hows in drives.OF.items()
        for how in hows
    ]
    return _any(*cases)


def _coupling() -> Schema:
    joints_of = {'description': 'coordinates and their factors: the sum is constant', **_factors()}
    shapes = {key: {'joints': joints_of}[key] for key in couplings.KEYS}
    return _mapping({'for': {'$ref': '#/definitions/for'}, **shapes}, couplings.KEYS)


def _factors() -> Schema:
    return {**_by_name(_NUMBER), 'type': 'object', 'minProperties': 1}


def _fields(
    keys: Iterable[str], table: Mapping[str, tuple[str, Callable[[int], Schema]]], D: int
) -> dict[str, Schema]:
    """The keys of a thing in the plane (D = 2) or in space, each with shape and meaning."""
    return {key: {'description': table[key][0], 'allOf': [table[key][1](D)]} for key in keys}


def _repeated(keys: Iterable[str], needed: Iterable[str], table: Any, D: int) -> Schema:
    return _mapping({'for': {'$ref': '#/definitions/for'}, **_fields(keys, table, D)}, needed)


def _joint(D: int) -> Schema:
    """Which keys there are depends on the type."""
    types = joint_types.types(D)
    cases = []
    for kind, about in types.items():
        keys = (_BETWEEN, *about.keys, *about.optional)
        table = {key.name: (key.doc, _SHAPES[key.shape]) for key in keys}
        table[bearings.KEY] = (bearings.DOC, _bearing)
        then = _repeated(table, joints.needed(about, between=True), table, D)
        then['properties']['type'] = True
        given = {'properties': {'type': {'const': kind}}, 'required': ['type']}
        cases.append({'if': given, 'then': then})
    kinds = {'type': {'enum': list(types), 'description': 'coordinates that it leaves free'}}
    return {'type': 'object', 'properties': kinds, 'required': ['type'], 'allOf': cases}


def _parts(D: int) -> dict[str, Schema]:
    keys = bodies.KEYS + (bodies.IN_SPACE if D == 3 else ())
    point, vector = mechanism_file.POINT, mechanism_file.VECTOR
    return {
        'points': _by_name(_repeated(point, point[:1], _POINT, D)),
        'vectors': _by_name(_repeated(vector, vector[:1], _POINT, D)) if D == 3 else False,  # type: ignore[dict-item]
        'bodies': _by_name(_repeated(keys, bodies.KEYS[:2], _BODY, D)),
        'joints': _by_name(_joint(D)),
        'couplings': _by_name(_coupling()),
        'drives': _by_name(_drive(D)),
    }


def _mechanism() -> Schema:
    planar, spatial = mechanism_file.SPACES
    about: dict[str, Schema] = {
        'alf': {
            'description': 'version of this format',
            'enum': [mechanism_file.VERSION, str(mechanism_file.VERSION)],
        },
        'name': _TITLE,
        'description': _DESCRIPTION,
        'space': {
            'description': 'two coordinates of a point, or three',
            'enum': [planar, spatial],
            'default': planar,
        },
        'parameters': {
            'description': 'numbers by name; each may use those before it',
            **_by_name(_NUMBER),
        },
        'points': {'description': 'by name; fixed, or carried by a body'},
        'vectors': {'description': 'by name: directions that bodies share'},
        'bodies': {'description': 'by name: rigid bodies'},
        'joints': {'description': 'by name; no joint is the one that closes the loop'},
        'couplings': {'description': 'by name: joint coordinates whose sum stays as drawn'},
        'drives': {'description': 'by name: motions as functions of the time t'},
        shapes_section.KEY: {
            'description': 'what viewers show of the ground, world frame',
            **_SHOWN,
        },
    }
    whole = _mapping({key: about[key] for key in mechanism_file.KEYS}, mechanism_file.REQUIRED)
    is_spatial = {'properties': {'space': {'const': spatial}}, 'required': ['space']}
    return whole | {
        'if': is_spatial,
        'then': {'properties': _parts(3)},
        'else': {'properties': _parts(2)},
    }


# ----------------------------------------------------------------------------------------- scene

_SIZED = _list(_NUMBER, 2, 3)  # the dimension belongs to a mechanism, which may be another file
_PLACE = _any(_NOTHING, _TEXT, _SIZED)
_KINDS: Mapping[str, Schema] = {
    'number': _NUMBER,
    'vector': _SIZED,
    'spin': _any(_NUMBER, _list(_NUMBER, 3)),
    'boolean': {'type': 'boolean'},
    'pair': _list(_TEXT, 2),
    'place': _PLACE,
    'places': _list(_PLACE, 2),
    'path': _list(_any(_TEXT, _list(_PLACE, 2))),
    'factors': _list(_list(_any(_TEXT, _NUMBER), 2)),
    'numbers': _list(_NUMBER),
    'table': _TABLE,
    'signal': _any(_NUMBER, _TABLE),
}


def _effect(kind: str) -> Schema:
    """One effect, from its `Parameters`."""
    module = effects.load(kind)
    one = _described(module.Parameters, module.__doc__)
    one_of = getattr(module, 'ONE_OF', ())
    return one | _given_one(one_of) if one_of else one


def _given_one(names: Sequence[str]) -> Schema:
    return {'anyOf': [{'required': [name]} for name in names]}


def _described(parameters: Any, doc: str | None) -> Schema:
    """An effect or a sensor, from the dataclass of its parameters."""
    fields, required = {}, []
    for item in dataclasses.fields(parameters):
        about = item.metadata
        known = {'enum': list(about['choices'])} if 'choices' in about else _TEXT
        shape = _KINDS.get(about['kind'], known)
        unit = f' ({about["unit"]})' if 'unit' in about else ''
        described: Schema = {'description': f'{about["doc"]}{unit}'}
        if item.default is None:
            shape = _any(_NOTHING, shape)
        elif isinstance(item.default, (str, float)):
            described['default'] = item.default
        elif item.default is dataclasses.MISSING is item.default_factory:
            required.append(item.name)
        fields[item.name] = described | {'allOf': [shape]}
    one = _mapping(fields, required)
    needs = {item.name: item.metadata.get('needs') for item in dataclasses.fields(parameters)}
    if any(needs.values()):
        one['dependencies'] = {name: _given_one(each) for name, each in needs.items() if each}
    one['description'] = ' '.join((doc or '').partition('\n\n')[0].split())
    return one


def _standing(kind: str) -> Schema:
    """An effect where it is named."""
    one = {'$ref': f'#/definitions/effects/{kind}'}
    return _some(one) if effects.load(kind).MULTIPLE else one


def _some(one: Schema) -> Schema:
    """Where several may stand: one, or a list or a mapping of them."""
    some = {'additionalProperties': {'not': {'type': 'object'}}}
    named = {'type': 'object', 'not': some}  # at least one value is a mapping
    several = {'if': named, 'then': {'additionalProperties': one}, 'else': one}
    return {'if': {'type': 'array'}, 'then': _list(one), 'else': several}


def _solver() -> Schema:
    fields: dict[str, Schema] = {}
    for name, (low, high, whole, expected) in scene.NUMBERS.items():
        kind = 'integer' if whole else 'number'
        number = {'type': kind, 'minimum': low, 'maximum': high}
        text = _DEFINITIONS['number']['anyOf'][1]
        fields[name] = {'description': f'{_SETTINGS[name]}: {expected}', **_any(number, text)}
    for name, choices in scene.CHOICES.items():
        fields[name] = {'description': _SETTINGS[name], 'enum': list(choices)}
    fields['formulation']['enum'] += scene.RENAMED
    for item in dataclasses.fields(scene.Solver):
        fields[item.name]['default'] = item.default
    return {'description': 'how the motion is computed', **_mapping(fields, ())}


def mechanism_schema() -> Schema:
    """Of a mechanism file."""
    title = 'Mechanism of alf_ros'
    return {'$schema': _DRAFT, 'title': title, 'definitions': _DEFINITIONS, **_mechanism()}


def scene_schema(kinds: Collection[str]) -> Schema:
    """Of a scene file with effects of these `kinds`, and any that are files by path."""
    components = _by_name(_list(_any(_NOTHING, _NUMBER), 2, 3))
    by_path: Schema = {r'\.py(#sha256=[0-9a-f]{64})?$': {}}
    about: dict[str, Schema] = {
        'name': _TITLE,
        'description': _DESCRIPTION,
        'mechanism': {
            'description': 'a name under config/mechanisms, a path, or the mapping itself',
            'if': {'type': 'object'},
            'then': {'$ref': '#/definitions/mechanism'},
            'else': _TEXT,
        },
        'parameters': {
            'description': 'numbers by name, instead of the numbers of the mechanism',
            **_by_name(_NUMBER),
        },
        'drives': {
            'description': 'by name: motions as functions of t',
            'anyOf': [_by_name(_drive(D)) for D in (2, 3)],
        },
        'effects': {
            'description': 'effects that act; only effects named here are computed',
            **_mapping({kind: _standing(kind) for kind in kinds}, (), patternProperties=by_path),
        },
        'diff_drive': _described(DiffDrive, 'wheels that follow cmd_vel'),
        'sensors': {
            'description': 'what is measured and published; only sensors named here',
            **_mapping(
                {
                    kind: _some({'$ref': f'#/definitions/sensors/{kind}'})
                    for kind in sensors_section.KINDS
                },
                (),
            ),
        },
        'initial': {
            'description': 'positions and velocities at the start; missing values are solved',
            **_mapping(
                {
                    'positions': {'description': _INITIAL['positions'], **components},
                    'velocities': {'description': _INITIAL['velocities'], **components},
                    'branch': {'description': _INITIAL['branch'], **_NUMBER},
                },
                (),
            ),
        },
        'solver': _solver(),
    }
    definitions = _DEFINITIONS | {
        'mechanism': _mechanism(),
        'effects': {kind: _effect(kind) for kind in kinds},
        'sensors': {
            kind: _described(about, about.__doc__) for kind, about in sensors_section.KINDS.items()
        },
    }
    fields = {key: about[key] for key in scene.KEYS}
    head = {'$schema': _DRAFT, 'title': 'Scene of alf_ros', 'definitions': definitions}
    return head | _mapping(fields, scene.REQUIRED)


def text(schema: Schema) -> str:
    """A schema as the text of its file."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + '\n'
