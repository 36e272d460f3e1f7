"""Find where a scene rests, and whether it rests stably."""

from __future__ import annotations

import json
from collections.abc import Sequence

from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.scene.library import load
from alf_ros.studies.statics.positions_of_rest import equilibria, equilibrium
from alf_ros.studies.statics.rest_report import as_data, report


def main(argv: Sequence[str] | None = None) -> int:
    """Find positions of rest of one scene; returns 0. Raises InputError if there is none."""
    parser = Parser(
        prog='equilibrium',
        description='Find where a scene rests under its effects, from where it starts, and '
        'whether it rests stably.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    parser.add_argument(
        '--at', type=float, metavar='T', help='instant at which drives are frozen, s (default: 0)'
    )
    parser.add_argument(
        '--nearest',
        action='store_true',
        help='the nearest position of rest of any kind, in place of going down the potential',
    )
    parser.add_argument(
        '--starts',
        type=int,
        default=0,
        metavar='N',
        help='search from N random positions too, and list all positions of rest found',
    )
    parser.add_argument('--seed', type=int, default=0, help='of the random positions (default: 0)')
    add_numbers(parser)
    parser.add_argument('--json', metavar='FILE', help='write all numbers to this file too')
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    if options.starts:
        found = equilibria(scene, starts=options.starts, seed=options.seed, t=options.at)
    else:
        found = (equilibrium(scene, t=options.at, nearest=options.nearest),)
    print('\n\n'.join(report(each) for each in found))
    if options.json:
        with writing('--json', options.json), open(options.json, 'w', encoding='utf-8') as stream:
            json.dump([as_data(each) for each in found], stream, indent=1)
    return 0
