"""The XML of a robot file, whatever stands in it: xacro expanded, prefixes without declaration.

Each element knows its file and its line.

Many files use prefixes (`gazebo:`, `sensor:`, `body:`) that they do not declare. What such
elements say is none of ours, so they get a declaration and are listed as what they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.exchange import xacro_file
from alf_ros.scene.text.yaml_document import LARGEST_FILE

# of a xacro: a declaration, whatever it says, and an element with the prefix; xacro goes by both
_XACRO = (re.compile(rb'\sxmlns:xacro\s*='), re.compile(rb'<xacro:[A-Za-z_]'))
_USED = re.compile(rb'[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=[\s/>=])')
# a comment, and a CDATA section, in which nothing is one
_TOLD = 200  # characters of an element that are told
_COMMENT = re.compile(rb'<!--.*?-->|<!\[CDATA\[.*?\]\]>', re.DOTALL)
_DECLARATION = re.compile(rb'\s*(<\?xml\b.*?\?>)', re.DOTALL)
_ENCODING = re.compile(rb'(<\?xml\b[^>]*?\sencoding\s*=\s*)("[^"]*"|\'[^\']*\')')
_NAMESPACE = re.compile(rb'\sxmlns\s*=\s*("[^"]*"|\'[^\']*\')')
_SCOPED = re.compile(rb'</?[A-Za-z_][\w.-]*(?:::[\w.-]+)+')
_ROOT = re.compile(rb'<[A-Za-z_][\w.-]*(?=[\s/>])')
# how files in UTF-16 begin, with a mark of the order of bytes or without one
_UTF_16 = {b'\xff\xfe': 'utf-16', b'\xfe\xff': 'utf-16', b'<\0': 'utf-16-le', b'\0<': 'utf-16-be'}


_DEEPEST = 200  # elements in elements


class PlacedElement(ElementTree.Element):
    """An element of a file, with the line on which it begins; None for a xacro, which is
    expanded."""

    file = ''
    line: int | None = None


def kind_of(path: Path) -> str:
    """The name of the first element of a file, `mujoco`, `sdf` or `robot`; '' if there is none."""
    bare = _COMMENT.sub(_blank, _content(path))
    root = _ROOT.search(bare)
    return '' if root is None else root[0][1:].decode('ascii', 'replace')


def root_of(path: Path, arguments: Mapping[str, str] | None = None) -> ElementTree.Element:
    """The root element of a file; of a xacro what it expands to with `arguments`.

    Raises InputError.
    """
    text = _content(path)
    root = _parsed(text, path)
    if _is_xacro(text, path):
        return _parsed(xacro_file.expanded(path, arguments or {}), path, expanded=True)
    if arguments:
        raise InputError('for xacro only', key='--argument', value=next(iter(arguments)))
    return root


def _content(path: Path) -> bytes:
    """A file, in UTF-8 if it is in UTF-16: the patterns here are of bytes. Raises InputError."""
    data = paths.content(path, LARGEST_FILE)
    try:
        text = data.decode(_UTF_16[data[:2]]).encode()
    except (KeyError, UnicodeDecodeError):  # which the parser refuses
        return data
    return _ENCODING.sub(rb'\1"UTF-8"', text, count=1)


def _parsed(text: bytes, path: Path, expanded: bool = False) -> ElementTree.Element:
    declared = _declared(_strict(text))
    builder = ElementTree.TreeBuilder(element_factory=PlacedElement)
    try:
        root: ElementTree.Element = ElementTree.fromstring(
            declared, ElementTree.XMLParser(target=builder)
        )
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # an unknown encoding
        raise InputError(f'not XML: {error}', file=str(path)) from None
    for element, line in zip(root.iter(), _lines(declared, path), strict=True):
        if isinstance(element, PlacedElement):
            element.file, element.line = str(path), None if expanded else line
    return root


def _lines(text: bytes, path: Path) -> list[int]:
    """Of each element of a text that is XML the line on which it begins. Raises InputError for
    elements that are too deep inside others, because readers call themselves for each."""
    lines: list[int] = []
    inside: list[str] = []
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines.append(parser.CurrentLineNumber)
        inside.append(tag)
        if len(inside) > _DEEPEST:
            message = f'an element inside more than {_DEEPEST} others'
            raise InputError(message, file=str(path), line=lines[-1], key=tag)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: inside.pop()
    parser.Parse(text, True)
    return lines


def _strict(text: bytes) -> bytes:
    """The text without comments and default namespaces, with its XML declaration at the start, and
    one colon for two in names of elements; lines stay.

    The parser of Gazebo and ROS reads comments with two hyphens, a declaration behind blank lines,
    and names as `gz::system_priority`, and knows no namespaces. Many files need this.
    """
    bare = _NAMESPACE.sub(_blank, _without_comments(text))
    bare = _SCOPED.sub(lambda found: found[0].replace(b'::', b':', 1).replace(b'::', b'.'), bare)
    found = _DECLARATION.match(bare)
    if found is None:
        return bare
    return found[1] + bare[: found.start(1)] + bare[found.end(1) :]


def _without_comments(text: bytes) -> bytes:
    return _COMMENT.sub(lambda found: found[0] if found[0][2:3] == b'[' else _blank(found), text)


def _blank(found: re.Match[bytes]) -> bytes:
    return re.sub(rb'[^\n]', b' ', found[0])


def _declared(text: bytes) -> bytes:
    """A text without comments, with a declaration in its root for each prefix that has none."""
    used = {prefix for prefix in _USED.findall(text) if not prefix.startswith(b'xml')}
    missing = sorted(p for p in used if not re.search(rb'\sxmlns:' + p + rb'\s*=', text))
    root = _ROOT.search(text)
    if not missing or root is None:
        return text
    more = b''.join(b' xmlns:%b="undeclared:%b"' % (prefix, prefix) for prefix in missing)
    return text[: root.end()] + more + text[root.end() :]


def beside(element: ElementTree.Element, attributes: dict[str, str]) -> ElementTree.Element:
    """A new element of the same kind and place in the file, so that errors name the line."""
    made = PlacedElement(element.tag, attributes)
    if isinstance(element, PlacedElement):
        made.file, made.line = element.file, element.line
    return made


def place_of(element: ElementTree.Element | None, file: str) -> dict[str, Any]:
    """File and line of an InputError about an element; `file` alone if it is of no file."""
    if not isinstance(element, PlacedElement):
        return {'file': file}
    return {'file': element.file, 'line': element.line}


def refusal(
    file: str, key: str, message: str, at: ElementTree.Element | None = None, **details: Any
) -> InputError:
    """An InputError about an element of a file, with its line; `details` are its other fields."""
    return InputError(message, **place_of(at, file), key=key, **details)


def told(element: ElementTree.Element) -> str:
    """An element on one line: `line 6: cylinder radius -1 length 1`."""
    words = [element.tag, *(f'{key} {value}' for key, value in element.attrib.items())]
    words += [f'{each.tag} {each.text or ""}' for each in element]
    text = ' '.join(' '.join([*words, element.text or '']).split())[:_TOLD]
    return f'line {element.line}: {text}' if isinstance(element, PlacedElement) else text


def _is_xacro(text: bytes, path: Path) -> bool:
    bare = _COMMENT.sub(b'', text)
    return path.suffix == '.xacro' or all(each.search(bare) for each in _XACRO)
