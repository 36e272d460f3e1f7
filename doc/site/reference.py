"""Pages made from the tables of the package: keys of scenes, joints, effects."""

from __future__ import annotations

import ast
import dataclasses
import importlib
from pathlib import Path
from typing import Any

from docstrings import markdown, paragraphs, table

from alf_ros import effects
from alf_ros.model import joints
from alf_ros.model.joints.contract import JointType
from alf_ros.scene import json_schema

Schema = dict[str, Any]

_SPACES = {2: 'in the plane', 3: 'in space'}
_MADE = '\nThis page is made from the tables that the loader reads.'


# ------------------------------------------------------------------------------------ scene keys


def scene_keys() -> str:
    """Every key of mechanism and scene files, from the JSON schemas."""
    scene, mechanism = json_schema.scene_schema(effects.own()), json_schema.mechanism_schema()
    in_space, in_plane = mechanism['then']['properties'], mechanism['else']['properties']
    parts = [
        '# Keys of mechanism and scene files',
        f'[scene_format.md](../scene_format.md) explains them, with examples.{_MADE} The JSON '
        'schemas for editors are `config/schema/scene.json` and `config/schema/mechanism.json`. '
        'A number may be an expression of parameters.',
        '## A scene',
        _keys(scene),
        '### `solver`',
        _keys(scene['properties']['solver']),
        '### `initial`',
        _keys(scene['properties']['initial']),
        '### `effects`',
        'The keys are names of effects: [effects](effects.md).',
        '### `sensors`',
        'The keys are kinds of sensors: [sensors](../sensors.md).',
        *(
            f'**{kind}.** {markdown(about["description"])}\n\n{_keys(about)}'
            for kind, about in scene['definitions']['sensors'].items()
        ),
        '## A mechanism',
        _keys(mechanism),
        '### A point',
        _keys(in_space['points']['additionalProperties']),
        '### A vector',
        'In space only.',
        _keys(in_space['vectors']['additionalProperties']),
        '### A body',
        _keys(
            in_space['bodies']['additionalProperties'], in_plane['bodies']['additionalProperties']
        ),
        '### A shape',
        'One of these, in `shapes` of a body or of the mechanism.',
        *(_keys(case) for case in mechanism['definitions']['shapes']['items']['anyOf']),
        '### A joint',
        'The other keys follow from the `type`: [joints](joints.md).',
        '### A coupling',
        _keys(in_plane['couplings']['additionalProperties']),
        '### A drive',
        'One of these.',
    ]
    parts += [_keys(case) for case in in_space['drives']['additionalProperties']['anyOf']]
    return '\n\n'.join(parts) + '\n'


def _keys(of: Schema, planar: Schema | None = None) -> str:
    """The keys of a mapping. `planar`: the same in the plane, which may have fewer."""
    rows = []
    for key, about in of['properties'].items():
        about = about if isinstance(about, dict) else {}
        need = 'required' if key in of.get('required', ()) else _default(about)
        what = about.get('description', '')
        if planar is not None and key not in planar['properties']:
            what += '; in space only'
        rows.append((f'`{key}`', shape(about), need, markdown(what)))
    return table(('key', 'value', 'default', 'meaning'), rows)


def _default(about: Schema) -> str:
    value = about.get('default')
    if value is None:
        return ''
    return f'`{value:g}`' if isinstance(value, float) else f'`{value}`'


def shape(about: Schema) -> str:
    """The shape of a value in words, as Markdown."""
    if 'enum' in about:
        return ', '.join(f'`{each}`' for each in about['enum'])
    if '$ref' in about:
        name = about['$ref'].rpartition('/')[2]
        words = {'for': 'ranges of indices', 'mechanism': 'mapping', 'shapes': 'list of mappings'}
        return words.get(name, name)
    if 'then' in about:
        return f'{shape(about["else"])} or {shape(about["then"])}'
    if 'allOf' in about:
        return shape(about['allOf'][0])
    if 'anyOf' in about:
        said = dict.fromkeys(shape(each) for each in about['anyOf'] if 'pattern' not in each)
        return ' or '.join(each for each in said if each)
    return _shape_of_type(about)


def _shape_of_type(about: Schema) -> str:
    kinds = about.get('type', 'any')
    kind = kinds if isinstance(kinds, str) else next(k for k in kinds if k != 'null')
    if kind == 'array':
        least, most = about.get('minItems'), about.get('maxItems')
        count = '' if most is None else f'{least} ' if least == most else f'{least} to {most} '
        items = shape(about.get('items', {}))
        return f'list of {count}{items}' if items else f'list of {count}values'
    if kind == 'object':
        names = ', '.join(f'`{key}`' for key in about.get('properties', ()))
        return f'mapping of {names}' if names and len(names) < 60 else 'mapping'
    words = {'null': '`null`', 'boolean': '`true` or `false`', 'string': 'text', 'any': ''}
    return words.get(kind, 'number' if kind in ('integer', 'number') else kind)


# ---------------------------------------------------------------------------------------- joints


def joint_types() -> str:
    """Every type of joint, from its file."""
    names = list(dict.fromkeys([*joints.types(2), *joints.types(3)]))
    rows = [
        (f'[`{name}`](#{name})', *('yes' if joints.find(name, D) else '' for D in _SPACES))
        for name in names
    ]
    parts = [
        '# Joints',
        f'A joint is between two bodies, or the ground and a body.{_MADE} '
        '[scene_format.md](../scene_format.md) has examples.',
        table(('type', *_SPACES.values()), rows),
    ]
    for name in names:
        parts += [f'## {name}', paragraphs(_without_name(_docstring(joints, name), name))]
        found = {D: joints.find(name, D) for D in _SPACES}
        for D, each in found.items():
            if each is not None:
                parts += [
                    f'**{_SPACES[D].capitalize()}.** {_coordinates(each)}',
                    _joint_keys(each),
                ]
    return '\n\n'.join(parts) + '\n'


def _coordinates(found: JointType) -> str:
    if not found.freedoms:
        return 'It has no joint coordinate.'
    said = [
        f'{"an angle (rad)" if each.is_angle else "a length (m)"}'
        + (f', `<name>{each.suffix}`' if each.suffix else '')
        for each in found.freedoms
    ]
    what = 'coordinates' if len(said) > 1 else 'coordinate'
    return f'Joint {what}: {"; ".join(said)}.'


def _joint_keys(found: JointType) -> str:
    rows = [(f'`{key.name}`', 'required', markdown(key.doc)) for key in found.keys]
    rows += [(f'`{key.name}`', '', markdown(key.doc)) for key in found.optional]
    return table(('key', 'default', 'meaning'), rows)


# --------------------------------------------------------------------------------------- effects


def effect_kinds() -> str:
    """Every effect, from its file."""
    parts = [
        '# List of effects',
        f'Forces that a scene may name.{_MADE} [effects.md](../effects.md) explains their use, '
        'and how to write one.',
        table(
            ('effect', 'several', 'what it is'),
            [
                (
                    f'[`{kind}`](#{kind})',
                    'yes' if effects.load(kind).MULTIPLE else '',
                    markdown(_summary(_without_name(_docstring(effects, kind), kind))),
                )
                for kind in effects.own()
            ],
        ),
    ]
    for kind in effects.own():
        text = _without_name(_docstring(effects, kind), kind)
        parts += [f'## {kind}', paragraphs(text), _parameters(kind)]
    return '\n\n'.join(parts) + '\n'


def _parameters(kind: str) -> str:
    rows = []
    for field in dataclasses.fields(effects.load(kind).Parameters):
        about = field.metadata
        choices = ', '.join(f'`{each}`' for each in about.get('choices', ()))
        unit = markdown(about.get('unit', ''))
        rows.append(
            (
                f'`{field.name}`',
                choices or about['kind'],
                unit,
                _initial(field),
                markdown(about['doc']),
            )
        )
    return table(('key', 'value', 'unit', 'default', 'meaning'), rows)


def _initial(field: dataclasses.Field[Any]) -> str:
    if field.default is dataclasses.MISSING:
        return 'required' if field.default_factory is dataclasses.MISSING else ''
    if field.default is None or isinstance(field.default, tuple):
        return ''
    return f'`{field.default}`'


def _docstring(package: Any, name: str) -> str:
    """The docstring of a file of a package, unchanged."""
    module = importlib.import_module(f'{package.__name__}.{name}')
    return ast.get_docstring(ast.parse(Path(str(module.__file__)).read_text('utf-8'))) or ''


def _without_name(text: str, name: str) -> str:
    start, colon, rest = text.partition(':')
    if not (colon and name in start and len(start) < len(name) + 4):
        return text
    rest = rest.strip()
    return rest[:1].upper() + rest[1:]


def _summary(text: str) -> str:
    return ' '.join(text.partition('\n\n')[0].split())
