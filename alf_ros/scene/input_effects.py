"""Inputs from outside as numbers of a scene.

`joints.knee.effort` and `wrenches.B.force.x` are held from outside, so a scene has no number of
them. Changed by these names, it gets an effect in their place: `knee_effort`, a `joint_effort`, or
`B_force`, a `constant_wrench`. Its numbers add to the inputs that are held.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import chain, count
from typing import NamedTuple

from alf_ros import effects
from alf_ros.effects.contract import EFFORT, WRENCH
from alf_ros.errors import InputError
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry

_EFFORT = re.compile(r'joints\.(.+)\.effort')
_WRENCH = re.compile(r'wrenches\.(.+)\.(?:force\.([xyz])|(torque)(?:\.([xyz]))?)')


class InputEffect(NamedTuple):
    """The effect in place of an input: its kind, its name, its parameters as YAML, and the keys
    that lead to the number in these."""

    kind: str
    name: str
    text: str
    rest: tuple[str, ...]

    @property
    def place(self) -> tuple[str, ...]:
        """The keys that lead to the number in a scene."""
        return ('effects', self.kind, self.name, *self.rest)

    def is_in(self, root: Entry) -> bool:
        """Whether a scene has it."""
        return self.name in _named(root, self.kind)

    def added_to(self, root: Entry, source: str) -> Entry:
        """The scene with it; errors say the source."""
        fields = root.mapping()
        section = fields.get('effects', Entry({}))
        kinds = section.mapping()
        kind = kinds.get(self.kind, Entry({}))
        own = yaml_document.parse(f'value: {self.text}', source).mapping()['value']
        changed = kind.having({**kind.mapping(), self.name: own})
        return root.having({**fields, 'effects': section.having({**kinds, self.kind: changed})})


def input_effect(name: str, root: Entry) -> InputEffect | None:
    """The effect in place of the input of a name; None for another name."""
    effort, wrench = _EFFORT.fullmatch(name), _WRENCH.fullmatch(name)
    if effort is not None:
        return _effect(root, effects.ROLES[EFFORT], {'joint': effort[1], 'effort': '0'}, ())
    if wrench is None:
        return None
    is_spatial = _is_spatial(root)
    on, force, _, about = wrench.groups()
    axis = force or about
    what = 'torque' if force is None else 'force'
    if is_spatial and axis is None:
        return None  # a torque in space has three axes
    if not is_spatial and (force == 'z' or about is not None):
        return None  # a force in the plane has two, and its torque none
    zero = '[0, 0, 0]' if is_spatial else '[0, 0]' if what == 'force' else '0'
    rest = () if axis is None else (str('xyz'.index(axis)),)
    return _effect(root, effects.ROLES[WRENCH], {'on': on, what: zero}, rest)


def refuse_malformed(name: str, root: Entry, said: str) -> None:
    """Raise InputError, about the argument `said`, for a name that begins as an input does and is
    of none: with steps, in which a scene has no number of it, and for a wrench without these parts
    on a body or a point."""
    whole, steps, _ = name.partition('[')
    first, _, rest = whole.partition('.')
    if first in ('joints', 'wrenches', 'targets') and steps:
        what = 'acts in some of the steps: a scene has no number of it'
        expected = f'{whole}, which acts in the whole run'
        raise InputError(what, key=said, value=name, expected=expected)
    on, mechanism = rest.partition('.')[0], root.mapping()['mechanism'].mapping()
    owners = [part for part in ('points', 'bodies') if part in mechanism]
    if first != 'wrenches' or not any(on in mechanism[part].mapping() for part in owners):
        return
    ends = ['force.x', 'force.y', *['force.z'] * _is_spatial(root)]
    if 'bodies' in owners and on in mechanism['bodies'].mapping():
        ends += [f'torque.{axis}' for axis in 'xyz'] if _is_spatial(root) else ['torque']
    if rest.removeprefix(f'{on}.') not in ends:
        choices = [f'wrenches.{on}.{end}' for end in ends]
        raise InputError('no such input', key=said, value=name, choices=choices)


def refuse_input(name: str, root: Entry, said: str) -> None:
    """Raise InputError for the name of an input, which is held from outside: a scene has a number
    of it only as an effect."""
    first, _, rest = name.partition('.')
    mechanism = root.mapping()['mechanism'].mapping()
    joints = mechanism['joints'].mapping() if 'joints' in mechanism else {}
    if first == 'wrenches' and rest:
        effect = f'constant_wrench: {{push: {{on: {rest.partition(".")[0]}, force: …}}}}'
        number = 'push.force.0'
    elif name.endswith('.effort') and (first == 'joints' or name[:-7] in joints):
        if first != 'joints':
            expected = f'joints.{name}'
            raise InputError('nothing of this name', key=said, value=name, expected=expected)
        joint = rest[:-7]
        effect, number = f'joint_effort: {{push: {{joint: {joint}, effort: 0}}}}', 'push.effort'
    else:
        return
    expected = f'an effect in its place, {effect}, which has the number {number}'
    raise InputError('an input from outside is no number', key=said, value=name, expected=expected)


def _is_spatial(root: Entry) -> bool:
    space = root.mapping()['mechanism'].mapping().get('space')
    return space is not None and space.value == 'spatial'


def _effect(
    root: Entry, kind: str, given: Mapping[str, str], rest: tuple[str, ...]
) -> InputEffect:
    """An effect of these fields: where it acts, and its value. Its name is free, or the one of an
    effect with the same fields there, as of an input that was changed before."""
    (where, at), (what, _) = given.items()
    base, own = f'{at}_{what}', _named(root, kind)
    taken = {name for each in _kinds(root) for name in _named(root, each)}
    for name in chain([base], (f'{base}_{n}' for n in count(2))):
        fields = own[name].mapping() if name in own else {}
        made = fields.keys() == given.keys() and fields[where].value == at
        if made or name not in taken:
            break
    text = ', '.join(f'{key}: {value}' for key, value in given.items())
    return InputEffect(kind, name, f'{{{text}}}', (what, *rest))


def _kinds(root: Entry) -> Mapping[str, Entry]:
    section = root.mapping().get('effects')
    return {} if section is None else section.mapping()


def _named(root: Entry, kind: str) -> Mapping[str, Entry]:
    """The effects of a kind that have names."""
    entry = _kinds(root).get(kind)
    named = entry.mapping() if entry is not None and isinstance(entry.value, dict) else {}
    return {name: each for name, each in named.items() if isinstance(each.value, dict)}
