"""A robot file of another format as the text of a mechanism or scene file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from alf_ros import paths, resources
from alf_ros.errors import AssemblyError, InputError
from alf_ros.exchange import (
    ball_rows,
    fitting_solver,
    gimbal_lock,
    given_masses,
    ground_touches,
    inertia,
    inertialess_ends,
    initial_velocities,
    massless_ends,
    mechanism_text,
    mesh_units,
    mjcf_import,
    sdf_import,
    sdf_versions,
    urdf_with_loops,
    usd_import,
    xml_file,
)
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_stage import SUFFIXES
from alf_ros.model import massless_directions
from alf_ros.model.compile import compile_model
from alf_ros.scene.scene import Scene, scene_from_text
from alf_ros.scene.text.yaml_document import LARGEST
from alf_ros.simulation.start import started

_MASSES = 'mass and inertia of links; or --mass KG, for positions and loops alone'
_LIGHT = 1e-4  # of the mean mass: a direction with less may have too little for a run

# the formats that take no plane besides those of the file, with the reason
WITHOUT_GROUND = {
    'mujoco': 'not for MJCF, which states planes in the file',
    'usd': 'not for USD, whose contact is not imported',
}


@dataclass(frozen=True)
class Wishes:
    """Options of an import.

    loops: path of a side file that closes loops of a URDF. scene: effects as well. stops:
    stiffness of a stop at each limit of a joint. contact: stiffness of what touches a plane.
    ground: height of a horizontal plane, m, for URDF and SDF. floating: the root link of a URDF is
    free. positions: of joints as drawn, rad or m. mass: of each link, kg, where the file has none.
    repair_inertia: change impossible inertias. balls: one ball, with their angles, for three
    revolutes through links without mass. key: the keyframe of an MJCF that it begins at.
    arguments: of a xacro.
    """

    loops: str | None = None
    scene: bool = False
    stops: float | None = None
    contact: float | None = None
    ground: float | None = None
    floating: bool = False
    positions: Mapping[str, float] = field(default_factory=dict)
    mass: float | None = None
    repair_inertia: bool = False
    balls: bool = True
    key: str | None = None
    arguments: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_scene(self) -> bool:
        """Whether a scene is written."""
        return self.scene or self.stops is not None or self.contact is not None


def imported(source: str, **wishes: Any) -> str:
    """The text of a mechanism file (of a scene if `scene`, `stops` or `contact`), which loads.

    wishes: fields of `Wishes`. Needs urdf_parser_py for URDF, mujoco for MJCF, xacro for xacro,
    usd-core for USD. Raises InputError.
    """
    asked = Wishes(**wishes)
    for name, x in asked.positions.items():
        if not abs(x) <= LARGEST:
            raise InputError(f'not a usable number for {name!r}', key='--set', value=x)
    robot = _robot(paths.named(source), asked)
    ground_touches.of_colliders(robot, asked.ground)
    if asked.mass is not None:
        given_masses.given(robot, asked.mass)
    massless_ends.left_out(robot)
    inertialess_ends.fixed(robot)
    if asked.balls:
        ball_rows.joined(robot, asked.stops is not None)
    gimbal_lock.checked(robot)
    if not robot.parts:
        kinds = ('joints of massless ends', 'joints without inertia')
        light = [name for kind in kinds for name in robot.left_out.names.get(kind, ())]
        if light:
            message = f'no part of it can move: joints {", ".join(light)} move no mass'
            raise InputError(message, file=source, expected=_MASSES)
        raise InputError(f'no part of it can move{robot.still}', file=source)
    if not any(part.mass or part.inertia.any() for part in robot.parts):
        message = 'no part that can move has mass'
        raise InputError(message, file=source, expected=_MASSES)
    inertia.checked(robot, asked.repair_inertia)
    mesh_units.noted(robot)
    scene = asked.is_scene
    text, loaded = _written(robot, asked)
    if inertia.may_lack(robot) and (names := _without_mass(loaded)):
        for name in names:
            robot.leave('no mass in a free direction', name)
        text, loaded = _written(robot, asked)
    if scene and robot.velocities:
        section = initial_velocities.section(loaded, robot)
        if not section:
            many = section is None
            for name in robot.velocities:
                robot.leave('velocities of many bodies' if many else 'velocities of bodies', name)
        text, loaded = _written(robot, asked, section or '')
    return text + fitting_solver.section(loaded) if scene else text


def _written(robot: Robot, asked: Wishes, more: str = '') -> tuple[str, Scene]:
    """The text with `more` sections, and the scene that it loads as. Raises InputError."""
    scene = asked.is_scene
    text = mechanism_text.text(robot, scene, asked.stops, resources.version(), asked.contact)
    text += more
    whole = text if scene else 'mechanism:\n' + ''.join(f'  {line}\n' for line in text.split('\n'))
    try:
        return text, scene_from_text(whole)
    except InputError as error:
        message = f'the imported mechanism cannot be used: {error.key or ""}: {error.message}'
        raise InputError(message, file=robot.file, value=error.value) from None


def _without_mass(scene: Scene) -> list[str]:
    """Bodies that move in a direction of the free motion in which nothing has mass, or so little
    that no run starts; the last of them with their joints."""
    try:
        model = compile_model(scene.mechanism, scene.solver.penalty)
    except AssemblyError:
        return []
    light = massless_directions.bodies(model, model.q, _LIGHT)
    if not light:
        return []
    found = massless_directions.bodies(model, model.q)
    if not found and not _has_mass_enough(scene):
        found = light
    joints = massless_directions.joints_of(model, found)
    if joints:
        found[-1] += f' (joints {", ".join(joints)})'
    return found


def _has_mass_enough(scene: Scene) -> bool:
    """Whether a run that starts finds mass in every free direction."""
    try:
        started(scene, scene.solver)
    except AssemblyError as error:
        return error.key != massless_directions.KEY
    return True


def format_of(path: Path) -> str:
    """`usd` by the ending of the name, or else the first element of a file: `mujoco`, `sdf`,
    `robot`."""
    if path.suffix.lower() in SUFFIXES:
        return 'usd'
    kind = xml_file.kind_of(path)
    return 'sdf' if kind == sdf_versions.OLD_ROOT else kind


def _robot(path: Path, asked: Wishes) -> Robot:
    """The robot of a file."""
    if os.path.isdir(path):
        expected = f'a file; `import --corpus {path}` imports all files below it'
        raise InputError('a folder', file=str(path), expected=expected)
    kind = format_of(path)
    for_urdf = ((asked.loops, '--loops'), (asked.floating, '--floating'))
    for given, option in for_urdf if kind != 'robot' else ():
        if given:
            raise InputError('for URDF only: this format states it in the file', key=option)
    if asked.ground is not None and kind in WITHOUT_GROUND:
        raise InputError(WITHOUT_GROUND[kind], key='--ground')
    if asked.arguments and kind in ('mujoco', 'usd'):
        raise InputError('for xacro only', key='--argument', value=next(iter(asked.arguments)))
    if kind == 'mujoco':
        return mjcf_import.read(path, asked.positions, asked.key)
    if asked.key is not None:
        raise InputError('for MJCF only', key='--key', value=asked.key)
    if kind == 'sdf':
        return sdf_import.read(path, asked.positions, asked.arguments)
    if kind == 'usd':
        return usd_import.read(path, asked.positions)
    side = None if asked.loops is None else paths.named(asked.loops)
    return urdf_with_loops.read(
        path, side, asked.positions, floating=asked.floating, arguments=asked.arguments
    )
