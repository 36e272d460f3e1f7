"""Logs that ask for more than there is, and for longer than anybody waits."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from support.log_files import make
from support.paths import ROOT

sys.path.insert(0, str(ROOT / 'fuzz'))

from mcap_records import (
    CHUNK,
    METADATA,
    SCHEMA,
    Record,
    mapping,
    read_mapping,
    read_text,
    records,
    text,
    together,
)

from support.thorough import thinned

# Within the memory (bytes) and processor time (s) that doc/reliability.md states for logs.
COMMANDS = """
import resource, sys
from alf_ros.__main__ import main
for limit, most in ((resource.RLIMIT_AS, 3 << 30), (resource.RLIMIT_CPU, 120)):
    resource.setrlimit(limit, (most, most))
for path in sys.argv[1:]:
    for verb in ('verify', 'recover', 'analyze', 'fork'):
        code = main([verb, path, *(['--at', '0.01'] if verb == 'fork' else [])])
        print(path, verb, code)
"""
ENDLESS = """
import sys
from alf_ros.__main__ import main
from alf_ros.commands import fork, verify
print('ready', flush=True)
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope='module')
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path, _ = make(tmp_path_factory.mktemp('whole'), 'slider_crank', ticks=12, push_at=6)
    return path.read_bytes()


def _chunk(parts: list[Record], **head: object) -> None:
    next(part for part in parts if part.code == CHUNK).head.update(head)


def bomb(parts: list[Record]) -> None:
    """300 MB of zeros, in a frame that does not tell its size, called 100 bytes."""
    import zstandard

    packer = zstandard.ZstdCompressor().compressobj()
    packed = b''.join(packer.compress(bytes(1 << 20)) for _ in range(300)) + packer.flush()
    chunk = next(part for part in parts if part.code == CHUNK)
    head = (0).to_bytes(16, 'little') + (100).to_bytes(8, 'little') + bytes(4) + text(b'zstd')
    chunk.inner, chunk.content = None, head + len(packed).to_bytes(8, 'little') + packed


def boast(parts: list[Record]) -> None:
    """A chunk of 100 bytes that is called 6 GB."""
    _chunk(parts, compression=b'zstd', size=6 * 10**9)


def nested(parts: list[Record]) -> None:
    """Types within themselves, and very many within each other."""
    for part in parts:
        for record in part.inner or ():
            if record.code == SCHEMA:
                name, at = read_text(record.content, 2)
                encoding, at = read_text(record.content, at)
                own = name.replace(b'/msg/', b'/')
                many = b''.join(b'===\nMSG: a/T%d\nT%d[100] x\n' % (k, k + 1) for k in range(9))
                lines = own + b' inner\na/T0 deep\n' + many
                record.content = record.content[:2] + text(name) + text(encoding) + text(lines)


def deep(parts: list[Record]) -> None:
    """JSON of 100,000 levels."""
    record = next(part for part in parts if part.code == METADATA)
    name, at = read_text(record.content, 0)
    pairs = dict.fromkeys(read_mapping(record.content, at), '[' * 10**5 + ']' * 10**5)
    record.content = text(name) + mapping(pairs)


def test_what_is_huge_ends_within_the_stated_memory_and_time(whole: bytes, tmp_path: Path) -> None:
    changes: tuple[Callable[[list[Record]], None], ...] = (bomb, boast, nested, deep)
    for change in changes:
        parts = records(whole)
        change(parts)
        (tmp_path / f'{change.__name__}_0.mcap').write_bytes(together(parts))
    done = subprocess.run(
        [sys.executable, '-c', COMMANDS, *(f'{change.__name__}_0.mcap' for change in changes)],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.strip().splitlines()
    assert all(line.isprintable() and line.startswith('alf_ros ') for line in lines), lines
    ends = [line for line in done.stdout.splitlines() if '.mcap verify' in line]
    assert len(ends) == 4 and not any(end.endswith(' 0') for end in ends), ends  # none is equal


def endless(parts: list[Record]) -> None:
    """A step so small that the run takes an hour, at 8 million steps a stamp."""
    record = next(part for part in parts if part.code == METADATA)
    name, at = read_text(record.content, 0)
    pairs = read_mapping(record.content, at)
    pairs['solver'] = json.dumps({**json.loads(pairs['solver']), 'step': 2.5e-10})
    record.content = text(name) + mapping(pairs)


@pytest.mark.parametrize('verb', thinned(['verify', 'fork'], keep=['verify']))
def test_a_command_that_would_take_an_hour_ends_at_ctrl_c(
    whole: bytes, tmp_path: Path, verb: str
) -> None:
    parts = records(whole)
    if verb == 'verify':
        endless(parts)
    path = tmp_path / 'log_0.mcap'
    path.write_bytes(together(parts))
    further = ['--at', '0.01', '--duration', '1e6'] if verb == 'fork' else []
    arguments = [verb, str(path), *further]
    with subprocess.Popen(
        [sys.executable, '-c', ENDLESS, *arguments],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == 'ready\n'
            time.sleep(1.0)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=300)
        finally:
            process.kill()
    assert process.returncode == 130 and 'Traceback' not in said, said
