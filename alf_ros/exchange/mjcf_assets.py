"""An MJCF whose meshes or pictures are not there: compiled without them.

Files are shared without their meshes. Where a body says its inertia a mesh moves nothing; where it
does not, the mass of the mesh is unknown, and the body is named.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any


def compiled_without(mujoco: Any, path: Path) -> tuple[Any, list[str]]:
    """The model without what needs files that are not there, and bodies that lack its mass.

    Raises ValueError, as MuJoCo does.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    folder = path.parent
    meshes, pictures = (folder / (each or '') for each in (spec.meshdir, spec.texturedir))
    gone = {_name(mesh) for mesh in spec.meshes if _missing(mesh.file, meshes)}
    fields = {_name(field) for field in spec.hfields if _missing(field.file, meshes)}
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
        if _missing(skin.file, meshes):
            spec.delete(skin)
    _without_pictures(spec, pictures)
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


def _without_pictures(spec: Any, folder: Path) -> None:
    gone = set()
    for texture in list(spec.textures):
        files = [texture.file, *texture.cubefiles]
        if any(_missing(file, folder) for file in files):
            gone.add(_name(texture))
            spec.delete(texture)
    for material in spec.materials:
        kept = ['' if name in gone else name for name in material.textures]
        if kept != list(material.textures):
            material.textures = kept


def _name(asset: Any) -> str:
    """How geoms and materials call it: by the name of its file if it has none."""
    return asset.name or Path(asset.file).stem


def _missing(file: str, folder: Path) -> bool:
    return bool(file) and not (folder / file).is_file()
