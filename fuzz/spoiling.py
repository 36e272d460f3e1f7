"""Values nobody expects, and changes of bytes, texts and JSON."""

from __future__ import annotations

import atexit
import copy
import os
import shutil
import struct
import tempfile
from pathlib import Path
from random import Random
from typing import Any

FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-300, 5e-324, 1e300, 1.8e308, float('inf'), float('nan'), 1e40)
INTEGERS = (
    0,
    1,
    -1,
    2,
    7,
    255,
    256,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**53,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
TEXTS = (
    '',
    ' ',
    'x',
    'a' * 300,
    '\0',
    '\x1b[2J',
    '\u202e',
    '<script>alert(1)</script>',
    '"><img src=x onerror=alert(1)>',
    '../../etc/passwd',
    '/dev/zero',
    '~nobody-of-this-name/x',
    'nan',
    'inf',
    '1e999',
    '9' * 5000,
    'é世',
    '%s%n{}',
    'null',
    'state',
    'position',
    'notes.py',
    '-1',
    '\ud800',
)


def scratch(name: str) -> Path:
    """A folder for files of a harness, in memory where there is such a place: a file for each case
    would wait for the disk. Below FUZZ_FOLDER, if a campaign has set it: the campaign removes all
    there, also what a killed process leaves."""
    memory = '/dev/shm' if os.access('/dev/shm', os.W_OK) else None
    folder = tempfile.mkdtemp(prefix=f'fuzz_{name}_', dir=os.environ.get('FUZZ_FOLDER', memory))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def number(random: Random) -> float | int:
    """A float or an integer at the edge."""
    return random.choice(FLOATS if random.randrange(2) else INTEGERS)


def value(random: Random, depth: int = 2) -> Any:
    """Any value of JSON."""
    kind = random.randrange(8 if depth else 5)
    if kind <= 1:
        return number(random)
    if kind == 2:
        return random.choice(TEXTS)
    if kind == 3:
        return random.choice((None, True, False))
    if kind == 4:
        return random.choice(([], {}, [[]], [None], {'': ''}))
    if kind == 5:
        return [value(random, depth - 1) for _ in range(random.randrange(5))]
    if kind == 6:
        deep: Any = 0
        for _ in range(random.choice((3, 50, 2000))):
            deep = [deep]
        return deep
    return {random.choice(TEXTS): value(random, depth - 1) for _ in range(random.randrange(4))}


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of lists and dictionaries within each other."""
    found, waiting = [], [tree]
    while waiting:
        here = waiting.pop()
        keys = here.keys() if isinstance(here, dict) else range(len(here))
        for key in keys:
            found.append((here, key))
            if isinstance(here[key], (dict, list)):
                waiting.append(here[key])
    return found


def spoil(tree: Any, random: Random) -> None:
    """Change one place of JSON data."""
    known = places(tree)
    if not known:
        return
    where, key = random.choice(known)
    kind = random.randrange(6)
    if kind == 0 and isinstance(where, dict):
        del where[key]
    elif kind == 0:
        where.pop(key)
    elif kind == 1 and isinstance(where, dict):
        where[random.choice(TEXTS)] = where.pop(key)
    elif kind == 1:
        where.insert(key, where[key])
    elif kind == 2 and isinstance(where[key], float):
        where[key] = altered(where[key], random)
    elif kind == 2 and isinstance(where[key], int):
        where[key] += random.choice((-1, 1, 1000))
    elif kind == 3:
        other, place = random.choice(known)
        try:
            where[key] = copy.deepcopy(other[place])
        except RecursionError:
            where[key] = None
    else:
        where[key] = value(random)


def altered(x: float, random: Random) -> float:
    """The number with one bit changed."""
    (bits,) = struct.unpack('<Q', struct.pack('<d', x))
    return struct.unpack('<d', struct.pack('<Q', bits ^ (1 << random.randrange(64))))[0]


def damaged(data: bytes, random: Random) -> bytes:
    """Bytes changed, left out, doubled or cut off."""
    if not data:
        return b'\0'
    some, at = bytearray(data), random.randrange(len(data))
    kind = random.randrange(7)
    if kind <= 1:
        some[at] ^= 1 << random.randrange(8)
    elif kind == 2:
        some[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF))
    elif kind == 3:
        del some[at : at + random.choice((1, 4, 8, 100))]
    elif kind == 4:
        some[at:at] = some[at : at + random.choice((1, 4, 8, 100))]
    elif kind == 5:
        size = random.choice((1, 2, 4, 8))
        number = random.choice(INTEGERS) % 2 ** (8 * size)
        some[at : at + size] = number.to_bytes(size, 'little')
    else:
        del some[at:]
    return bytes(some)


def damaged_text(text: str, random: Random) -> str:
    """A text with words changed, doubled, left out, or put in."""
    if not text:
        return random.choice(TEXTS)
    at, length = random.randrange(len(text)), random.choice((1, 1, 2, 5, 20))
    kind = random.randrange(5)
    if kind == 0:
        return text[:at] + text[at + length :]
    if kind == 1:
        return text[:at] + text[at : at + length] * random.choice((2, 3, 50)) + text[at:]
    if kind == 2:
        return text[:at] + random.choice(TEXTS) + text[at:]
    if kind == 3:
        return (
            text[:at]
            + chr(random.choice((0, 9, 10, 32, 44, 58, 91, 123, 0x85, 0xFFFF)))
            + text[at + 1 :]
        )
    other = random.randrange(len(text))
    return text[:at] + text[other : other + length] + text[at + length :]
