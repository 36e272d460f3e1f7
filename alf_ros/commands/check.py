"""Judge whether a mechanism is sound: closure, mobility, redundancy, mass, singular positions."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, add_folder, add_numbers, numbers, writing, writing_into
from alf_ros.inspection import mechanism_plot
from alf_ros.inspection.soundness import as_data, examine, table
from alf_ros.scene.library import load


def main(argv: Sequence[str] | None = None) -> int:
    """Check one mechanism; returns 0 if it is sound, 1 if not. Raises InputError."""
    parser = Parser(
        command='check',
        description='Judge whether a mechanism is sound, and draw it. '
        'Exit code: 0 if it is sound, 1 if it is not, 2 if it cannot be read.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    add_numbers(parser)
    add_folder(parser, 'check', 'folder for the picture')
    parser.add_argument(
        '--json', metavar='FILE', help='write the answers and all singular positions to this file'
    )
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    found = examine(scene)
    print(table(found, scene.name))
    if options.json:
        with writing('--json', options.json):
            text = json.dumps(as_data(found, scene.name), indent=1)
            paths.put(paths.named(options.json), text)
    with writing_into(options.folder) as folder:
        path = folder / f'{scene.name}.png'
        try:
            mechanism_plot.draw(path, found)
            print(f'drawn in {path}')
        except ImportError as error:
            print(f'alf_ros check: no picture: {error}', file=sys.stderr)
    return 0 if found.sound else 1
