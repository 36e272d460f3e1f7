"""The geoms of an MJCF that MuJoCo's viewer shows: of the groups 0 to 2.

MuJoCo moves the vertices of a mesh into the axes of inertia of the mesh. The frame of the file is
found again, because viewers read the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.exchange.robot import FramePose, Robot
from alf_ros.exchange.visuals import mesh_file, shape, show
from alf_ros.mechanism import VisualShape

_SHOWN = 3  # groups from there on are hidden
_UNSAID = (0.5, 0.5, 0.5, 1.0)  # the colour of a geom that says none


def add(robot: Robot, mujoco: Any, data: Any, path: Path, held: list[str]) -> None:
    """Give the parts of a robot their geoms; `held` has the part of each body."""
    model = data.model
    folder = _mesh_folder(mujoco, path) if model.nmesh else path.parent
    for geom in range(model.ngeom):
        part = held[model.geom_bodyid[geom]]
        frame = FramePose(data.geom_xpos[geom].copy(), data.geom_xmat[geom].reshape(3, 3).copy())
        try:
            found, inner = _shape(mujoco, model, geom, folder)
            show(robot, part, found, frame @ inner)
        except ValueError:
            robot.leave('shapes', f'geom {geom} of {part}')


def _mesh_folder(mujoco: Any, path: Path) -> Path:
    return path.parent / str(mujoco.MjSpec.from_file(str(path)).meshdir or '')


def _shape(mujoco: Any, model: Any, geom: int, folder: Path) -> tuple[VisualShape, FramePose]:
    """A shape, and its frame in the frame of the geom. Raises ValueError for one that is hidden,
    or of another kind."""
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    color, (a, b, c) = _color(model, geom), model.geom_size[geom]
    if model.geom_group[geom] >= _SHOWN or (color is not None and color[3] == 0.0):
        raise ValueError('hidden')
    here = FramePose(np.zeros(3), np.eye(3))
    if kind == kinds.mjGEOM_MESH:
        return _mesh(mujoco, model, model.geom_dataid[geom], folder, color)
    if kind == kinds.mjGEOM_BOX:
        return shape('box', (2.0 * a, 2.0 * b, 2.0 * c), color), here
    if kind == kinds.mjGEOM_SPHERE:
        return shape('sphere', (a,), color), here
    round_kinds = {kinds.mjGEOM_CYLINDER: 'cylinder', kinds.mjGEOM_CAPSULE: 'capsule'}
    if kind in round_kinds:
        return shape(round_kinds[kind], (a, 2.0 * b), color), here
    raise ValueError('no such kind')


def _mesh(
    mujoco: Any, model: Any, mesh: int, folder: Path, color: list[float] | None
) -> tuple[VisualShape, FramePose]:
    start = model.mesh_pathadr[mesh]
    if start < 0:
        raise ValueError('no file')
    name = model.paths[start:].split(b'\0')[0].decode()
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[mesh])
    inner = FramePose(model.mesh_pos[mesh].astype(float), turn.reshape(3, 3)).inverse
    return shape('mesh', model.mesh_scale[mesh], color, mesh_file(name, folder)), inner


def _color(model: Any, geom: int) -> list[float] | None:
    """As the viewer: the colour of the geom, or of its material if the geom says none."""
    color: list[float] = model.geom_rgba[geom].tolist()
    material = model.geom_matid[geom]
    if tuple(color) != _UNSAID:
        return color
    return None if material < 0 else list(map(float, model.mat_rgba[material]))
