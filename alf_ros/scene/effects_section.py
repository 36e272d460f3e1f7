"""The effects of a scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import ModuleType

from alf_ros import effects
from alf_ros.effects import Effect
from alf_ros.effects.contract import user_file
from alf_ros.errors import InputError
from alf_ros.mechanism import Mechanism, Rotor, natural_coordinates
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.rotors import rotor_rows
from alf_ros.scene.parameter_reader import ParameterReader, instances
from alf_ros.scene.references import References
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry as as_entry

_NOTHING = Entry('')


def read_effects(
    section: Entry,
    cut: Layout,
    numbers: Mapping[str, float],
    references: References,
    known: Sequence[tuple[Entry, Effect]] = (),
) -> tuple[tuple[Effect, ...], Entry]:
    """The effects in a section, on a mechanism cut, and the section without references to files
    of numbers, files of effects named in full. Raises InputError.

    `known`: effects that were read before, on the same mechanism with the same numbers, each with
    its entry; where this entry stands again, so does the effect.
    """
    reader = ParameterReader(cut.mechanism, numbers, references)
    before = {(id(entry), effect.kind, effect.name): effect for entry, effect in known}
    found: list[Effect] = []
    labels: set[str] = set()
    whole: dict[str, Entry] = {}
    for key, entry in section.mapping().items():
        kind, module = _module(key, entry, references)
        if kind in whole:
            raise entry.error('another path to an effect that is named above', value=key)
        one_of = getattr(module, 'ONE_OF', ())
        for name, instance in _instances(kind, module, entry):
            effect = before.get((id(instance), kind, name))
            if effect is None:
                values = reader.parameters(instance, module.Parameters)
                effect = _effect(kind, name, values, cut, instance)
            if effect.label in labels:  # which powers, works and loads are called by
                raise instance.error('another effect has this name', value=effect.label)
            labels.add(effect.label)
            if one_of and all(instance.mapping().get(key, _NOTHING).is_null for key in one_of):
                raise instance.error('has no effect', expected=f'one of {", ".join(one_of)}')
            found.append(effect)
        whole[kind] = reader.tables.without_files(entry)
    return tuple(found), as_entry(whole)


def effect_entries(section: Entry) -> list[Entry]:
    """The entry of each effect in a section that was read, in the order of the effects."""
    found = []
    for key, entry in section.mapping().items():
        kind, module = _module(key, entry, References())
        found += [instance for _, instance in _instances(kind, module, entry)]
    return found


def _instances(kind: str, module: ModuleType, entry: Entry) -> list[tuple[str, Entry]]:
    return instances(effects.short_name(kind), entry, module.Parameters, module.MULTIPLE)


def _effect(
    kind: str, name: str, values: Mapping[str, object], cut: Layout, instance: Entry
) -> Effect:
    """An effect that fits the mechanism. Raises InputError: with the line of the scene about what
    it says, with the line of the effect if its file fails."""
    module = effects.load(kind)
    try:
        effect = Effect(kind, name, module.Parameters(**values))
        packed = module.pack([effect], cut)
    except ValueError as error:
        raise _error(instance, str(error)) from None
    except Exception as error:  # whatever somebody's file raises
        if kind in effects.own():
            raise
        raise user_file.failure(error, module.__file__ or kind) from None
    user_file.check_packed(packed, module.__file__ or kind)
    return effect


def _error(instance: Entry, message: str) -> InputError:
    """At the key with which the message begins, if the instance has that."""
    key, _, rest = message.partition(' ')
    entry = instance.mapping().get(key.rstrip(':'))
    if entry is None:
        return instance.error(message)
    return entry.error(rest if key.endswith(':') else message)


def fit(found: Sequence[Effect], cut: Layout) -> bool:
    """Whether effects that were read before fit a mechanism, cut, that has other numbers."""
    try:
        for effect in found:
            effects.load(effect.kind).pack([effect], cut)
    except ValueError:
        return False
    return True


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


def with_rotors(mechanism: Mechanism, effects: Sequence[Effect]) -> Mechanism:
    """The mechanism with the rotors of those effects that have an `armature`, on a `joint` or on
    the sum of several `joints`.

    Raises InputError where none can be geared to a joint.
    """
    rotors = []
    for effect in effects:
        inertia = getattr(effect.parameters, 'armature', None)
        if inertia:  # of none, nothing: not even in the last digit
            several = getattr(effect.parameters, 'joints', None)
            of = several or ((effect.parameters.joint, 1.0),)
            moving = tuple((name, factor) for name, factor in of if factor)
            rotors.append(Rotor(f'{effect.label}.rotor', moving, inertia))
    if not rotors:
        return mechanism
    whole = dataclasses.replace(mechanism, rotors=tuple(rotors))
    for rotor in rotors:
        try:
            list(rotor_rows(rotor, natural_coordinates.cut(whole)))
        except ValueError as error:
            raise InputError(str(error), key=f'effects.{rotor.name.rpartition(".")[0]}') from None
    return whole
