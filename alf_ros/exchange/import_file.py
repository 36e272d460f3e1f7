"""A URDF, with a side file for its loops, or an MJCF as the text of a mechanism or scene file."""

from __future__ import annotations

from pathlib import Path

from alf_ros import resources
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
