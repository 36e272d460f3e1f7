"""Contact of an MJCF with fixed planes, with the pairs and the friction that MuJoCo has.

Two geoms touch if a `pair` names them, or if the contype of one has a bit of the conaffinity of
the other and no `exclude` names their bodies. The coefficient of friction is stated by the pair,
or by the geom with the higher priority, or else the larger one counts. A pair may state two, one
for each direction: the smaller one counts. Margins move the plane up; the margins of two geoms add
up, less their gaps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from alf_ros.exchange import ground_touches, mjcf_switches
from alf_ros.exchange.robot import GROUND, FixedPlane, FramePose, Robot
from alf_ros.exchange.visuals import moved, shape
from alf_ros.mechanism import VisualShape

_MANY = 2000  # geoms: of more, pairs of bodies are not looked for one by one


@dataclass(frozen=True)
class _Pair:
    """How two geoms touch: coefficient of sliding friction, whether others matter too, margin,
    whether a second direction has another coefficient, when `friction` is the smaller one, and
    whether a second pair names both."""

    friction: float
    turning: bool
    margin: float
    directed: bool = False
    repeated: bool = False


def add(robot: Robot, mujoco: Any, data: Any, held: Sequence[str]) -> None:
    """Give a robot its touches; list contact that has none here. held: the part of each body."""
    model = data.model
    if model.opt.disableflags & (
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    ):
        return
    planes = [n for n in range(model.ngeom) if _is_ground(mujoco, model, n, held)]
    for geom in range(model.ngeom):
        part = held[model.geom_bodyid[geom]]
        if part == GROUND:
            continue
        for plane in planes:
            pair = _pair(mujoco, model, geom, plane)
            if pair is not None:
                _touch(robot, mujoco, data, geom, part, plane, pair)
    for name in _obstacles(mujoco, model, held, planes):
        robot.leave('contact with fixed shapes', name)
    for name in _moving_or_sticking(model):
        robot.leave('adhesion and moving surfaces', name)
    for part in (*_touching(mujoco, model, held, planes), *_paired(model, held, planes)):
        robot.leave('contact between bodies', part)


def _moving_or_sticking(model: Any) -> Iterator[str]:
    """Geoms and pairs that stick, or whose surface moves, as from MuJoCo 3.11 on they can."""
    nothing = np.zeros(max(model.ngeom, model.npair))
    adhesion, of_pairs, speed = (
        getattr(model, name, nothing)
        for name in ('geom_adhesion', 'pair_adhesion', 'geom_surfacevel')
    )
    for geom in range(model.ngeom):
        if np.any(adhesion[geom]) or np.any(speed[geom]):
            yield model.geom(geom).name or f'geom{geom}'
    for pair in range(model.npair):
        if np.any(of_pairs[pair]):
            yield model.pair(pair).name or f'pair{pair}'


def _is_ground(mujoco: Any, model: Any, geom: int, held: Sequence[str]) -> bool:
    is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    return bool(is_plane and held[model.geom_bodyid[geom]] == GROUND)


@cache
def _uses_gap(mujoco: Any) -> bool:
    """Whether MuJoCo pushes from margin - gap on, as it did before 3.9; then from the margin."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body><freejoint/>
        <geom size="1" margin="0.5" gap="0.25"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return bool(data.contact.includemargin[0] < model.geom_margin.max())


def _pair(mujoco: Any, model: Any, one: int, other: int) -> _Pair | None:
    """None for two geoms that pass through each other."""
    used = _uses_gap(mujoco)
    pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
    named = [n for n, pair in enumerate(pairs) if set(map(int, pair)) == {one, other}]
    if named:
        n, repeated = named[0], len(named) > 1
        along, across = map(float, model.pair_friction[n, :2])
        margin = float(model.pair_margin[n] - used * model.pair_gap[n])
        dims = int(model.pair_dim[n])
        if dims == 1:
            return _Pair(0.0, False, margin, repeated=repeated)
        return _Pair(min(along, across), dims > 3, margin, along != across, repeated)
    masks = model.geom_contype, model.geom_conaffinity
    if not masks[0][one] & masks[1][other] and not masks[0][other] & masks[1][one]:
        return None
    bodies = sorted(int(model.geom_bodyid[each]) for each in (one, other))
    if (bodies[0] << 16) + bodies[1] in model.exclude_signature:
        return None
    ranks = [int(model.geom_priority[each]) for each in (one, other)]
    ruling = [each for each, rank in zip((one, other), ranks, strict=True) if rank == max(ranks)]
    dims = max(int(model.geom_condim[each]) for each in ruling)
    friction = max(float(model.geom_friction[each, 0]) for each in ruling)
    margin = sum(
        float(model.geom_margin[each] - used * model.geom_gap[each]) for each in (one, other)
    )
    if dims == 1:
        return _Pair(0.0, False, margin)
    return _Pair(friction, dims > 3, margin, mjcf_switches.is_directed(mujoco, model))


def _touch(
    robot: Robot, mujoco: Any, data: Any, geom: int, part: str, plane: int, pair: _Pair
) -> None:
    model = data.model
    name = model.geom(geom).name or f'{part}_geom{geom}'
    found = _shape(mujoco, model, geom)
    if found is None:
        robot.leave('contact of other shapes', f'{_kind(mujoco, model, geom)} {name}')
        return
    normal = data.geom_xmat[plane].reshape(3, 3)[:, 2].copy()
    ground = FixedPlane(data.geom_xpos[plane] + pair.margin * normal, normal)
    frame = FramePose(data.geom_xpos[geom].copy(), data.geom_xmat[geom].reshape(3, 3).copy())
    drawn = moved(found, frame)
    ground_touches.touch(robot, part, name, drawn, ground, pair.friction, pair.turning)
    if pair.directed:
        robot.leave('friction in two directions', name)
    if pair.repeated:
        robot.leave('second pairs of contact', name)


def _shape(mujoco: Any, model: Any, geom: int) -> VisualShape | None:
    """In the frame of the geom; None for a kind or a size that no shape here has."""
    kinds, (a, b, c) = mujoco.mjtGeom, model.geom_size[geom]
    sizes = {
        kinds.mjGEOM_SPHERE: ('sphere', (a,)),
        kinds.mjGEOM_CAPSULE: ('capsule', (a, 2.0 * b)),
        kinds.mjGEOM_CYLINDER: ('cylinder', (a, 2.0 * b)),
        kinds.mjGEOM_BOX: ('box', (2.0 * a, 2.0 * b, 2.0 * c)),
    }
    found = sizes.get(kinds(model.geom_type[geom]))
    try:
        return None if found is None else shape(*found)
    except ValueError:
        return None


def _kind(mujoco: Any, model: Any, geom: int) -> str:
    return str(mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix('mjGEOM_').lower())


def _obstacles(
    mujoco: Any, model: Any, held: Sequence[str], planes: Sequence[int]
) -> Iterator[str]:
    """Geoms, besides planes, that do not move and that something moving touches in MuJoCo, except
    geoms of a body that carries a moving one, such as the base of a robot."""
    bases: set[int] = set()
    for body in reversed(range(1, model.nbody)):  # parents come before their children
        if held[body] != GROUND or body in bases:
            bases.add(int(model.body_parentid[body]))
    bases.discard(0)  # the world
    moving = np.array([held[body] != GROUND for body in model.geom_bodyid], dtype=bool)
    kinds, affinities = (
        int(np.bitwise_or.reduce(masks[moving], initial=0))
        for masks in (model.geom_contype, model.geom_conaffinity)
    )
    pairs = [set(map(int, both)) for both in zip(model.pair_geom1, model.pair_geom2, strict=True)]
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if moving[geom] or geom in planes or body in bases:
            continue
        meets = model.geom_contype[geom] & affinities or model.geom_conaffinity[geom] & kinds
        if meets or any(geom in both and any(moving[n] for n in both) for both in pairs):
            yield f'{_kind(mujoco, model, geom)} {model.geom(geom).name or f"geom{geom}"}'


def _paired(model: Any, held: Sequence[str], planes: Sequence[int]) -> Iterator[str]:
    """Parts that a `pair` lets touch others, whatever the masks of their geoms."""
    for geoms in zip(model.pair_geom1, model.pair_geom2, strict=True):
        parts = {held[model.geom_bodyid[geom]] for geom in geoms}
        if len(parts) > 1 and not set(planes).intersection(map(int, geoms)):
            yield from parts - {GROUND}


def _touching(
    mujoco: Any, model: Any, held: Sequence[str], planes: Sequence[int]
) -> Iterator[str]:
    """Parts that touch others in MuJoCo, which no effect here does."""
    above = model.body_weldid[model.body_parentid[model.body_weldid]]
    bodies = model.body_weldid[model.geom_bodyid]
    solid = np.setdiff1d(np.flatnonzero(model.geom_contype | model.geom_conaffinity), planes)
    if solid.size > _MANY:
        yield from {held[model.geom_bodyid[n]] for n in solid} - {GROUND}
        return
    own, parent = bodies[solid], above[model.geom_bodyid[solid]]
    kind, affinity = model.geom_contype[solid], model.geom_conaffinity[solid]
    meet = (kind[:, None] & affinity) | (affinity[:, None] & kind)
    apart = own[:, None] != own
    related = (own[:, None] == parent) | (parent[:, None] == own)
    related &= (own[:, None] != 0) & (own != 0)
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        related[:] = False
    found = (meet != 0) & apart & ~related
    own_body = model.geom_bodyid[solid]
    low, high = np.minimum(own_body[:, None], own_body), np.maximum(own_body[:, None], own_body)
    found &= ~np.isin((low << 16) + high, model.exclude_signature)
    for n in np.flatnonzero(found.any(axis=1)):
        if own[n] != 0:
            yield held[own_body[n]]
