"""Values by name, computed when asked for, and arrays that nobody changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

from alf_ros.arrays import Floats

T = TypeVar('T')


class NamedValues(Mapping[str, T], Generic[T]):
    """A mapping whose values are computed when asked for."""

    def __init__(self, names: Sequence[str], value: Callable[[int], T]) -> None:
        self._names, self._value = {name: n for n, name in enumerate(names)}, value

    def __getitem__(self, name: str) -> T:
        return self._value(self._names[name])

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
