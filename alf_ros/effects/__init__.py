"""Effects: what acts on a mechanism. A scene names them; what it does not name is not imported."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

from alf_ros.effects.contract import Effect

__all__ = ['Effect', 'kinds', 'load']


def kinds() -> tuple[str, ...]:
    """Names of all effects there are: the files of this folder, none of them imported."""
    names = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name for name in names if name != 'contract'))


def load(kind: str) -> ModuleType:
    """The module of one effect. Raises KeyError if there is no such file."""
    if kind not in kinds():
        raise KeyError(kind)
    return importlib.import_module(f'{__name__}.{kind}')
