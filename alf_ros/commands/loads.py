"""Compute the efforts that a given motion needs, the reactions, and the fastest run of a path.

See doc/loads.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence

from alf_ros.commands.parser import Parser, add_numbers, numbers, pairs, refuse_given, writing
from alf_ros.errors import InputError
from alf_ros.scene.library import load
from alf_ros.scene.scene import Scene
from alf_ros.scene.text.expression import ExpressionError, evaluate
from alf_ros.simulation.input_checks import number, whole
from alf_ros.studies.loads.fastest_run import fastest
from alf_ros.studies.loads.load_history import LoadHistory
from alf_ros.studies.loads.prescribed_loads import loads

_MOST = 1_000_000  # instants


def main(argv: Sequence[str] | None = None) -> int:
    """Compute the loads of one motion; returns 0, or 1 if the actuators cannot make it. Raises
    InputError."""
    parser = Parser(
        command='loads',
        description='Compute the efforts of chosen actuators for the motion that the drives of a '
        'scene prescribe, with the reactions of all joints: inverse dynamics. With --limits, the '
        'fastest run of this motion as a path.',
    )
    parser.add_argument('scene', help='a scene with drives: a name, or the path of a file')
    parser.add_argument(
        '--actuators',
        nargs='+',
        metavar='NAME',
        help='actuators: joints, or wrenches.C.force.z, ... (default: the driven joints)',
    )
    parser.add_argument(
        '--duration', type=float, required=True, metavar='S', help='duration of the motion, s'
    )
    parser.add_argument(
        '--rate',
        type=float,
        metavar='HZ',
        help='instants per second (default: 100)',
    )
    parser.add_argument(
        '--weights',
        nargs='+',
        default=[],
        metavar='NAME=NUMBER',
        help='weights of efforts, if there are more actuators than freedoms (default: 1)',
    )
    parser.add_argument(
        '--without', nargs='+', default=[], metavar='EFFECT', help='effects that do not act'
    )
    parser.add_argument(
        '--limits',
        nargs='+',
        default=[],
        metavar='NAME=MOST',
        help='find the fastest run under these limits of efforts (N, N m): NAME=MOST or '
        'NAME=LEAST:MOST; the t of the drives is then the parameter of the path',
    )
    parser.add_argument(
        '--pieces', type=int, metavar='N', help='pieces of the path (default: 1000)'
    )
    add_numbers(parser)
    parser.add_argument(
        '--csv', metavar='FILE', help='write efforts and reactions over time to this file'
    )
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    with parser.naming():
        history = _history(scene, options)
    for note in history.notes:
        print(f'note: {note}')
    print(_table(history))
    if options.csv:
        with writing('--csv', options.csv):
            print(f'written: {history.csv(options.csv)}')
    return 0 if history.is_possible else 1


def _history(scene: Scene, options: argparse.Namespace) -> LoadHistory:
    """The loads of the motion as it is, or of its fastest run, which is printed."""
    duration = number(options.duration, '--duration', 0.0)
    if options.limits:
        if options.actuators:
            raise InputError('the limits name the actuators', key='--actuators')
        refuse_given(options, ('rate', 'weights'), 'has no meaning with --limits')
        run = fastest(
            scene,
            _limits(options.limits),
            length=duration,
            pieces=1000 if options.pieces is None else options.pieces,
            without=options.without,
        )
        print(f'the fastest run takes {run.duration:.9g} s')
        for name, part in run.limited_by.items():
            print(f'  {name} is at a limit for {part:.1%} of the time')
        return run.loads
    refuse_given(options, ('pieces',), 'has no meaning without --limits')
    rate = number(100.0 if options.rate is None else options.rate, '--rate', 0.0)
    if duration and not round(duration * rate):
        expected = f'{1.0 / duration:g} or more'
        raise InputError(
            'no instant behind the first', key='--rate', value=rate, expected=expected
        )
    if duration * rate > _MOST:
        raise InputError(f'more than {_MOST} instants', key='--duration', value=duration)
    count = whole(round(duration * rate), '--duration', 1)
    return loads(
        scene,
        options.actuators,
        times=[k * duration / count for k in range(count + 1)],
        weights=numbers(options.weights, '--weights'),
        without=options.without,
    )


def _limits(given: Iterable[str]) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    expected = 'NAME=MOST or NAME=LEAST:MOST'
    for name, value in pairs(given, '--limits', expected).items():
        try:
            ends = [evaluate(part, {}) for part in value.split(':')]
        except ExpressionError as error:
            text = f'{name}={value}'
            raise InputError(str(error), key='--limits', value=text, expected=expected) from None
        found[name] = [-ends[0], ends[0]] if len(ends) == 1 else ends
    return found


def _table(history: LoadHistory) -> str:
    peaks = history.peaks
    width = max(map(len, peaks)) + 2
    lines = ['', f'{"":{width}}{"largest":>14}{"at t, s":>12}{"rms":>14}']
    for name, peak in peaks.items():
        if name in history.names or peak.largest != 0.0:
            values = f'{peak.largest:>14.6g}{peak.t:>12.6g}{peak.rms:>14.6g}'
            lines.append(f'{name:{width}}{values}  {peak.unit}')
    return '\n'.join(lines)
