"""`<include merge="true">` of SDF: an included model that becomes a part of the model around it.

Its links, joints, frames and nested models keep their names and get no scope. A frame
`_merged__NAME__model__`, at the pose of the <include>, stands for `__model__` of the included
model: it hangs from its canonical link, and poses without `relative_to` are relative to it. What
the included model says of itself (<static>) does not count. Source: the proposal of SDFormat,
sdformat.org/tutorials?tut=composition_proposal, and its libsdformat.
"""

from __future__ import annotations

from xml.etree import ElementTree

from alf_ros.exchange.sdf_frames import MODEL
from alf_ros.exchange.sdf_values import Refuse, is_true
from alf_ros.exchange.sdf_versions import OF_MODEL

PLACED = 'placement_frame'  # an attribute of the frame, which SDF itself does not have
_NAMES = ('relative_to', 'attached_to', 'expressed_in')
_NESTED = ('model', 'include')
_OF_MODEL = ('link', 'joint', 'frame', 'plugin', 'gripper', 'model_state', *_NESTED)


def content(
    model: ElementTree.Element, canonical: str, around: str, refuse: Refuse
) -> list[ElementTree.Element]:
    """The elements that stand for a model, which changes, in the frame `around` it.

    canonical: the name of its canonical link; '' if it has none. Raises the error.
    """
    own = f'_merged__{model.get("name", "")}{MODEL}'
    frame = ElementTree.Element('frame', {'name': own})
    if canonical:
        frame.set('attached_to', canonical)
    placed = model.get(PLACED) or model.findtext(PLACED) or ''
    if placed:
        frame.set(PLACED, placed)
    pose = ElementTree.SubElement(frame, 'pose')
    given = model.find('pose')
    if given is not None:
        pose.attrib, pose.text = given.attrib, given.text
    if not pose.get('relative_to'):  # not to the link that the frame hangs from
        pose.set('relative_to', around)
    found = [each for each in model if each.tag in _OF_MODEL]
    for each in found:
        _rename(each, own)
        if each.tag == 'frame' and not each.get('attached_to'):
            each.set('attached_to', own)
        elif each.tag in ('link', *_NESTED):
            own_pose = each.find('pose')
            if own_pose is None:
                own_pose = ElementTree.SubElement(each, 'pose')
            if not own_pose.get('relative_to'):
                own_pose.set('relative_to', own)
        elif each.tag == 'joint':
            for axis in (*each.findall('axis'), *each.findall('axis2')):
                _express(axis, own, refuse)
    return [frame, *found]


def _rename(element: ElementTree.Element, own: str) -> None:
    """Put the frame in place of `__model__`, but not within nested models, which have one."""
    for name in _NAMES:
        if element.get(name) == MODEL:
            element.set(name, own)
    if element.tag in ('parent', 'child') and (element.text or '').strip() == MODEL:
        element.text = own
    for each in element:
        if element.tag not in _NESTED or each.tag == 'pose':
            _rename(each, own)


def _express(axis: ElementTree.Element, own: str, refuse: Refuse) -> None:
    """An axis in the frame of the model is one in the frame that stands for it."""
    flag = axis.find(OF_MODEL)
    if flag is None or not is_true(flag.text, refuse, axis.tag, flag):
        return
    xyz = axis.find('xyz')
    if xyz is None:
        xyz = ElementTree.SubElement(axis, 'xyz')
        xyz.text = '0 0 1'
    if not xyz.get('expressed_in'):
        xyz.set('expressed_in', own)
    axis.remove(flag)
