"""Names that may be shortened to an end that no other name has."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from alf_ros.errors import InputError


def full_name(name: object, known: Sequence[str], key: str) -> str:
    """The quantity that a name means: the whole name, or an end of it that no other one has.

    'knee.force' is 'reactions.knee.force'. Raises InputError, which says `key`, for an end that
    several names have and for one that none has, with the nearest name.
    """
    if isinstance(name, str):
        if name in known:
            return name
        ends = [each for each in known if each.endswith(f'.{name}')]
        if len(ends) == 1:
            return ends[0]
        if ends:
            raise InputError(
                'more than one quantity ends so', key=key, value=name, expected=' or '.join(ends)
            )
    short = [each.partition('.')[2] for each in known]
    near = difflib.get_close_matches(str(name), dict.fromkeys((*short, *known)), 1, 0.5)
    if near and near[0] not in known and short.count(near[0]) > 1:
        ends = [each for each in known if each.partition('.')[2] == near[0]]
        raise InputError('no such quantity', key=key, value=name, expected=' or '.join(ends))
    choices = [each for each in short if each and short.count(each) == 1]
    raise InputError('no such quantity', key=key, value=name, choices=[*choices, *known])
