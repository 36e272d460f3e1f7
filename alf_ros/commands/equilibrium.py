"""Find where a scene rests, whether it rests stably, and how this changes with a number."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, add_numbers, numbers, refuse_given, writing
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.scene.library import load
from alf_ros.scene.scene import Scene
from alf_ros.studies.statics import path_report
from alf_ros.studies.statics.equilibrium_path import equilibrium_path
from alf_ros.studies.statics.positions_of_rest import equilibria, equilibrium
from alf_ros.studies.statics.rest_report import as_data, report


def main(argv: Sequence[str] | None = None) -> int:
    """Find positions of rest of one scene; returns 0. Raises InputError if there is none."""
    parser = Parser(
        command='equilibrium',
        description='Find where a scene rests under its effects, from where it starts, and '
        'whether it rests stably.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    parser.add_argument(
        '--at',
        type=float,
        metavar='T',
        help='instant at which drives, motors and tables are frozen, s (default: 0)',
    )
    parser.add_argument(
        '--nearest',
        action='store_true',
        help='find the nearest position of rest of any kind, also an unstable one',
    )
    parser.add_argument(
        '--starts',
        type=int,
        metavar='N',
        help='also search from N random positions, and list all positions of rest found',
    )
    parser.add_argument('--seed', type=int, help='seed of the random positions (default: 0)')
    add_numbers(parser)
    parser.add_argument('--json', metavar='FILE', help='also write all numbers to this file')
    _add_path(parser)
    options = parser.parse_args(argv)
    _refuse_others(options)
    scene = load(options.scene, numbers(options.set))
    with parser.naming(t='--at', start='--from', end='--to'):
        if options.over is not None:
            return _follow(scene, options)
        if options.starts is not None:
            starts, seed = options.starts, options.seed or 0
            with ProgressBar('equilibrium') as bar:
                found = equilibria(scene, starts=starts, seed=seed, t=options.at, report=bar)
        else:
            found = (equilibrium(scene, t=options.at, nearest=options.nearest),)
    print('\n\n'.join(report(each) for each in found))
    if options.json:
        with writing('--json', options.json):
            text = json.dumps([as_data(each) for each in found], indent=1)
            paths.put(paths.named(options.json), text)
    return 0


def _refuse_others(options: Namespace) -> None:
    """Raises InputError for options of another search."""
    if options.over is not None:
        others = ('starts', 'seed', 'json')
        return refuse_given(options, others, 'has no meaning with --over')
    path = ('to', 'begin', 'back', 'branches', 'csv', 'picture', 'show')
    refuse_given(options, path, 'has no meaning without --over', begin='from')
    if options.starts is not None:
        return refuse_given(options, ('nearest',), 'has no meaning with --starts')
    return refuse_given(options, ('seed',), 'has no meaning without --starts')


def _add_path(parser: Parser) -> None:
    group = parser.add_argument_group('equilibrium path')
    group.add_argument(
        '--over',
        metavar='NAME',
        help='follow the position of rest while this number changes: spring.stiffness, '
        'gravity.acceleration.1, coupler.mass, crank_pin.effort, t, ...',
    )
    group.add_argument('--to', type=float, metavar='VALUE', help='value at which the path ends')
    group.add_argument(
        '--from',
        dest='begin',
        type=float,
        metavar='VALUE',
        help='value at which the path begins (default: the value in the scene)',
    )
    group.add_argument(
        '--back',
        type=float,
        metavar='VALUE',
        help='value at which the path ends on the other side of its start (default: as far from '
        'the start as --to)',
    )
    group.add_argument(
        '--branches', action='store_true', help='also follow the paths through branch points'
    )
    group.add_argument('--csv', metavar='FILE', help='write all points of the path to this file')
    group.add_argument(
        '--picture', metavar='FILE', help='draw the path to this file: .png, .svg, .pdf'
    )
    group.add_argument(
        '--show',
        nargs='+',
        default=[],
        metavar='NAME',
        help='quantities in the picture: points.B.y, knee.position, ... (default: those that '
        'change most)',
    )


def _follow(scene: Scene, options: Namespace) -> int:
    """Follow a path, print and write it; returns 0."""
    if options.to is None:
        raise InputError('a path has an end', key='--to', expected='a value')
    with ProgressBar('equilibrium') as bar:
        path = equilibrium_path(
            scene,
            over=options.over,
            start=options.begin,
            end=options.to,
            back=options.back,
            t=options.at,
            nearest=options.nearest,
            report=bar,
        )
    with ProgressBar('branches') as bar:
        others = path.branches(bar) if options.branches else {}
    print(path_report.report(path, others))
    if options.csv:
        with writing('--csv', options.csv):
            path.write(options.csv)
    if options.picture:
        path.plot(*options.show, file=options.picture, branches=others.values())
    return 0
