"""A mechanism whose active joint coordinates are prescribed: the model in which loops close."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from alf_ros import kernel, resources
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError, InputError
from alf_ros.mechanism import GROUND, Coordinate, Drive, Joint, Mechanism, natural_coordinates
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.mechanism.time_function import signal
from alf_ros.model import assembly, ordinary_positions
from alf_ros.model.carried_positions import carried
from alf_ros.model.compile import Model, allocate, compile_model
from alf_ros.model.constraints.row import Row
from alf_ros.model.constraints.rows import joint_rows
from alf_ros.model.joints import type_of
from alf_ros.model.penalty import fitted
from alf_ros.scene.scene import Scene, SceneSource, load_scene
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.reactions import ReactionsOf
from alf_ros.simulation.start import started

_MOVES = 1e-7  # of the fastest motion: rate of a joint that a free motion moves


@dataclass(frozen=True, eq=False)
class Actuated:
    """The model with a row for each active coordinate, in the position where it begins.

    q (blocks D, m): that position, closed. values: of all joint coordinates there, rad or m.
    dependent_rows: rows that depend on others in ordinary positions.
    """

    name: str
    model: Model
    active: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]
    q: Floats
    values: Floats
    dependent_rows: int
    instruments: Instruments


def scene_of(source: SceneSource) -> Scene:
    """The scene of a name or path of a scene or a mechanism, or of a mapping of either.

    Raises InputError.
    """
    if isinstance(source, Mapping):
        return load_scene(source if 'mechanism' in source else {'mechanism': dict(source)})
    if isinstance(source, (str, os.PathLike)):
        name = str(source)
        path = Path(name)
        if path.suffix in ('.yaml', '.yml') and path.is_file():
            fields = yaml_document.read(path).mapping()
            return load_scene(path if 'mechanism' in fields else {'mechanism': str(path)})
        scenes, mechanisms = resources.library('scenes'), resources.library('mechanisms')
        if name in mechanisms and name not in scenes:
            return load_scene({'mechanism': name})
        return load_scene(name)
    return load_scene(source)


def actuated(scene: Scene, active: Sequence[str]) -> Actuated:
    """The model of a scene's mechanism with these joint coordinates active, where it begins.

    Its drives are left out. Raises InputError for a name that is no joint coordinate, or if the
    active coordinates do not determine all others; AssemblyError if the mechanism cannot be
    closed.
    """
    bare = replace(scene.mechanism, drives=(), rotors=())
    names = _checked(bare, active)
    _refuse_what_rolls(bare)
    free = started(
        replace(scene.at_rest(), mechanism=bare, effects=(), document=SceneDocument('')),
        scene.solver,
    )
    values = _values(free.model, free.q)
    numbers = dict(zip(free.model.coordinate_names, values.tolist(), strict=True))
    mechanism = free.model.mechanism
    drives = tuple(_drive(mechanism.coordinate[name], numbers[name]) for name in names)
    driven = replace(mechanism, drives=drives)
    try:
        model = compile_model(driven, free.model.penalty)
        q = assembly.close(model, {}, carried(free.model, free.q, model))
        work = allocate(model, model.system, 0)
        dependent, ordinary, sigma = ordinary_positions.ordinary(model, q, work)
        model = fitted(model.accustomed(sigma, dependent), ordinary, work, dependent)
    except AssemblyError as error:
        raise AssemblyError(
            error.message, file=scene.file, key=error.key, expected=error.expected
        ) from None
    before = free.model.n - (len(free.model.row_names) - free.dependent_rows)
    after = model.n - (len(model.row_names) - dependent)
    _refuse_count(model, ordinary, names, before, after)  # in a dead point more joints move
    return Actuated(
        scene.name,
        model,
        names,
        model.coordinates,
        q,
        values,
        dependent,
        Instruments(model, ReactionsOf(model)),
    )


def _checked(mechanism: Mechanism, active: Sequence[str]) -> tuple[str, ...]:
    if isinstance(active, str) or not isinstance(active, Sequence):
        raise InputError(
            'not a list of joint coordinates', key='active', value=active, expected="['name', …]"
        )
    known = mechanism.coordinate
    for name in active:
        if not isinstance(name, str) or name not in known:
            raise InputError('no such joint coordinate', key='active', value=name, choices=known)
    if len(set(active)) < len(active):
        twice = next(name for name in active if list(active).count(name) > 1)
        raise InputError('given twice', key='active', value=twice)
    if not active:
        raise InputError('no joint is active', key='active', choices=known)
    return tuple(active)


def _refuse_what_rolls(mechanism: Mechanism) -> None:
    """Raise InputError for rows of velocities without an integral: they leave positions open."""
    layout = natural_coordinates.cut(mechanism)
    for joint in mechanism.joints:
        _refuse_motion(joint)
        if type_of(joint).integral is None and _binds_velocities(joint, layout):
            text = f'a joint of type {joint.kind} binds velocities only (it is non-holonomic): '
            text += 'its position depends on the path, not on the active joints'
            raise InputError(text, key=f'joints.{joint.name}')


def _refuse_motion(joint: Joint) -> None:
    if joint.motion:
        text = 'a joint that moves as a function of time does not follow from positions'
        raise InputError(text, key=f'joints.{joint.name}')


def _binds_velocities(joint: Joint, layout: Layout) -> bool:
    return any(isinstance(row, Row) and row.velocity for row in joint_rows(joint, layout))


def refuse_velocity_rows(mechanism: Mechanism) -> None:
    """Rows that bind velocities only leave positions open: what rolls, meshes, or is coupled, is
    refused."""
    layout = natural_coordinates.cut(mechanism)
    for joint in mechanism.joints:
        _refuse_motion(joint)
        if _binds_velocities(joint, layout):
            text = f'a joint of type {joint.kind} binds velocities: positions do not follow'
            raise InputError(text, key=f'joints.{joint.name}')
    for coupling in mechanism.couplings:
        text = 'a coupling binds velocities: positions do not follow'
        raise InputError(text, key=f'couplings.{coupling.name}')


def _refuse_count(
    model: Model, q: Floats, names: tuple[str, ...], before: int, after: int
) -> None:
    """Raise InputError unless the active coordinates take all freedoms, each one."""
    taken = before - after
    if taken < len(names):
        raise InputError(
            f'{len(names)} active joints, but together they have {taken} '
            f'freedom{"s" if taken != 1 else ""}: the loops would not allow all values',
            key='active',
            value=', '.join(names),
            expected=f'{before} independent joint coordinates',
        )
    if after > 0:
        moving = _free_joints(model, q, names)
        raise InputError(
            f'{after} freedom{"s are" if after > 1 else " is"} left: {", ".join(moving)} '
            'would still be free',
            key='active',
            value=', '.join(names),
            expected=f'{before} independent joint coordinates',
        )


def _free_joints(model: Model, q: Floats, names: tuple[str, ...]) -> list[str]:
    """Joint coordinates that move though the active ones do not; bodies, if none does."""
    work = allocate(model, model.system, 1)
    work.q[:] = q
    kernel.linearise(model.unit, model.system, work, work.q)
    random = np.random.default_rng(0)
    x = np.zeros_like(q)
    kernel.add_mass_times(
        model.unit, model.system.mass, 1.0, random.standard_normal(q.size), work.p
    )
    until = kernel.Until(iterations=100, tolerance=1e-15, patience=1.0)
    kernel.augmented(model.unit, model.system, work, work.p, x, until)
    rates = np.abs(_rates(model, q, x))
    # where only bodies move, such as floats and balls, all rates of joints are rounding
    moving = rates > _MOVES * max(float(rates.max(initial=0.0)), np.abs(x).max() / model.size)
    found = {n for n, m in zip(model.coordinate_names, moving, strict=True) if m}
    shown = [name for name in model.coordinate_names if name in found - set(names)]
    if not shown:
        D, layout = model.layout.dimension, model.layout
        fast = np.abs(x.reshape(-1, D)).max(axis=1)
        shown = [
            f'body {body}'
            for body, blocks in layout.of_body.items()
            if fast[list(blocks)].max() > _MOVES * fast.max()
        ]
    return shown[:8] + (['…'] if len(shown) > 8 else [])


def _drive(coordinate: Coordinate, value: float) -> Drive:
    joint = coordinate.joint
    from_ground = joint.parent == GROUND and coordinate.name != f'{joint.name}_second'
    kind = 'angle' if coordinate.is_angle else 'length'
    name = f'{coordinate.name} given'  # no name of a file has a space
    return Drive(
        name, kind, (coordinate.name,), (signal(value),), from_ground and coordinate.is_angle
    )


def _values(model: Model, q: Floats) -> Floats:
    """Joint coordinates at q, rad or m, turns not counted."""
    return _read(model, q, np.zeros_like(q))[0]


def _rates(model: Model, q: Floats, qd: Floats) -> Floats:
    return _read(model, q, qd)[1]


def _read(model: Model, q: Floats, qd: Floats) -> Floats:
    angles = model.system.angles.c.size // 2
    counted = np.zeros((3, angles))
    turns = np.zeros(angles, dtype=np.int64)
    kernel.counted_angles(model.unit, model.system.angles, q, qd, turns, *counted)
    found = np.zeros((2, len(model.coordinates)))
    joints = Instruments(model, ReactionsOf(model)).coordinates
    kernel.joint_coordinates(model.unit, joints, q, qd, counted[0], counted[1], *found)
    return found
