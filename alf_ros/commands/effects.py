"""List all effects, or measure the cost and the influence of the effects of a scene."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.errors import InputError
from alf_ros.inspection import effect_costs_plot, effects_table
from alf_ros.inspection.effect_costs import effect_costs
from alf_ros.logs.provenance import about
from alf_ros.scene.scene import load_scene


def main(argv: Sequence[str] | None = None) -> int:
    """List the effects, or measure the effects of a scene. Returns 0; raises InputError,
    StepError."""
    parser = Parser(
        command='effects',
        description='Without SCENE: list all effects with their parameters, defaults and units. '
        'With SCENE: measure what each of its effects costs on this machine, and how it changes '
        'the motion. Write the results as CSV and as a picture.',
    )
    parser.add_argument('scene', nargs='?', metavar='SCENE', help='name or path of a scene')
    parser.add_argument(
        '--duration', type=float, default=1.0, metavar='S', help='simulated time, s (default: 1)'
    )
    add_folder(parser, 'effects', 'folder for the results')
    options = parser.parse_args(argv)
    if options.scene is None:
        print(effects_table.listing())
        return 0
    if not 0.0 < options.duration < math.inf:
        raise InputError(
            'not a duration', key='--duration', value=options.duration, expected='above 0 s'
        )
    scene = load_scene(options.scene)
    if not scene.effects:
        raise InputError('this scene has no effects', key='SCENE', value=options.scene)
    found = effect_costs(scene, options.duration)
    print(effects_table.table(found))
    written = [f'{scene.name}.csv']
    with writing_into(options.folder) as folder:
        effects_table.write(folder / written[0], found, about())
        try:
            effect_costs_plot.draw(folder / f'{scene.name}.png', scene.name, found)
            written.append(f'{scene.name}.png')
        except ImportError as error:
            print(f'alf_ros effects: no picture: {error}', file=sys.stderr)
    print(f'{" and ".join(written)} in {folder}')
    return 0
