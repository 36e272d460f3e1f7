"""List the natural frequencies of a scene at rest, their damping, and who moves in each mode."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from alf_ros import paths
from alf_ros.arrays import Floats
from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.scene.library import load
from alf_ros.studies.statics.mode_words import damping_text, frequency_text, largest_shares
from alf_ros.studies.statics.modes_page import page
from alf_ros.studies.statics.positions_of_rest import equilibrium
from alf_ros.studies.statics.vibration_modes import VibrationModes, modes


def main(argv: Sequence[str] | None = None) -> int:
    """List the modes of one scene; returns 0. Raises InputError."""
    parser = Parser(
        command='modes',
        description='List the lowest natural frequencies of a scene about its position of rest, '
        'with damping, and the shares of bodies and effects in their energy.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    parser.add_argument(
        '--count', type=int, default=20, metavar='N', help='modes at most (default: 20)'
    )
    parser.add_argument(
        '--at', type=float, metavar='T', help='instant at which drives are frozen, s (default: 0)'
    )
    add_numbers(parser)
    parser.add_argument('--json', metavar='FILE', help='write numbers and shapes to this file too')
    parser.add_argument(
        '--html', metavar='FILE', help='write a page that shows each mode moving, for a browser'
    )
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    with parser.naming(t='--at'):
        rest = equilibrium(scene, t=options.at)
        found = modes(rest, count=options.count)
    notes = (*rest.notes, *found.notes)
    print('\n'.join([f'at rest, {rest.stability}', *(f'note: {note}' for note in notes)]))
    print(_table(found))
    if options.json:
        with writing('--json', options.json):
            text = json.dumps(_data(found), indent=1, allow_nan=False)
            paths.put(paths.named(options.json), text)
    if options.html:
        title = f'{scene.name}: modes at rest, {rest.stability}'
        with writing('--html', options.html):
            paths.put(paths.named(options.html), page(found, title, notes))
    return 0


def _table(found: VibrationModes) -> str:
    kinetic, potential = found.kinetic_shares, found.potential_shares
    head = f'{"mode":>4}{"frequency, Hz":>18}{"damping ratio":>18}'
    lines = ['', f'{head}   kinetic energy; potential energy']
    for k in range(len(found.squares)):
        shares = f'{largest_shares(kinetic, k)}; {largest_shares(potential, k)}'
        low, ratio = frequency_text(found, k), damping_text(found, k)
        lines.append(f'{k + 1:>4}{low:>18}{ratio:>18}   {shares}')
    return '\n'.join(lines)


def _data(found: VibrationModes) -> dict[str, object]:
    """Numbers as plain data; None for values that are not finite."""

    def plain(values: Floats) -> list[object]:
        return [None if not np.isfinite(value) else float(value) for value in values]

    return {
        'frequencies': plain(found.frequencies),
        'squares': plain(found.squares),
        'damping_ratios': plain(found.damping_ratios),
        'shapes': [plain(shape) for shape in found.shapes],
        'kinetic_shares': {name: plain(each) for name, each in found.kinetic_shares.items()},
        'potential_shares': {name: plain(each) for name, each in found.potential_shares.items()},
    }
