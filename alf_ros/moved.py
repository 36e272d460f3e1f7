"""Gives the new name of a module that was documented under another name.

Effects and programs of users import some modules by name. Without this the error would only state
that the module does not exist.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType

_NOW = {
    'alf_ros.fork': 'alf_ros.ros.recording.fork',
    'alf_ros.logs.export': 'alf_ros.logs.tables',
    'alf_ros.measure': 'alf_ros.effects.contract.scalars',
    'alf_ros.table': 'alf_ros.effects.contract.piecewise',
}


class _Moved:
    """Finds nothing: it is asked where everybody else has failed."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> None:
        if name in _NOW:
            raise ModuleNotFoundError(f'{name} has moved: it is {_NOW[name]} now', name=name)


def announce() -> None:
    """Have the import system ask."""
    if _Moved not in sys.meta_path:
        sys.meta_path.append(_Moved)
