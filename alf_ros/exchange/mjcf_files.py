"""The files of an MJCF: itself, those that it includes, and models that it attaches."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from alf_ros.exchange import xml_file


def elements(path: Path) -> Iterator[ElementTree.Element]:
    """Of all these files that are there."""
    for _, element in _read(path, path.parent, set()):
        yield element


def folders(path: Path) -> list[Path]:
    """The folders of the file and of the models that it attaches, in which MuJoCo looks for their
    meshes."""
    return list(
        dict.fromkeys([path.parent, *(folder for folder, _ in _read(path, path.parent, set()))])
    )


def _read(path: Path, folder: Path, seen: set[Path]) -> Iterator[tuple[Path, ElementTree.Element]]:
    """Each element, and the folder of its model. MuJoCo looks for included files there, or beside
    the file that includes them."""
    if path in seen or not path.is_file():
        return
    seen.add(path)
    for element in xml_file.root_of(path).iter():
        yield folder, element
        file = element.get('file', '')
        if element.tag == 'include':
            for beside in dict.fromkeys([folder, path.parent]):
                yield from _read(beside / file, folder, seen)
        elif element.tag == 'model':
            yield from _read(folder / file, (folder / file).parent, seen)
