"""The files and the version that come with the package, in a source tree or installed, and where
other packages of ROS have their files."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

_HERE = Path(__file__).resolve()


def _ament_prefixes() -> list[Path]:
    entries = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in entries if entry]


def shares(package: str) -> list[Path]:
    """Return where a package of ROS has its files: none if AMENT_PREFIX_PATH lacks it."""
    folders = (prefix / 'share' / package for prefix in _ament_prefixes())
    return [share for share in folders if share.is_dir()]


def _roots() -> Iterator[Path]:
    """Yield where package.xml and config/ may lie, nearest to this code first."""
    yield _HERE.parents[1]
    # <prefix>/lib/pythonX.Y/site-packages/alf_ros: also finds pip's --user and --prefix.
    prefixes = [_HERE.parents[1], _HERE.parents[min(4, len(_HERE.parents) - 1)]]
    for prefix in [*prefixes, *_ament_prefixes(), Path(sys.prefix)]:
        yield prefix / 'share' / 'alf_ros'


def folder(kind: str) -> list[Path]:
    """Return the existing folders of `kind` ('mechanisms' or 'scenes'), in the order of the
    search.

    The source tree comes first, then the files installed beside this code, each entry of
    AMENT_PREFIX_PATH, and the prefix of the interpreter.
    """
    folders = (root / 'config' / kind for root in _roots() if (root / 'package.xml').is_file())
    return list(dict.fromkeys(path for path in folders if path.is_dir()))


def library(kind: str) -> dict[str, Path]:
    """Return what can be named, by name: the YAML files of `kind`; the first folder wins."""
    folders = reversed(folder(kind))
    return {path.stem: path for each in folders for path in sorted(each.glob('*.yaml'))}


@lru_cache(maxsize=1)
def version() -> str:
    """Return the version of the package, as package.xml states it.

    Raises RuntimeError when no package.xml came along: then config/ is missing as well.
    """
    for root in _roots():
        if (root / 'package.xml').is_file():
            return ElementTree.parse(root / 'package.xml').findtext('version', '')
    raise RuntimeError(
        f'no package.xml of alf_ros near {_HERE} or on AMENT_PREFIX_PATH: reinstall alf_ros'
    )
