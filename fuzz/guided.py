"""Cases led by coverage: libFuzzer keeps a case that reaches new branches, and changes it further.

`run.py --guided` starts this file as a process for a harness, a time (s) and an empty folder, and
reads what it leaves there: `tally.json`, a file `found_...` for each kind of failure, and files of
libFuzzer for a case that hangs or crashes, which ends the process. It begins with cases of the
harness. Only code that reads files is watched (`WATCHED`).
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

from campaign import Tally
from worker import Found, Harness, case, harness, where

# Whose case is the content of a file. A change of bytes of a log is found by its checksums.
GUIDED = ('expressions', 'tables', 'scenes', 'robots', 'states')
TEXTS = ('expressions', 'scenes')

SEEDS = 300
SECONDS = 20  # of a case
MEMORY = 6000  # MB
WATCHED = [
    'alf_ros.errors',
    'alf_ros.exchange',
    'alf_ros.logs',
    'alf_ros.mechanism',
    'alf_ros.scene',
    'alf_ros.simulation.saved_states',
]
COMPILED = ['alf_ros.logs.mcap_chunks']  # numba cannot compile what atheris has changed


def available() -> bool:
    """Whether atheris is installed."""
    return importlib.util.find_spec('atheris') is not None


def guided(name: str, seconds: float) -> Tally:
    """Try cases of a harness for so many seconds; what went wrong is in the tally."""
    tally, begin = Tally(f'{name}, guided'), time.monotonic()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        command = [sys.executable, __file__, name, str(max(1, round(seconds))), made]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        told = folder / 'tally.json'
        assert told.is_file(), done.stderr[-2000:]
        counts = json.loads(told.read_text())
        for number, (kind, place) in enumerate(counts.pop('found')):
            tally.found.append(Found(0, kind, place, (folder / f'found_{number}').read_bytes()))
        tally.cases, tally.ran, tally.refused = (counts[k] for k in ('cases', 'ran', 'refused'))
        for kind, pattern in (('hang', 'timeout-*'), ('crash', 'crash-*'), ('crash', 'oom-*')):
            for path in folder.glob(pattern):
                tally.found.append(Found(0, kind, pattern, path.read_bytes()))
    tally.seconds = time.monotonic() - begin
    return tally


def main() -> None:
    """Fuzz; libFuzzer ends the process."""
    import atheris

    name, seconds, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    with atheris.instrument_imports(include=WATCHED, exclude=COMPILED):
        tried = harness(name)
        seeds = [case(tried, name, number) for number in range(SEEDS)]
        for data in seeds[:50]:  # imports what is imported late
            _end(tried, name, data)
    corpus = folder / 'corpus'
    corpus.mkdir(parents=True)
    for number, data in enumerate(seeds):
        (corpus / f'{number}').write_bytes(data)
    counts = {'cases': 0, 'ran': 0, 'refused': 0}
    found: dict[str, Found] = {}

    def tell() -> None:
        kinds = [[each.kind, each.where] for each in found.values()]
        (folder / 'tally.json').write_text(json.dumps({**counts, 'found': kinds}))

    def one(data: bytes) -> None:
        end = _end(tried, name, data)
        counts['cases'] += 1
        if isinstance(end, str):
            counts[end] += 1
        elif (place := end.where.partition(': ')[0]) not in found:
            (folder / f'found_{len(found)}').write_bytes(end.case)
            found[place] = end
            tell()
        if counts['cases'] % 100 == 0:
            tell()

    tell()
    limits = [f'-max_total_time={seconds}', f'-timeout={SECONDS}', f'-rss_limit_mb={MEMORY}']
    places = [f'-artifact_prefix={folder}/', '-max_len=100000', '-verbosity=0']
    atheris.Setup([sys.argv[0], *limits, *places, str(corpus)], one)
    atheris.Fuzz()


def _end(tried: Harness, name: str, data: bytes) -> str | Found:
    """'ran' or 'refused', or what went wrong."""
    if name in TEXTS:  # their cases are texts already
        data = data.decode('utf-8', 'ignore').encode()
    try:
        return tried.check(data)
    except (Exception, SystemExit) as error:
        kind = 'silent' if str(error).startswith('silent') else 'traceback'
        return Found(0, kind, where(error), data)


if __name__ == '__main__':
    warnings.simplefilter('ignore')
    main()
