"""A xacro, expanded by the package xacro of ROS; what it lacks ends in one line."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.exchange.nearby_packages import found_by_ament, nearby_package
from alf_ros.resources import shares
from alf_ros.scene.text.yaml_document import LARGEST_FILE

# <xacro:arg name="...">, $(arg ...) and xacro.arg('...') in expressions
_ARGUMENT = re.compile(
    r"""<\w+:arg\b[^>]*?\bname\s*=\s*["']([^"']+)|\$\(arg\s+([^)\s]+)|\barg\(\s*["']([^"']+)"""
)
_PARTS, _MACRO = re.compile(r'<(link|model|include)\b'), re.compile(r'<\w+:macro\b')
_PACKAGE, _COMMENT = re.compile(r'\$\(find\s+([^)\s]+)'), re.compile('<!--.*?-->', re.DOTALL)
_TWICE = re.compile(r"<class '[^']*'>: (.+?) \1", re.DOTALL)  # xacro of errors of Python
_NESTED, _TOLD = 20, 3  # what is deeper is inside itself; macros around an error that are told
_NOT_FOUND = ('AMENT_PREFIX_PATH', 'not found, searching', 'ament_index')


def expanded(path: Path, arguments: Mapping[str, str]) -> bytes:
    """The XML of a xacro. Packages that ROS does not find are searched around the file.

    Raises InputError, also for arguments that the file does not have.
    """
    try:
        import xacro
    except ImportError:
        message = 'a xacro: `pip install xacro`, or run `xacro FILE > OUT.urdf` first'
        raise InputError(message, file=str(path)) from None
    packages = dict[str, Path]()  # around the file; each attempt reads more of its includes
    while True:
        with found_by_ament(packages) as links:
            shown = partial(_unlinked, links=links, packages=packages)
            getattr(xacro, 'all_includes', []).clear()  # of files before
            try:
                document = xacro.process_file(str(path), mappings=dict(arguments))
                whole = shown(document.toxml())
            except Exception as error:  # whatever an expression of the file raises
                found = {name: nearby_package(name, path) for name in _missing(path, xacro)}
                more = {name: folder for name, folder in found.items() if folder is not None}
                if not more:
                    raise _refused(path, xacro, error, shown) from None
            else:
                _check(arguments, path, xacro)
                if not _PARTS.search(whole) and any(map(_MACRO.search, _texts(path, xacro))):
                    raise InputError(
                        'a xacro of macros alone: it has no link',
                        file=str(path),
                        expected='the file that includes it and calls its macros',
                    )
                return whole.encode()
        packages |= more


def _unlinked(text: str, links: Mapping[str, Path], packages: Mapping[str, Path]) -> str:
    """A text with the folders of packages in the place of their links."""
    for name, link in links.items():
        text = text.replace(str(link), str(packages[name]))
    return text


def _missing(path: Path, xacro: Any) -> list[str]:
    """The packages that ROS does not find, of those that a file and its includes name."""
    texts = (_COMMENT.sub('', text) for text in _texts(path, xacro))
    found = [name for text in texts for name in _PACKAGE.findall(text)]
    return [name for name in dict.fromkeys(found) if not shares(name)]


def _check(arguments: Mapping[str, str], path: Path, xacro: Any) -> None:
    """Refuse arguments that neither the file nor one that it includes names."""
    named = [''.join(each) for text in _texts(path, xacro) for each in _ARGUMENT.findall(text)]
    if any('$' in name for name in named):  # a name that is computed
        return
    for name, value in arguments.items():
        if name not in named:
            raise InputError(
                'no such argument',
                file=str(path),
                key='--argument',
                value=name,
                choices=dict.fromkeys(named),
                expected=None if named else f'no --argument {name}={value}: it has none',
            )


def _contents(path: Path, xacro: Any) -> dict[str, bytes]:
    """A file and those that it includes, by their paths."""
    files = dict.fromkeys([str(path), *map(str, getattr(xacro, 'all_includes', ()))])
    return {
        each: paths.content(Path(each), LARGEST_FILE) for each in files if os.path.isfile(each)
    }


def _texts(path: Path, xacro: Any) -> list[str]:
    """The texts of a file and of those that it includes."""
    return [each.decode('utf-8', 'replace') for each in _contents(path, xacro).values()]


def _encoded(path: Path, xacro: Any, shown: Callable[[str], str]) -> InputError | None:
    """The error of the first file that is not in UTF-8; None if all are."""
    for file, content in _contents(path, xacro).items():
        try:
            content.decode()
        except UnicodeDecodeError as error:
            return InputError(
                'not in UTF-8, and xacro reads no other encoding',
                file=shown(file),
                line=content.count(b'\n', 0, error.start) + 1,
                expected='the same text in UTF-8, or expanded by hand as a URDF',
            )
    return None


def _refused(path: Path, xacro: Any, error: Exception, shown: Callable[[str], str]) -> InputError:
    """The error of a file; `shown`: texts without links to packages."""
    said = shown(f'{error or type(error).__name__}')
    if isinstance(error, ImportError) or any(each in said for each in _NOT_FOUND):
        return InputError(
            'xacro cannot expand it: $(find ...) finds no package',
            file=str(path),
            value=', '.join(_missing(path, xacro)) or None,
            expected='a sourced ROS 2 that has the package, its folder around or beside the file, '
            'or `xacro FILE > OUT.urdf` there',
        )
    cause = getattr(error, 'exc', None)
    encoded = _encoded(path, xacro, shown) if isinstance(cause or error, UnicodeError) else None
    if encoded is not None:
        return encoded
    files = [str(each) for each in getattr(xacro, 'filestack', None) or [path]]
    macros = [_macro(each) for each in getattr(xacro, 'macrostack', None) or []]
    if isinstance(cause or error, RecursionError) and max(len(files), len(macros)) > _NESTED:
        return _endless(path, files, macros, shown)
    if isinstance(cause, OSError) and cause.filename:  # xacro says both, with the path in each
        said = shown(f'{cause.strerror}: {cause.filename}')
    said = _TWICE.sub(r'\1', said)
    line = error.lineno if isinstance(error, ExpatError) else None
    calls = f' in the macro {" of ".join(macros[: -1 - _TOLD : -1])}' if macros else ''
    return InputError(
        f'xacro cannot expand it{shown(calls)}: {said}', file=shown(files[-1]), line=line
    )


def _macro(macro: Any) -> str:
    """A macro with the file that defines it."""
    return f'{macro.body.getAttribute("name")} ({macro.history[-1][-1]})'


def _endless(
    path: Path, files: list[str], macros: list[str], shown: Callable[[str], str]
) -> InputError:
    """The error of a file or macro inside itself more often than Python calls functions."""
    what, inside = ('a macro', macros) if len(macros) > len(files) else ('an include', files)
    name = shown(max(inside, key=inside.count))
    return InputError(
        f'xacro cannot expand it: {what} inside itself too often for Python: {name}',
        file=str(path),
        expected=f'{what} that ends',
    )
