"""Run a command of the package: `python -m alf_ros <command>`, or its name in lib/alf_ros."""

from __future__ import annotations

import ast
import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros.commands import COMMANDS, stop_signals
from alf_ros.errors import AlfError, InputError, printable, shortened
from alf_ros.resources import version

# Libraries of commands that need no ROS, by what setup.py calls them
_EXTRAS = {
    'urdf_parser_py': 'alf_ros[import]',
    'mujoco': 'alf_ros[import]',
    'mcap': 'alf_ros[record]',
}


def summary(module: str) -> str:
    """Return the first line of a module's docstring without importing it (that may take rclpy)."""
    source = Path(__file__).parent / (module.partition('.')[2].replace('.', '/') + '.py')
    docstring = ast.get_docstring(ast.parse(source.read_text(encoding='utf-8')))
    return (docstring or '').partition('\n')[0]


def usage() -> str:
    """Return the help of `python -m alf_ros`."""
    lines = [f'  {name:16}{summary(module)}' for name, module in COMMANDS.items()]
    return '\n'.join(
        [
            'usage: python -m alf_ros [-h] [--version] <command> ...',
            '',
            'ALF2 simulation of closed-loop mechanisms.',
            '',
            'commands:',
            *lines,
            '',
            '`python -m alf_ros <command> --help` explains one.',
        ]
    )


def run(name: str, arguments: list[str]) -> int:
    """Run the command `name`, or show help or the version, and return the exit code."""
    if name in ('', '-h', '--help'):
        print(usage(), file=sys.stdout if name else sys.stderr)
        return 0 if name else 2
    if name == '--version':
        print(version())
        return 0
    if name not in COMMANDS:
        raise InputError('no such command', value=name, choices=COMMANDS)
    # Before numpy is imported. Matrices here are small: threads of BLAS save no time, wait by
    # spinning, and beside other work make a command many times slower.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # rclpy reads its arguments there
    sys.argv = [f'alf_ros {name}', *arguments]
    code: int = importlib.import_module(COMMANDS[name]).main(arguments)
    return code


def _remedy(error: ImportError) -> str:
    """How to get the missing library."""
    missing = (error.name or '').partition('.')[0]
    if missing in _EXTRAS:
        return (
            f"`make setup` makes an interpreter that has it, or pip install '{_EXTRAS[missing]}'"
        )
    return (
        '`make setup` makes an interpreter that has it, and a sourced ROS 2 brings rclpy and the '
        'messages'
    )


def unless_half_made(unraisable: sys.UnraisableHookArgs) -> None:
    """A hook of what cannot be raised: the usual one, except for what Ctrl-C left half made while
    machine code was compiled. Such an object of llvmlite misses the handle that it would close."""
    module = getattr(unraisable.object, '__module__', None) or ''
    if not (unraisable.exc_type is AttributeError and module.startswith('llvmlite.')):
        sys.__unraisablehook__(unraisable)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command `argv[0]` with the rest of `argv` (default: the process's arguments).

    Returns the exit code: 2 for a usage or input error or a missing library, or 143 after SIGTERM,
    both told in one line; 130 after Ctrl-C.
    """
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = unless_half_made
    name, *rest = (sys.argv[1:] if argv is None else list(argv)) or ['']
    try:
        with stop_signals.heard():
            code = run(name, rest)
            sys.stdout.flush()
        return code
    except AlfError as error:
        print(f'alf_ros {printable(shortened(name))}: {error}', file=sys.stderr)
        return error.exit_code
    except ImportError as error:
        if (error.name or '').partition('.')[0] == 'alf_ros':
            raise
        print(f'alf_ros {name}: {error} ({sys.executable}); {_remedy(error)}', file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        return stop_signals.stopped(printable(shortened(name)), error)
    except BrokenPipeError:
        # The reader (head, less) has gone. Python flushes once more at exit: let that go nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def leave_folder() -> None:
    """Import nothing more from the present folder, which `python -m` puts before all others: a log
    or a scene may have come into it with a numpy.py, or a package that registers effects.

    It stays if this package itself lies in it, or PYTHONPATH names it.
    """
    here = os.path.realpath('.')
    named = [path for path in os.environ.get('PYTHONPATH', '').split(os.pathsep) if path]
    wanted = map(os.path.realpath, [str(Path(__file__).parents[1]), *named])
    if here not in wanted:
        sys.path[:] = [path for path in sys.path if os.path.realpath(path) != here]


def executable() -> int:
    """Run the command named like the file that was started: what lib/alf_ros/<command> calls."""
    return main([Path(sys.argv[0]).name, *sys.argv[1:]])


if __name__ == '__main__':
    leave_folder()
    sys.exit(main())
