"""Turn URDF (loops and all) or MJCF into a mechanism or scene file."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros import resources
from alf_ros.commands.parser import Parser, add_numbers, numbers, writing
from alf_ros.errors import InputError
from alf_ros.exchange import mechanism_text, mjcf_import, urdf_loops, urdf_loops_file
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.scene.scene import scene_from_text


def imported(
    source: str,
    *,
    loops: str | None = None,
    scene: bool = False,
    stops: float | None = None,
    floating: bool = False,
    positions: dict[str, float] | None = None,
) -> str:
    """The text of a mechanism file (of a scene if `scene` or `stops`), which loads.

    Needs urdf_parser_py for URDF, mujoco for MJCF. Raises InputError.
    """
    robot = _robot(Path(source).expanduser(), loops, floating, positions or {})
    if not robot.parts:
        raise InputError('nothing in it can move', file=source)
    scene = scene or stops is not None
    text = mechanism_text.text(robot, scene, stops, resources.version())
    whole = text if scene else 'mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n'))
    try:
        scene_from_text(whole)
    except InputError as error:
        message = f'what it becomes cannot be used: {error.key or ""}: {error.message}'
        raise InputError(message, file=source, value=error.value) from None
    return text


def _robot(path: Path, loops: str | None, floating: bool, positions: dict[str, float]) -> Robot:
    """What a file describes; MJCF is known by its first element."""
    if not path.is_file():
        raise InputError('no such file', file=str(path))
    if b'<mujoco' not in path.read_bytes():
        side = None if loops is None else Path(loops).expanduser()
        drawn = {} if side is None else urdf_loops_file.positions(side)
        reader = UrdfReader(path, drawn | positions, floating)
        urdf_loops.close(reader)
        if side is not None:
            urdf_loops_file.close(side, reader)
        return reader.robot
    for given, option in ((loops, '--loops'), (floating, '--floating')):
        if given:
            raise InputError('for URDF only: MJCF says it itself', key=option)
    return mjcf_import.read(path, positions)


def main(argv: Sequence[str] | None = None) -> int:
    """Import a file. Returns 0; raises InputError."""
    parser = Parser(
        prog='import',
        description='Write the mechanism of a URDF or MJCF file. What it does not carry over is '
        'listed at the head of the output, and on stderr.',
    )
    parser.add_argument('file', metavar='FILE', help='a URDF or an MJCF')
    parser.add_argument('--loops', metavar='SIDE.yaml', help='joints that close loops of a URDF')
    parser.add_argument('-o', '--output', metavar='OUT.yaml', help='(default: standard output)')
    parser.add_argument(
        '--scene', action='store_true', help='a scene: with gravity, damping and springs of joints'
    )
    parser.add_argument(
        '--stops',
        type=float,
        metavar='STIFFNESS',
        help='a scene, with a stop at each limit of a joint (N m/rad^1.5 or N/m^1.5)',
    )
    parser.add_argument(
        '--floating', action='store_true', help='the root link of a URDF is free, not fixed'
    )
    add_numbers(parser, 'JOINT=NUMBER', 'positions of joints at which it is drawn (rad, m)')
    options = parser.parse_args(argv)
    if options.stops is not None and not 0.0 < options.stops < math.inf:
        raise InputError('not a stiffness', key='--stops', value=options.stops)
    text = imported(
        options.file,
        loops=options.loops,
        scene=options.scene,
        stops=options.stops,
        floating=options.floating,
        positions=numbers(options.set),
    )
    if options.output is None:
        print(text, end='')
    else:
        with writing('-o', options.output):
            Path(options.output).expanduser().write_text(text, encoding='utf-8')
    for line in text.split('\n'):
        if line.startswith('#   ') or line == '# Not carried over:':
            print(line[2:], file=sys.stderr)
    return 0
