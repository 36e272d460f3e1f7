"""Conditions for a mechanism as a whole, for any source.

At every point or vector the bodies that carry it, and the ground if it is fixed, must be connected
by the declared joints as a tree. A missing joint would be a connection without a name. An
additional joint would make the split of the reaction arbitrary.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from alf_ros.mechanism import GROUND, Joint, Mechanism
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.drives import drive_rows
from alf_ros.model.constraints.rows import joint_rows, rigidity
from alf_ros.scene.text.yaml_document import Entry

_ALIGNED = 1e-9  # of directions of length 1: singular value from which down they are one line


def check(layout: Layout, entries: Mapping[str, Entry]) -> None:
    """Raise InputError at the entry (by name in `entries`) that is wrong; the layout is cut."""
    mechanism = layout.mechanism
    _check_held(mechanism, entries)
    fixed = {item.name for item in mechanism.blocks if item.fixed}
    _check_shared(mechanism, 'point', fixed, entries)
    _check_shared(mechanism, 'vector', fixed, entries)
    _check_row_names(layout, entries)


def check_numbers(layout: Layout, known: Layout, entries: Mapping[str, Entry]) -> None:
    """`check`, of a mechanism with the structure of one that was checked, `known`: the conditions
    that depend on numbers too."""
    _check_held(layout.mechanism, entries)
    # rows of a body are named after those of its points and vectors that carry it
    names = [body.name for body in layout.bodies]
    if any(layout.shape(name).ends != known.shape(name).ends for name in names):
        _check_row_names(layout, entries)


def _check_held(mechanism: Mechanism, entries: Mapping[str, Entry]) -> None:
    """Require that each body can move."""
    fixed = {item.name for item in mechanism.blocks if item.fixed}
    for body in mechanism.bodies:
        held = [name for name in (*body.points, *body.vectors) if name in fixed]
        if _holds(mechanism, held) or held == [*body.points, *body.vectors]:
            message = f'body {body.name!r} cannot move: fixed at {" and ".join(held)}'
            raise entries[body.name].error(message)


def _holds(mechanism: Mechanism, held: Collection[str]) -> bool:
    """Whether a body that is fixed at these points and vectors cannot move: in space, if they span
    two directions. Points on one line are hinges."""
    points = [point.at for point in mechanism.points if point.name in held]
    vectors = [vector.along for vector in mechanism.vectors if vector.name in held]
    enough = 1 if mechanism.dimension == 2 else 2
    if len(points) + len(vectors) <= enough:
        return False
    arms = [np.subtract(at, points[0]) for at in points[1:]]
    rows = np.array([*arms, *vectors], dtype=float)
    directions = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    return bool(np.linalg.matrix_rank(directions, tol=_ALIGNED) >= enough)


def _check_shared(
    mechanism: Mechanism, kind: str, fixed: Collection[str], entries: Mapping[str, Entry]
) -> None:
    """Require that joints connect the bodies at every shared point or vector."""
    items = mechanism.points if kind == 'point' else mechanism.vectors
    carriers: dict[str, list[str]] = {item.name: [] for item in items}
    for body in mechanism.bodies:
        for name in body.points if kind == 'point' else body.vectors:
            carriers[name].append(body.name)
    pins: dict[str, list[Joint]] = {}
    for joint in mechanism.joints:
        if getattr(joint, kind) is not None:
            pins.setdefault(getattr(joint, kind), []).append(joint)
    for name, bodies in carriers.items():
        if not bodies and name not in fixed:
            raise entries[name].error(f'{kind} {name!r} is of no body and not fixed')
        _check_pin(name, [GROUND] * (name in fixed) + bodies, pins.get(name, []), entries)


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


def _check_row_names(layout: Layout, entries: Mapping[str, Entry]) -> None:
    """Rows are named after bodies, vectors and joints; two rows of one name could not be
    distinguished."""
    owners: dict[str, str] = {}
    alike = _alike(layout.mechanism)
    for row, owner in _row_names(layout, alike) if alike else ():
        if row in owners:
            raise entries[owner].error(
                f'{owner!r} and {owners[row]!r} both have a constraint {row!r}: rename one'
            )
        owners[row] = owner


def _alike(mechanism: Mechanism) -> set[str]:
    """The names whose rows may have equal names. A row has the name of its owner, alone or with an
    underscore and more behind it: so one of two such owners has the name of the other and more."""
    items = (mechanism.bodies, mechanism.vectors, mechanism.joints, mechanism.couplings)
    names = {item.name for group in (*items, mechanism.drives) for item in group}
    found: set[str] = set()
    for name in names:
        end = name.rfind('_')
        while end > 0:
            if name[:end] in names:
                found |= {name, name[:end]}
            end = name.rfind('_', 0, end)
    return found


def _row_names(layout: Layout, owners: Collection[str]) -> Iterator[tuple[str, str]]:
    """The rows of the owners, each with the name of its own."""
    mechanism = layout.mechanism
    for body in mechanism.bodies:
        if body.name in owners:
            yield from ((row.name, body.name) for row in rigidity(body, layout))
    for vector in mechanism.vectors:
        if vector.name in owners:
            yield f'{vector.name}_unit', vector.name
    for joint in mechanism.joints:
        if joint.name in owners:
            yield from ((row.name, joint.name) for row in joint_rows(joint, layout))
    for coupling in mechanism.couplings:
        if coupling.name in owners:
            yield coupling.name, coupling.name
    for drive in mechanism.drives:
        if drive.name in owners:
            yield from ((row.name, drive.name) for row in drive_rows(drive, layout))
