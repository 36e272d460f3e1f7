"""SDF to a robot: links, and joints of any graph, so that loops need nothing of their own.

No parser of SDF comes as a package (libsdformat's bindings do not), so the XML is read here.
Specification: sdformat.org, versions 1.4 to 1.12; what a file does not say has its default there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from alf_ros.errors import InputError
from alf_ros.exchange import (
    sdf_elements,
    sdf_joints,
    sdf_merge,
    sdf_resources,
    sdf_versions,
    sdf_visuals,
    xml_file,
)
from alf_ros.exchange.robot import GROUND, Robot, RobotPart
from alf_ros.exchange.sdf_frames import MODEL, WORLD, SdfFrames, pose_of
from alf_ros.exchange.sdf_inertial import inertial_of, states_mass
from alf_ros.exchange.sdf_joints import SdfJoints
from alf_ros.exchange.sdf_values import is_true, name_of, number, numbers, says

_GRAVITY = '0 0 -9.8'
_DEEPEST = 40  # models in models
_STILL = ': every link is fixed to the world, or its model is static'


def read(
    path: Path, positions: Mapping[str, float], arguments: Mapping[str, str] | None = None
) -> Robot:
    """The robot of a file: of its first world, or of its models.

    arguments: of a xacro. Raises InputError.
    """
    if positions:
        message = 'not for SDF, which places each link: change the <pose> of links'
        raise InputError(message, key='--set', value=next(iter(positions)))
    return _Reader(path, arguments).robot


class _Reader:
    """Links and frames of all models first, then the joints between them."""

    def __init__(self, path: Path, arguments: Mapping[str, str] | None) -> None:
        self.path = path
        self._told: list[tuple[str, str]] = []  # kind and name, about the versions of files
        root = self._root(path, arguments)
        world = root.find('world')
        top = root if world is None else world
        models = [each for each in top if each.tag in ('model', 'include')]
        names = [name for each in (top, *models) if (name := each.get('name'))]
        gravity = None if world is None else world.find('gravity')
        text = (gravity is not None and gravity.text) or _GRAVITY
        self.robot = Robot(names[0] if names else path.stem, str(path), (), _STILL)
        down = numbers(text, 3, self.error, 'gravity', gravity)
        self.robot.gravity = tuple(map(float, down))
        self.frames = SdfFrames(self._frame_error)
        self.links: dict[str, RobotPart] = {}
        self.still: set[str] = set()  # links of static models
        self.weightless: set[str] = set()  # links without gravity
        self.joints: list[tuple[str, ElementTree.Element]] = []
        self.visuals: list[tuple[str, str, ElementTree.Element]] = []  # scope, link
        if not models:
            place = 'or <world>' if world is None else 'or <include> in the <world>'
            raise self.error('model', 'there is none', top, expected=f'<model> {place}')
        for other in root.findall('world')[1:]:
            self.robot.leave('elements', f'world {other.get("name", "")}')
        only = models[0].findtext('name') or models[0].get('name') if len(models) == 1 else None
        self.only = f'{only}::' if world is not None and only else ''
        self._scope(top, world is None and len(models) == 1)
        self._connect()
        for kind, name in self._told:
            self.robot.leave(kind, name)
        if omitted := self.robot.left_out.names.get('includes'):
            self.robot.still += f', or in a model that was not found: {", ".join(omitted)}'

    def _root(self, path: Path, arguments: Mapping[str, str] | None = None) -> ElementTree.Element:
        """The root of a file, as the newest version has it. Raises InputError."""
        root, told = sdf_versions.root_of(path, arguments)
        self._told += told
        return root

    def _folder(self, element: ElementTree.Element) -> Path:
        """Of the file that has an element, which may be included."""
        return Path(xml_file.place_of(element, str(self.path))['file']).parent

    # ------------------------------------------------------------------------- links and frames

    def _scope(self, element: ElementTree.Element, alone: bool) -> None:
        """Models, frames and joints of a world, or of a file with models; one alone has no scope
        of its own, so its names stay short."""
        sdf_elements.leave_unknown(self.robot, element, element.get('name') or 'the file')
        self._include(element, WORLD)
        for each in element.findall('model'):
            self._model(each, '', '' if alone else f'{self._name(each)}::', WORLD)
        for each in element:
            if each.tag == 'link':
                message = 'merged into a world, where a link has no model'
                expected = '<include> in a <model>'
                raise self.error(self._name(each), message, each, expected=expected)
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
            elif each.tag in ('actor', 'road', 'population', 'wind'):
                self.robot.leave('elements', f'{each.tag} {each.get("name", "")}'.strip())

    def _include(self, element: ElementTree.Element, around: str, depth: int = 0) -> None:
        """Put models of other files in the place of their <include>; of those that are to be
        merged, their content."""
        for each in element.findall('include'):
            merged = is_true(each.get('merge'), self.error, 'include', each)
            model = self._included(each)
            place = list(element).index(each)
            element.remove(each)
            if model is None:
                continue
            if not merged:
                element.insert(place, model)
                continue
            if depth > _DEEPEST:
                raise self.error('include', 'a model that includes itself', each)
            sdf_elements.leave_unknown(self.robot, model, model.get('name', ''))
            self._include(model, MODEL, depth + 1)
            parts = sdf_merge.content(model, _canonical(model), around, self.error)
            for n, part in enumerate(parts):
                element.insert(place + n, part)

    def _included(self, element: ElementTree.Element) -> ElementTree.Element | None:
        """The model of another file, with the name and the pose that this one gives it."""
        uri = (element.findtext('uri') or '').strip()
        folders = dict.fromkeys((self._folder(element), self.path.parent))
        path = sdf_resources.model_file(uri, *folders)
        model = None if path is None else self._root(path).find('model')
        if model is None:
            self.robot.leave('includes', uri)
            return None
        name = element.findtext('name')
        if name is not None:
            model.set('name', name.strip())
        model.extend(each for each in element if each.tag in ('plugin', 'model_state'))
        if any(each.tag.rpartition('}')[2] == 'params' for each in element):
            self.robot.leave('parameters of includes', model.get('name', uri))
        for tag in ('pose', 'static', 'placement_frame'):
            given = element.find(tag)
            if given is not None:
                for own in model.findall(tag):
                    model.remove(own)
                model.append(given)
        return model

    def _model(
        self,
        element: ElementTree.Element,
        outer: str,
        scope: str,
        above: str,
        still: bool = False,
        blown: bool = False,
    ) -> None:
        """A model in the scope `outer`, whose own scope is `scope`. still, blown: whether a model
        around it is static, or feels the wind."""
        if scope.count('::') > _DEEPEST:
            message = f'inside more than {_DEEPEST} others, as a model that includes itself'
            raise self.error(self._name(element), message, element)
        name = scope.rstrip(':') or element.get('name', '')
        sdf_elements.leave_unknown(self.robot, element, name)
        self._include(element, MODEL)
        pose = element.find('pose')
        to = '' if pose is None else pose.get('relative_to', '')
        placed = element.get('placement_frame') or element.findtext('placement_frame') or ''
        canonical = _canonical(element)
        still |= says(element, 'static', self.error, name)
        blown |= says(element, 'enable_wind', self.error, name)
        self.frames.add(
            scope + MODEL,
            self._pose(element),
            self._later(to, outer) if to else above,
            scope + canonical if canonical else WORLD,
            scope + placed if placed else '',
            at=element,
        )
        for link in element.findall('link'):
            self._link(link, scope, still, blown)
        for each in element.findall('model'):
            own = f'{scope}{self._name(each)}::'
            self._model(each, scope, own, scope + MODEL, still, blown)
        for each in element:
            if each.tag == 'frame':
                self._frame(each, scope, scope + MODEL)
            elif each.tag == 'joint':
                self._joint(each, scope)
            elif each.tag == 'plugin':
                self.robot.leave('plugins', each.get('name', ''))
            elif each.tag == 'gripper':
                self.robot.leave('elements', f'gripper {each.get("name", "")}')
            elif each.tag == 'model_state':
                self.robot.leave('state of the world', each.get('name', ''))

    def _link(self, element: ElementTree.Element, scope: str, still: bool, blown: bool) -> None:
        name = scope + self._name(element)
        to = self._relative(element)
        above = self._later(to, scope) if to else scope + MODEL
        self.frames.add(name, self._pose(element), above, at=element)
        self.links[name] = self._part(element, self._short(name))
        sdf_elements.leave_unknown(self.robot, element, self._short(name))
        if still:
            self.still.add(name)
        elif says(element, 'kinematic', self.error, self._short(name)):  # no force moves it
            self.still.add(name)
            self.robot.leave('motion of kinematic bodies', self._short(name))
        else:
            self._leave_of_link(element, self._short(name), blown)
            if not says(element, 'gravity', self.error, self._short(name), default=True):
                self.weightless.add(name)
        shown = (each for each in element if each.tag in sdf_visuals.READ)
        self.visuals += [(scope, name, each) for each in shown]
        for tag, kind in (('sensor', 'sensors'), ('light', 'lights')):
            if element.find(tag) is not None:
                self.robot.leave(kind, self._short(name))

    def _leave_of_link(self, element: ElementTree.Element, name: str, blown: bool) -> None:
        """Note forces on a link that moves."""
        decay = element.find('velocity_decay')
        if any(number(decay, tag, 0.0, self.error, name) for tag in ('linear', 'angular')):
            self.robot.leave('damping of bodies', name)
        if says(element, 'enable_wind', self.error, name, default=blown):
            self.robot.leave('wind', name)

    def _frame(self, element: ElementTree.Element, scope: str, default: str) -> None:
        name, given = scope + self._name(element), element.get('attached_to', '')
        attached = self._later(given, scope) if given else default
        to = self._relative(element)
        above = self._later(to, scope) if to else attached
        placed = element.get(sdf_merge.PLACED)
        self.frames.add(
            name,
            self._pose(element),
            above,
            attached,
            scope + placed if placed else '',
            at=element,
        )

    def _joint(self, element: ElementTree.Element, scope: str) -> None:
        to = self._relative(element)
        child = self._side(element, 'child')
        above = self._later(to or child, scope)
        own = scope + self._name(element)
        sdf_elements.leave_unknown(self.robot, element, self._short(own))
        attached = self._later(child, scope)
        self.frames.add(own, self._pose(element), above, attached, at=element)
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
        return pose_of(element.find('pose'), self.error, element.get('name', element.tag))

    def _name(self, element: ElementTree.Element) -> str:
        return name_of(element, self.error)

    def _side(self, element: ElementTree.Element, side: str) -> str:
        given = (element.findtext(side) or '').strip()
        if not given:
            raise self.error(self._name(element), f'no <{side}>', element)
        return given

    def _part(self, element: ElementTree.Element, name: str) -> RobotPart:
        """A link, as if its frame were the world frame: the frame is known later."""
        inertial = element.find('inertial')
        if inertial is not None and is_true(inertial.get('auto'), self.error, name, inertial):
            self.robot.leave('inertia by shapes', name)
        if inertial is not None and inertial.find('fluid_added_mass') is not None:
            self.robot.leave('added mass of fluids', name)
        pose = None if inertial is None else inertial.find('pose')
        if pose is not None and pose.get('relative_to'):  # it is relative to the link
            self.robot.leave('unknown attributes', f'pose relative_to in inertial of {name}')
        mass, frame, J = inertial_of(inertial, self.error, name)
        turned = frame.turn @ J @ frame.turn.T
        return RobotPart(name, np.zeros(3), mass, frame.origin, turned, inertial)

    @property
    def error(self) -> Any:
        return self.robot.error

    def _frame_error(self, key: str, message: str, *at: Any, **details: Any) -> InputError:
        """An error about a frame, which may be one of a model that was not found."""
        omitted = self.robot.left_out.names.get('includes')
        if omitted and 'choices' in details:
            details['expected'] = f'the content of {", ".join(omitted)}, which was not found'
        return self.error(key, message, *at, **details)

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
            if sdf_joints.kind_of(each) == 'fixed':
                parent, child = map(root, sides[id(each)])
                if child == WORLD:  # which stays a root
                    parent, child = child, parent
                above[child] = parent
        roots = {name: GROUND if root(name) == WORLD else root(name) for name in links}
        part_of = self.robot.add_links(links, roots) | {WORLD: GROUND}
        for name, part in self.links.items():
            if not states_mass(part.at) and roots[name] != GROUND:
                self.robot.leave('mass: default of SDF', self._short(name))
        self.robot.lift(links, part_of, self.weightless)
        for scope, link, visual in self.visuals:
            frame = self.frames.pose(self._visual_frame(scope, link, visual))
            sdf_visuals.add(self.robot, visual, self._folder(visual), part_of[link], frame)
        self._leave_obstacles()
        held = {
            scope + self._name(each)
            for scope, each in self.joints
            if all(part_of[side] == GROUND for side in sides[id(each)])
        }
        joints = SdfJoints(self.robot, self.frames, self.joints, held, self._short)
        for scope, each in self.joints:
            joints.leave(scope, each)
            if sdf_joints.kind_of(each) == 'fixed' or sdf_joints.is_gearbox(each):
                continue
            parent, child = (part_of[side] for side in sides[id(each)])
            if not sdf_joints.is_known(each):
                name = f'{self._short(scope)}{each.get("name")}'
                self.robot.leave('joints of unknown type', f'{name} ({each.get("type", "")})')
            elif parent == child == GROUND:
                joints.hold(scope, each)
            else:
                for connection in joints.connections(scope, each, parent, child):
                    self.robot.connect(connection, at=each)
        for scope, each in self.joints:
            if sdf_joints.is_gearbox(each) and not each.findtext('gearbox_reference_body'):
                self.robot.leave('gearboxes', self._short(scope + self._name(each)))
            elif sdf_joints.is_gearbox(each):
                reference = part_of[self._carrier(scope, each, 'gearbox_reference_body')]
                joints.gearbox(scope, each, reference, [part_of[x] for x in sides[id(each)]])

    def _leave_obstacles(self) -> None:
        """Note the shapes of static models, besides planes, which stop nothing that moves."""
        if all(each.part == GROUND for each in self.robot.colliders):
            return
        for _, link, each in self.visuals:
            kinds = [shape.tag for shape in each.iterfind('geometry/*')]
            if link in self.still and each.tag == sdf_visuals.COLLISION and kinds != ['plane']:
                name = f'{self._short(link)} {each.get("name", "")}'.strip()
                self.robot.leave('contact with fixed shapes', ' '.join([*kinds[:1], name]))

    def _visual_frame(self, scope: str, link: str, visual: ElementTree.Element) -> str:
        to = self._relative(visual)
        return self.frames.find(to, scope, visual) if to else link

    def _placed(self, name: str, part: RobotPart) -> RobotPart:
        pose = self.frames.pose(name)
        J = pose.turn @ part.inertia @ pose.turn.T
        return replace(part, origin=pose.origin, com=pose.place(part.com), inertia=J)

    def _sides(self, scope: str, element: ElementTree.Element) -> tuple[str, str]:
        parent, child = (self._carrier(scope, element, side) for side in ('parent', 'child'))
        return parent, child

    def _carrier(self, scope: str, element: ElementTree.Element, side: str) -> str:
        """The link that a joint names."""
        link = self.frames.link(self.frames.find(self._side(element, side), scope, element))
        if link != WORLD and link not in self.links:
            raise self.error(self._name(element), 'no link carries it', element, value=link)
        return link


def _canonical(element: ElementTree.Element) -> str:
    """The frame to which the frame of a model is fixed: the link that it names, its first link, or
    the frame of its first model; '' for a model without links and models."""
    named = element.get('canonical_link')
    if named:
        return named
    for link in element.findall('link'):
        return link.get('name', '')
    for model in element.findall('model'):
        return f'{model.get("name", "")}::{MODEL}'
    return ''
