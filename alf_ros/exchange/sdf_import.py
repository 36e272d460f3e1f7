"""SDF to a robot: links, and joints of any graph, so that loops need nothing of their own.

No parser of SDF comes as a package (libsdformat's bindings do not), so the XML is read here.
Specification: sdformat.org, versions 1.4 to 1.12; what a file does not say has its default there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import sdf_merge, sdf_resources, sdf_visuals, xml_file
from alf_ros.exchange.robot import AXES, TYPES, Connection, Coupled, Robot, RobotPart
from alf_ros.exchange.sdf_frames import MODEL, WORLD, SdfFrames, numbers, pose_of
from alf_ros.mechanism import GROUND

_TYPES = TYPES | {'screw': 'screw'}  # which only SDF has, with its pitch
_AXES = ('axis', 'axis2')
_GRAVITY = '0 0 -9.8'
_ENDLESS = 1e15  # a limit from there on is none: the default is 1e16
_MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
_OLDEST, _NEWEST = 4, 12  # minor versions that are read
_AXES_OF_JOINTS = 5  # from this minor version on, axes are in the frames of their joints
_DEEPEST = 40  # models in models
_STILL = ': every link is fixed to the world, or its model is static'


def read(path: Path, positions: Mapping[str, float]) -> Robot:
    """The robot of a file: of its first world, or of its models. Raises InputError."""
    if positions:
        message = 'not for SDF, which places each link: change the <pose> of links'
        raise InputError(message, key='--set', value=next(iter(positions)))
    return _Reader(path).robot


class _Reader:
    """Links and frames of all models first, then the joints between them."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._unsaid: list[str] = []  # files without a version, or with another than known ones
        root = self._root(path)
        world = root.find('world')
        top = root if world is None else world
        models = [each for each in top if each.tag in ('model', 'include')]
        names = [name for each in (top, *models) if (name := each.get('name'))]
        gravity = _GRAVITY if world is None else world.findtext('gravity') or _GRAVITY
        self.robot = Robot(names[0] if names else path.stem, str(path), (), _STILL)
        down = numbers(gravity, 3, self.robot.error, 'gravity')
        self.robot.gravity = tuple(map(float, down))
        self.frames = SdfFrames(self.robot.error)
        self.links: dict[str, RobotPart] = {}
        self.still: set[str] = set()  # links of static models
        self.joints: list[tuple[str, ElementTree.Element]] = []
        self.visuals: list[tuple[str, str, ElementTree.Element]] = []  # scope, link
        if not models:
            raise self.robot.error('model', 'there is none', expected='<model> or <world>')
        for other in root.findall('world')[1:]:
            self.robot.leave('elements', f'world {other.get("name", "")}')
        only = models[0].findtext('name') or models[0].get('name') if len(models) == 1 else None
        self.only = f'{only}::' if world is not None and only else ''
        self._scope(top, world is None and len(models) == 1)
        self._connect()
        for name in self._unsaid:
            self.robot.leave('version of SDF', name)

    def _root(self, path: Path) -> ElementTree.Element:
        """The root of a file, whose joints say where their axes are. Raises InputError."""
        root = xml_file.root_of(path)
        given = root.get('version')
        words = ('1.12' if given is None else given).strip().split('.')
        known = len(words) == 2 and all(word.isdigit() for word in words) and words[0] == '1'
        if not known:
            message, expected = 'not a version of SDF that is read', '1.4 to 1.12'
            raise InputError(
                message, file=str(path), key='sdf version', value=given, expected=expected
            )
        minor = int(words[1])
        if given is None or not _OLDEST <= minor <= _NEWEST:
            self._unsaid.append(f'{path.name} has {given or "none"}')
        if minor < _AXES_OF_JOINTS:
            for joint in root.iter('joint'):
                for tag in _AXES:
                    axis = joint.find(tag)
                    axis = ElementTree.SubElement(joint, tag) if axis is None else axis
                    if axis.find('use_parent_model_frame') is None:
                        ElementTree.SubElement(axis, 'use_parent_model_frame').text = '1'
        return root

    # ------------------------------------------------------------------------- links and frames

    def _scope(self, element: ElementTree.Element, alone: bool) -> None:
        """Models, frames and joints of a world, or of a file with models; one alone has no scope
        of its own, so its names stay short."""
        self._merge(element, WORLD)
        for each in self._models(element):
            self._model(each, '', '' if alone else f'{self._name(each)}::', WORLD)
        for each in element:
            if each.tag == 'link':
                message = 'merged into a world, where a link has no model'
                raise self.robot.error(
                    self._name(each), message, expected='<include> in a <model>'
                )
            if each.tag == 'frame':
                self._frame(each, '', WORLD)
            elif each.tag == 'joint':
                self._joint(each, '')
            elif each.tag == 'light':
                self.robot.leave('lights', each.get('name', ''))
            elif each.tag == 'plugin':
                self.robot.leave('plugins', each.get('name', ''))
            elif each.tag == 'state':
                self.robot.leave('state of the world', each.get('world_name', ''))
            elif each.tag in ('actor', 'road', 'population'):
                self.robot.leave('elements', f'{each.tag} {each.get("name", "")}')

    def _models(self, element: ElementTree.Element) -> Iterator[ElementTree.Element]:
        """The models in an element and in the files that it includes."""
        for each in element:
            if each.tag == 'model':
                yield each
            elif each.tag == 'include':
                found = self._included(each)
                if found is not None:
                    yield found

    def _merge(self, element: ElementTree.Element, around: str, depth: int = 0) -> None:
        """Put the content of models that are to be merged in the place of their <include>."""
        for each in element.findall('include'):
            if not _is(each.get('merge')):
                continue
            model = self._included(each)
            place = list(element).index(each)
            element.remove(each)
            if model is None:
                continue
            if depth > _DEEPEST:
                raise self.robot.error('include', 'a model that includes itself')
            self._merge(model, MODEL, depth + 1)
            canonical = model.get('canonical_link') or _first_link(model)
            for n, part in enumerate(sdf_merge.content(model, canonical, around)):
                element.insert(place + n, part)

    def _included(self, element: ElementTree.Element) -> ElementTree.Element | None:
        """The model of another file, with the name and the pose that this one gives it."""
        uri = (element.findtext('uri') or '').strip()
        path = sdf_resources.model_file(uri, self.path.parent)
        model = None if path is None else self._root(path).find('model')
        if model is None:
            self.robot.leave('includes', uri)
            return None
        name = element.findtext('name')
        if name is not None:
            model.set('name', name.strip())
        for tag in ('pose', 'static', 'placement_frame'):
            given = element.find(tag)
            if given is not None:
                for own in model.findall(tag):
                    model.remove(own)
                model.append(given)
        return model

    def _model(
        self, element: ElementTree.Element, outer: str, scope: str, above: str, still: bool = False
    ) -> None:
        """A model in the scope `outer`, whose own scope is `scope`."""
        if scope.count('::') > _DEEPEST:
            raise self.robot.error('include', 'a model that includes itself')
        self._merge(element, MODEL)
        pose = element.find('pose')
        to = '' if pose is None else pose.get('relative_to', '')
        placed = element.get('placement_frame') or element.findtext('placement_frame') or ''
        canonical = element.get('canonical_link') or _first_link(element)
        still |= _is(element.findtext('static'))
        self.frames.add(
            scope + MODEL,
            self._pose(element),
            self._later(to, outer) if to else above,
            scope + canonical if canonical else WORLD,
            scope + placed if placed else '',
        )
        for link in element.findall('link'):
            self._link(link, scope, still)
        for each in self._models(element):
            self._model(each, scope, f'{scope}{self._name(each)}::', scope + MODEL, still)
        for each in element:
            if each.tag == 'frame':
                self._frame(each, scope, scope + MODEL)
            elif each.tag == 'joint':
                self._joint(each, scope)
            elif each.tag == 'plugin':
                self.robot.leave('plugins', each.get('name', ''))
            elif each.tag == 'gripper':
                self.robot.leave('elements', f'gripper {each.get("name", "")}')

    def _link(self, element: ElementTree.Element, scope: str, still: bool) -> None:
        name = scope + self._name(element)
        to = self._relative(element)
        above = self._later(to, scope) if to else scope + MODEL
        self.frames.add(name, self._pose(element), above)
        self.links[name] = self._part(element, self._short(name))
        if still:
            self.still.add(name)
        if element.findtext('gravity') is not None and not _is(element.findtext('gravity')):
            self.robot.leave('gravity off', self._short(name))
        shown = (each for each in element if each.tag in sdf_visuals.READ)
        self.visuals += [(scope, name, each) for each in shown]
        for tag, kind in (('sensor', 'sensors'), ('light', 'lights')):
            if element.find(tag) is not None:
                self.robot.leave(kind, self._short(name))

    def _frame(self, element: ElementTree.Element, scope: str, default: str) -> None:
        name, given = scope + self._name(element), element.get('attached_to', '')
        attached = self._later(given, scope) if given else default
        to = self._relative(element)
        above = self._later(to, scope) if to else attached
        placed = element.get(sdf_merge.PLACED)
        self.frames.add(
            name, self._pose(element), above, attached, scope + placed if placed else ''
        )

    def _joint(self, element: ElementTree.Element, scope: str) -> None:
        to = self._relative(element)
        child = self._side(element, 'child')
        above = self._later(to or child, scope)
        own = scope + self._name(element)
        self.frames.add(own, self._pose(element), above, self._later(child, scope))
        self.joints.append((scope, element))

    def _short(self, name: str) -> str:
        """A scoped name without the name of the only model."""
        return name.removeprefix(self.only)

    def _later(self, name: str, scope: str) -> str:
        """The scoped name of a frame that may come later in the file; a model stands for its
        frame."""
        if name == WORLD:
            return WORLD
        return f'{scope}{name}'

    def _relative(self, element: ElementTree.Element) -> str:
        pose = element.find('pose')
        return '' if pose is None else pose.get('relative_to', '')

    def _pose(self, element: ElementTree.Element) -> Any:
        return pose_of(element.find('pose'), self.robot.error, element.get('name', element.tag))

    def _name(self, element: ElementTree.Element) -> str:
        given = element.get('name', '')
        if not given:
            raise self.robot.error(element.tag, 'it has no name')
        return given

    def _side(self, element: ElementTree.Element, side: str) -> str:
        given = (element.findtext(side) or '').strip()
        if not given:
            raise self.robot.error(self._name(element), f'no <{side}>')
        return given

    def _part(self, element: ElementTree.Element, name: str) -> RobotPart:
        """A link, as if its frame were the world frame: the frame is known later."""
        inertial = element.find('inertial')
        if inertial is None or inertial.find('mass') is None:
            self.robot.leave('mass: default of SDF', name)
        if inertial is not None and _is(inertial.get('auto')):
            self.robot.leave('inertia by shapes', name)
        if inertial is not None and inertial.find('fluid_added_mass') is not None:
            self.robot.leave('added mass of fluids', name)
        origin = pose_of(None if inertial is None else inertial.find('pose'), self.error, name)
        inertia = None if inertial is None else inertial.find('inertia')
        mass = self._number(inertial, 'mass', 1.0, name)
        ixx, ixy, ixz, iyy, iyz, izz = (
            self._number(inertia, key, float(key[1] == key[2]), name) for key in _MOMENTS
        )
        J = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        turned = origin.turn @ J @ origin.turn.T
        return RobotPart(name, np.zeros(3), mass, origin.origin, turned)

    def _number(
        self, element: ElementTree.Element | None, tag: str, default: float, key: str
    ) -> float:
        text = None if element is None else element.findtext(tag)
        if text is None or not text.strip():
            return default
        return float(numbers(text, 1, self.error, key)[0])

    @property
    def error(self) -> Any:
        return self.robot.error

    # -------------------------------------------------------------------------------- joints

    def _connect(self) -> None:
        """All fixed links become one part; the other joints connect parts."""
        links = {name: self._placed(name, part) for name, part in self.links.items()}
        above = {name: name for name in links} | {WORLD: WORLD}

        def root(name: str) -> str:
            while above[name] != name:
                name = above[name]
            return name

        for name in self.still:
            above[root(name)] = root(WORLD)
        sides = {id(each): self._sides(scope, each) for scope, each in self.joints}
        for _, each in self.joints:
            if each.get('type') == 'fixed':
                parent, child = map(root, sides[id(each)])
                if child == WORLD:  # which stays a root
                    parent, child = child, parent
                above[child] = parent
        roots = {name: GROUND if root(name) == WORLD else root(name) for name in links}
        part_of = self.robot.add_links(links, roots) | {WORLD: GROUND}
        for scope, link, visual in self.visuals:
            frame = self.frames.pose(self._visual_frame(scope, link, visual))
            sdf_visuals.add(self.robot, visual, self.path.parent, part_of[link], frame)
        for scope, each in self.joints:
            kind = each.get('type', '')
            if kind == 'fixed':
                continue
            parent, child = (part_of[side] for side in sides[id(each)])
            if kind not in _TYPES:
                self.robot.leave(
                    'joints of unknown type', f'{self._short(scope)}{each.get("name")} ({kind})'
                )
            elif parent == child == GROUND:
                self.robot.leave('elements', f'joint {each.get("name")} of a fixed part')
            else:
                self.robot.connect(self._connection(scope, each, parent, child))

    def _visual_frame(self, scope: str, link: str, visual: ElementTree.Element) -> str:
        to = self._relative(visual)
        return self.frames.find(to, scope) if to else link

    def _placed(self, name: str, part: RobotPart) -> RobotPart:
        pose = self.frames.pose(name)
        J = pose.turn @ part.inertia @ pose.turn.T
        return RobotPart(part.name, pose.origin, part.mass, pose.place(part.com), J)

    def _sides(self, scope: str, element: ElementTree.Element) -> tuple[str, str]:
        parent, child = (
            self.frames.link(self.frames.find(self._side(element, side), scope))
            for side in ('parent', 'child')
        )
        for link in (parent, child):
            if link != WORLD and link not in self.links:
                raise self.robot.error(self._name(element), 'no link carries it', value=link)
        return parent, child

    def _connection(
        self, scope: str, element: ElementTree.Element, parent: str, child: str
    ) -> Connection:
        own = scope + self._name(element)
        name, place = self._short(own), self.frames.pose(own).origin
        kind = _TYPES[element.get('type', '')]
        tags = _AXES[: AXES.get(kind, 1)]
        axes = tuple(self._axis(scope, element, tag) for tag in tags)
        if len(axes) == 2 and abs(axes[0] @ axes[1]) > 1e-6:
            raise self.robot.error(name, 'its two axes are not perpendicular')
        if len(axes) != 1:
            self._leave_of_axes(element, tags, name)
            return Connection(name, kind, parent, child, place, axes)
        limit, dynamics = element.find('axis/limit'), element.find('axis/dynamics')
        ends = [self._end(limit, tag, d, name) for tag, d in _ENDS]
        limited = kind != 'screw' and min(map(abs, ends)) < math.inf
        if limit is not None and 0.0 <= self._end(limit, 'effort', -1.0, name) < math.inf:
            self.robot.leave('limits of effort', name)
        damping, friction, stiffness, rest = (
            self._number(dynamics, tag, 0.0, name)
            for tag in ('damping', 'friction', 'spring_stiffness', 'spring_reference')
        )
        mimic = element.find('axis/mimic')
        if mimic is not None:
            self._mimic(scope, name, mimic)
        return Connection(
            name,
            kind,
            parent,
            child,
            place,
            axes,
            limits=(ends[0], ends[1]) if limited else None,
            damping=damping,
            stiffness=stiffness,
            rest=rest,
            friction=friction,
            pitch=self._pitch(element, name) if kind == 'screw' else 0.0,
        )

    def _leave_of_axes(
        self, element: ElementTree.Element, tags: tuple[str, ...], name: str
    ) -> None:
        """Note what only joints with one axis have here."""
        for axis in (element.find(tag) for tag in tags):
            if axis is None:
                continue
            ends = [self._end(axis.find('limit'), tag, d, name) for tag, d in _ENDS]
            if axis.find('dynamics') is not None or min(map(abs, ends)) < math.inf:
                self.robot.leave('limits, damping, friction, springs, armature', name)
            if axis.find('mimic') is not None:
                self.robot.leave('mimic', name)

    def _end(
        self, limit: ElementTree.Element | None, tag: str, default: float, name: str
    ) -> float:
        """A limit, infinite if there is none."""
        text = '' if limit is None else (limit.findtext(tag) or '').strip()
        try:
            x = float(text or default)
        except ValueError:
            x = math.nan
        if math.isnan(x):
            raise self.robot.error(name, 'not a number', value=text)
        return x if abs(x) < _ENDLESS else math.copysign(math.inf, x)

    def _mimic(self, scope: str, name: str, element: ElementTree.Element) -> None:
        """x = multiplier (other - reference) + offset, of a joint with one axis."""
        other = self.frames.find(element.get('joint', ''), scope)
        if self._short(other) == name:
            raise self.robot.error(name, 'it mimics itself')
        kinds = [each.get('type') for at, each in self.joints if at + self._name(each) == other]
        if kinds[:1] not in (['revolute'], ['continuous'], ['prismatic']):
            self.robot.leave('mimic', name)
            return
        factor, reference, offset = (
            self._number(element, tag, default, name)
            for tag, default in (('multiplier', 1.0), ('reference', 0.0), ('offset', 0.0))
        )
        if offset != factor * reference:
            self.robot.leave('phase of mimic', name)
        of = {name: 1.0} | ({self._short(other): -factor} if factor else {})
        self.robot.couplings.append(Coupled(f'{name}_mimic', of))

    def _pitch(self, element: ElementTree.Element, name: str) -> float:
        """m per turn; `thread_pitch`, the older one, is -rad/m."""
        if element.find('screw_thread_pitch') is not None:
            return self._number(element, 'screw_thread_pitch', 1.0, name)
        per_metre = self._number(element, 'thread_pitch', 1.0, name)
        if per_metre == 0.0:
            raise self.robot.error(name, 'a thread without pitch')
        return -2.0 * np.pi / per_metre

    def _axis(self, scope: str, element: ElementTree.Element, tag: str) -> Floats:
        """A unit direction in the world."""
        name = self._name(element)
        axis = element.find(tag)
        axis = (
            ElementTree.Element(tag) if axis is None else axis
        )  # along z, as where <xyz> is absent
        xyz = axis.find('xyz')
        u = numbers((xyz is not None and xyz.text) or '0 0 1', 3, self.robot.error, name)
        if not np.linalg.norm(u) > 0.0:
            raise self.robot.error(name, 'zero is no direction')
        given = '' if xyz is None else xyz.get('expressed_in', '')
        of_model = _is(axis.findtext('use_parent_model_frame'))
        if given:
            frame = self.frames.find(given, scope)
        else:
            frame = scope + (MODEL if of_model else name)
        turned = self.frames.pose(frame).turn @ (u / np.linalg.norm(u))
        return np.asarray(turned, dtype=float)


_ENDS = (('lower', -1e16), ('upper', 1e16))


def _first_link(element: ElementTree.Element) -> str:
    """The name of the link that a model is fixed to unless it says another; '' if it has none."""
    for link in element.findall('link'):
        return link.get('name', '')
    for model in element.findall('model'):
        name = _first_link(model)
        if name:
            return f'{model.get("name")}::{name}'
    return ''


def _is(text: str | None) -> bool:
    return (text or '').strip().lower() in ('1', 'true')
