"""Run a log again, and say whether every recorded state comes out bit for bit."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from alf_ros.commands.parser import add_trust, of_log
from alf_ros.commands.progress import ProgressBar
from alf_ros.logs import load
from alf_ros.logs.comparison import Result, compare
from alf_ros.logs.log import Log

_MOST = 12  # variables told one by one


def told(log: Log, result: Result) -> str:
    """The result as lines of text."""
    lines = [f'{log.info["scene"]}: {result.steps} instants, {result.inputs} inputs']
    for key, (there, here) in result.versions.items():
        lines.append(f'  other {key}: {there} in the log, {here} here')
    if result.damage:
        lines.append(f'  not closed: {result.damage}')
    lines += [f'  wrong: {fault}' for fault in result.faults]
    if result.first is not None:
        lines.append(f'  first: {result.first}')
        if result.first.cause:
            lines.append(f'  last input before it: {result.first.cause}')
        lines.append('  largest difference of each variable:')
        worst = sorted(result.variables.items(), key=lambda item: -item[1].worst.size)
        for name, variable in worst[:_MOST]:
            size, step = variable.worst.size, variable.worst.step
            lines.append(
                f'    {name:40} {size:.3g} at step {step}, differs {variable.count} times'
            )
        if len(worst) > _MOST:
            lines.append(f'    and {len(worst) - _MOST} more')
    if result.equal:
        lines.append(f'EQUAL: {result.compared} messages, bit for bit')
    else:
        lines.append('DIFFERS' if result.first is not None else 'NOT AS IT WAS WRITTEN')
    return '\n'.join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Verify one log; returns 0 if it is equal, 1 if not. Raises InputError."""
    parser = of_log(
        'verify',
        'Run a log again and compare every recorded state, joint, reaction, constraint and energy '
        'with it. Exit code: 0 equal, 1 not, 2 for what cannot be run.',
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
