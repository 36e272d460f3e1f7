"""Paths and files as people and their files name them: what cannot be ends in one line."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from alf_ros.errors import InputError

_blocks = itertools.count()  # of `replacing` in this process


def named(text: str | Path, key: str | None = None) -> Path:
    """The path that a text names, `~` expanded. Raises InputError for what can be none."""
    try:
        path = Path(text).expanduser()
        if b'\0' in os.fsencode(path):
            raise ValueError
    except (RuntimeError, TypeError, ValueError):  # a home of nobody; what no file's name has
        raise InputError('not a path', key=key, value=str(text)) from None
    return path


def content(path: Path, most: int) -> bytes:
    """The content of a regular file. Raises InputError if there is none, or it has more than
    `most` bytes: a device or a pipe would be read without end."""
    data = head(path, most + 1)
    if len(data) > most:
        raise InputError(f'larger than {most >> 20} MB', file=str(path))
    return data


def head(path: Path, most: int) -> bytes:
    """The first bytes, at most so many, of a regular file. Raises InputError if there is none."""
    try:
        with open(path, 'rb', opener=_opened) as stream:
            return stream.read(most)
    except IsADirectoryError:
        raise InputError('a folder', file=str(path), expected='a file') from None
    except (FileNotFoundError, NotADirectoryError):
        raise InputError('no such file', file=str(path)) from None
    except (OSError, ValueError) as error:
        why = getattr(error, 'strerror', None) or 'not a path'
        raise InputError(f'cannot be read: {why}', file=str(path)) from None


def put(path: Path, content: str | bytes, beside: Path | None = None) -> None:
    """Write a file beside its place and rename it: `path` holds the whole content, a text in
    UTF-8, or what it held before. `beside`: the name until then, on the same disk, for a folder
    whose readers take all files in it. Raises OSError."""
    with replacing(path, beside) as target:
        target.write_bytes(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def replacing(path: Path, beside: Path | None = None) -> Iterator[Path]:
    """As a block: yields the path, of the same suffix, at which the content of a file is written.
    At the end of the block it replaces `path` and gets its permissions, but not if the block
    raises. A pipe, /dev/stdout, or a file in a folder without write permission cannot be replaced,
    and is yielded itself. Raises OSError, as for a file that may not be written."""
    place = Path(os.path.realpath(path))  # a link stays one
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        mode = None
    if mode is not None and not (stat.S_ISREG(mode) and os.access(place.parent, os.W_OK)):
        yield path
        return
    if mode is not None and not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    beside = beside or _beside(place, path.suffix)
    try:
        yield beside
        if mode is not None:
            os.chmod(beside, stat.S_IMODE(mode))
        os.replace(beside, place)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)


def _beside(place: Path, suffix: str) -> Path:
    """A name beside a place, short however long the name of the place is, that no other block of
    any process has. Programs know kinds of files by suffixes, none of which is long."""
    return place.with_name(f'.{os.getpid()}-{next(_blocks)}{suffix if len(suffix) < 16 else ""}')


def written(folder: str | Path, texts: Mapping[str, str]) -> Path:
    """Write files of these names, in this order and each of them whole, into a folder, which is
    made; returns it. Raises InputError for a text that is no path, OSError if it cannot be
    written."""
    target = named(folder, 'folder')
    target.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        put(target / name, text)
    return target


def _opened(path: str, flags: int) -> int:
    """Open a regular file, and nothing else: a pipe must not be waited for."""
    file = os.open(path, flags | os.O_NONBLOCK)
    mode = os.fstat(file).st_mode
    if not stat.S_ISREG(mode):
        os.close(file)
        raise IsADirectoryError(path) if stat.S_ISDIR(mode) else FileNotFoundError(path)
    return file
