"""Convert URDF (with loops), xacro, SDF, MJCF or USD to a mechanism or scene file."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Sequence
from typing import Any

from alf_ros import paths
from alf_ros.commands.parser import (
    Parser,
    add_numbers,
    numbers,
    pairs,
    refuse_given,
    refuse_source,
    writing,
)
from alf_ros.errors import InputError
from alf_ros.exchange import corpus
from alf_ros.exchange.import_file import imported
from alf_ros.logs.provenance import about

_LIMIT = 120.0  # s for each file of --corpus


def main(argv: Sequence[str] | None = None) -> int:
    """Import a file. Returns 0; raises InputError."""
    parser = Parser(
        command='import',
        description='Write the mechanism of a URDF, xacro, SDF, MJCF or USD file. Everything that '
        'is not imported is listed at the head of the output, and on stderr.',
    )
    parser.add_argument(
        'file', nargs='?', metavar='FILE', help='a URDF, xacro, SDF, MJCF or USD file'
    )
    parser.add_argument(
        '--corpus',
        metavar='FOLDER',
        help='import, check and simulate every file below a folder, and print a table',
    )
    parser.add_argument(
        '--limit',
        type=float,
        metavar='S',
        help=f'time limit for each file of --corpus, s (default: {_LIMIT:g})',
    )
    parser.add_argument(
        '--loops', metavar='SIDE.yaml', help='joints that close the loops of a URDF'
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='OUT',
        help='file to write (default: stdout); with --corpus, also write the table as CSV',
    )
    parser.add_argument(
        '--scene',
        action='store_true',
        help='write a scene, with gravity, damping and springs of joints',
    )
    parser.add_argument(
        '--stops',
        type=float,
        metavar='STIFFNESS',
        help='write a scene, with a stop of this stiffness at each joint limit '
        '(N m/rad^1.5 or N/m^1.5)',
    )
    parser.add_argument(
        '--contact',
        type=float,
        metavar='STIFFNESS',
        help='write a scene, with a contact of this stiffness (N/m^1.5) where balls, capsules, '
        'boxes and wheels meet a plane of the ground',
    )
    parser.add_argument(
        '--ground',
        type=float,
        metavar='HEIGHT',
        help='height of a horizontal plane that they meet (m), for URDF and SDF',
    )
    parser.add_argument(
        '--floating', action='store_true', help='let the root link of a URDF move freely'
    )
    parser.add_argument(
        '--mass',
        type=float,
        metavar='KG',
        help='a mass for each link of a file without any, for positions and loops alone',
    )
    parser.add_argument(
        '--repair-inertia',
        action='store_true',
        help='replace each impossible inertia by the nearest possible one',
    )
    parser.add_argument(
        '--balls',
        action=argparse.BooleanOptionalAction,
        default=True,
        help='one ball, with their names and angles, for each row of three revolutes through '
        'links without mass on which nothing acts (default: yes)',
    )
    parser.add_argument('--key', metavar='NAME', help='keyframe of an MJCF for the start')
    parser.add_argument(
        '--argument',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='argument of a xacro file',
    )
    add_numbers(parser, 'JOINT=NUMBER', 'joint positions of the drawing (rad, m)')
    options = parser.parse_args(argv)
    for key in ('stops', 'contact'):
        given = getattr(options, key)
        if given is not None and given <= 0.0:
            raise InputError('not a stiffness', key=f'--{key}', value=given)
    if options.mass is not None and options.mass <= 0.0:
        raise InputError('not a mass', key='--mass', value=options.mass)
    if (options.file is None) == (options.corpus is None):
        raise InputError('give a FILE, or a folder of them by --corpus')
    if options.corpus is None:
        refuse_given(options, ('limit',), 'has no meaning without --corpus')
    refuse_source('-o', options.output, [options.file, options.loops])
    wishes = {
        'loops': options.loops,
        'scene': options.scene,
        'stops': options.stops,
        'contact': options.contact,
        'ground': options.ground,
        'floating': options.floating,
        'positions': numbers(options.set),
        'mass': options.mass,
        'repair_inertia': options.repair_inertia,
        'balls': options.balls,
        'key': options.key,
        'arguments': _arguments(options.argument),
    }
    if options.corpus is not None:
        return _corpus(options, wishes)
    text = imported(options.file, **wishes)
    if options.output is None:
        print(text, end='')
    else:
        with writing('-o', options.output):
            paths.put(paths.named(options.output, '-o'), text)
    for line in text.split('\n')[1:]:
        if not line.startswith('#'):
            break
        print(line[2:], file=sys.stderr)
    return 0


def _corpus(options: argparse.Namespace, wishes: dict[str, Any]) -> int:
    """The table of a folder, row by row as they come. Returns 0 if every file runs, 1 if not."""
    folder = paths.named(options.corpus, '--corpus')
    if not folder.is_dir():
        raise InputError('no such folder', key='--corpus', value=options.corpus)
    for option in ('loops', 'positions', 'key', 'arguments'):
        if wishes.pop(option):
            raise InputError('for one file only', key=f'--{_OPTIONS.get(option, option)}')
    limit = _LIMIT if options.limit is None else options.limit
    if not 0.0 < limit < math.inf:
        raise InputError('not a time', key='--limit', value=limit, expected='s')
    if not corpus.files_below(folder):
        raise InputError(
            'no robot files below this folder',
            key='--corpus',
            value=options.corpus,
            expected=', '.join(corpus.SUFFIXES),
        )
    found: list[corpus.Examined] = []
    print(corpus.head())
    limits = corpus.ExaminationLimits(seconds=limit)
    for each in corpus.examined(folder, wishes | {'scene': True}, limits):
        print(corpus.row(each), flush=True)
        found.append(each)
    print(f'\n{corpus.total(found)}')
    if options.output is not None:
        path = paths.named(options.output, '-o')
        with writing('-o', options.output), paths.replacing(path) as target:
            # names of files need not be UTF-8
            with target.open('w', encoding='utf-8', errors='backslashreplace') as stream:
                print(about(), file=stream)
                corpus.write(stream, found)
    return 0 if all(each.result == corpus.OK for each in found) else 1


_XACRO = re.compile('^([^=:]+):=')
_OPTIONS = {'positions': 'set', 'arguments': 'argument'}


def _arguments(given: Sequence[str]) -> dict[str, str]:
    """NAME=VALUE, and NAME:=VALUE as xacro has it."""
    return pairs((_XACRO.sub(r'\1=', each) for each in given), '--argument')
