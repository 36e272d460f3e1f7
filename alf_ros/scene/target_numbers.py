"""Targets of motors and tendons by name, as numbers of a scene.

`targets.elbow.position` is what the motor on the joint follows: its `position`, as
`servo.position`. While another target is held from outside, that one acts in its place.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

from alf_ros import effects
from alf_ros.errors import InputError
from alf_ros.scene.parameter_reader import instances
from alf_ros.scene.text.yaml_document import Entry

_NAME = re.compile(r'targets\.(.+)\.([a-z]+)')
_WHAT = ('position', 'velocity')


class _Controller(NamedTuple):
    """An effect that follows a target: the name of the target, the keys that lead to the effect,
    and what the scene says of it."""

    target: str
    place: tuple[str, ...]
    fields: dict[str, Entry]


def place_of_target(name: str, root: Entry, said: str) -> tuple[str, ...] | None:
    """The keys that lead to the number of a target; None for another name.

    Raises InputError, which says the argument `said`, if nothing follows the target, if several
    effects do, and for a target that is no number of the scene.
    """
    if not name.startswith('targets.'):
        return None
    found = _NAME.fullmatch(name)
    target, what = ('', '') if found is None else found.groups()
    known = list(_controllers(root))
    if not known:
        raise InputError(
            'no target: no motor or tendon of the scene follows one', key=said, value=name
        )
    followed = [f'targets.{each.target}.{what}' for each in known for what in _followed(each)]
    own = [each for each in known if each.target == target]
    if not own or what not in _WHAT:
        raise InputError('no such target', key=said, value=name, choices=followed)
    if len(own) > 1:
        ways = ' or '.join('.'.join((*each.place, what)) for each in own)
        raise InputError('several effects follow it', key=said, value=name, expected=ways)
    (effect,) = own
    if what not in _followed(effect):
        expected = f'an effect there with {what}_gain'
        raise InputError(f'nothing follows its {what}', key=said, value=name, expected=expected)
    return (*effect.place, what)


def _controllers(root: Entry) -> Iterator[_Controller]:
    section, mechanism = root.mapping().get('effects'), root.mapping()['mechanism'].mapping()
    joints = mechanism['joints'].mapping() if 'joints' in mechanism else {}
    for kind, entry in section.mapping().items() if section is not None else ():
        module = None
        with suppress(KeyError, InputError):
            module = effects.load(kind)
        if module is None or not hasattr(module, 'aimed'):
            continue
        short, is_list = effects.short_name(kind), isinstance(entry.value, tuple)
        each = instances(short, entry, module.Parameters, module.MULTIPLE)
        for n, (own, instance) in enumerate(each):
            inner = () if instance is entry else (str(n) if is_list else own,)
            fields = instance.mapping()
            has_joint = 'joint' in {f.name for f in dataclasses.fields(module.Parameters)}
            if not has_joint and own in joints:
                continue  # targets of this name are of the joint
            target = fields['joint'].value if has_joint and 'joint' in fields else own
            yield _Controller(str(target), ('effects', kind, *inner), fields)


def _followed(effect: _Controller) -> list[str]:
    """Position and velocity, each with a gain in the scene; 0 is one too, as it may vary."""
    given = [what for what in _WHAT if f'{what}_gain' in effect.fields]
    return [what for what in given if not effect.fields[f'{what}_gain'].is_null]
