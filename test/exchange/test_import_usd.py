"""USD physics: motions, joints and drives of stages, against closed forms, other formats and the
parser of usd-core itself, which has single precision."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import support.usd_robots as usd
from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_bodies import UsdBodies
from alf_ros.exchange.usd_joints import joints
from alf_ros.exchange.usd_stage import UsdStage
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import check_four_bar, saved, simulate
from support.paths import DATA
from support.usd_robots import (
    FULL,
    body,
    gravity,
    joint,
    made,
    massive,
    numbers,
    placed,
    prim,
    robot_of,
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


# ---------------------------------------------------------------------------------------- joints

SPACE = ('transX', 'transY', 'transZ', 'rotX', 'rotY', 'rotZ')


def d6(free: str, name: str = 'j', child: str = '/b', low: float = 1.0) -> str:
    """A general joint of the world and a body at the origin, whose other motions are locked."""
    locked = [each for each in SPACE if each not in free.split()]
    limits = [
        f'float limit:{each}:physics:low = {low}\nfloat limit:{each}:physics:high = {-low}'
        for each in locked
    ]
    ends = ('', (0.0, 0.0, 0.0)), (child, (0.0, 0.0, 0.0))
    return joint('', name, ends, *limits, schemas=' '.join(f'Limit:{each}' for each in locked))


KINDS = {
    'rotX': ('revolute', [(1, 0, 0)]),
    'rotZ': ('revolute', [(0, 0, 1)]),
    'rotX rotY': ('universal', [(0, 1, 0), (1, 0, 0)]),
    'rotX rotZ': ('universal', [(0, 0, 1), (1, 0, 0)]),
    'rotY rotZ': ('universal', [(0, 1, 0), (0, 0, 1)]),
    'rotX rotY rotZ': ('spherical', []),
    'transY': ('prismatic', [(0, 1, 0)]),
    'transY rotY': ('cylindrical', [(0, 1, 0)]),
    'transX transY rotZ': ('planar', [(0, 0, 1)]),
}


@pytest.mark.parametrize('free', KINDS)
def test_a_general_joint(free: str, tmp_path: Path) -> None:
    """Its locks make it one of our joints; a mechanism file has it."""
    kind, axes = KINDS[free]
    for low in (1.0, 0.0):
        text = stage(body('b', FULL), d6(free, low=low))
        (found,) = robot_of(tmp_path, text).connections
        assert found.kind == kind
        assert np.array(found.axes).reshape(-1, 3) == pytest.approx(np.array(axes).reshape(-1, 3))
        text = made(tmp_path, text)
        assert f'type: {kind}' in text
        assert ('swings of two axes' in text) == (free == 'rotY rotZ')


def test_general_joints_that_hold_all_or_nothing(tmp_path: Path) -> None:
    still = stage(body('b', FULL), body('c', FULL), d6('', 'i'), d6('rotX', 'j', '/c'))
    assert [part.name for part in robot_of(tmp_path, still).parts] == ['c']
    free = made(tmp_path, stage(body('b', FULL), d6(' '.join(SPACE))))
    assert '#   elements: joint j, which leaves all motions free\n' in free
    odd = made(tmp_path, stage(body('b', FULL), d6('transX transY')))
    assert '#   joints of unknown type: they are omitted: j (transX, transY free)\n' in odd


def test_frames_of_joints_as_usd_core_reads_them(tmp_path: Path) -> None:
    """Bodies below scales, ends on prims below bodies and on static prims, y up, inches."""
    from pxr import Usd, UsdPhysics

    turns = [Rotation.from_rotvec(x) for x in ((0.3, 0.2, -0.4), (1.0, 0.1, 0.2), (0.0, 2.0, 0.1))]
    scale = 'double3 xformOp:scale = (2, 0.5, 3)'
    with_scale = placed((1.0, 2.0, 3.0), turns[0]).replace('"]', '", "xformOp:scale"]')
    hook = prim('Xform', 'hook', '', placed((0.1, 0.0, 0.2)))
    text = stage(
        prim('Xform', 'a', 'RigidBody Mass', scale, with_scale, FULL, hook),
        prim('Xform', 'post', '', placed((0.0, 5.0, 0.0), turns[1])),
        joint(
            'Fixed',
            'j',
            (('/post', (0.3, -0.2, 0.1)), ('/a/hook', (1.0, 2.0, -1.0))),
            f'quatf physics:localRot0 = {usd.quaternion(turns[2])}',
            f'quatf physics:localRot1 = {usd.quaternion(turns[1])}',
        ),
        up='Y',
        metre=0.0254,
    )
    opened = Usd.Stage.Open(saved(tmp_path, 'it.usda', text))
    found = UsdPhysics.UsdPhysicsLoadStageFromPrimRange(opened, ['/'])
    (paths, (theirs,)) = found[UsdPhysics.ObjectType.FixedJoint]
    (_, (parsed,)) = found[UsdPhysics.ObjectType.RigidBody]
    read = UsdStage(tmp_path / 'it.usda')
    robot = Robot('it', '', ())
    (ours,) = joints(read, UsdBodies(read, robot), robot)

    def turn(q: Any) -> Rotation:
        return Rotation.from_quat([*q.GetImaginary(), q.GetReal()])

    whole = turn(parsed.rotation)
    place = np.array(parsed.position) + whole.apply(np.array(theirs.localPose1Position))
    assert ours.ends[1].frame.origin / 0.0254 == pytest.approx(place, abs=1e-5)
    axes = (whole * turn(theirs.localPose1Orientation)).as_matrix()
    assert ours.ends[1].frame.turn == pytest.approx(axes, abs=1e-6)
    place = np.array(theirs.localPose0Position)
    assert ours.ends[0].frame.origin / 0.0254 == pytest.approx(place, abs=1e-5)
    assert ours.ends[0].frame.turn == pytest.approx(
        turn(theirs.localPose0Orientation).as_matrix(), abs=1e-6
    )


def test_a_bar_between_two_bodies(tmp_path: Path) -> None:
    """A distance with equal limits: a pendulum on a rod, drawn a little too near."""
    bob = body('bob', FULL, at=(0.0, 0.0, -0.999))
    ends = ('', (0.0, 0.0, 0.0)), ('/bob', (0.0, 0.0, 0.0))
    limits = 'float physics:minDistance = 1', 'float physics:maxDistance = 1'
    text = made(tmp_path, stage(bob, joint('Distance', 'rod', ends, *limits)), scene=True)
    simulation = simulate(text)
    simulation.step(10)
    (place,) = (x for n, x in simulation.sample().points.items() if n == 'rod_at')
    assert np.linalg.norm(place) == pytest.approx(1.0, abs=1e-12)
    for low, high, said in (
        (-1, -1, 'joint rod, which limits no distance'),
        (0, 2, 'distances with play: these joints hold nothing'),
    ):
        limits = f'float physics:minDistance = {low}', f'float physics:maxDistance = {high}'
        assert said in made(tmp_path, stage(bob, joint('Distance', 'rod', ends, *limits)))


def test_joints_that_are_drawn_apart(tmp_path: Path) -> None:
    """A four-bar of which each link is drawn elsewhere: the bodies move until it closes."""
    text = usd.Z_UP.four_bar()
    shifted = text.replace(
        'xformOp:translate = (0.3, 0.0, 0.0)', 'xformOp:translate = (0.33, 0, 0.02)'
    )
    assert shifted != text
    made_ = made(tmp_path, shifted, scene=True)
    assert '#   posture of bodies: joints are open as drawn; the bodies were moved' in made_
    sample = simulate(made_).sample()
    ends = (('crank_pin_at', 'knee_at', 0.1), ('knee_at', 'wrist_at', 0.3))
    for one, other, length in (*ends, ('rocker_pin_at', 'wrist_at', 0.25)):
        found = sample.points[one] - sample.points[other]
        assert np.linalg.norm(found) == pytest.approx(length, abs=1e-9)
    short = text.replace('physics:localPos1 = (0.25, 0.0, 0.0)', 'physics:localPos1 = (2, 0, 0)')
    with pytest.raises(InputError, match=r'wrist: drawn .* m apart, and moving the bodies does'):
        made(tmp_path, short)


# ---------------------------------------------------------------------------- limits and drives

PIN = ('', (0.0, 0.0, 0.0)), ('/b', (0.0, 0.0, 0.0))
BOB = massive(2.0, (0.0, 0.0, -0.5), (0.1, 0.1, 0.05))
DRIVE = {
    'stiffness': 0.3,  # N m per degree
    'damping': 0.02,
    'targetPosition': 60.0,
    'targetVelocity': 20.0,
    'maxForce': 25.0,
}


def drive(instance: str, **values: float | str) -> list[str]:
    kinds = {key: 'uniform token' if key == 'type' else 'float' for key in values}
    return [f'{kinds[key]} drive:{instance}:physics:{key} = {x}' for key, x in values.items()]


@pytest.mark.parametrize('metre', [1.0, 0.01])
def test_a_drive(metre: float, tmp_path: Path) -> None:
    """A pendulum with a drive, in metres and in centimetres: its equation of motion."""
    kilogram = 1.0 if metre == 1.0 else 1e-3
    effort = kilogram * metre**2
    scaled = {**DRIVE, **{k: DRIVE[k] / effort for k in ('stiffness', 'damping', 'maxForce')}}
    bob = massive(
        2.0 / kilogram, (0.0, 0.0, -0.5 / metre), tuple(x / effort for x in (0.1, 0.1, 0.05))
    )
    text = stage(
        body('b', bob),
        joint(
            'Revolute',
            'pin',
            PIN,
            usd.axis('Y'),
            *drive('angular', **scaled),
            schemas='Drive:angular',
        ),
        metre=metre,
        kilogram=kilogram,
    )
    text = made(tmp_path, text, scene=True)
    simulation = simulate(text)
    k, d = (math.degrees(1.0) * DRIVE[key] for key in ('stiffness', 'damping'))
    wanted, speed = math.radians(60.0), math.radians(20.0)

    def rate(_: float, y: Floats) -> list[float]:
        effort = np.clip(k * (wanted - y[0]) + d * (speed - y[1]), -25.0, 25.0)
        return [y[1], (effort - 2.0 * G * 0.5 * math.sin(y[0])) / (0.1 + 2.0 * 0.25)]

    found = solve_ivp(
        rate, (0.0, 0.3), [0.0, 0.0], 'DOP853', rtol=1e-12, atol=1e-13, max_step=1e-3
    )
    simulation.step(300)
    assert simulation.sample().joints['pin'].position == pytest.approx(found.y[0, -1], abs=1e-7)


def test_a_linear_drive_and_its_units(tmp_path: Path) -> None:
    text = stage(
        body('b', FULL),
        d6('transY')
        .replace(']', ', "PhysicsDriveAPI:transY"]')
        .replace('rel physics:body1', '\n'.join([*drive('transY', **DRIVE), 'rel physics:body1'])),
        metre=0.01,
        kilogram=0.001,
    )
    scene = scene_from_text(made(tmp_path, text, scene=True))
    (motor,) = (each.parameters for each in scene.effects if each.kind == 'motor')
    assert motor.position_gain == pytest.approx(0.3e-3, rel=1e-15)  # g/s^2
    assert motor.velocity_gain == pytest.approx(0.02e-3, rel=1e-15)
    assert (motor.position, motor.velocity) == pytest.approx((0.6, 0.2), rel=1e-15)
    assert motor.limit == pytest.approx(25e-5, rel=1e-15)


def test_limits_are_in_degrees_from_the_zero_of_the_file(tmp_path: Path) -> None:
    """A joint drawn at 200 of its 170 to 350 degrees; one side without a limit."""
    turned = body('b', BOB).replace(
        placed((0.0, 0.0, 0.0)), placed((0, 0, 0), Rotation.from_euler('y', 200, True))
    )
    for high, upper in (('350', math.radians(150.0)), ('inf', None), ('3.4e38', None)):
        limits = 'float physics:lowerLimit = 170', f'float physics:upperLimit = {high}'
        text = stage(turned, joint('Revolute', 'pin', PIN, usd.axis('Y'), *limits))
        made_ = made(tmp_path, text, stops=100.0)
        assert 'pin at 3.49066' in made_
        (stop,) = (e.parameters for e in scene_from_text(made_).effects if e.kind == 'joint_stop')
        assert stop.lower == pytest.approx(math.radians(-30.0), abs=1e-9)
        assert stop.upper == (upper if upper is None else pytest.approx(upper, abs=1e-9))
    made_ = made(tmp_path, text)
    assert '#   limits (see --stops): joints pass their limits: pin\n' in made_


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


# ------------------------------------------------------------------------------------ the report


def test_losses_that_change_the_motion_come_first(tmp_path: Path) -> None:
    more = 'bool physxRigidBody:disableGravity = true\nfloat physxRigidBody:angularDamping = 0.5'
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
        'gravity off: these bodies have weight here: b',
        'damping of bodies: these bodies are not damped: b',
        'friction coefficients of PhysX: these joints have no friction: the file has no load: pin',
        'breaking of joints: these joints carry any load: pin',
        'actuators: they apply no force: pin (it sets accelerations)',
        'limits, damping, friction, springs, armature: these joints have none: ball',
        'motion of kinematic bodies: they do not move: moving',
        'joints of unknown type: they are omitted: gear (PhysxPhysicsGearJoint)',
        'contact: bodies pass through each other and through the ground (1)',
        'elements: joint no, which is not enabled',
    ):
        assert f'#   {line}' in lines, line
    (lost,) = (line for line in lines if line.startswith('#   includes: their content is omitted'))
    assert 'nowhere.usda' in lost and '(/lost)' in lost
