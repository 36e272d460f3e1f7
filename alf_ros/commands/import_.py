"""Turn URDF (loops and all) or MJCF into a mechanism or scene file."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.errors import InputError
from alf_ros.exchange.import_file import imported


def main(argv: Sequence[str] | None = None) -> int:
    """Import a file. Returns 0; raises InputError."""
    parser = Parser(
        prog='import',
        description='Write the mechanism of a URDF or MJCF file. What it does not carry over is '
        'listed at the head of the output, and on stderr.',
    )
    parser.add_argument('file', metavar='FILE', help='a URDF or an MJCF')
    parser.add_argument('--loops', metavar='SIDE.yaml', help='joints that close loops of a URDF')
    parser.add_argument('-o', '--output', metavar='OUT.yaml', help='(default: standard output)')
    parser.add_argument(
        '--scene', action='store_true', help='a scene: with gravity, damping and springs of joints'
    )
    parser.add_argument(
        '--stops',
        type=float,
        metavar='STIFFNESS',
        help='a scene, with a stop at each limit of a joint (N m/rad^1.5 or N/m^1.5)',
    )
    parser.add_argument(
        '--floating', action='store_true', help='the root link of a URDF is free, not fixed'
    )
    add_numbers(parser, 'JOINT=NUMBER', 'positions of joints at which it is drawn (rad, m)')
    options = parser.parse_args(argv)
    if options.stops is not None and not 0.0 < options.stops < math.inf:
        raise InputError('not a stiffness', key='--stops', value=options.stops)
    text = imported(
        options.file,
        loops=options.loops,
        scene=options.scene,
        stops=options.stops,
        floating=options.floating,
        positions=numbers(options.set),
    )
    if options.output is None:
        print(text, end='')
    else:
        with writing('-o', options.output):
            Path(options.output).expanduser().write_text(text, encoding='utf-8')
    for line in text.split('\n'):
        if line.startswith('#   ') or line == '# Not carried over:':
            print(line[2:], file=sys.stderr)
    return 0
