"""Parameters of effects and sensors, each read according to the metadata of its field.

`kind` of a parameter: 'number'; 'numbers', a list of them; 'vector', 2 or 3 numbers; 'spin', 1 or
3; 'boolean'; 'text', one of `choices` if the metadata has them; names: 'body', 'point', 'joint',
'coordinate' (of a joint), 'body or point'; 'pair', two bodies or points, or the ground; 'place',
the name of a point or a vector; 'places', two of them; 'path', a list of points, or of bodies or
the ground, each with a place; 'factors', a list of joint coordinates, each with a number; 'table',
a list of lists of numbers, or the name of a CSV file; 'signal', a number or a table.

`needs` of a parameter, if the metadata has it: other ones, of which one is given beside it, since
without them it has no meaning.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from alf_ros.mechanism import GROUND, Mechanism
from alf_ros.scene.references import References
from alf_ros.scene.text.number_table import Tables
from alf_ros.scene.text.yaml_document import Entry

_MISSING = dataclasses.MISSING
KINDS = (
    *('number', 'numbers', 'vector', 'spin', 'boolean', 'text', 'body', 'point', 'joint'),
    *('coordinate', 'body or point', 'pair', 'place', 'places', 'path', 'factors', 'table'),
    'signal',
)


def instances(name: str, entry: Entry, parameters: Any, multiple: bool) -> list[tuple[str, Entry]]:
    """One thing of a kind, called `name`; where `multiple` may stand, also a list or a mapping of
    names."""
    if multiple and isinstance(entry.value, tuple):
        return [(f'{name}_{i}', item) for i, item in enumerate(entry.value)]
    given = entry.mapping()
    named = [isinstance(value.value, dict) for value in given.values()]
    own = {item.name for item in dataclasses.fields(parameters)}
    # keys of one thing beside a wrong mapping: the error is about that mapping, not about the keys
    if multiple and any(named) and (all(named) or own.isdisjoint(given)):
        return list(given.items())
    return [(name, entry)]


class ParameterReader:
    """Reads parameters of effects and sensors on a mechanism.

    `numbers`: values that expressions may name. `tables` are the tables that were read.
    """

    def __init__(
        self, mechanism: Mechanism, numbers: Mapping[str, float], references: References
    ) -> None:
        points = [point.name for point in mechanism.points]
        bodies = [body.name for body in mechanism.bodies]
        self._known: dict[str, list[str]] = {
            'point': points,
            'body': bodies,
            'joint': [joint.name for joint in mechanism.joints],
            'coordinate': [coordinate.name for coordinate in mechanism.coordinates],
            'body or point': [*bodies, *points],
            'pair': [*bodies, *points, GROUND],
        }
        self._of_joint: dict[str, list[str]] = {joint: [] for joint in self._known['joint']}
        for coordinate in mechanism.coordinates:
            self._of_joint[coordinate.joint.name].append(coordinate.name)
        self._numbers, self._dimension = numbers, mechanism.dimension
        self.tables = Tables(references)

    def parameters(self, entry: Entry, parameters: Any) -> dict[str, object]:
        """The fields of a dataclass of parameters. Raises InputError."""
        fields = {item.name: item for item in dataclasses.fields(parameters)}
        required = [
            name
            for name, f in fields.items()
            if f.default is _MISSING and f.default_factory is _MISSING
        ]
        values: dict[str, object] = {}
        entries = entry.mapping(fields, required)
        given = {key for key, value in entries.items() if not value.is_null}
        for key, value in entries.items():
            if value.is_null and fields[key].default is None:
                values[key] = None
            else:
                values[key] = self._value(value, fields[key].metadata)
                needs = fields[key].metadata.get('needs', ())
                if needs and given.isdisjoint(needs):
                    wanted = f'{" or ".join(needs)} beside it'
                    raise value.error('has no meaning here', expected=wanted)
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
        if kind == 'path':
            return tuple(self._station(item) for item in entry.sequence())
        if kind == 'coordinate':
            return self._coordinate(entry)
        if kind == 'factors':
            return tuple(self._factor(item) for item in entry.sequence())
        if kind == 'numbers':
            return tuple(item.number(numbers) for item in entry.sequence())
        if kind == 'table' or (kind == 'signal' and self._is_table(entry)):
            return self.tables.table(entry, numbers)
        if kind == 'signal':
            return entry.number(numbers)
        if kind != 'text' and kind not in self._known:
            raise entry.error('a parameter of no kind', value=kind, choices=KINDS)
        return entry.text(self._known.get(kind, about.get('choices')))

    def _station(self, entry: Entry) -> tuple[str, str | tuple[float, ...] | None]:
        """A name, or a name and a place."""
        if isinstance(entry.value, str):
            return entry.text(self._known['pair']), None
        name, where = entry.sequence(2)
        return name.text(self._known['pair']), self._place(where)

    def _factor(self, entry: Entry) -> tuple[str, float]:
        name, factor = entry.sequence(2)
        return self._coordinate(name), factor.number(self._numbers)

    def _coordinate(self, entry: Entry) -> str:
        """A joint coordinate. The name of a joint is one only if the joint has a single one."""
        own = self._of_joint.get(name := entry.text(), [name])
        if not own:
            raise entry.error('a joint without a coordinate')
        if name not in own:
            raise entry.error('a joint with several coordinates', expected=' or '.join(own))
        return entry.text(self._known['coordinate'])

    def _place(self, entry: Entry) -> str | tuple[float, ...] | None:
        if entry.is_null:
            return None
        if isinstance(entry.value, str):
            return entry.text(self._known['point'])
        return entry.vector(self._dimension, self._numbers)

    @staticmethod
    def _is_table(entry: Entry) -> bool:
        return not isinstance(entry.value, str) or entry.value.endswith('.csv')
