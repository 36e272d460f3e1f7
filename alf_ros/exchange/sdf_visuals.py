"""The `<visual>` elements of an SDF."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from alf_ros.exchange.robot import FramePose, Robot
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_resources import mesh_uri
from alf_ros.exchange.visuals import ROUND, mesh_file, numbers, shape, show
from alf_ros.mechanism import VisualShape


def add(
    robot: Robot, visual: ElementTree.Element, folder: Path, part: str, frame: FramePose
) -> None:
    """Give a part the shape of a visual, which is relative to `frame`."""
    name = f'{part} {visual.get("name", "")}'.strip()
    try:
        found = _shape(visual, folder)
        pose = pose_of(visual.find('pose'), lambda *_, **__: ValueError(name), name)
        show(robot, part, found, frame @ pose)
    except ValueError:
        robot.leave('shapes', name)


def _shape(visual: ElementTree.Element, folder: Path) -> VisualShape:
    """Raises ValueError."""
    color = visual.findtext('material/diffuse') or visual.findtext('material/ambient')
    rgba = None if color is None else [*map(float, color.split()), 1.0][:4]
    for each in visual.iterfind('geometry/*'):
        if each.tag == 'mesh':
            if each.find('submesh') is not None:
                raise ValueError('a part of a mesh')
            file = mesh_file(mesh_uri((each.findtext('uri') or '').strip(), folder), folder)
            return shape('mesh', numbers(each.findtext('scale'), 3, (1.0, 1.0, 1.0)), rgba, file)
        if each.tag == 'box':
            return shape('box', numbers(each.findtext('size'), 3), rgba)
        if each.tag in ROUND:
            size = [numbers(each.findtext(key), 1)[0] for key in ROUND[each.tag]]
            return shape(each.tag, size, rgba)
    raise ValueError('no geometry')
