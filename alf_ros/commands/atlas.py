"""Map all positions of a mechanism over one or two of its coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence

from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.commands.progress import ProgressBar
from alf_ros.scene.library import load
from alf_ros.studies.atlas.mapped_piece import DEAD_POINT, TRAVEL_LIMIT
from alf_ros.studies.atlas.position_map import Atlas, atlas

_MOST = 12  # lines of one kind


def main(argv: Sequence[str] | None = None) -> int:
    """Map one mechanism; returns 0. Raises InputError."""
    parser = Parser(
        command='atlas',
        description='Map all positions of a mechanism over one or two of its coordinates: '
        'assembly modes, branches, singular positions, travel limits.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    parser.add_argument(
        '--over',
        nargs='+',
        metavar='COORDINATE',
        help='one or two inputs: joint coordinates, or components of points (B.x)',
    )
    parser.add_argument(
        '--levels',
        type=int,
        metavar='N',
        help='values of the second input (default: 25)',
    )
    parser.add_argument(
        '--hold',
        nargs='+',
        default=[],
        metavar='COORDINATE=VALUE',
        help='other coordinates that stay at a value, rad or m',
    )
    parser.add_argument(
        '--output',
        metavar='COORDINATE',
        help='output of the velocity ratio and the mechanical advantage',
    )
    parser.add_argument(
        '--bar',
        nargs=2,
        metavar='POINT',
        help='ends of the bar of the transmission angle, the output end last',
    )
    parser.add_argument(
        '--starts',
        type=int,
        metavar='N',
        help='random places in a row that must find nothing new (default: 200; over two '
        'coordinates 40)',
    )
    parser.add_argument(
        '--seed', type=int, default=0, help='seed of the random places (default: 0)'
    )
    add_numbers(parser)
    parser.add_argument(
        '-o', '--html', metavar='FILE', help='write an interactive page to this file'
    )
    parser.add_argument(
        '--csv', metavar='FILE', help='write all positions to this file, as a table'
    )
    options = parser.parse_args(argv)
    with parser.naming(), ProgressBar('atlas') as bar:
        found = atlas(
            load(options.scene, numbers(options.set)),
            options.over,
            levels=options.levels,
            hold=numbers(options.hold, '--hold'),
            output=options.output,
            bar=options.bar,
            starts=options.starts,
            seed=options.seed,
            report=bar,
        )
    print('\n'.join(report(found)))
    for key, file, write in (
        ('--html', options.html, found.write_html),
        ('--csv', options.csv, found.write_csv),
    ):
        if file:
            with writing(key, file):
                write(file)
    return 0


def report(found: Atlas) -> list[str]:
    """The result in lines."""
    over = found.over.name + (f' and {found.second.name}' if found.second else '')
    circuits = sum(max((p.circuit for p in s.pieces), default=0) for s in found.sheets)
    kinds = [turning.kind for turning in found.turnings]
    sheets = f' on {len(found.sheets)} sheets' if found.second else ''
    lines = [
        f'{found.name}: positions over {over}',
        '',
        f'  circuits             {circuits}{sheets}',
        f'  singular positions   {len(found.nodes)}',
        f'  travel limits        {kinds.count(TRAVEL_LIMIT)}',
    ]
    if found.output:
        lines.append(f'  dead points          {kinds.count(DEAD_POINT)}')
    lines += ['', f'  {found.statement}']
    return lines if found.second else lines + _details(found)


def _details(found: Atlas) -> list[str]:
    lines = ['', f'{found.over.name}, {found.over.unit:16}positions']
    lines += [f'  {low:.9g} to {high:.9g}: {count}' for low, high, count in found.counts()][:_MOST]
    lines += ['', f'{"circuit":24}travel']
    for circuit, (low, high) in [*found.limits().items()][:_MOST]:
        travel = 'full turns' if math.isinf(high) else f'{low:.9g} to {high:.9g}'
        lines.append(f'  {circuit:<22}{travel}')
    texts = dict.fromkeys(node.report.text for node in found.nodes)
    return lines + ([''] + [f'  {text}' for text in texts][:_MOST] if texts else [])
