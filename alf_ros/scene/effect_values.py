"""Numbers of a scene's effects by name, and the scene with other ones.

A number is called `effects.<kind>.<field>`, or `effects.<kind>.<instance>.<field>` where a scene
names the effect several times. What an effect acts on is structure and has no such name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from alf_ros.effects import Effect
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene, whole_scene
from alf_ros.scene.text.yaml_document import Entry


@dataclass(frozen=True)
class EffectValue:
    """One field of an effect: a float, a list of floats (vector) or a bool; `doc` with its
    unit."""

    name: str
    effect: Effect
    field: str
    value: Any
    doc: str


def effect_values(scene: Scene) -> dict[str, EffectValue]:
    """All numbers, vectors and switches of the scene's effects, by name."""
    return {found.name: found for effect in scene.effects for found in _values(effect)}


def _values(effect: Effect) -> Iterator[EffectValue]:
    for field in dataclasses.fields(effect.parameters):
        value, about = _plain(getattr(effect.parameters, field.name)), field.metadata
        if value is not None:
            instance = '' if effect.name == effect.kind else f'{effect.name}.'
            name = f'effects.{effect.kind}.{instance}{field.name}'
            unit = f', {about["unit"]}' if 'unit' in about else ''
            doc = f'{effect.name}: {about.get("doc", field.name)}{unit}'
            yield EffectValue(name, effect, field.name, value, doc)


def _plain(value: object) -> bool | float | list[float] | None:
    """The value if it is a switch, a number or a vector; None for names and absent values."""
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, tuple) and value and all(isinstance(n, (int, float)) for n in value):
        return [float(number) for number in value]
    return None


def with_effect_values(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with other numbers in its effects; its text and hash say them too.

    Raises InputError for an unknown name, or a value that the effect does not take.
    """
    if not values:
        return scene
    known = effect_values(scene)
    fields = scene.document.root.mapping()
    effects: dict[str, object] = dict(fields['effects'].mapping()) if scene.effects else {}
    for name, value in values.items():
        if name not in known:
            raise InputError('no such number of an effect', value=name, choices=known)
        found = known[name]
        entry = effects[found.effect.kind]
        effects[found.effect.kind] = _replaced(entry, found, value)
    changed = whole_scene({**fields, 'effects': effects})
    return dataclasses.replace(changed, file=scene.file)


def _replaced(node: object, found: EffectValue, value: object) -> object:
    """The section of a kind with one field replaced: of a list, a mapping of names, or alone."""
    content = node.value if isinstance(node, Entry) else node
    if isinstance(content, (tuple, list)):
        index = int(found.effect.name.rpartition('_')[2])
        items = list(content)
        items[index] = _replaced(items[index], found, value)
        return items
    fields = dict(content) if isinstance(content, Mapping) else {}
    if found.effect.name in fields:
        inner = fields[found.effect.name]
        if isinstance(inner.value if isinstance(inner, Entry) else inner, Mapping):
            return {**fields, found.effect.name: _replaced(inner, found, value)}
    return {**fields, found.field: value}
