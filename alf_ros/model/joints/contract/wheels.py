"""Common parts of joints of wheels: radii that fit the drawing, bodies that can turn."""

from __future__ import annotations

import numpy as np

from alf_ros import columns
from alf_ros.mechanism import GROUND, Joint
from alf_ros.model.joints.contract.given import Given, Surface

_FITS = 1e-6  # of the radii: how well the drawing must fit them


def pair(given: Given) -> Joint:
    """Two wheels by their centres and the radii of their pitch circles."""
    centres = given.points('centres')
    for n, (point, body) in enumerate(zip(centres, (given.parent, given.child), strict=True)):
        given.check_carries('centres', point, body, n)
        _check_turns(given, 'centres', body, n)
    R, r = given.radius('radii', 0), given.radius('radii', 1)
    if given.boolean('internal'):
        R, r = (R, -r) if R > r else (-R, r)
    drawn = columns.distance(*(given.place(point) for point in centres))
    if not drawn > 0.0 or abs(drawn - R - r) > _FITS * max(abs(R), abs(r)):
        message = f'the centres are drawn {drawn:.6g} m apart, the radii ask for {R + r:.6g} m'
        raise given.error('radii', message)
    first, second = centres
    parent, child = given.frame(given.parent, first), given.frame(given.child, second)
    return given.joint(parent, child, value=r, of_parent=R)


def on_a_rack(given: Given) -> Joint:
    """A wheel that rolls on a line of its parent, on the left of its direction."""
    centre = given.point('at')
    given.check_carries('at', centre, given.child)
    _check_turns(given, 'at', given.child)
    line = given.surface('on', may_move=False)
    radius, axes = given.radius('radius'), given.axes(line.along)
    away = float(axes[1] @ (np.array(given.place(centre)) - line.through))
    if abs(away - radius) > _FITS * radius:
        message = f'the centre is drawn {away:.6g} m on the left of the line'
        raise given.error('radius', message, expected='as much as the radius')
    parent = given.frame_at(given.parent, line.through, axes)
    return given.joint(parent, given.frame(given.child, centre, axes), value=radius)


def wheel(given: Given) -> Joint:
    """A wheel, in space a ball, that rolls on a line or plane of the ground."""
    point, on, radius = rolls_on(given)
    axes = given.axes(on.along)
    frames = given.frame_at(GROUND, on.through, axes), given.frame(given.child, point, axes)
    return given.joint(*frames, value=radius, motion=on.motion)


def rolls_on(given: Given) -> tuple[str, Surface, float]:
    """Centre, what it rolls on, and radius (m) of a wheel."""
    point = given.point('at')
    given.check_carries('at', point, given.child)
    on = given.surface('on')
    return point, on, given.radius('radius')


def _check_turns(given: Given, key: str, body: str, n: int | None = None) -> None:
    found = given.body(body)
    if found is not None and len(found.points) < 2:
        raise given.error(key, f'body {body!r} has one point only, which cannot turn', n)
