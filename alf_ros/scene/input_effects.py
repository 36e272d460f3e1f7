"""Inputs from outside as numbers of a scene.

`joints.knee.effort` and `wrenches.B.force.x` are held from outside, so a scene has no number of
them. Changed by these names, it gets an effect in their place: `knee_effort`, a `joint_effort`, or
`B_force`, a `constant_wrench`. Its numbers add to the inputs that are held.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from alf_ros import effects
from alf_ros.effects.contract import EFFORT, WRENCH
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
        section = root.mapping().get('effects')
        kind = None if section is None else section.mapping().get(self.kind)
        return kind is not None and self.name in kind.mapping()

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
        joint = effort[1]
        text = f'{{joint: {joint}, effort: 0}}'
        return InputEffect(effects.ROLES[EFFORT], f'{joint}_effort', text, ('effort',))
    if wrench is None:
        return None
    space = root.mapping()['mechanism'].mapping().get('space')
    on, force, _, about = wrench.groups()
    zero = '[0, 0, 0]' if space is not None and space.value == 'spatial' else '[0, 0]'
    if force is not None:
        rest: tuple[str, ...] = ('force', str('xyz'.index(force)))
    else:
        rest = ('torque',) if about is None else ('torque', str('xyz'.index(about)))
    turning = '0' if zero == '[0, 0]' else zero
    parts = f'force: {zero}' if force is not None else f'torque: {turning}'
    return InputEffect(effects.ROLES[WRENCH], f'{on}_{rest[0]}', f'{{on: {on}, {parts}}}', rest)
