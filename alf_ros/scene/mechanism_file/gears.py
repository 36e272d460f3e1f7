"""The joints `gear`, `rolling` and `rack` of a planar mechanism file: lines that roll on each
other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from alf_ros.mechanism import Frame, Joint
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

if TYPE_CHECKING:
    from alf_ros.scene.mechanism_file.joints import JointReader

_FITS = 1e-6  # of the radii: how well the drawing must fit them


def gear(reader: JointReader, item: Item, parent: str, child: str) -> Joint:
    """Two wheels by their centres and the radii of their pitch circles."""
    fields = item.fields
    ends = fields['centres'].sequence(2)
    centres = [reader.point(end, item) for end in ends]
    for end, point, body in zip(ends, centres, (parent, child), strict=True):
        reader.check_on(end, point, body)
        _check_turns(reader, end, body)
    R, r = (_radius(entry, item) for entry in fields['radii'].sequence(2))
    if 'internal' in fields and fields['internal'].boolean():
        R, r = (R, -r) if R > r else (-R, r)
    drawn = math.dist(*(reader.points[point].at for point in centres))
    if not drawn > 0.0 or abs(drawn - R - r) > _FITS * max(abs(R), abs(r)):
        message = f'the centres are drawn {drawn:.6g} m apart, the radii ask for {R + r:.6g} m'
        raise fields['radii'].error(message)
    frames = reader.frame(parent, centres[0]), reader.frame(child, centres[1])
    kind = fields['type'].text()  # 'rolling': the distance of the centres is held too
    return Joint(item.name, kind, parent, child, frames, value=r, of_parent=R)


def rack(reader: JointReader, item: Item, parent: str, child: str) -> Joint:
    """A wheel that rolls on a line of its parent, on the left of its direction."""
    fields = item.fields
    centre = reader.point(fields['at'], item)
    reader.check_on(fields['at'], centre, child)
    _check_turns(reader, fields['at'], child)
    wheel = reader.wheel(item, child, centre)
    line = fields['on'].mapping()['through'].vector(2, item.names)
    axes = np.array(wheel.frames[0].axes)
    away = float(axes[1] @ (np.array(reader.points[centre].at) - line))
    if abs(away - wheel.value) > _FITS * wheel.value:
        message = f'the centre is drawn {away:.6g} m on the left of the line'
        raise fields['radius'].error(message, expected='as much as the radius')
    frames: tuple[Frame, Frame] = reader.at(parent, line, axes), wheel.frames[1]
    return Joint(item.name, 'rack', parent, child, frames, value=wheel.value)


def _check_turns(reader: JointReader, entry: Entry, body: str) -> None:
    if body in reader.bodies and len(reader.bodies[body].points) < 2:
        raise entry.error(f'body {body!r} has one point only, which cannot turn')


def _radius(entry: Entry, item: Item) -> float:
    radius = entry.number(item.names)
    if not radius > 0.0:
        raise entry.error('not a radius', expected='m, more than zero')
    return radius
