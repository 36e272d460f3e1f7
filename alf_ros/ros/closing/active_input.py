"""The latest positions and velocities of the active joints, from JointState messages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sensor_msgs.msg import JointState

from alf_ros.errors import InputError

_LARGEST = 1e9  # rad or m: no joint is there, and none moves as far in a second


def renamed(pairs: Sequence[str], active: Sequence[str]) -> dict[str, str]:
    """The active joint of each name in messages; each pair is 'name in messages=active joint'.

    Active joints without a pair have their own name. Raises InputError.
    """
    found: dict[str, str] = {}
    for pair in pairs:
        name, given, joint = pair.partition('=')
        if not given or not name:
            raise InputError(
                'not a pair of names', key='names', value=pair, expected='name_in_messages=joint'
            )
        if joint not in active:
            raise InputError('not an active joint', key='names', value=joint, choices=active)
        if name in found or joint in found.values():
            raise InputError('renamed twice', key='names', value=pair)
        found[name] = joint
    unchanged = [joint for joint in active if joint not in found.values()]
    for joint in unchanged:
        if joint in found:  # messages could not name it
            raise InputError(
                'the name of another active joint',
                key='names',
                value=f'{joint}={found[joint]}',
                expected=f'a new name of {joint} too',
            )
    return {**{joint: joint for joint in unchanged}, **found}


class ActiveInput:
    """The values of the active joints; a joint that a message leaves out keeps its values.

    `counts`: messages, and how many of them are wrong in each way. `trouble`: the last mistake, in
    one line. `unusable`: the mistake for which the last message gave no value, or empty.
    """

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names
        self.positions: dict[str, float] = {}
        self.rates: dict[str, float] = {}
        self.counts = dict.fromkeys(
            (
                *('messages', 'unknown_names', 'repeated_names'),
                *('wrong_lengths', 'not_finite', 'times_back'),
            ),
            0,
        )
        self.trouble = self.unusable = ''

    @property
    def missing(self) -> list[str]:
        """Active joints of which nothing is known yet."""
        return [joint for joint in self._names.values() if joint not in self.positions]

    def take(self, message: JointState) -> bool:
        """Take the values of a message; whether it has a new value of an active joint.

        A message with arrays of different lengths, or with a name twice, is left out, and so is a
        value that is not finite; all are counted, and so are messages with names that are no
        active joint.
        """
        new = self._take(message)
        if new:
            self.unusable = ''
        elif message.name or message.position:  # an empty one makes no mistake
            self.unusable = self.trouble
        return new

    def _take(self, message: JointState) -> bool:
        """`take`, without the reason."""
        self.counts['messages'] += 1
        names, positions, velocities = message.name, message.position, message.velocity
        optional = {len(velocities), len(message.effort)} - {0}
        if len(positions) != len(names) or not optional <= {len(names)}:
            self._note(
                'wrong_lengths',
                f'{len(names)} names, {len(positions)} positions, {len(velocities)} velocities, '
                f'{len(message.effort)} efforts',
            )
            return False
        if len(set(names)) != len(names):  # either value could be the right one
            twice = next(name for n, name in enumerate(names) if name in names[:n])
            self._note('repeated_names', f'{twice!r} is in one message twice')
            return False
        new = False
        unknown = [name for name in names if name not in self._names]
        if unknown:
            self._note(
                'unknown_names',
                str(
                    InputError(
                        'left out, not an active joint',
                        key='name',
                        value=unknown[0],
                        choices=self._names,
                    )
                ),
            )
        for n, name in enumerate(names):
            if name not in self._names:
                continue
            joint, position = self._names[name], positions[n]
            if not (math.isfinite(position) and abs(position) < _LARGEST):
                self._note('not_finite', f'position of {name}: {position}')
                continue
            self.positions[joint], new = position, True
            self.rates.pop(joint, None)
            if velocities and abs(velocities[n]) < _LARGEST:
                self.rates[joint] = velocities[n]
            elif velocities and not math.isnan(velocities[n]):
                self._note('not_finite', f'velocity of {name}: {velocities[n]}')
        return new

    def went_back(self) -> None:
        """Count a stamp that is not later than the last one."""
        self._note('times_back', 'the stamp is not later than the last one')

    def _note(self, kind: str, text: str) -> None:
        self.counts[kind] += 1
        self.trouble = f'{kind}: {text}'
