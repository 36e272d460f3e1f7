"""Joints of a USD stage: locks, frames, gaps, limits and drives, against closed forms and the
parser of usd-core itself, which has single precision."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import support.usd_robots as usd
from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_bodies import UsdBodies
from alf_ros.exchange.usd_joints import joints
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.display_geometry import poses
from support.imported_motions import saved, simulate
from support.usd_robots import (
    FULL,
    PIN,
    body,
    drive,
    gravity,
    joint,
    made,
    massive,
    placed,
    prim,
    robot_of,
    stage,
)

pxr = pytest.importorskip('pxr')
G = 9.81


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
    odd = robot_of(tmp_path, stage(body('b', FULL), d6('transX transY')))
    assert [each.kind for each in odd.connections] == ['prismatic', 'prismatic']


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
    (ours,) = joints(read, UsdScene(read, robot), UsdBodies(read, robot), robot)

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
    with pytest.raises(
        InputError, match=r'wrist: drawn apart, and moving the bodies leaves a gap of'
    ):
        made(tmp_path, short)
    around = joint('Revolute', 'pin', PIN, 'quatf physics:localRot0 = (0, 0, 1, 0)')
    with pytest.raises(InputError, match='pin: its two ends are drawn more than a right angle'):
        made(tmp_path, stage(body('b', FULL), around))


# ---------------------------------------------------------------------------- limits and drives

BOB = massive(2.0, (0.0, 0.0, -0.5), (0.1, 0.1, 0.05))
DRIVE = {
    'stiffness': 0.3,  # N m per degree
    'damping': 0.02,
    'targetPosition': 60.0,
    'targetVelocity': 20.0,
    'maxForce': 25.0,
}


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


@pytest.mark.parametrize('kind', ['Revolute', 'Prismatic', ''])
def test_drives_of_another_name_exert_no_force(kind: str, tmp_path: Path) -> None:
    """A revolute joint has the drive `angular`, a prismatic one `linear`, a general joint the
    name of its freedom: others would add to it."""
    short, slides = {'Revolute': 'angular', 'Prismatic': 'linear'}.get(kind, 'rotY'), 'transY'
    other = slides if kind == 'Prismatic' else 'angular' if kind == '' else 'rotY'
    lines = [*drive(short, stiffness=2.0), *drive(other, stiffness=3.0)]
    schemas = f'Drive:{short} Drive:{other}'
    if kind:
        pin = joint(kind, 'pin', PIN, usd.axis('Y'), *lines, schemas=schemas)
    else:
        names = ''.join(f', "PhysicsDriveAPI:{each}"' for each in (short, other))
        pin = d6('rotY', 'pin').replace(']', f'{names}]', 1)
        pin = pin.replace('rel physics:body1', '\n'.join([*lines, 'rel physics:body1']))
    text = made(tmp_path, stage(body('b', FULL), pin), scene=True)
    assert f'they apply no force: pin ({other})' in text
    (motor,) = (e.parameters for e in scene_from_text(text).effects if e.kind == 'motor')
    gain = 2.0 if kind == 'Prismatic' else math.degrees(2.0)
    assert motor.position_gain == pytest.approx(gain, rel=1e-15)


def test_the_order_of_ends(tmp_path: Path) -> None:
    """The coordinate is the angle of body 1 against body 0, also if body 1 is the world."""
    found = []
    for ends in (PIN, PIN[::-1]):
        drives = drive('angular', stiffness=2.0, targetPosition=30.0)
        pin = joint('Revolute', 'pin', ends, usd.axis('Y'), *drives, schemas='Drive:angular')
        simulation = simulate(made(tmp_path, stage(body('b', BOB), pin), scene=True))
        simulation.step(50)
        sample = simulation.sample()
        (pose,) = poses(sample)
        turned = Rotation.from_quat(pose[3:]).as_rotvec()
        found.append((sample.joints['pin'].position, turned[1]))
    angle = found[0][0]
    assert angle > 0.01
    assert found == pytest.approx(np.array([(angle, angle), (angle, -angle)]), abs=1e-12)


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


def test_drives_of_a_joint_that_locks_nothing(tmp_path: Path) -> None:
    """A body on a spring and a damper, against the closed form; a torque on a ball is listed, and
    a drive of a locked motion is not."""
    lines = drive('transX', stiffness=50.0, damping=4.0, targetPosition=0.3)
    driven = joint('', 'j', PIN, *lines, schemas='Drive:transX')
    text = made(tmp_path, stage(body('b', FULL), driven, gravity((1, 0, 0), G)), scene=True)
    assert 'Changes' not in text
    simulation = simulate(text)
    simulation.step(300)
    rest, t = 0.3 + 2.0 * G / 50.0, 0.3  # x'' + 2 x' + 25 (x - rest) = 0
    w = math.sqrt(24.0)
    x = rest - rest * math.exp(-t) * (math.cos(w * t) + math.sin(w * t) / w)
    assert poses(simulation.sample())[0, 0] == pytest.approx(x, abs=1e-9)

    for degree, listed in (('rotY', True), ('transX', False)):
        lines = [] if listed else ['float limit:transX:physics:low = 1']
        lines += [] if listed else ['float limit:transX:physics:high = -1']
        schemas = f'Drive:{degree}' if listed else f'Drive:{degree} Limit:transX'
        driven = joint('', 'j', PIN, *drive(degree, stiffness=5.0), *lines, schemas=schemas)
        text = made(tmp_path, stage(body('b', FULL), driven), scene=True)
        assert (f'({degree})\n' in text) == listed
        assert ('#   limits, damping, friction, springs' in text) == listed


def test_limits_are_in_degrees_from_the_zero_of_the_file(tmp_path: Path) -> None:
    """A joint drawn at 200 of its 170 to 350 degrees; one side without a limit."""
    turned = body('b', BOB).replace(
        placed((0.0, 0.0, 0.0)), placed((0, 0, 0), Rotation.from_euler('y', 200, True))
    )
    for high, upper in (('350', math.radians(150.0)), ('inf', None), ('3.4e38', None)):
        limits = 'float physics:lowerLimit = 170', f'float physics:upperLimit = {high}'
        text = stage(turned, joint('Revolute', 'pin', PIN, usd.axis('Y'), *limits))
        made_ = made(tmp_path, text, stops=100.0)
        assert 'pin at 3.49065850399' in made_
        (stop,) = (e.parameters for e in scene_from_text(made_).effects if e.kind == 'joint_stop')
        assert stop.lower == pytest.approx(math.radians(-30.0), abs=1e-9)
        assert stop.upper == (upper if upper is None else pytest.approx(upper, abs=1e-9))
    made_ = made(tmp_path, text)
    assert '#   limits (see --stops): joints pass their limits: pin\n' in made_


@pytest.mark.parametrize(('low', 'high'), [('20', 'inf'), ('20', '390'), ('-inf', '-20')])
def test_a_joint_that_is_drawn_beyond_its_only_limit(tmp_path: Path, low: str, high: str) -> None:
    """Of limits that leave a whole turn any angle is within, turns further: it is as drawn."""
    limits = f'float physics:lowerLimit = {low}', f'float physics:upperLimit = {high}'
    text = stage(body('b', BOB), joint('Revolute', 'pin', PIN, usd.axis('Y'), *limits))
    made_ = made(tmp_path, text, stops=100.0)
    assert 'zero of joints' not in made_
    assert '#   limits as drawn: ' in made_ and ': pin is at 0, its limit is' in made_
    (stop,) = (e.parameters for e in scene_from_text(made_).effects if e.kind == 'joint_stop')
    ends = (stop.lower, stop.upper)
    assert math.radians(20.0) in [abs(x) for x in ends if x is not None]


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('axis = "Y"', 'axis = "y"', "/j physics:axis: not known, got 'y'; known: X, Y, Z"),
        ('"force"', '"forse"', "/j drive:angular:physics:type: not known, got 'forse'; did you"),
    ],
)
def test_a_word_that_usd_does_not_have_is_refused(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    """The first one of the format was taken, x for an axis."""
    lines = 'uniform token physics:axis = "Y"', *drive('angular', type='"force"', stiffness=1.0)
    hinge = joint('Revolute', 'j', PIN, *lines, schemas='Drive:angular')
    text = stage(body('b', FULL), hinge)
    assert 'axis: [0.0, 1.0, 0.0]' in made(tmp_path, text)
    with pytest.raises(InputError) as caught:
        made(tmp_path, text.replace(old, new))
    assert message in str(caught.value)
