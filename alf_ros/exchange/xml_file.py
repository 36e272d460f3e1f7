"""The XML of a robot file, whatever stands in it: xacro expanded, prefixes without declaration.

Many files use prefixes (`gazebo:`, `sensor:`, `body:`) that they do not declare. What such
elements say is none of ours, so they get a declaration and are listed as what they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.text.yaml_document import LARGEST, LARGEST_FILE

XACRO = 'http://www.ros.org/wiki/xacro'
_USED = re.compile(rb'[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s/>=])')
_COMMENT = re.compile(rb'<!--.*?-->', re.DOTALL)
_ROOT = re.compile(rb'<[A-Za-z_][\w.-]*(?=[\s/>])')
_TEXTS = ('name', 'link', 'joint', 'type', 'filename', 'uri')


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
    if path.suffix == '.xacro' or root.find(f'.//{{{XACRO}}}*') is not None:
        return _parsed(_expanded(path, arguments or {}), path)
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


def _expanded(path: Path, arguments: Mapping[str, str]) -> bytes:
    """A file expanded by the package xacro of ROS."""
    try:
        import xacro
    except ImportError:
        message = 'a xacro: `pip install xacro`, or run `xacro FILE > OUT.urdf` first'
        raise InputError(message, file=str(path)) from None
    try:
        document = xacro.process_file(str(path), mappings=dict(arguments))
        return bytes(document.toxml(encoding='utf-8'))
    except Exception as error:  # whatever an expression of the file raises
        message = f'xacro cannot expand it: {error or type(error).__name__}'
        if isinstance(error, ImportError):
            message = 'xacro cannot expand it: $(find ...) needs a sourced ROS 2'
        raise InputError(message, file=str(path)) from None


def check_sizes(element: ElementTree.Element, path: Path) -> None:
    """Refuse attributes that read as numbers, but cannot be computed with. Raises InputError."""
    for key, value in element.attrib.items():
        for word in value.split() if key not in _TEXTS else ():
            try:
                usable = abs(float(word)) <= LARGEST
            except ValueError:  # the parser says what should have been there
                usable = True
            if not usable:
                where = f'{element.tag} {key}'
                message = 'not a usable number'
                raise InputError(message, file=str(path), key=where, value=word)
