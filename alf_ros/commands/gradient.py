"""Derivatives of a number of a recorded run, by numbers of its scene."""

from __future__ import annotations

import json
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import add_trust, of_log, writing
from alf_ros.errors import StepError
from alf_ros.logs import load
from alf_ros.scene import overrides
from alf_ros.simulation.input_slopes import is_input


def main(argv: Sequence[str] | None = None) -> int:
    """Print the derivatives; returns 0, or 1 if a step fails. Raises InputError."""
    parser = of_log('gradient', 'Derivatives of a number of a recorded run.')
    parser.add_argument(
        '--of',
        required=True,
        metavar='NUMBER',
        help="'final(points.B.x)', 'max(norm(knee.force))', 'mean(energy)': max, min, final, "
        'mean, integral or rms of a quantity, as of record',
    )
    parser.add_argument(
        '--by',
        required=True,
        nargs='+',
        metavar='NAME',
        help='numbers of the scene: coupler.mass, spring.stiffness, initial.velocities.B.0',
    )
    parser.add_argument(
        '--every', type=int, metavar='N', help='steps between samples (default: ticks of the log)'
    )
    parser.add_argument('--json', metavar='FILE', help='also write all numbers to this file')
    add_trust(parser)
    options = parser.parse_args(argv)
    # it teaches numba new types: only where somebody asks
    from alf_ros.studies.gradients.gradient import gradient

    log = load(options.log)
    try:
        with parser.naming():
            found = gradient(log, options.of, options.by, every=options.every, trust=options.trust)
    except StepError as error:
        print(f'a step fails: {error}')
        return 1
    where = '' if found.t is None else f' at t = {found.t:.9g} s'
    print(f'{found.of} = {found.value:.9g} {found.unit}{where}')
    scene, width = log.scene(options.trust), max(map(len, options.by))
    print(f'{"by":{width}}  {"its value":>14}  {"derivative":>16}  {"for 1 % more":>14}')
    for name, slope in found.by.items():
        derivative = slope + 0.0  # without negative zeros
        if is_input(name, scene):  # added to what was held, which may have changed on the way
            print(f'{name:{width}}  {"added":>14}  {derivative:16.9g}  {"":14}'.rstrip())
            continue
        value = overrides.number(scene, name)
        for_more = 0.01 * value * slope + 0.0
        print(f'{name:{width}}  {value:14.6g}  {derivative:16.9g}  {for_more:14.3g}')
    if log.cut:  # of a shorter run than the one that was made, maybe
        print(log.cut)
    if found.trouble:
        print(f'the run is not resolved: {found.trouble}')
    if options.json:  # last: what cannot be written must not take the numbers along
        told = {'of': found.of, 'value': found.value, 'unit': found.unit, 't': found.t}
        with writing('--json', options.json):
            text = json.dumps({**told, 'by': dict(found.by)}, indent=1)
            paths.put(paths.named(options.json), text)
    return 0
