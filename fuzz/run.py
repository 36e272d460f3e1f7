"""Try what nobody would write: `make fuzz ARGS="--minutes 60"`.

Every harness gets the same share of the time. A finding is printed and kept as a file of
test/data/fuzz, which a test tries again for ever; numbers go to benchmark/results/fuzz.csv, where
they replace the earlier numbers of the same harness.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import sys
from pathlib import Path

from campaign import Tally, campaign
from guided import GUIDED, available, guided
from worker import HARNESSES, Found, harness

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / 'test/data/fuzz'
RESULTS = ROOT / 'benchmark/results/fuzz.csv'
KINDS = ('traceback', 'hang', 'crash', 'silent')
COLUMNS = ('harness', 'cases', 'ran', 'refused', *KINDS, 'cases_per_second')


def main() -> int:
    """Run the campaign; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog='fuzz', description=__doc__)
    parser.add_argument('--minutes', type=float, default=5.0, help='of all harnesses together')
    parser.add_argument('--cases', type=int, default=0, help='of each harness, in place of a time')
    parser.add_argument('--harness', nargs='+', choices=HARNESSES, default=HARNESSES)
    parser.add_argument('--first', type=int, default=0, help='number of the first case')
    parser.add_argument('--guided', action='store_true', help='led by coverage; needs atheris')
    parser.add_argument('--add', action='store_true', help='add to the results of a harness')
    options = parser.parse_args()
    names = [name for name in options.harness if name in GUIDED or not options.guided]
    if options.guided and not available():
        parser.error('--guided: pip install -r fuzz/requirements.txt (Python 3.11 to 3.13, Linux)')
    share = 60.0 * options.minutes / max(1, len(names))
    code = 0
    for name in names:
        if options.guided:
            tally = guided(name, share)
        else:
            tally = campaign(name, options.first, share, options.cases, _Progress())
        print(file=sys.stderr)
        for where, each in sorted(_kinds(tally).items()):
            print(f'  {each[0].kind} {where}: {len(each)}, such as {name} {each[0].number}')
            _keep(name, each[0])
        code |= bool(tally.found)
        rows = {row['harness']: row for row in _stored()}  # also of a campaign beside this one
        rows[tally.name] = _row(tally, rows.get(tally.name) if options.add else None)
        _store(list(rows.values()))
    print(table(_stored()))
    return code


def _kinds(tally: Tally) -> dict[str, list[Found]]:
    found: dict[str, list[Found]] = {}
    for each in tally.found:
        found.setdefault(each.where, []).append(each)
    return found


def _keep(name: str, found: Found) -> None:
    """The case as a file that the tests try."""
    digest = hashlib.sha256(found.case).hexdigest()[:12]
    path = CORPUS / name / f'{digest}{harness(name).SUFFIX}'
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(found.case)


def _row(tally: Tally, before: dict[str, str] | None) -> dict[str, str]:
    counts = {'cases': tally.cases, 'ran': tally.ran, 'refused': tally.refused}
    counts.update({kind: tally.of(kind) for kind in KINDS})
    if before:
        counts = {key: count + int(before[key]) for key, count in counts.items()}
    rate = f'{tally.cases / max(tally.seconds, 1e-9):.3g}'
    return {'harness': tally.name, **{k: str(v) for k, v in counts.items()}, COLUMNS[-1]: rate}


def _stored() -> list[dict[str, str]]:
    if not RESULTS.is_file():
        return []
    with open(RESULTS, encoding='utf-8', newline='') as stream:
        lines = [line for line in stream if not line.startswith('#')]
    return list(csv.DictReader(lines))


def _store(rows: list[dict[str, str]]) -> None:
    from alf_ros.logs.provenance import about

    with open(RESULTS, 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}\n')
        writer = csv.DictWriter(stream, COLUMNS, lineterminator='\n')
        writer.writeheader()
        writer.writerows(rows)


def table(rows: list[dict[str, str]]) -> str:
    """The rows as a table of Markdown, with their sum."""
    heads = (
        'harness',
        'cases',
        'ran',
        'refused',
        'tracebacks',
        'hangs',
        'crashes',
        'silent changes',
    )
    keys = COLUMNS[: len(heads)]
    total = {key: str(sum(int(row[key]) for row in rows)) for key in keys[1:]}
    lines = [heads, ['---', *['--:'] * (len(heads) - 1)]]
    lines += [[row[key] for key in keys] for row in [*rows, {'harness': 'all', **total}]]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


class _Progress:
    """Says how far a campaign is, and each finding at once."""

    def __init__(self) -> None:
        self._said = 0

    def __call__(self, tally: Tally) -> None:
        for each in tally.found[self._said :]:
            print(f'\n{tally.name} {each.number}: {each.kind} {each.where}', flush=True)
        self._said = len(tally.found)
        print(
            f'\r{tally.name}: {tally.cases} cases, {tally.ran} ran, {tally.refused} refused, '
            f'{len(tally.found)} found, {tally.seconds:.0f} s',
            end='',
            file=sys.stderr,
            flush=True,
        )


if __name__ == '__main__':
    sys.exit(main())
