"""The effects of a scene: every parameter is read according to its metadata.

`kind` of a parameter: 'number'; 'vector', 2 or 3 numbers; 'spin', 1 or 3; 'boolean'; 'text', one
of `choices` if the metadata has them; names: 'body', 'point', 'joint', 'coordinate' (of a joint),
'body or point'; 'pair', two bodies or points, or the ground; 'place', the name of a point or a
vector; 'places', two of them; 'table', a list of lists of numbers, or the name of a CSV file;
'signal', a number or a table.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from types import ModuleType
from typing import Any

from alf_ros import effects
from alf_ros.effects import Effect
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND, Mechanism, Rotor, natural_coordinates
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.rotors import rotor_rows
from alf_ros.scene.references import References
from alf_ros.scene.text.number_table import Tables
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry as as_entry

Names = Mapping[str, Collection[str]]
_MISSING = dataclasses.MISSING


def read_effects(
    section: Entry, cut: Layout, numbers: Mapping[str, float], references: References
) -> tuple[tuple[Effect, ...], Entry]:
    """The effects in a section, on a mechanism cut, and the section without references to files
    of numbers, files of effects named in full. Raises InputError.
    """
    mechanism = cut.mechanism
    points = [point.name for point in mechanism.points]
    bodies = [body.name for body in mechanism.bodies]
    known = {
        'point': points,
        'body': bodies,
        'joint': [joint.name for joint in mechanism.joints],
        'coordinate': [coordinate.name for coordinate in mechanism.coordinates],
        'body or point': [*bodies, *points],
        'pair': [*bodies, *points, GROUND],
    }
    reader = _Reader(known, numbers, mechanism.dimension, references)
    found: list[Effect] = []
    whole: dict[str, Entry] = {}
    for key, entry in section.mapping().items():
        kind, module = _module(key, entry, references)
        for name, instance in _instances(kind, entry, module.MULTIPLE):
            values = reader.parameters(instance, module.Parameters)
            try:
                effect = Effect(kind, name, module.Parameters(**values))
                module.pack([effect], cut)
            except ValueError as error:
                raise instance.error(str(error)) from None
            found.append(effect)
        whole[kind] = reader.tables.without_files(entry)
    return tuple(found), as_entry(whole)


def _module(key: str, entry: Entry, references: References) -> tuple[str, ModuleType]:
    """The full name of an effect, and its module."""
    try:
        kind = effects.full_name(key, references.folder, references.code)
        return kind, effects.load(kind)
    except KeyError:
        raise entry.error('unknown effect', value=key, choices=effects.kinds()) from None
    except InputError as error:
        if error.file is not None:  # of the effect
            raise
        raise entry.error(error.message, value=error.value, expected=error.expected) from None


def _instances(kind: str, entry: Entry, multiple: bool) -> list[tuple[str, Entry]]:
    """An effect that may stand several times: a list, a mapping of names, or one alone."""
    name = effects.short_name(kind)
    if multiple and isinstance(entry.value, tuple):
        return [(f'{name}_{i}', item) for i, item in enumerate(entry.value)]
    if multiple and any(isinstance(value.value, dict) for value in entry.mapping().values()):
        return list(entry.mapping().items())
    return [(name, entry)]


class _Reader:
    """Reads parameters."""

    def __init__(
        self,
        known: Names,
        numbers: Mapping[str, float],
        dimension: int,
        references: References,
    ) -> None:
        self._known, self._numbers = known, numbers
        self._dimension, self.tables = dimension, Tables(references)

    def parameters(self, entry: Entry, parameters: Any) -> dict[str, object]:
        """The fields of an effect's `Parameters`."""
        fields = {item.name: item for item in dataclasses.fields(parameters)}
        required = [
            name
            for name, f in fields.items()
            if f.default is _MISSING and f.default_factory is _MISSING
        ]
        values: dict[str, object] = {}
        for key, value in entry.mapping(fields, required).items():
            if value.is_null and fields[key].default is None:
                values[key] = None
            else:
                values[key] = self._value(value, fields[key].metadata)
        return values

    def _value(self, entry: Entry, about: Mapping[str, Any]) -> object:
        kind, D, numbers = about['kind'], self._dimension, self._numbers
        if kind == 'number':
            return entry.number(numbers)
        if kind == 'vector':
            return entry.vector(D, numbers)
        if kind == 'spin':
            return entry.number(numbers) if D == 2 else entry.vector(3, numbers)
        if kind == 'boolean':
            return entry.boolean()
        if kind == 'pair':
            return tuple(item.text(self._known['pair']) for item in entry.sequence(2))
        if kind == 'place':
            return self._place(entry)
        if kind == 'places':
            return tuple(self._place(item) for item in entry.sequence(2))
        if kind == 'table' or (kind == 'signal' and self._is_table(entry)):
            return self.tables.table(entry, numbers)
        if kind == 'signal':
            return entry.number(numbers)
        return entry.text(self._known.get(kind, about.get('choices')))

    def _place(self, entry: Entry) -> str | tuple[float, ...] | None:
        if entry.is_null:
            return None
        if isinstance(entry.value, str):
            return entry.text(self._known['point'])
        return entry.vector(self._dimension, self._numbers)

    @staticmethod
    def _is_table(entry: Entry) -> bool:
        return not isinstance(entry.value, str) or entry.value.endswith('.csv')


def with_rotors(mechanism: Mechanism, effects: Sequence[Effect]) -> Mechanism:
    """The mechanism with the rotors of those effects that have an `armature`.

    Raises InputError where none can be geared to the joint.
    """
    rotors = []
    for effect in effects:
        inertia = getattr(effect.parameters, 'armature', None)
        if inertia:  # of none, nothing: not even in the last digit
            rotors.append(Rotor(f'{effect.label}.rotor', effect.parameters.joint, inertia))
    if not rotors:
        return mechanism
    whole = dataclasses.replace(mechanism, rotors=tuple(rotors))
    for rotor in rotors:
        try:
            list(rotor_rows(rotor, natural_coordinates.cut(whole)))
        except ValueError as error:
            raise InputError(str(error), key=f'effects.{rotor.name.rpartition(".")[0]}') from None
    return whole
