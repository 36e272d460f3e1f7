"""The effects, one file for each. An effect that the scene does not name is not imported.

Besides the files of this folder a scene may name an effect that another package registers (entry
point of the group `alf_ros.effects`, a module), or a file of its own (`my_effect.py`).
"""

from __future__ import annotations

import hashlib
import importlib
import pkgutil
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType

from alf_ros.effects import contract
from alf_ros.effects.contract import Effect, user_file
from alf_ros.errors import InputError
from alf_ros.kernel.numba_ext.cache_sources import module_digests

__all__ = [
    'ROLES',
    'Effect',
    'foreign_code',
    'held',
    'full_name',
    'kinds',
    'load',
    'origin',
    'own',
    'short_name',
]

_GROUP = 'alf_ros.effects'
# the files that pack held commands, by role (`contract`): found without importing all
ROLES = {
    contract.WRENCH: 'constant_wrench',
    contract.EFFORT: 'joint_effort',
    contract.EFFORT_OVER_TIME: 'motor',
}


@cache
def own() -> tuple[str, ...]:
    """Names of the effects in this folder. Imports no effect."""
    names = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name for name in names if name != 'contract'))


def _registered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=_GROUP)}


def kinds() -> tuple[str, ...]:
    """Names of all effects that need no path. Imports no effect."""
    return tuple(dict.fromkeys((*own(), *sorted(_registered()))))


def full_name(name: str, folder: Path | None, code: bool = True) -> str:
    """The name that means the same wherever it is read: of a file, its path and digest.

    `folder`, `code`: which files may be meant, as `user_file.full_name` says. Raises KeyError if
    there is no such effect, InputError if it is not the file that is meant, or may not run.
    """
    if user_file.is_file_name(name):
        return user_file.full_name(name, folder, code)
    if name not in own() and name not in _registered():  # a search for installed packages is slow
        raise KeyError(name)
    return name


def short_name(kind: str) -> str:
    """Name of an effect without a name of its own: for a file, the name of the file."""
    return user_file.stem(kind) if user_file.is_file_name(kind) else kind


def origin(kind: str) -> str:
    """Package, version and digest of an effect of another package; '' of one of ours or a file.

    Raises KeyError if there is none.
    """
    if user_file.is_file_name(kind) or kind in own():
        return ''
    point = _registered()[kind]
    package = f'{point.dist.name} {point.dist.version} ' if point.dist else ''
    digest = hashlib.sha256(Path(load(kind).__file__ or '').read_bytes()).hexdigest()
    return f'{package}sha256={digest}'


def foreign_code(named: Iterable[str]) -> dict[str, str]:
    """The code that these effects run besides ours and the texts of their files: `origin` of each
    one of another package, and digests of the modules that they import, unless installed."""
    found: dict[str, str] = {}
    for kind in dict.fromkeys(named):
        if kind in own():
            continue
        if not user_file.is_file_name(kind):
            found[kind] = origin(kind)
        module = load(kind)
        digests = module_digests(Path(module.__file__ or '/'), vars(module))
        found |= {f'module {name}': f'sha256={text}' for name, text in digests.items()}
    return found


def held(role: str, name: str, what: object) -> Effect:
    """A held command on a body, point or joint coordinate, as an effect."""
    kind = ROLES[role]
    return Effect(kind, name, load(kind).held(name, what))


def carried(kind: str) -> tuple[str, str]:
    """Data that an effect needs in another process: the text of its file if it is one of its own,
    and `origin` of one of another package."""
    return (user_file.source(kind), '') if user_file.is_file_name(kind) else ('', origin(kind))


def arrived(kind: str, name: str, values: Mapping[str, object], text: str, known: str) -> Effect:
    """The effect of these values from another process, with what `carried` said there.

    Raises InputError if the package of an effect is not the one it was there.
    """
    if text:
        if not user_file.is_known(kind):
            user_file.provide(kind, text)
    elif kind not in own():
        if kind not in kinds():
            raise InputError('no effect of this name here', value=kind, choices=kinds())
        if origin(kind) != known:
            raise InputError('not the version it was pickled with', value=kind, expected=known)
    return Effect(kind, name, load(kind).Parameters(**values))


@cache
def _of_package(kind: str) -> ModuleType:
    return importlib.import_module(f'{__name__}.{kind}')


def load(kind: str) -> ModuleType:
    """The module of one effect, by its full name.

    Raises KeyError if there is none, InputError if somebody else's is not what an effect is.
    """
    if kind in own():
        return _of_package(kind)
    if user_file.is_file_name(kind):
        return user_file.load(kind)
    point = _registered()[kind]
    try:
        module: ModuleType = point.load()
    except Exception as error:  # whatever somebody's package raises
        told = f'{type(error).__name__}: {error}'
        raise InputError(f'cannot be loaded from its package: {told}', value=kind) from None
    return user_file.checked(module, module.__file__ or kind)
