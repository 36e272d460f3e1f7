"""Values by name, computed when asked for, and arrays that nobody changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

from alf_ros.arrays import Floats
from alf_ros.errors import UnknownNameError

T = TypeVar('T')


class NamedValues(Mapping[str, T], Generic[T]):
    """A mapping whose values are computed when asked for. An unknown name raises a KeyError, which
    has the nearest known one."""

    def __init__(self, names: Sequence[str], value: Callable[[int], T]) -> None:
        self._names, self._value = {name: n for n, name in enumerate(names)}, value

    def __getitem__(self, name: str) -> T:
        n = self._names.get(name)
        if n is None:
            raise UnknownNameError('nothing of this name', value=name, choices=self._names)
        return self._value(n)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


def read_only(array: Floats) -> Floats:
    """The array, which cannot be written any more."""
    array.flags.writeable = False
    return array
