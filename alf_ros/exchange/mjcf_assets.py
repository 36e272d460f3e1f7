"""An MJCF whose meshes or pictures are not there: compiled without them.

Files are shared without their meshes. Where a body says its inertia a mesh moves nothing; where it
does not, the mass of the mesh is unknown, and the body is named.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from alf_ros.exchange import mjcf_files


def compiled_without(mujoco: Any, path: Path) -> tuple[Any, list[str]]:
    """The model without what needs files that are not there, and bodies that lack its mass.

    Raises ValueError, as MuJoCo does.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    folders = mjcf_files.folders(path)
    gone = {_name(mesh) for mesh in spec.meshes if _missing(mesh, folders)}
    fields = {_name(field) for field in spec.hfields if _missing(field, folders)}
    lighter, lost = [], set[str]()
    for geom in list(spec.geoms):
        if geom.meshname in gone or geom.hfieldname in fields:
            body = geom.parent
            if body.name != 'world' and not body.explicitinertial:
                lighter.append(body.name or 'a body without name')
            lost.add(geom.name)
            spec.delete(geom)
    _without_geoms(mujoco, spec, lost - {''})
    for mesh in list(spec.meshes):
        if _name(mesh) in gone:
            spec.delete(mesh)
    for field in list(spec.hfields):
        if _name(field) in fields:
            spec.delete(field)
    for skin in list(spec.skins):
        if _missing(skin, folders):
            spec.delete(skin)
    _without_pictures(spec, folders)
    return spec.compile(), lighter


def _without_geoms(mujoco: Any, spec: Any, lost: Collection[str]) -> None:
    """Delete the pairs and sensors of geoms that are not there any more."""
    geom = mujoco.mjtObj.mjOBJ_GEOM
    for pair in list(spec.pairs):
        if pair.geomname1 in lost or pair.geomname2 in lost:
            spec.delete(pair)
    for sensor in list(spec.sensors):
        ends = (sensor.objtype, sensor.objname), (sensor.reftype, sensor.refname)
        if any(kind == geom and name in lost for kind, name in ends):
            spec.delete(sensor)


def _without_pictures(spec: Any, folders: Sequence[Path]) -> None:
    gone = set()
    for texture in list(spec.textures):
        files = [texture.file, *texture.cubefiles]
        if any(_is_gone(file, texture.compiler.texturedir, folders) for file in files):
            gone.add(_name(texture))
            spec.delete(texture)
    for material in spec.materials:
        kept = ['' if name in gone else name for name in material.textures]
        if kept != list(material.textures):
            material.textures = kept


def _name(asset: Any) -> str:
    """How geoms and materials call it: by the name of its file if it has none."""
    return asset.name or Path(asset.file).stem


def _missing(asset: Any, folders: Sequence[Path]) -> bool:
    return _is_gone(asset.file, asset.compiler.meshdir, folders)


def _is_gone(file: str, within: str | None, folders: Sequence[Path]) -> bool:
    """Whether no folder has a file: MuJoCo does not say to which model it belongs."""
    return bool(file) and not any((each / (within or '') / file).is_file() for each in folders)
