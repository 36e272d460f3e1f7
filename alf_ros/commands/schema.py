"""Write the JSON schemas of mechanism and scene files, which editors use.

Those that come with the package know its own effects; these know in addition what other packages
register as effects on this machine.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from alf_ros import effects
from alf_ros.errors import InputError
from alf_ros.scene.json_schema import Schema, mechanism_schema, scene_schema


def text(schema: Schema) -> str:
    """A schema as the text of its file."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + '\n'


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f'{message} (see --help)')


def main(argv: Sequence[str] | None = None) -> int:
    """Write both schemas. Returns 0; raises InputError."""
    parser = _Parser(
        prog='schema',
        description='Write mechanism.json and scene.json: JSON schemas for editors, with all '
        'effects that are installed.',
    )
    parser.add_argument(
        '--folder', default='schema', metavar='DIR', help='where to (default: schema)'
    )
    folder = Path(parser.parse_args(argv).folder).expanduser()
    made = {'mechanism': mechanism_schema(), 'scene': scene_schema(effects.kinds())}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, schema in made.items():
            (folder / f'{name}.json').write_text(text(schema), encoding='utf-8')
    except OSError as error:
        raise InputError(str(error.strerror), key='--folder', value=str(folder)) from None
    print(f'mechanism.json and scene.json in {folder}')
    return 0
