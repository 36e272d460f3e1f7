"""Run a log again, and compare every recorded state bit for bit."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from alf_ros.commands.parser import add_trust, of_log
from alf_ros.commands.progress import ProgressBar
from alf_ros.logs import load
from alf_ros.logs.comparison import compare, told


def main(argv: Sequence[str] | None = None) -> int:
    """Verify one log; returns 0 if it is equal, 1 if not. Raises InputError."""
    parser = of_log(
        'verify',
        'Run a log again. Compare every state, joint, reaction, constraint and energy with the '
        'recorded values. Exit code: 0 if all are equal, 1 if not, 2 if the log cannot be run.',
    )
    add_trust(parser)
    options = parser.parse_args(argv)
    log = load(options.log)
    with ProgressBar('verify') as bar:
        result = compare(log, options.trust, bar)
    print(told(log, result))
    if result.trouble:
        print(f'alf_ros verify: {result.trouble}', file=sys.stderr)
    return 0 if result.equal else 1
