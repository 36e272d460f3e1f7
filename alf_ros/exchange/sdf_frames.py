"""The frames of an SDF: what each pose is relative to, and which link each frame hangs from.

Versions 1.7 on name frames freely (`relative_to`, `attached_to`, `placement_frame`); before, what
a pose is relative to follows from the element alone. Names of nested models are scoped with `::`.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.exchange.robot import STILL, FramePose
from alf_ros.exchange.sdf_values import Refuse, is_true, numbers

MODEL, WORLD = '__model__', 'world'
_FORMATS = ('euler_rpy', 'quat_xyzw')


@dataclass
class _Frame:
    """A frame: its pose in another one, the frame that it is fixed to (itself: a link), and the
    element of the file that has it."""

    pose: FramePose
    relative_to: str
    attached_to: str
    at: ElementTree.Element | None = None

    @property
    def placed_at(self) -> ElementTree.Element | None:
        """The element that says what the pose is relative to."""
        pose = None if self.at is None else self.at.find('pose')
        return self.at if pose is None else pose


class SdfFrames:
    """Frames by their scoped names; poses are found when they are asked for."""

    def __init__(self, refuse: Refuse) -> None:
        self._refuse = refuse
        self._frames = {WORLD: _Frame(STILL, '', WORLD)}
        self._poses = {WORLD: STILL}

    def add(
        self,
        name: str,
        pose: FramePose,
        relative_to: str,
        attached_to: str | None = None,
        placed: str = '',
        at: ElementTree.Element | None = None,
    ) -> None:
        """A frame; a link if it is attached to nothing. placed: the frame of a model that is put
        at the pose, instead of the model's own. at: the element that has it. Raises the error."""
        if name in self._frames:
            raise self._refuse(_called(name), f'a name of two {_kind(name)}', at)
        if placed:
            self._frames[f'{name} placed'] = _Frame(pose, relative_to, name, at)
            pose, relative_to = STILL, f'{name} placed\0{placed}'
        self._frames[name] = _Frame(
            pose, relative_to, name if attached_to is None else attached_to, at
        )

    def find(self, name: str, scope: str, at: ElementTree.Element | None = None) -> str:
        """The scoped name of a frame that a name means in a scope ('' or ending in ::). The name
        of a model is the name of its frame. at: the element that has the name. Raises the error.
        """
        if name == WORLD:
            return WORLD
        for found in (f'{scope}{name}', f'{scope}{name}::{MODEL}'):
            if found in self._frames:
                return found
        known = [each[len(scope) :] for each in self._frames if each.startswith(scope)]
        choices = [each for each in known if MODEL not in each and ' ' not in each]
        key = scope.rstrip(':') or name
        raise self._refuse(key, 'no such frame', at, value=name, choices=choices)

    def pose(self, name: str) -> FramePose:
        """In the world. Raises the error for frames that refer to each other."""
        return self._within(name, WORLD)

    def _within(self, name: str, base: str) -> FramePose:
        """Of a frame in another one, along what it is relative to, however long that chain is."""
        known = self._poses if base == WORLD else {base: STILL}
        chain: dict[str, str] = {}  # from each frame to what the model there is placed by, or ''
        while name not in known:
            frame = self._frames[name]
            if name in chain:
                raise self._refuse(
                    _called(name), 'its pose is relative to itself', frame.placed_at
                )
            to, _, chain[name] = frame.relative_to.partition('\0')
            if not to:
                first, model = next(iter(chain)), self._frames[base].at
                message = f'the pose of its placement_frame leads to {name!r}, not to the model'
                raise self._refuse(_called(base), message, model, value=_called(first))
            name = self.find(to, '', frame.placed_at)
        found = known[name]
        for name, placed in reversed(chain.items()):
            frame = self._frames[name]
            found = found @ frame.pose
            if placed:  # the pose belongs to a frame of the model, and places the model
                found = found @ self._within(self.find(placed, '', frame.at), name).inverse
            known[name] = found
        return found

    def link(self, name: str) -> str:
        """The scoped name of the link, or the world, that a frame is fixed to."""
        seen = [name]
        while (frame := self._frames[seen[-1]]).attached_to != seen[-1]:
            seen.append(self.find(frame.attached_to, '', frame.at))
            if len(seen) > len(self._frames):
                raise self._refuse(_called(name), 'it is attached to itself', frame.at)
        return seen[-1]


def _called(name: str) -> str:
    """A scoped name as the file has it: the frame of a model has the name of the model."""
    return name.removesuffix(f'::{MODEL}')


def _kind(name: str) -> str:
    """The word for two things of a scoped name."""
    if _called(name) == name:
        return 'frames'
    return 'models: the <name> of an <include> gives its model another one'


def pose_of(element: ElementTree.Element | None, refuse: Refuse, key: str) -> FramePose:
    """The values of a <pose>: x y z and roll pitch yaw (rad, or degrees), or a quaternion."""
    if element is None or not (element.text or '').strip():
        return STILL
    form = element.get('rotation_format', _FORMATS[0])
    if form not in _FORMATS:
        raise refuse(key, 'no such rotation_format', element, value=form, choices=_FORMATS)
    quaternion = form == 'quat_xyzw'
    degrees = is_true(element.get('degrees'), refuse, key, element)
    x = numbers(element.text or '', 7 if quaternion else 6, refuse, key, element)
    if quaternion:
        if degrees:
            raise refuse(key, 'a quaternion has no degrees', element)
        if not np.linalg.norm(x[3:]) > 0.0:
            raise refuse(key, 'zero is no quaternion', element)
        return FramePose(x[:3], Rotation.from_quat(x[3:]).as_matrix())
    return FramePose(x[:3], Rotation.from_euler('xyz', x[3:], degrees=degrees).as_matrix())
