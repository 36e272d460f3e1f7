"""A scene with some of its values changed by name, as a command line says them.

`coupler.mass=1.1` is a field of a body, joint, point, vector, coupling, effect or the solver of
that name, of several things the one that has the field; `L=1.2` a parameter of the mechanism;
`drives.crane.angle=0.1*t` a motion, of the scene or of the mechanism. Anything can be said in
full, as the scene's text has it: `mechanism.bodies.coupler.mass`, `effects.spring.0.stiffness`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache

import numpy as np

from alf_ros import effects
from alf_ros.columns import ColumnText
from alf_ros.errors import InputError
from alf_ros.scene.absent_sections import with_sections
from alf_ros.scene.input_effects import input_effect, refuse_input, refuse_malformed
from alf_ros.scene.joint_states import refuse_joint_state
from alf_ros.scene.mechanism_file import read_parameters
from alf_ros.scene.rereading import reading_of
from alf_ros.scene.scene import PICKED, Scene, load_scene
from alf_ros.scene.target_numbers import place_of_target
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry

_NUMBER = re.compile(r'-?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?')  # as Python prints it
_INDEX = re.compile('0|[1-9][0-9]*')  # one spelling: a place has one name
_TIME = re.compile(r'\bt\b')
_RIVALS = {'accuracy': PICKED, **dict.fromkeys(PICKED, ('accuracy',))}
_OF_NODES = ('sensors', 'diff_drive')  # sections
_PARTS = ('bodies', 'joints', 'points', 'vectors', 'couplings', 'parameters')


def read(assignments: Sequence[str], option: str = '--set') -> dict[str, str]:
    """`NAME=VALUE` texts of an option as a mapping. Raises InputError."""
    found: dict[str, str] = {}
    for text in assignments:
        name, given, value = text.partition('=')
        if not given or not name or not value.strip():
            raise InputError('not a change', key=option, value=text, expected='NAME=VALUE')
        if name.strip() in found:
            raise InputError('given twice', key=option, value=name.strip(), expected='it once')
        found[name.strip()] = value.strip()
    return found


def with_changes(scene: Scene, changes: Mapping[str, str], prefix: str = '--set ') -> Scene:
    """The scene with other values, YAML as in a scene file. Raises InputError for an unknown name,
    or a value that cannot be there; its message gives the name of the change after
    `prefix`."""
    if not changes:
        return scene
    scene = with_inputs(scene, changes, prefix)
    sources = [f'{prefix}{name}' for name in changes]
    try:
        values = {
            name: _value(text, source)
            for (name, text), source in zip(changes.items(), sources, strict=True)
        }
        root = _with_values(scene, values, prefix)
        again = reading_of(scene.document).again(root, scene.file)
        changed = again or dataclasses.replace(load_scene(root.mapping()), file=scene.file)
    except InputError as error:
        if error.file not in sources:
            raise
        # the text of a change is no file with lines and keys
        raise error.about(error.file) from None
    return changed


def with_inputs(scene: Scene, names: Collection[str], prefix: str = '') -> Scene:
    """The scene with an effect of zero for each of the names that is of an effort or a wrench, and
    of no number of the scene. Raises InputError, about the name after `prefix`, for a joint or a
    body that it does not have, and for an input that cannot act there."""
    root, added = scene.document.root, {}
    for name in names:
        effect = input_effect(name, root)
        if effect is None or effect.is_in(root) or _has(root, name):
            continue
        root, added[name] = effect.added_to(root, name), effect
    if not added:
        return scene
    pushed = root  # a torque of zero acts everywhere, another one only on what turns
    for name, effect in added.items():
        pushed = _replaced(pushed, effect.place, Entry('1', name), name)
    try:
        load_scene(pushed.mapping())
        return dataclasses.replace(load_scene(root.mapping()), file=scene.file)
    except InputError as error:
        for name, effect in added.items():
            place = '.'.join(effect.place[:3])
            if error.file == name or place == '.'.join((error.key or '').split('.')[:3]):
                raise error.about(f'{prefix}{name}') from None
        raise


def _has(root: Entry, name: str) -> bool:
    try:
        _place(root, name, '')
    except InputError:
        return False
    return True


def of_members(scene: Scene, changes: Sequence[Mapping[str, str]]) -> Scene | None:
    """`with_changes` of many members at once, whose numbers are columns (`alf_ros.columns`); None
    where something else than numbers differs.

    Raises Divided where the members differ in more than numbers; InputError, ArithmeticError,
    TypeError and ValueError where some of them cannot be read, or all only one by one.
    """
    values: dict[str, Entry] = {}
    for name, first in changes[0].items():
        texts = [each[name] for each in changes]
        if texts.count(first) == len(texts):
            values[name] = _value(first, name)
        elif all(map(_NUMBER.fullmatch, texts)):
            values[name] = Entry(ColumnText(np.array([float(text) for text in texts])), path=name)
        else:
            return None
    root = _with_values(scene, values, 'vary.')
    return reading_of(scene.document).again(root, scene.file)


def _with_values(scene: Scene, values: Mapping[str, Entry], prefix: str) -> Entry:
    """The document of a scene with other values by name."""
    base, said = reading_of(scene.document), prefix.rstrip(' .')
    root, alike = base.root, True  # whether all names mean what they do in the scene
    given = _GivenPlaces(said)
    for name, value in values.items():
        place = base.places.get(name) if alike else None
        if place is None:
            place = _place(root, name, said)
            if alike:
                base.places[name] = place
        given.add(name, place)
        alike = alike and not isinstance(value.value, dict)
        source = f'{prefix}{name}'
        root = with_sections(_without_rivals(root, place), place, source)
        root = _replaced(root, place, value, source)
    return root


@lru_cache(maxsize=256)
def _value(text: str, source: str) -> Entry:
    """The YAML value in the text of a change. Raises InputError."""
    if _NUMBER.fullmatch(text):
        return Entry(text, source, 1, 'value')
    return yaml_document.parse(f'value: {text}', source).mapping()['value']


def number(scene: Scene, name: str, said: str = 'tangents') -> float:
    """The number of this name in a scene. Raises InputError, about the argument `said`, for an
    unknown name, and for a value that is no number."""
    root = scene.document.root
    parameters = root.mapping()['mechanism'].mapping().get('parameters')
    node, place, key = root, _place(root, name, said), f'{said}.{name}'
    if name.startswith('targets.') and 'targets' not in place and _node(root, place) is None:
        field = place[-1]
        expected = f'{".".join(place)}, as {field}: 0'
        raise InputError(f'the scene gives no {field} there', key=key, expected=expected)
    for part in place:
        node = _part(node, part, key)
    if isinstance(node.value, str):
        if 'drives' in place[:2] and _TIME.search(node.value):
            expected = 'a number, as a parameter that it names'
            raise InputError('a function of time', key=key, value=node.value, expected=expected)
        try:
            return node.number(read_parameters(parameters, {}))
        except InputError:  # the scene could be read: the value is a word
            raise InputError('not a number', key=key, value=node.value) from None
    what = 'a list' if isinstance(node.value, tuple) else 'a mapping'
    first = next(_numbers(node, name, read_parameters(parameters, {})), None)
    raise InputError('not one number', key=key, value=what, expected=first)


def _part(node: Entry, part: str, key: str) -> Entry:
    """A part of a value. Raises InputError, about `key`, if there is none of this name."""
    if isinstance(node.value, tuple):
        if _INDEX.fullmatch(part) and int(part) < len(node.value):
            return node.value[int(part)]
        raise _no_place(node.value, part, key)
    if not isinstance(node.value, dict):
        raise InputError('a single value has no parts', key=key, value=part)
    if part not in node.value:
        raise InputError('no such part', key=key, value=part, choices=node.value)
    return node.value[part]


def _no_place(items: tuple[Entry, ...], part: str, key: str) -> InputError:
    """About a place that a list does not have; an axis has the place that is meant."""
    axis = 'xyz'.find(part) if part else -1
    expected = f'0 to {len(items) - 1}'
    if 0 <= axis < len(items):
        expected = f'{axis} for {part}'
    return InputError('no such place in a list', key=key, value=part, expected=expected)


def _numbers(node: Entry, name: str, parameters: Mapping[str, float]) -> Iterator[str]:
    """The names of the numbers in a part of this name."""
    if isinstance(node.value, str):
        with suppress(InputError):
            node.number(parameters)
            yield name
        return
    fields = node.value.items() if isinstance(node.value, dict) else enumerate(node.value)
    for key, inner in fields:
        if key != 'alf':  # the version of a mechanism
            yield from _numbers(inner, f'{name}.{key}', parameters)


def is_target(scene: Scene, name: str) -> bool:
    """Whether a name is of what a motor or a tendon of the scene follows, as an input has it, and
    not of a part of the scene that is called `targets`."""
    return name.startswith('targets.') and number_name(scene, name) != name


def number_name(scene: Scene, name: str) -> str:
    """The name as the text of the scene has it, of a target; any other name as it is."""
    try:
        place = _place(scene.document.root, name, '')
    except InputError:
        return name
    is_alias = name.startswith('targets.') and 'targets' not in place
    return '.'.join(place) if is_alias else name


def section(scene: Scene, name: str) -> str:
    """The section of a scene that has the value of this name: 'mechanism', 'drives', 'effects',
    'initial', 'solver'. Raises InputError for an unknown name."""
    return _place(scene.document.root, name, 'name')[0]


def _place(root: Entry, name: str, said: str) -> tuple[str, ...]:
    """The keys that lead to the value."""
    first, *rest = name.split('.')
    fields = root.mapping()
    mechanism = fields['mechanism'].mapping()
    if first == 'effects' and rest and 'effects' in fields:
        return (first, *_in_effects(fields['effects'].mapping(), '.'.join(rest)))
    kinds = fields['effects'].mapping() if 'effects' in fields else ()
    files = [kind for kind in kinds if effects.short_name(kind) != kind]
    of_file = _by_file(files, name, short=False)  # which has a dot
    if of_file:
        return ('effects', *of_file)
    if first in ('mechanism', 'effects', 'initial', 'solver'):
        return (first, *rest)
    drives = _drives(fields, mechanism)
    if first == 'drives' and rest and rest[0] in drives:
        return (*drives[rest[0]], *rest[1:])
    places: dict[str, list[tuple[str, ...]]] = {}
    for part in _PARTS:
        entry = mechanism.get(part)
        for key in entry.mapping() if entry is not None else ():
            if (part == 'parameters') != bool(rest):
                places.setdefault(key, []).append(('mechanism', part, key))
    for kind, entry in fields['effects'].mapping().items() if 'effects' in fields else ():
        if rest:
            places.setdefault(effects.short_name(kind), []).append(('effects', kind))
            for key, instance in entry.value.items() if isinstance(entry.value, dict) else ():
                if isinstance(instance.value, dict):
                    places.setdefault(key, []).append(('effects', kind, key))
    found = places.get(first, [])
    if all(place[0] == 'mechanism' for place in found):
        effect = input_effect(name, root)
        if effect is not None and effect.is_in(root):
            return effect.place
        refuse_malformed(name, root, said)
        refuse_input(name, root, said)
        refuse_joint_state(name, root, said)
    target = place_of_target(name, root, said) if not found else None
    if target is not None:
        return target
    if not found and first == 'drives' and not drives:
        return (first, *rest)
    if not found and first in _OF_NODES:
        raise InputError('has no effect: only the node `simulator` has it', key=said, value=name)
    if not found and not rest:
        inside = _numbers_of_parts(root, first)
        if inside:
            raise InputError('not one value', key=said, value=first, choices=inside)
    if not found:
        known = [f'drives.{key}' for key in drives]
        if first == 'drives' and known:
            value = '.'.join((first, *rest[:1]))
            raise InputError('no such drive', key=said, value=value, choices=known)
        if first in _PARTS and rest and rest[0] in places:
            known, places = ['.'.join(('mechanism', first, rest[0]))], {}
        choices = [f'drives.{first}'] if first in drives else [*places, *known]
        raise InputError('nothing of this name', key=said, value=first, choices=choices)
    if len(found) > 1:
        found = _that_have(root, found, rest, said, name)
    return (*found[0], *rest)


def _in_effects(kinds: Iterable[str], name: str) -> tuple[str, ...]:
    """The keys that lead to a value of an effect. Names of files have dots, and the text of a
    scene has their digest too."""
    return _by_file(kinds, name, True) or tuple(name.split('.'))


def _by_file(kinds: Iterable[str], name: str, short: bool) -> tuple[str, ...]:
    """The keys that lead to a value of one of the effects, if the name begins with a kind or its
    file, or `short`, with the name that the file gives to the effect; else none."""
    for kind in kinds:
        path = kind.partition('#')[0]
        ways = [kind, path, path.rpartition('/')[2]]
        for way in (*ways, effects.short_name(kind)) if short else ways:
            if name == way:
                return (kind,)
            if name.startswith(f'{way}.'):
                return (kind, *name[len(way) + 1 :].split('.'))
    return ()


def _that_have(
    root: Entry, found: list[tuple[str, ...]], rest: Sequence[str], said: str, name: str
) -> list[tuple[str, ...]]:
    """The one of several places of a name that has the rest of it. Raises InputError.

    A field that the scene gives comes before the defaults of effects.
    """
    having = [place for place in found if _node(root, (*place, *rest)) is not None]
    having = having or [place for place in found if _is_default(place, rest)]
    if len(having) == 1:
        return having
    if having:
        ways = ' or '.join('.'.join((*place, *rest)) for place in having)
        raise InputError('several things of this name', key=said, value=name, expected=ways)
    parameters = read_parameters(root.mapping()['mechanism'].mapping().get('parameters'), {})
    known = []
    for place in found:
        node = _node(root, place)
        known += list(_numbers(node, '.'.join(place), parameters)) if node is not None else []
    raise InputError('nothing of this name has that', key=said, value=name, choices=known)


def _node(root: Entry, place: Sequence[str]) -> Entry | None:
    """The part of a scene at a place, if it has one."""
    node = root
    try:
        for part in place:
            node = _part(node, part, '')
    except InputError:
        return None
    return node


def _is_default(place: tuple[str, ...], rest: Sequence[str]) -> bool:
    """Whether an effect of the package has this field, whatever the scene says about it."""
    if place[0] != 'effects' or place[1] not in effects.own():
        return False
    fields = dataclasses.fields(effects.load(place[1]).Parameters)
    return rest[0] in {field.name for field in fields}


def _numbers_of_parts(root: Entry, name: str) -> list[str]:
    """The names of the numbers in the parts and effects of a name."""
    fields = root.mapping()
    mechanism = fields['mechanism'].mapping()
    parts = [mechanism[part].mapping().get(name) for part in _PARTS[:-1] if part in mechanism]
    for kind, entry in fields['effects'].mapping().items() if 'effects' in fields else ():
        if effects.short_name(kind) == name:
            parts.append(entry)
        elif isinstance(entry.value, dict):
            parts.append(entry.value.get(name))
    parameters = read_parameters(mechanism.get('parameters'), {})
    return [each for part in parts if part for each in _numbers(part, name, parameters)]


def _drives(
    fields: Mapping[str, Entry], mechanism: Mapping[str, Entry]
) -> dict[str, tuple[str, ...]]:
    """Where the drives of a scene are by name: in its own section, or in its mechanism."""
    found: dict[str, tuple[str, ...]] = {}
    if 'drives' in mechanism:
        found |= {key: ('mechanism', 'drives', key) for key in mechanism['drives'].mapping()}
    if 'drives' in fields:
        found |= {key: ('drives', key) for key in fields['drives'].mapping()}
    return found


class _GivenPlaces:
    """The places of values that are given together: none within another one, and no rivals, since
    the order of names would decide which one counts."""

    def __init__(self, said: str) -> None:
        self._said = said
        self._names: dict[tuple[str, ...], str] = {}  # that are given at a place or below it
        self._whole: set[tuple[str, ...]] = set()

    def add(self, name: str, place: tuple[str, ...]) -> None:
        """Raises InputError for a name whose value is given already."""
        other = self._names.get(place)
        above = [place[:n] for n in range(1, len(place) + 1)]
        for each in above:
            if each in self._whole:
                other = self._names[each]
        if other is not None:
            raise InputError(f'given twice, also by {other}', key=self._said, value=name)
        for rival in _RIVALS.get(place[-1], ()) if place[0] == 'solver' else ():
            if ('solver', rival) in self._names:
                rest = f'has no meaning beside {self._names["solver", rival]}'
                raise InputError(rest, key=self._said, value=name)
        self._whole.add(place)
        self._names.update(dict.fromkeys(above, name))


def _without_rivals(root: Entry, place: tuple[str, ...]) -> Entry:
    """The scene without what an accuracy that is set would pick, or the other way round."""
    if place[0] != 'solver' or place[-1] not in _RIVALS or 'solver' not in root.mapping():
        return root
    section, against = root.mapping()['solver'], _RIVALS[place[-1]]
    fields = section.mapping()
    if fields.keys().isdisjoint(against):
        return root
    kept = {k: v for k, v in fields.items() if k not in against}
    return root.having({**root.mapping(), 'solver': section.having(kept)})


def _replaced(node: Entry, place: Sequence[str], value: Entry, said: str) -> Entry:
    """The node with what stands at `place` replaced; errors are about `said`."""
    if not place:
        return value
    key, *rest = place
    if isinstance(node.value, tuple):
        if not _INDEX.fullmatch(key) or int(key) >= len(node.value):
            raise _no_place(node.value, key, said)
        items = list(node.value)
        items[int(key)] = _replaced(items[int(key)], rest, value, said)
        return node.having(tuple(items))
    if not (node.is_null or isinstance(node.value, dict)):
        raise InputError('a single value has no parts', key=said, value=key)
    fields = node.mapping()
    if key not in fields and rest:
        raise InputError('no such part', key=said, value=key, choices=fields)
    inner = _replaced(fields[key], rest, value, said) if key in fields else value
    return node.having({**fields, key: inner})
