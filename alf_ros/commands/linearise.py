"""Write the linear model of a scene, about rest or about an instant of its motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.errors import InputError
from alf_ros.scene.library import load
from alf_ros.scene.scene import Scene
from alf_ros.simulation.input_checks import number, steps_of
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.floquet import FloquetModel, floquet
from alf_ros.studies.statics.linear_files import write
from alf_ros.studies.statics.linear_model import LinearModel
from alf_ros.studies.statics.linearisation import linearise


def main(argv: Sequence[str] | None = None) -> int:
    """Linearise one scene; returns 0. Raises InputError."""
    parser = Parser(
        command='linearise',
        description='Compute the linear model of a scene about its position of rest, or about an '
        'instant of its motion, between named inputs and outputs.',
    )
    parser.add_argument('scene', help='a scene or a mechanism: a name, or the path of a file')
    parser.add_argument(
        '--at', type=float, metavar='T', help='linearise about this instant of the motion, s'
    )
    parser.add_argument(
        '--inputs',
        nargs='+',
        default=[],
        metavar='NAME',
        help='inputs of the model: crank_pin.effort, wrenches.coupler.force.x, '
        'targets.crank_pin.position, ...',
    )
    parser.add_argument(
        '--outputs',
        nargs='+',
        metavar='NAME',
        help='outputs of the model: crank_pin.position, points.B.x, knee.force, ... (default: the '
        'positions of all joints)',
    )
    parser.add_argument(
        '--period',
        type=float,
        metavar='T',
        help='compute the Floquet multipliers of the periodic motion with this period (s) that '
        'begins at the start or at --at, in place of the model',
    )
    add_numbers(parser)
    parser.add_argument(
        '-o',
        '--output',
        nargs='+',
        default=[],
        metavar='FILE',
        help='files to write: .npz (numpy), .mat (MATLAB), .json',
    )
    options = parser.parse_args(argv)
    scene = load(options.scene, numbers(options.set))
    about: Scene | Simulation = scene
    if options.at is not None:
        about = Simulation(scene)
        about.step(steps_of(number(options.at, '--at', 0.0), about.h, 0))
    if options.period is not None:
        if options.inputs or options.outputs or options.output:
            raise InputError('has neither inputs, outputs nor files', key='--period')
        with parser.naming():
            print(_multipliers(floquet(about, period=options.period)))
        return 0
    with parser.naming():
        model = linearise(about, inputs=options.inputs, outputs=options.outputs)
    print(_table(model))
    for name in options.output:
        with writing('--output', name):
            print(f'written: {write(model, name)}')
    return 0


def _multipliers(found: FloquetModel) -> str:
    lines = [f'{found.verdict}, period {found.period:g} s', '']
    lines.append(f'{"":4}{"multiplier":>30}{"magnitude":>18}{"exponent, 1/s":>30}')
    each = zip(found.multipliers, found.exponents, strict=True)
    for k, (value, rate) in enumerate(each, 1):
        lines.append(f'{k:>4}{_complex(value):>30}{abs(value):>18.9g}{_complex(rate):>30}')
    if found.autonomous:
        lines += ['', 'one multiplier is 1 because the motion may begin at any time']
    return '\n'.join(lines)


def _complex(value: complex) -> str:
    return f'{value.real:.9g}{value.imag:+.9g}j' if value.imag else f'{value.real:.9g}'


def _table(model: LinearModel) -> str:
    lines = [f'{len(model.A)} states, {len(model.inputs)} inputs, {len(model.outputs)} outputs']
    lines += [f'note: {note}' for note in model.notes]
    lines += ['', f'{"mode":>4}{"frequency, Hz":>18}{"damping ratio":>18}']
    each = zip(model.frequencies, model.damping_ratios, strict=True)
    lines += [f'{k:>4}{f:>18.9g}{z + 0.0:>18.9g}' for k, (f, z) in enumerate(each, 1)]
    settles = not model.A.size or np.linalg.cond(model.A) < 1e12
    if model.inputs and model.outputs and settles:
        gain = model.D - model.C @ np.linalg.solve(model.A, model.B)
        lines += ['', 'steady output for a unit of each input:']
        width = max(map(len, model.outputs)) + 2
        head = ''.join(f'{name:>{max(18, len(name) + 2)}}' for name in model.inputs)
        lines.append(' ' * width + head)
        for name, row in zip(model.outputs, gain, strict=True):
            cells = zip(model.inputs, row, strict=True)
            values = ''.join(f'{value + 0.0:>{max(18, len(n) + 2)}.9g}' for n, value in cells)
            lines.append(f'{name:{width}}{values}')
    return '\n'.join(lines)
