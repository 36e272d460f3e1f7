"""Gearboxes in extensions of Gazebo: one hinge mimics another, as in `sdf_gearboxes`.

Gazebo creates them with all joints at zero, where both angles are zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

from alf_ros.arrays import Floats
from alf_ros.exchange import urdf_loops
from alf_ros.exchange.robot import FramePose
from alf_ros.exchange.sdf_gearboxes import ALONG
from alf_ros.exchange.sdf_values import number
from alf_ros.exchange.urdf_import import UrdfReader

_ENDS = ('gearbox_reference_body', 'parent', 'child')


def mimics(reader: UrdfReader) -> tuple[dict[str, tuple[str, float, float]], list[str]]:
    """The mimics of gearboxes, by joint as `UrdfReader.mimics`, and the names of the gearboxes
    whose links are not on two hinges of the reference body. Raises InputError."""
    found, left, zero = dict[str, tuple[str, float, float]](), list[str](), reader.poses_at({})
    for element in urdf_loops.gazebo_joints(reader):
        if element.get('type') != urdf_loops.GEARBOX:
            continue
        name = element.get('name', 'gazebo_joint')
        made = _mimic(reader, name, element, zero, reader.mimics | found)
        if made is None:
            left.append(name)
        else:
            joint, other, factor = made
            found[joint] = other, factor, 0.0
    return found, left


def _mimic(
    reader: UrdfReader,
    name: str,
    element: ElementTree.Element,
    zero: dict[str, FramePose],
    found: Mapping[str, tuple[str, float, float]],
) -> tuple[str, str, float] | None:
    """A hinge, the one that it mimics, and the factor; None where no two hinges are free to."""
    if not (element.findtext(_ENDS[0]) or '').strip():
        return None
    links = urdf_loops.ends(reader, name, element, _ENDS)
    reference, *parts = (reader.part(link, name, element)[0] for link in links)
    axes = urdf_loops.placed(reader, name, element, zero, 2)[1]
    ratio = number(element, 'gearbox_ratio', 1.0, reader.error, name)
    hinges = [_hinge(reader, reference, *each, zero) for each in zip(parts, axes, strict=True)]
    (first, turn), (second, other) = hinges
    factor = -ratio * turn * other
    ways = [(second, first, factor)] + ([(first, second, 1.0 / factor)] if factor else [])
    for joint, driver, times in ways if first and second else ():
        if joint not in found and not _follows(driver, joint, found):
            return joint, driver, times
    return None


def _follows(name: str, other: str, found: Mapping[str, tuple[str, float, float]]) -> bool:
    """Whether a joint is another one, or mimics it, however long the chain between is."""
    seen = {name}
    while name != other and name in found and found[name][0] not in seen:
        name = found[name][0]
        seen.add(name)
    return name == other


def _hinge(
    reader: UrdfReader, reference: str, part: str, axis: Floats, zero: dict[str, FramePose]
) -> tuple[str, float]:
    """The joint of the tree that turns a part on the reference part, and the sign of its
    coordinate; '' if there is none."""
    for each in reader.robot.connections:
        sides = (each.parent, each.child)
        if each.kind != 'revolute' or sides not in ((reference, part), (part, reference)):
            continue
        link = reader.joints[each.name].child
        along = float(zero[link].turn @ reader.poses[link].turn.T @ each.axes[0] @ axis)
        if abs(along) > ALONG:
            return each.name, 1.0 if (along > 0.0) == (each.child == part) else -1.0
    return '', 1.0
