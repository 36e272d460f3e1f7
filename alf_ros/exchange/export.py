"""A mechanism as URDF, and as the side file that closes its loops; what neither carries over.

`import_file` reads both back: the side file holds the positions of the joints as drawn, and the
joints that are not in the tree.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

from scipy.spatial.transform import Rotation

from alf_ros import resources
from alf_ros.exchange.robot import AXES
from alf_ros.exchange.urdf_export import WORLD, closing, frame, outside, urdf
from alf_ros.mechanism import GROUND, Joint
from alf_ros.model.joints import type_of
from alf_ros.scene.scene import Scene
from alf_ros.scene.text.yaml_writer import entry, serialise
from alf_ros.simulation.display_geometry import poses
from alf_ros.simulation.simulation import Simulation


def tree(scene: Scene) -> tuple[str, list[str]]:
    """URDF of the spanning tree of a scene's mechanism, and what it does not carry over."""
    mechanism = scene.mechanism
    left_out = [f'effects: {effect.kind}' for effect in scene.effects]
    left_out += [f'couplings: {coupling.name}' for coupling in mechanism.couplings]
    left_out += [f'loops (see --loops): {joint.name}' for joint in closing(mechanism)]
    left_out += [f'bodies (see --loops): {name}' for name in outside(mechanism)]
    return urdf(mechanism), left_out


def exported(scene: Scene) -> tuple[str, str, list[str]]:
    """URDF and side file of a scene's mechanism, and a list of omissions.

    Bodies that are not in the tree are exported on `floating` joints. Raises InputError if the
    mechanism cannot be assembled.
    """
    mechanism = scene.mechanism
    sample = Simulation(scene).sample()
    frames = [(x[:3], Rotation.from_quat(x[3:]).as_matrix()) for x in poses(sample)]
    names = [body.name for body in mechanism.bodies]
    text = urdf(mechanism, free=dict(zip(names, frames, strict=True)))
    tree = ElementTree.fromstring(text)
    links = {link.get('name') for link in tree.iter('link')}
    moved = {joint.get('name') for joint in tree.iter('joint')}
    positions = {name: state.position for name, state in sample.joints.items() if name in moved}
    left_out = [f'effects: {effect.kind}' for effect in scene.effects]
    left_out += [f'couplings: {coupling.name}' for coupling in mechanism.couplings]
    loops: dict[str, Any] = {}
    for joint in closing(mechanism):
        made = _loop(joint, len(mechanism.points[0].at) == 2)
        if made is None or not links.issuperset(made['between']):
            left_out.append(f'joints: {joint.name} ({joint.kind})')
        else:
            loops[joint.name if joint.name not in moved else f'{joint.name}_pin'] = made
    version = resources.version()
    head = f'# Joints that close the loops of the URDF of {scene.name}. '
    head += f'Exported by alf_ros {version}.\n'
    head += ''.join(f'# Not carried over: {line}\n' for line in dict.fromkeys(left_out))
    side = serialise(entry({'positions': positions, 'loops': loops}))
    return text, re.sub(r'[^\x20-\x7e\n\xa0-\ud7ff]', '?', head) + side, left_out


def _loop(joint: Joint, planar: bool) -> dict[str, Any] | None:
    """A joint of the side file, in the frame of its parent; None for what it does not know."""
    parent = WORLD if joint.parent == GROUND else joint.parent
    if type_of(joint).urdf_rail:  # what slides along the rail is a link, and turns on a pin
        (x, y), slide = joint.frames[1].origin, f'{joint.name}_slide'
        between, at = [joint.child, slide], [x, y, 0.0]
        return {'type': 'revolute', 'between': between, 'at': at, 'axis': [0.0, 0.0, 1.0]}
    if joint.kind not in AXES:
        return None
    place, axes = frame(joint, joint.parent)
    x, _, z = axes.T.tolist()
    found = {'type': joint.kind, 'between': [parent, joint.child], 'at': place.tolist()}
    if AXES[joint.kind] == 1:
        found['axis'] = x if planar and joint.kind == 'prismatic' else z
    elif AXES[joint.kind] == 2:
        found['axes'] = [z, x]
    return found
