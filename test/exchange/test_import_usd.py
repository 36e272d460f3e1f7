"""USD physics: motions of stages against other formats, velocities at the start, the report."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import support.usd_robots as usd
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from support.imported_motions import check_four_bar, saved, simulate
from support.paths import DATA
from support.usd_robots import (
    FULL,
    PIN,
    body,
    drive,
    gravity,
    joint,
    made,
    massive,
    numbers,
    placed,
    prim,
    stage,
)

pxr = pytest.importorskip('pxr')
G = 9.81

# ------------------------------------------------------------------------------------------ motion


@pytest.mark.parametrize('units', [usd.Z_UP, usd.Y_UP, usd.TILTED], ids=['z', 'y', 'tilted'])
def test_a_loop(units: usd.Units, tmp_path: Path) -> None:
    """Our four-bar in metres, in centimetres and grams with y up, and in inches at an angle."""
    text = made(tmp_path, units.four_bar(), scene=True)
    assert 'posture' not in text
    # the attributes of joints have single precision: exact here unless the stage is tilted
    check_four_bar(text, units.turn.as_matrix(), 1e-4 if units is usd.TILTED else 2e-8)


def coordinates(text: str, steps: int) -> list[float]:
    """All joint coordinates after so many ms."""
    simulation = simulate(text)
    simulation.step(steps)
    return [each.position for each in simulation.sample().joints.values()]


def double_pendulum(scale: float) -> str:
    """Two links below a parent that scales; the upper one swings, the lower one turns aside."""
    x, z = 1.0 / scale, 0.1 / scale
    upper, lower = '/above/upper', '/above/lower'
    above = prim(
        'Xform',
        'above',
        '',
        f'double3 xformOp:scale = {numbers([scale] * 3)}',
        'uniform token[] xformOpOrder = ["xformOp:scale"]',
        body('upper', massive(1.0, (0.5 * x, 0.0, z), (0.01, 0.1, 0.1))),
        body('lower', massive(0.5, (0.3 * x, z, 0.0), (0.01, 0.02, 0.02)), at=(x, 0.0, 0.0)),
    )
    return stage(
        above,
        joint('Revolute', 'a', (('', (0, 0, 0)), (upper, (0, 0, 0))), usd.axis('Y')),
        joint('Revolute', 'b', ((upper, (x, 0, 0)), (lower, (0, 0, 0))), usd.axis('X')),
    )


def test_scales_of_parents(tmp_path: Path) -> None:
    expected = coordinates(made(tmp_path, double_pendulum(1.0), scene=True), 200)
    assert np.abs(expected).min() > 0.01
    for scale in (4.0, 0.01):
        found = coordinates(made(tmp_path, double_pendulum(scale), scene=True), 200)
        assert found == pytest.approx(expected, abs=1e-12)


# ------------------------------------------------------------------------------ like other formats


def leg() -> tuple[str, str]:
    """The leg of test/data/robots without what USD has no words for, as MJCF and as USD."""
    import mujoco

    root = ElementTree.parse(DATA / 'robots/leg.xml').getroot()
    for tag in ('tendon', 'actuator', 'sensor', 'keyframe'):
        root.remove(root.find(tag))
    equality = root.find('equality')
    for each in equality.findall('joint'):
        equality.remove(each)
    for each in root.iter('joint'):
        each.attrib.pop('frictionloss', None)
    mjcf = ElementTree.tostring(root, 'unicode')
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    prims = [gravity(model.opt.gravity, float(np.linalg.norm(model.opt.gravity)))]
    for n in range(1, model.nbody):
        w, x, y, z = model.body_iquat[n]
        turn, axes = (Rotation.from_quat(q) for q in (np.roll(data.xquat[n], -1), [x, y, z, w]))
        given = massive(float(model.body_mass[n]), model.body_ipos[n], model.body_inertia[n])
        given += f'\nquatf physics:principalAxes = {usd.quaternion(axes)}'
        at = placed(data.xpos[n], turn)
        prims.append(prim('Xform', model.body(n).name, 'RigidBody Mass', at, given))

    def ends(one: int, other: int, place: Floats, along: Floats) -> tuple[list[Any], list[str]]:
        found, turns = [], []
        world = Rotation.align_vectors([along], [[0.0, 0.0, 1.0]])[0]
        for side, n in enumerate((one, other)):
            own = Rotation.from_quat(np.roll(data.xquat[n], -1)).inv()
            name = f'/{model.body(n).name}' if n else ''
            found.append((name, own.apply(place - data.xpos[n])))
            turns.append(f'quatf physics:localRot{side} = {usd.quaternion(own * world)}')
        return found, turns

    held = []
    for n in range(model.njnt):
        child = model.jnt_bodyid[n]
        slides = model.jnt_type[n] == mujoco.mjtJoint.mjJNT_SLIDE
        sides = ends(model.body_parentid[child], child, data.xanchor[n], data.xaxis[n])
        degree = 1.0 if slides else math.pi / 180.0
        kind, drive = ('Prismatic', 'linear') if slides else ('Revolute', 'angular')
        values = {
            'stiffness': model.jnt_stiffness[n] * degree,
            'damping': model.dof_damping[n] * degree,
            'targetPosition': (model.qpos_spring[n] - model.qpos0[n]) / degree,
        }
        acts = [f'float drive:{drive}:physics:{key} = {float(x)!r}' for key, x in values.items()]
        acts += [usd.axis('Z'), f'float physxJoint:armature = {float(model.dof_armature[n])!r}']
        found, turns = sides
        name = model.joint(n).name
        held.append(joint(kind, name, found, *turns, *acts, schemas=f'Drive:{drive}'))
    anchor, one, other = model.eq_data[0, :3], model.eq_obj1id[0], model.eq_obj2id[0]
    place = data.xpos[one] + data.xmat[one].reshape(3, 3) @ anchor
    found, turns = ends(one, other, place, np.array([0.0, 0.0, 1.0]))
    held.append(joint('Spherical', 'wrist', found, *turns))
    return mjcf, stage(*prims, prim('Scope', 'joints', '', *held))


def test_a_leg_as_from_mjcf(tmp_path: Path) -> None:
    """Slide, hinges, a loop, rotors, springs and dampers (drives), gravity aside: MuJoCo compiles
    the masses, and USD has them, with the frames of joints, in single precision."""
    pytest.importorskip('mujoco')
    mjcf, text = leg()
    first = simulate(imported(saved(tmp_path, 'leg.xml', mjcf), scene=True))
    second = simulate(made(tmp_path, text, scene=True))
    for simulation in (first, second):
        simulation.step(300)
    there, here = first.sample().joints, second.sample().joints
    names = ('rail', 'hip', 'knee', 'toe', 'crank', 'link', 'rocker')
    expected = [there[name].position for name in names]
    assert np.abs(expected).min() > 0.003
    assert [here[name].position for name in names] == pytest.approx(expected, abs=2e-6)


# ------------------------------------------------------------------------------ initial velocities

SPIN = 'vector3f physics:velocity = {}\nvector3f physics:angularVelocity = {}'


def test_velocities_of_a_free_body(tmp_path: Path) -> None:
    """In the space of its parent, which is turned and in centimetres; of the centre of mass."""
    one = body(
        'b', massive(2.0, (10.0, 0.0, 0.0), (2e3, 2e3, 2e3)), SPIN.format((0, 0, 30), (90, 0, 0))
    )
    above = prim('Xform', 'above', '', placed((0, 0, 0), Rotation.from_euler('z', 90, True)), one)
    text = made(tmp_path, stage(above, gravity((0, 0, -1), 0.0), metre=0.01), scene=True)
    simulation = simulate(text)
    simulation.step(500)
    (place,) = (x for name, x in simulation.sample().points.items() if name == 'b_at')
    # the centre, 0.1 m along y, rises 0.15 m; the body turns 45 degrees about the world's y
    assert place == pytest.approx([0.0, 0.0, 0.15], abs=1e-9)
    assert '#   velocities of bodies (see --scene): the motion starts at rest: b' in made(
        tmp_path, stage(above)
    )


def test_velocities_that_the_joints_permit(tmp_path: Path) -> None:
    """The crank of the four-bar turns; the velocities of the other bodies follow."""
    text = usd.TILTED.four_bar()
    axis = usd.TILTED.turn.apply((0.0, -1.0, 0.0))
    middle = usd.TILTED.turn.apply((-math.sin(math.pi / 3), 0.0, math.cos(math.pi / 3)))
    slide = 0.05 * 3.0 * middle / usd.TILTED.metre
    spins = SPIN.format(numbers(slide), numbers(np.degrees(3.0 * axis)))
    crank = text.replace('{\ndouble3', f'{{\n{spins}\ndouble3', 1)
    sample = simulate(made(tmp_path, crank, scene=True)).sample()
    assert sample.joints['crank_pin'].velocity == pytest.approx(3.0, abs=1e-6)
    assert sample.joints['rocker_pin'].velocity != 0.0
    wrong = text.replace(
        '{\ndouble3', f'{{\n{spins.replace(numbers(slide), "(1, 2, 3)")}\ndouble3', 1
    )
    text = made(tmp_path, wrong, scene=True)
    assert 'initial:' not in text
    assert '#   velocities of bodies: the joints do not permit them: the motion starts at' in text


def test_bodies_without_gravity(tmp_path: Path) -> None:
    """Two bodies on one pin, at 0.3 m and 0.5 m from it, of which one has no weight."""
    one = massive(2.0, (0.3, 0.0, 0.0), (0.1, 0.1, 0.1))
    other = massive(1.0, (0.5, 0.0, 0.0), (0.1, 0.1, 0.1))
    text = stage(
        body('a', one),
        body('b', other, 'bool physxRigidBody:disableGravity = true'),
        joint('Revolute', 'pin', (('', (0, 0, 0)), ('/a', (0, 0, 0))), usd.axis('Y')),
        joint('Fixed', 'held', (('/a', (0, 0, 0)), ('/b', (0, 0, 0)))),
    )
    simulation = simulate(made(tmp_path, text, scene=True))
    simulation.step(1)
    expected = 1e-3 * 2.0 * 0.3 * G / (0.2 + 2.0 * 0.3**2 + 0.5**2)
    speed = simulation.sample().joints['pin'].velocity
    assert speed == pytest.approx(expected, rel=1e-4)


# ------------------------------------------------------------------------------------ the report


def test_losses_that_change_the_motion_come_first(tmp_path: Path) -> None:
    more = 'bool physxRigidBody:disableGravity = true\nfloat physxRigidBody:angularDamping = 0.5'
    more += '\nbool physics:startsAsleep = true'
    ball = prim('Sphere', 'ball', 'Collision', 'double radius = 0.1')
    moving = prim(
        'Xform',
        'moving',
        'RigidBody',
        'bool physics:kinematicEnabled = true\nvector3f physics:velocity = (1, 0, 0)',
    )
    off = prim('Xform', 'off', 'RigidBody', 'bool physics:rigidBodyEnabled = false')
    text = stage(
        body('b', FULL, more, ball),
        body('c', FULL),
        moving,
        off,
        joint(
            'Revolute',
            'pin',
            PIN,
            'float physics:breakForce = 100\nfloat physxJoint:jointFriction = 0.1',
            *drive('angular', type='"acceleration"', stiffness=1.0),
            schemas='Drive:angular',
        ),
        joint(
            'Spherical',
            'ball',
            (('/b', (0, 0, 0)), ('/c', (0, 0, 0))),
            'float physics:coneAngle0Limit = 30',
        ),
        joint(
            'Revolute',
            'no',
            (('/off', (0, 0, 0)), ('/c', (0, 0, 0))),
            'bool physics:jointEnabled = false',
        ),
        prim('PhysxPhysicsGearJoint', 'gear', ''),
        prim('Xform', 'lost', '').replace('"lost"', '"lost" (references = @./nowhere.usda@)'),
    )
    lines = made(tmp_path, text).split('\n')
    assert lines[1] == '# Changes of the motion:'
    for line in (
        'sleeping bodies: they move from the start, not when something touches them: b',
        'damping of bodies: these bodies are not damped: b',
        'friction coefficients of PhysX: these joints have no friction: the file has no load: pin',
        'breaking of joints: these joints carry any load: pin',
        'actuators: they apply no force: pin (it sets accelerations)',
        'limits, damping, friction, springs, armature: these joints have none: ball',
        'motion of kinematic bodies: they do not move: moving',
        'joints of unknown type: they are omitted: gear (PhysxPhysicsGearJoint)',
        'contact in USD: bodies pass through each other and through the ground (1)',
        'elements: joint no, which is not enabled',
    ):
        assert f'#   {line}' in lines, line
    (lost,) = (line for line in lines if line.startswith('#   includes: their content is omitted'))
    assert 'nowhere.usda' in lost and '(/lost)' in lost
