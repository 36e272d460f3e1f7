"""The page of the commands, from the parsers that they make."""

from __future__ import annotations

import argparse
import importlib
import re
from typing import Any, NoReturn
from unittest.mock import patch

from docstrings import markdown, table

from alf_ros.__main__ import summary
from alf_ros.commands import COMMANDS

_COLUMNS = 90
_PART = re.compile(r'\[(?:[^\[\]]|\[[^\]]*\])*\]|\S+')  # an option in brackets, or a word


class _ParserMadeError(Exception):
    """Ends a command where its parser is made and would read the arguments."""


def parser(name: str) -> argparse.ArgumentParser:
    """The parser of a command."""
    made: list[argparse.ArgumentParser] = []

    def take(found: argparse.ArgumentParser, *arguments: Any) -> NoReturn:
        made.append(found)
        raise _ParserMadeError

    module = importlib.import_module(COMMANDS[name])
    with patch.object(argparse.ArgumentParser, 'parse_args', take):
        try:
            module.main([])
        except _ParserMadeError:
            return made[0]
    raise AssertionError(f'{name} reads no arguments')


def page() -> str:
    """The page in Markdown."""
    rows = [(f'[`{name}`](#{name})', markdown(summary(COMMANDS[name]))) for name in COMMANDS]
    parts = [
        '# Commands',
        'Each is `python -m alf_ros <command>`, and `ros2 run alf_ros <command>` in a workspace. '
        'A mistake in the arguments ends in one line, with exit code 2. Ctrl-C and SIGTERM end a '
        'command with its processes, and with exit code 130 or 143; nodes end with 0.',
        table(('command', 'purpose'), rows),
    ]
    for name in COMMANDS:
        found = parser(name)
        usage = ' '.join(found.format_usage().split()).removeprefix('usage: ')
        parts += [
            f'## {name}',
            markdown(found.description or summary(COMMANDS[name])),
            f'```text\n{_folded(f"python -m alf_ros {name}{_arguments(usage)}")}\n```',
            table(('argument', 'meaning'), [_row(found, each) for each in found._actions]),
        ]
    return '\n\n'.join(parts) + '\n'


def _arguments(usage: str) -> str:
    """The part of a usage line after the name of the program."""
    at = min((usage.find(mark) for mark in (' [', ' -') if mark in usage), default=len(usage))
    return usage[at:]


def _folded(usage: str) -> str:
    """The usage in lines that fit the page; an option in brackets stays whole."""
    lines = ['']
    for part in _PART.findall(usage):
        if lines[-1] and len(lines[-1]) + len(part) >= _COLUMNS:
            lines.append('   ')
        lines[-1] = f'{lines[-1]} {part}' if lines[-1] else part
    return '\n'.join(lines)


def _row(found: argparse.ArgumentParser, action: argparse.Action) -> tuple[str, str]:
    formatter = found._get_formatter()
    if action.option_strings:
        metavar = formatter._get_default_metavar_for_optional(action)
        value = formatter._format_args(action, metavar) if action.nargs != 0 else ''
        name = ', '.join(action.option_strings) + (f' {value}' if value else '')
    else:
        name = formatter._format_args(
            action, formatter._get_default_metavar_for_positional(action)
        )
    return f'`{name}'.replace('|', r'\|') + '`', markdown(
        formatter._expand_help(action) if action.help else ''
    )
