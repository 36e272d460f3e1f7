"""Continue a log from a chosen instant, with changes, in a new log."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import add_trust, of_log
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError, StepError
from alf_ros.logs import load
from alf_ros.ros.recording.fork import fork
from alf_ros.scene import overrides


def main(argv: Sequence[str] | None = None) -> int:
    """Fork one log; returns 0, or 1 if a step fails. Raises InputError."""
    parser = of_log('fork', 'Continue a log from a chosen instant, with changes, in a new log.')
    parser.add_argument(
        '--at', type=float, required=True, metavar='T', help='instant, simulated s'
    )
    parser.add_argument(
        '--set',
        metavar='NAME=VALUE',
        nargs='+',
        default=[],
        help='changes: coupler.mass=1.1, gravity.acceleration=[0,-1.62], solver.step=5e-4',
    )
    parser.add_argument(
        '--duration',
        type=float,
        metavar='S',
        help='simulated time, s (default: to the end of the log)',
    )
    parser.add_argument(
        '-o', '--output', metavar='NEW', help='folder to create (default: beside the log)'
    )
    add_trust(parser)
    options = parser.parse_args(argv)
    changes = overrides.read(options.set)
    log = load(options.log)
    own = log.path.parent if log.path.is_dir() else log.path.parent.parent
    new = paths.named(options.output, '--output') if options.output else None
    troubles: list[str] = []
    try:
        with parser.naming(), ProgressBar('fork') as bar:
            made = fork(
                log,
                options.at,
                changes,
                new.parent if new else own,
                new.name if new else '',
                options.duration,
                options.trust,
                bar,
                troubles.append,
            )
    except StepError as error:
        print(f'a step fails: {error}')
        return 1
    except OSError as error:
        raise InputError(str(error), key='--output') from None
    finally:
        for trouble in troubles:
            print(f'alf_ros fork: {trouble}', file=sys.stderr)
    log = load(made)
    parent = log.info['parent']
    print(f'{made}: from t = {parent["t"]:.9g} s of {parent["log"]} to t = {log.end:.9g} s')
    return 0
