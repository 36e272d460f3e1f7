"""What must hold for a mechanism as a whole, whatever it was read from.

At every point the bodies that carry it, and the ground if it is fixed, must be connected by the
declared revolute joints as a tree: a missing one would be a connection without a name, one more
would make the split of the reaction among them arbitrary.
"""

from __future__ import annotations

from collections.abc import Mapping

from alf_ros.document import Entry
from alf_ros.mechanism import GROUND, Joint, Mechanism


def check(mechanism: Mechanism, entries: Mapping[str, Entry]) -> None:
    """Raise InputError at the entry (by name in `entries`) that is wrong."""
    fixed = {point.name for point in mechanism.points if point.fixed}
    carriers: dict[str, list[str]] = {point.name: [] for point in mechanism.points}
    for body in mechanism.bodies:
        held = [point for point in body.points if point in fixed]
        if len(held) > 1 or held == list(body.points):
            message = f'body {body.name!r} cannot move: fixed at {" and ".join(held)}'
            raise entries[body.name].error(message)
        for point in body.points:
            carriers[point].append(body.name)
    pins: dict[str, list[Joint]] = {}
    for joint in mechanism.joints:
        if joint.kind == 'revolute':
            pins.setdefault(joint.point, []).append(joint)
    for point, bodies in carriers.items():
        if not bodies and point not in fixed:
            raise entries[point].error(f'point {point!r} is of no body and not fixed')
        _check_pin(point, [GROUND] * (point in fixed) + bodies, pins.get(point, []), entries)
    _check_row_names(mechanism, entries)


def _check_pin(
    point: str, members: list[str], joints: list[Joint], entries: Mapping[str, Entry]
) -> None:
    """Union-find over the members of one pin: its joints must be a spanning tree."""
    above = {member: member for member in members}

    def root(member: str) -> str:
        while above[member] != member:
            above[member] = member = above[above[member]]
        return member

    for joint in joints:
        parent, child = root(joint.parent), root(joint.child)
        if parent == child:
            raise entries[joint.name].error(
                f'joint {joint.name!r} is one too many: '
                f'{joint.parent} and {joint.child} are already connected at {point}',
            )
        above[child] = parent
    for member in members[1:]:
        if root(member) != root(members[0]):
            both = f'[{members[0]}, {member}]'
            raise entries[member].error(
                f'{members[0]} and {member} meet at {point}, but no joint connects them there',
                expected=f'{{type: revolute, between: {both}, at: {point}}} among the joints',
            )


def _check_row_names(mechanism: Mechanism, entries: Mapping[str, Entry]) -> None:
    """Rows are named after bodies and sliders; two of one name could not be told apart."""
    owners: dict[str, str] = {}
    rows: list[tuple[str, str]] = []
    for body in mechanism.bodies:
        rows += [(f'{body.name}_length', body.name)] * (len(body.points) > 1)
        rows += [(f'{body.name}_{p}_{axis}', body.name) for p in body.points[2:] for axis in 'xy']
    rows += [(joint.name, joint.name) for joint in mechanism.joints if joint.kind == 'slider']
    for row, owner in rows:
        if row in owners:
            raise entries[owner].error(
                f'{owner!r} and {owners[row]!r} both have a constraint {row!r}: rename one'
            )
        owners[row] = owner
