"""The XML of a robot file, whatever stands in it: xacro expanded, prefixes without declaration.

Many files use prefixes (`gazebo:`, `sensor:`, `body:`) that they do not declare. What such
elements say is none of ours, so they get a declaration and are listed as what they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.exchange import xacro_file
from alf_ros.scene.text.yaml_document import LARGEST_FILE

XACRO = 'http://www.ros.org/wiki/xacro'
_USED = re.compile(rb'[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s/>=])')
_COMMENT = re.compile(rb'<!--.*?-->', re.DOTALL)
_ROOT = re.compile(rb'<[A-Za-z_][\w.-]*(?=[\s/>])')


def kind_of(path: Path) -> str:
    """The name of the first element of a file, `mujoco`, `sdf` or `robot`; '' if there is none."""
    bare = _COMMENT.sub(b'', paths.content(path, LARGEST_FILE))
    root = _ROOT.search(bare)
    return '' if root is None else root[0][1:].decode('ascii', 'replace')


def root_of(path: Path, arguments: Mapping[str, str] | None = None) -> ElementTree.Element:
    """The root element of a file; of a xacro what it expands to with `arguments`.

    Raises InputError.
    """
    root = _parsed(paths.content(path, LARGEST_FILE), path)
    if _is_xacro(root, path):
        return _parsed(xacro_file.expanded(path, arguments or {}), path)
    if arguments:
        raise InputError('for xacro only', key='--argument', value=next(iter(arguments)))
    return root


def _parsed(text: bytes, path: Path) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(_declared(text))
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f'not XML: {error}', file=str(path)) from None


def _declared(text: bytes) -> bytes:
    """The text, with a declaration in its root for each prefix that has none."""
    used = {prefix for prefix in _USED.findall(text) if not prefix.startswith(b'xml')}
    missing = sorted(p for p in used if not re.search(rb'\sxmlns:' + p + rb'\s*=', text))
    bare = _COMMENT.sub(lambda found: b' ' * len(found[0]), text)
    root = _ROOT.search(bare)
    if not missing or root is None:
        return text
    more = b''.join(b' xmlns:%b="undeclared:%b"' % (prefix, prefix) for prefix in missing)
    return text[: root.end()] + more + text[root.end() :]


def line_of(element: ElementTree.Element, root: ElementTree.Element, path: Path) -> int | None:
    """The line on which an element of `root_of` begins; None for a xacro, which is expanded."""
    if _is_xacro(root, path):
        return None
    number = next((n for n, each in enumerate(root.iter()) if each is element), None)
    lines: list[int] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, attributes: lines.append(parser.CurrentLineNumber)
    parser.Parse(_declared(paths.content(path, LARGEST_FILE)), True)
    return None if number is None else lines[number]


def _is_xacro(root: ElementTree.Element, path: Path) -> bool:
    return path.suffix == '.xacro' or root.find(f'.//{{{XACRO}}}*') is not None
