"""Packages of ROS around a file, of which the environment does not know: a source tree that is not
built, or a shell where no ROS is sourced."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.resources import shares
from alf_ros.scene.text.yaml_document import LARGEST_FILE

_VARIABLE = 'AMENT_PREFIX_PATH'
_NAME = re.compile('[A-Za-z][A-Za-z0-9_-]*')


def nearby_package(name: str, file: Path) -> Path | None:
    """The folder of a package around a file: one that contains the file, or one beside these with
    a package.xml. None if ROS finds the package, and if there is no such folder."""
    if not _NAME.fullmatch(name) or shares(name):
        return None
    for folder in file.absolute().parents:
        if folder.parent == folder:
            return None
        if name in (folder.name, _name_in(folder)):
            return folder
        if _name_in(folder / name) == name:
            return folder / name
    return None


def _name_in(folder: Path) -> str:
    """The name of a package by the package.xml in its folder; empty without one."""
    try:
        text = paths.content(folder / 'package.xml', LARGEST_FILE)
        found = ElementTree.fromstring(text).findtext('name')
    except (InputError, ElementTree.ParseError):
        return ''
    return (found or '').strip()


@contextmanager
def found_by_ament(packages: Mapping[str, Path]) -> Iterator[Mapping[str, Path]]:
    """Let ament find packages by name, each in its folder, until the end of the block. Yields
    where ament says they are, which is a link."""
    if not packages:
        yield {}
        return
    with tempfile.TemporaryDirectory() as prefix:
        index = Path(prefix, 'share', 'ament_index', 'resource_index', 'packages')
        index.mkdir(parents=True)
        links = {name: Path(prefix, 'share', name) for name in packages}
        for name, folder in packages.items():
            (index / name).touch()
            links[name].symlink_to(folder, target_is_directory=True)
        before = os.environ.get(_VARIABLE)
        os.environ[_VARIABLE] = os.pathsep.join(filter(None, (before, prefix)))
        try:
            yield links
        finally:
            if before is None:
                del os.environ[_VARIABLE]
            else:
                os.environ[_VARIABLE] = before
