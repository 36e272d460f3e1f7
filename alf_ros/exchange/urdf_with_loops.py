"""A URDF and the file beside it that closes its loops, in any of three formats."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from alf_ros.errors import InputError
from alf_ros.exchange import (
    closed_loop_file,
    loop_closures_file,
    two_ended_loops,
    urdf_gearboxes,
    urdf_joint_types,
    urdf_loops,
    urdf_loops_file,
    xml_file,
)
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.tree_posture import closed_positions
from alf_ros.exchange.two_ended_loops import TwoEndedLoop
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.scene.text import yaml_document

_TOLD = ('posture', 'limits of mimics')  # what closing loops tells


def side_file(path: Path) -> Path | None:
    """The file beside a URDF that closes its loops, in the format of others; None without one."""
    for beside in (path.with_suffix('.yaml'), path.with_name('loop_closures.yaml')):
        if beside.is_file():
            try:
                keys = set(yaml_document.read(beside).mapping())
            except InputError:
                continue
            if keys & {'closed_loop', 'closures'}:
                return beside
    return None


def read(
    path: Path,
    side: Path | None,
    positions: Mapping[str, float],
    floating: bool,
    arguments: Mapping[str, str],
) -> Robot:
    """The robot of a URDF, with its loops closed. side: the file beside it, if there is one.

    positions: of joints (rad, m), which stay there, and do not change the loops. Raises
    InputError.
    """
    keys = set() if side is None else set(yaml_document.read(side).mapping())
    of_gepetto, of_scikit = 'closed_loop' in keys, 'closures' in keys
    own = side is not None and not of_gepetto and not of_scikit
    by_file: dict[str, float] = {}
    if side and own:
        root = xml_file.root_of(path, arguments)
        by_file = urdf_loops_file.positions(side, urdf_joint_types.named(root))
    types = closed_loop_file.joint_types(side) if side and of_gepetto else {}
    follows = loop_closures_file.dependent(side) if side and of_scikit else []

    geared: dict[str, tuple[str, float, float]] = {}

    def reader_at(positions: Mapping[str, float]) -> UrdfReader:
        return UrdfReader(path, positions, floating, arguments, types, follows, geared)

    reader = reader_at({**by_file, **positions})
    geared, gearboxes = urdf_gearboxes.mimics(reader)
    if geared:  # known from the tree
        reader = reader_at({**by_file, **positions})
    loops = list(urdf_loops.loops(reader))
    if side and own:
        loops += urdf_loops_file.loops(side, reader)
    if side and of_gepetto:
        loops += closed_loop_file.loops(side)
    if side and of_scikit:
        loops += loop_closures_file.loops(side, reader)
    moved = _moved(reader, loops, by_file, positions)
    if moved:
        told = reader.robot.left_out.names
        reader = reader_at({**by_file, **positions, **moved})
        for kind in _TOLD:
            for text in told.get(kind, ()):
                reader.robot.leave(kind, text)
    if side is None and (other := side_file(path)) is not None:
        reader.robot.leave('loops (see --loops)', other.name)
    urdf_loops.leave(reader)
    for name in gearboxes:
        reader.robot.leave('gearboxes', name)
    for loop in loops:
        two_ended_loops.add(reader, loop)
    if side and of_gepetto:
        closed_loop_file.add_motors(side, reader)
    return reader.robot


def _moved(
    reader: UrdfReader,
    loops: Sequence[TwoEndedLoop],
    by_file: Collection[str],
    by_user: Collection[str],
) -> dict[str, float]:
    """Positions (rad, m) of joints that close the loops.

    Joints of the side file and of --set stay. If they leave no posture, only those with --set do.
    """
    try:
        return closed_positions(reader, loops, [*by_file, *by_user])
    except InputError:
        if not by_user or not set(by_file) - set(by_user):
            raise
    for kind in _TOLD:
        reader.robot.left_out.names.pop(kind, None)
    return closed_positions(reader, loops, list(by_user))
