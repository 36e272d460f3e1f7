"""Say whether a mechanism is sound: closing, mobility, redundancy, mass, singular positions."""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from alf_ros import resources
from alf_ros.commands.parser import Parser, add_folder, add_numbers, numbers, writing_into
from alf_ros.errors import InputError
from alf_ros.inspection import mechanism_plot
from alf_ros.inspection.soundness import Soundness, examine
from alf_ros.scene.scene import Scene, load_scene
from alf_ros.scene.text import yaml_document

_WIDTH = 100


def load(source: str, parameters: dict[str, float]) -> Scene:
    """The scene of a name or a file; a mechanism alone is put into an empty one.

    Raises InputError.
    """
    is_file = source.endswith(('.yaml', '.yml')) or '/' in source
    if is_file:
        root = yaml_document.read(Path(source).expanduser())
        alone = isinstance(root.value, dict) and 'alf' in root.value
        name = re.sub(r'[^\w.-]', '_', Path(source).stem)[:100]
    else:
        scenes, mechanisms = (
            {path.stem for each in resources.folder(kind) for path in each.glob('*.yaml')}
            for kind in ('scenes', 'mechanisms')
        )
        alone, name = source in mechanisms - scenes, source
        if source not in scenes | mechanisms:
            message = 'neither a scene nor a mechanism of this name'
            raise InputError(message, key='check', value=source, choices=scenes | mechanisms)
    if alone:
        return load_scene({'name': name, 'mechanism': source}, parameters)
    return load_scene(source, parameters)


def table(found: Soundness, name: str) -> str:
    """The answers as lines of text."""
    lines = [f'{name}: is this mechanism sound?', '']
    for answer in found.answers:
        start = f'  {answer.verdict:5}{answer.question:20}'
        lines += textwrap.wrap(
            answer.answer, _WIDTH, initial_indent=start, subsequent_indent=' ' * len(start)
        )
    return '\n'.join([*lines, '', 'sound' if found.sound else 'NOT SOUND'])


def main(argv: Sequence[str] | None = None) -> int:
    """Check one mechanism; returns 0 if it is sound, 1 if not. Raises InputError."""
    parser = Parser(
        prog='check',
        description='Say whether a mechanism is sound, and draw it. '
        'Exit code: 0 if it is, 1 if not, 2 for what cannot be read.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    add_numbers(parser)
    add_folder(parser, 'check', 'for the picture')
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    found = examine(scene)
    print(table(found, scene.name))
    with writing_into(options.folder) as folder:
        path = folder / f'{scene.name}.png'
        try:
            mechanism_plot.draw(path, found)
            print(f'drawn in {path}')
        except ImportError as error:
            print(f'alf_ros check: no picture: {error}', file=sys.stderr)
    return 0 if found.sound else 1
