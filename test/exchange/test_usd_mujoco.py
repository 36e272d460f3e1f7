"""Attributes `mjc:*` and `newton:*` of a USD stage: the motion of MuJoCo's own model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import support.usd_robots as usd
from alf_ros import InputError
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.robot import GROUND
from support.imported_motions import saved, simulate
from support.usd_robots import body, joint, made, massive, numbers, robot_of, stage

pytest.importorskip('pxr')
mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 1e-4, 0.3
ORIGIN = (0.0, 0.0, 0.0)
MASS, COM, MOMENTS = 2.0, (0.125, 0.0, -0.25), (0.03, 0.05, 0.04)
BAR = massive(MASS, COM, MOMENTS)
INERTIAL = (
    f'<inertial pos="0.125 0 -0.25" mass="{MASS}" diaginertia="{MOMENTS[0]} {MOMENTS[1]} 0.04"/>'
)
SCENE = 'def PhysicsScene "scene" {\n%s\n}'
DEGREES, RADIANS = (
    f'uniform token mjc:compiler:angle = "{unit}"' for unit in ('degree', 'radian')
)
PER_DEGREE = math.pi / 180.0


def bars(first: str = '', more: str = '', scene: str = '') -> str:
    """Two bars that hang on each other, with attributes of the first joint and of the scene."""
    return stage(
        body('b1', BAR),
        body('b2', BAR, at=(0.25, 0.0, 0.0)),
        joint('Revolute', 'j1', (('', ORIGIN), ('/b1', ORIGIN)), usd.axis('Y'), first),
        joint('Revolute', 'j2', (('/b1', (0.25, 0.0, 0.0)), ('/b2', ORIGIN)), usd.axis('Y')),
        more,
        SCENE % scene,
    )


def theirs(first: str = '', more: str = '', joints: str = '') -> str:
    joints = joints or f'<joint name="j1" axis="0 1 0" {first}/>'
    return f"""<mujoco><compiler angle="radian"/>
<option timestep="{STEP}" integrator="RK4"><flag contact="disable"/></option><worldbody>
<body name="b1">{joints}{INERTIAL}<body name="b2" pos="0.25 0 0">
<joint name="j2" axis="0 1 0"/>{INERTIAL}</body></body></worldbody>{more}</mujoco>"""


def expected(source: str, names: Sequence[str], effort: float = 0.0) -> Floats:
    """Positions after the motion, with an effort on each joint."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    for name in names:
        data.joint(name).qfrc_applied[0] = effort
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    start = model.qpos0
    places = [int(model.joint(name).qposadr[0]) for name in names]
    return np.array([data.qpos[n] - start[n] for n in places])


def check(text: str, source: str, names: Sequence[str] = ('j1', 'j2')) -> None:
    simulation = simulate(text)
    simulation.step(round(DURATION * 1000))
    sample = simulation.sample()
    found = [sample.joints[name].position for name in names]
    assert found == pytest.approx(expected(source, names), abs=1e-9)
    assert np.abs(found).max() > 0.05


def prim(kind: str, name: str, *lines: str) -> str:
    return '\n'.join([f'def {kind} "{name}"', '{', *lines, '}'])


def actuator(*lines: str, on: str = '/j1') -> str:
    return prim('MjcActuator', 'a', f'rel mjc:target = <{on}>', *lines)


def general(text: str, on: str = 'joint="j1"') -> str:
    return f'<actuator><general {on} {text}/></actuator>'


SERVO = (
    'uniform token mjc:biasType = "affine"',
    'uniform double[] mjc:biasPrm = [0.5, -8, -0.5]',
    'uniform double[] mjc:gainPrm = [8]',
    'uniform double[] mjc:gear = [2, 0, 0, 0, 0, 0]',
)
SERVO_XML = 'biastype="affine" biasprm="0.5 -8 -0.5" gainprm="8" gear="2"'
# held at the ends of their ranges of force
PUSHED = tuple(each.replace('[0.5', '[50') for each in SERVO)
PUSHED_XML = SERVO_XML.replace('0.5', '50', 1)
CORD = prim(
    'MjcTendon',
    'cord',
    'uniform token mjc:type = "fixed"',
    'rel mjc:path = [</j1>, </j2>]',
    'uniform double[] mjc:path:coef = [1, -0.5]',
    'uniform double mjc:stiffness = 9\nuniform double mjc:damping = 0.5',
    'uniform double mjc:armature = 0.3',
    'uniform double[] mjc:springlength = [0.25, 0.25]',
)
CORD_XML = """<tendon><fixed name="cord" stiffness="9" damping="0.5" springlength="0.25"
 armature="0.3">
<joint joint="j1" coef="1"/><joint joint="j2" coef="-0.5"/></fixed></tendon>"""

# attributes of the first joint, more prims, of the scene; the same for MuJoCo
CASES: dict[str, tuple[str, str, str, str, str]] = {
    'damping': ('uniform double mjc:damping = 0.75', '', '', 'damping="0.75"', ''),
    'armature': ('uniform double mjc:armature = 0.5', '', '', 'armature="0.5"', ''),
    'spring': (
        'uniform double mjc:stiffness = 20\nuniform double mjc:springref = 30',
        '',
        '',
        f'stiffness="20" springref="{math.pi / 6}"',
        '',
    ),
    'spring in rad': (
        'uniform double mjc:stiffness = 20\nuniform double mjc:springref = 0.5',
        '',
        RADIANS,
        'stiffness="20" springref="0.5"',
        '',
    ),
    'reference': (
        'uniform double mjc:stiffness = 20\nuniform double mjc:ref = 0.5',
        '',
        RADIANS,
        'stiffness="20" ref="0.5"',
        '',
    ),
    'newton': (
        'float newton:damping = 0.0125\nfloat newton:armature = 0.25',
        '',
        '',
        f'damping="{0.0125 / PER_DEGREE}" armature="0.25"',
        '',
    ),
    'both': (
        'double mjc:damping = 0.75\nfloat newton:damping = 0.01308997',
        '',
        '',
        'damping="0.75"',
        '',
    ),
    'servo': ('', actuator(*SERVO), '', '', general(SERVO_XML)),
    'control range': (
        '',
        actuator('double mjc:ctrlRange:min = 0.5\ndouble mjc:ctrlRange:max = 1', *SERVO),
        '',
        '',
        general(f'ctrllimited="true" ctrlrange="0.5 1" {SERVO_XML}'),
    ),
    'force range': (
        '',
        actuator('double mjc:forceRange:min = -0.1\ndouble mjc:forceRange:max = 0.1', *PUSHED),
        '',
        '',
        general(f'forcelimited="true" forcerange="-0.1 0.1" {PUSHED_XML}'),
    ),
    'range of the joint': (
        'double mjc:actuatorfrcrange:min = -0.1\ndouble mjc:actuatorfrcrange:max = 0.1',
        actuator(*PUSHED),
        '',
        'actuatorfrclimited="true" actuatorfrcrange="-0.1 0.1"',
        general(PUSHED_XML),
    ),
    'tendon': ('', CORD, '', '', CORD_XML),
    'on a tendon': (
        '',
        f'{CORD}\n{actuator(*SERVO, on="/cord")}',
        '',
        '',
        CORD_XML + general(SERVO_XML, 'tendon="cord"'),
    ),
    'newton actuator': (
        '',
        """def NewtonActuator "a" (prepend apiSchemas = ["NewtonPDControlAPI"]) {
rel newton:targets = </j1>
float newton:kp = 8\nfloat newton:kd = 0.5\nfloat newton:constEffort = 2\n}""",
        '',
        '',
        general('biastype="affine" biasprm="2 -8 -0.5" gainprm="8"'),
    ),
}


@pytest.mark.parametrize(('first', 'prims', 'scene', 'xml', 'more'), CASES.values(), ids=CASES)
def test_what_acts_on_a_joint(
    first: str, prims: str, scene: str, xml: str, more: str, tmp_path: Path
) -> None:
    text = made(tmp_path, bars(first, prims, scene), scene=True)
    assert '# Changes of the motion' not in text
    check(text, theirs(xml, more))


def test_other_units(tmp_path: Path) -> None:
    """A stage in mm and g: forces on an angle are in g mm^2 / s^2, and so on."""
    text = stage(
        body('b', massive(2000.0, (125.0, 0.0, -250.0), [1e9 * x for x in MOMENTS])),
        joint(
            'Prismatic',
            'j1',
            (('', ORIGIN), ('/b', ORIGIN)),
            usd.axis('Z'),
            'double mjc:stiffness = 20000\ndouble mjc:damping = 750\ndouble mjc:springref = 100',
            'double mjc:armature = 500',
        ),
        metre=1e-3,
        kilogram=1e-3,
    )
    source = theirs(
        joints='<joint name="j1" type="slide" axis="0 0 1" stiffness="20" damping="0.75" '
        'springref="0.1" armature="0.5"/>'
    ).replace('<joint name="j2" axis="0 1 0"/>', '')
    source = source.replace(INERTIAL, '', 1).replace('<body name="b2" pos="0.25 0 0">', '')
    source = source.replace('</body></body>', '</body>')
    check(made(tmp_path, text, scene=True), source, ('j1',))


STACK = """<joint name="x" axis="1 0 0" damping="0.3"/><joint name="y" axis="0 1 0"/>
<joint name="s" type="slide" axis="0 0 1" stiffness="90"/>"""


def stacked(root: str = '', api: str = 'MjcJointAPI') -> str:
    """A bar with three joints on the world."""
    ends = ('', ORIGIN), ('/r/b', ORIGIN)
    links = [
        joint('Revolute', 'x', ends, usd.axis('X'), 'double mjc:damping = 0.3'),
        joint('Revolute', 'y', ends, usd.axis('Y')),
        joint('Prismatic', 's', ends, usd.axis('Z'), 'double mjc:stiffness = 90'),
    ]
    text = '\n'.join([body('b', BAR), *links])
    for name in ('x', 'y', 's') if api else ():
        text = text.replace(f'Joint "{name}"', f'Joint "{name}" (prepend apiSchemas = ["{api}"])')
    return stage(f'def Xform "r" {{ {root}\n{text}\n}}')


@pytest.mark.parametrize(
    ('root', 'api'), [('', 'MjcJointAPI'), ('uniform bool newton:jointsAddMobility = 1', '')]
)
def test_joints_one_after_the_other(root: str, api: str, tmp_path: Path) -> None:
    text = made(tmp_path, stacked(root, api), scene=True)
    source = theirs(joints=STACK).replace('<body name="b2" pos="0.25 0 0">', '')
    source = source.replace(INERTIAL, '', 1).replace('<joint name="j2" axis="0 1 0"/>', '')
    simulation = simulate(text)
    check(text, source.replace('</body></body>', '</body>'), ('x', 'y', 's'))
    assert len(simulation.sample().joints) == 3


def test_joints_that_constrain_together(tmp_path: Path) -> None:
    """Without a word, or with the word that they do not add freedoms."""
    for text in (stacked('', ''), stacked('uniform bool newton:jointsAddMobility = 0')):
        robot = robot_of(tmp_path, text)
        assert [part.name for part in robot.parts] == ['b']
        assert {(each.parent, each.child) for each in robot.connections} == {(GROUND, 'b')}


@pytest.mark.parametrize(
    'degrees',
    [
        ('transX', 'transY', 'transZ'),
        ('transX', 'transZ', 'rotX'),
        ('transX', 'rotY'),
        ('transZ', 'rotZ'),
        ('transX', 'transZ', 'rotY'),
        ('rotY', 'rotX'),
        ('rotZ', 'rotX'),
    ],
)
def test_chains_of_the_freedoms_of_a_joint(degrees: Sequence[str], tmp_path: Path) -> None:
    """Slides, swing and twist, as MuJoCo has them, each with a drive of its own."""
    space = [kind + axis for kind in ('trans', 'rot') for axis in 'XYZ']
    locks = [each for each in space if each not in degrees]
    lines = [
        f'float limit:{each}:physics:low = 1\nfloat limit:{each}:physics:high = -1'
        for each in locks
    ]
    for each in degrees:
        stiffness = 90.0 * (PER_DEGREE if each.startswith('rot') else 1.0)
        lines += usd.drive(each, stiffness=stiffness, targetPosition=0.0)
    schemas = [f'Limit:{each}' for each in locks] + [f'Drive:{each}' for each in degrees]
    pin = ('', ORIGIN), ('/b', ORIGIN)
    text = stage(body('b', BAR), joint('', 'j', pin, *lines, schemas=' '.join(schemas)))
    axes = {'X': '1 0 0', 'Y': '0 1 0', 'Z': '0 0 1'}
    joints = ''.join(
        f'<joint name="j_{each}" type="{"slide" if each.startswith("trans") else "hinge"}" '
        f'axis="{axes[each[-1]]}" stiffness="90"/>'
        for each in degrees
    )
    source = theirs(joints=joints).replace('<body name="b2" pos="0.25 0 0">', '')
    source = source.replace(INERTIAL, '', 1).replace('<joint name="j2" axis="0 1 0"/>', '')
    turned = simulate(made(tmp_path, text, scene=True))
    names = [f'j_{each}' for each in degrees]
    for name in names:
        turned.apply_effort(name, 7.0)
    turned.step(round(DURATION * 1000))
    found = [turned.sample().joints[name].position for name in names]
    there = expected(source.replace('</body></body>', '</body>'), names, 7.0)
    assert found == pytest.approx(there, abs=1e-7)  # a gain per degree has seven digits
    assert np.abs(found).max() > 0.01


def test_drives_and_states_of_a_ball_are_listed(tmp_path: Path) -> None:
    locks = [f'trans{axis}' for axis in 'XYZ']
    lines = [
        f'float limit:{each}:physics:low = 1\nfloat limit:{each}:physics:high = -1'
        for each in locks
    ]
    lines += [*usd.drive('rotY', stiffness=5.0), 'float newton:rotZ:position = 9']
    schemas = ' '.join([*(f'Limit:{each}' for each in locks), 'Drive:rotY'])
    pin = ('', ORIGIN), ('/b', ORIGIN)
    text = made(tmp_path, stage(body('b', BAR), joint('', 'j', pin, *lines, schemas=schemas)))
    assert '#   actuators: they apply no force: j (rotY)\n' in text
    assert '#   positions of joints: the bodies start as drawn, not there: j\n' in text


SWITCHES = {
    'spring': ('double mjc:stiffness = 20', 'springs'),
    'damper': ('double mjc:damping = 0.75', 'damping'),
    'frictionloss': ('double mjc:frictionloss = 0.5', 'dry friction'),
    'limit': ('float physics:lowerLimit = -1', 'limits'),
}


@pytest.mark.parametrize('flag', SWITCHES)
def test_switches_of_the_scene(flag: str, tmp_path: Path) -> None:
    line, kind = SWITCHES[flag]
    text = bars(line, '', f'uniform bool mjc:flag:{flag} = 0')
    text = made(tmp_path, text, scene=True, stops=1e5)
    assert f'#   switched off in the file: not imported: {kind}\n' in text
    check(text, theirs())


def test_gravity_that_is_off(tmp_path: Path) -> None:
    for name in ('newton:gravityEnabled', 'mjc:flag:gravity'):
        assert robot_of(tmp_path, bars('', '', f'bool {name} = 0')).gravity == (0.0, 0.0, 0.0)


def test_actuators_that_are_off(tmp_path: Path) -> None:
    for scene in ('bool mjc:flag:actuation = 0', 'int[] mjc:option:actuatorgroupdisable = [3]'):
        text = bars('', actuator('uniform int mjc:group = 3', *SERVO), scene)
        assert not robot_of(tmp_path, text).actuators


@pytest.mark.parametrize(
    ('lines', 'of'),
    [
        ('rel newton:mimicJoint = </j1>\nfloat newton:mimicCoef1 = -2', {'j2': 1.0, 'j1': 2.0}),
        ('rel mjc:target = </j1>\nuniform double mjc:coef1 = 1.5', {'j2': 1.0, 'j1': -1.5}),
    ],
)
def test_mimics(lines: str, of: dict[str, float], tmp_path: Path) -> None:
    api = 'NewtonMimicAPI' if 'newton' in lines else 'MjcEqualityJointAPI'
    text = bars().replace(
        'Joint "j2"\n{', f'Joint "j2" (prepend apiSchemas = ["{api}"])\n{{\n{lines}'
    )
    (coupled,) = robot_of(tmp_path, text).couplings
    assert dict(coupled.of) == of
    off = text.replace(lines, f'{lines}\nbool newton:mimicEnabled = 0')
    assert not robot_of(tmp_path, off).couplings
    curved = text.replace(lines, f'{lines}\ndouble mjc:coef2 = 1')
    listed = made(tmp_path, curved)
    assert 'linear: they are ignored: j2_mimic\n' in ' '.join(listed.split('#  ')) + '\n'


def test_an_inertia_of_six_numbers(tmp_path: Path) -> None:
    six = [0.03, 0.05, 0.04, 0.01, 0.002, 0.003]
    given = f'double[] newton:inertia = {list(six)}'
    part = robot_of(tmp_path, stage(body('b', BAR, given))).parts[0]
    xx, yy, zz, xy, xz, yz = six
    assert part.inertia == pytest.approx(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


NOT_READ = {
    'float physxLimit:angular:stiffness = 5': 'soft limits: they do not give way as in the file: '
    'with --stops they have its stiffness: j1',
    'float newton:limitStiffness = 5': 'with --stops they have its stiffness: j1',
    'double mjc:margin = 0.1': 'margins of limits: limits act at their values: j1',
    'float newton:velocityLimit = 5': 'nothing stops at the limits of velocity: j1',
    'float drive:angular:physics:maxVelocity = 5': 'nothing stops at the limits of velocity: j1',
    'double[] mjc:springdamper = [1, 2]': 'neither the spring nor the damper: j1',
    'float state:angular:physics:position = 9': 'the bodies start as drawn, not there: j1 at 0.15',
    'float newton:angular:velocity = 9': 'the velocities of the bodies only: j1',
    'double mjc:damping = 1\nfloat newton:damping = 1': 'the first one counts: j1 (mjc:damping',
    'float newton:wobble = 3': 'what they do is missing: newton:wobble of j1\n',
}


@pytest.mark.parametrize('line', NOT_READ)
def test_nothing_is_passed_over(line: str, tmp_path: Path) -> None:
    text = made(tmp_path, bars(line), scene=True)
    assert NOT_READ[line] in text.replace('\n# ', '\n')


ON_BODIES = {
    'bool physxRigidBody:enableGyroscopicForces = 0': 'gyroscopic moments off: these bodies',
    'int physxRigidBody:lockedRotAxis = 2': 'locked axes of bodies: these bodies',
    'float mjc:body:gravcomp = 1': 'compensation of gravity: these bodies',
    'float physxRigidBody:maxLinearVelocity = 3': 'velocities that are clamped: here nothing',
    'float3 physxForce:force = (1, 2, 3)': 'attributes without a counterpart: what they do is '
    'missing: physxForce:force of b',
}
HARMLESS = (
    'bool physxRigidBody:enableGyroscopicForces = 1\nbool physxRigidBody:retainAccelerations = 1\n'
    'float physxRigidBody:sleepThreshold = 1\nfloat physxRigidBody:maxLinearVelocity = inf\n'
    'uniform int mjc:group = 3'
)


def test_attributes_of_bodies(tmp_path: Path) -> None:
    for line, listed in ON_BODIES.items():
        assert f'#   {listed}' in made(tmp_path, stage(body('b', BAR, line)), scene=True)
    assert 'Changes' not in made(tmp_path, stage(body('b', BAR, HARMLESS)), scene=True)


def test_values_at_times_are_listed(tmp_path: Path) -> None:
    """Of bodies and of the prims that place them, not of shapes that are only shown."""
    at = 'each counts as it is without a time, or as if the file had none: '
    sampled = 'double3 xformOp:scale.timeSamples = {0: (1, 1, 1)}'
    shown = usd.prim('Xform', 'shown', '', sampled)
    mass = 'float3 physics:diagonalInertia.timeSamples = {0: (1, 1, 1), 1: (2, 2, 2)}'
    above = usd.prim('Xform', 'above', '', sampled, body('b', BAR, mass, shown))
    text = made(tmp_path, stage(above, shown, body('c', BAR)), scene=True).replace('\n# ', '\n')
    names = 'xformOp:scale of above, physics:diagonalInertia of b'
    assert f'  values at times: {at}{names}\n' in text


def test_bodies_of_points_and_further_scenes_are_listed(tmp_path: Path) -> None:
    points = 'int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (1, 0, 0)]'
    points = f'{points}\nrel prototypes = </p/b>'
    scenes = [usd.prim('PhysicsScene', name, '') for name in ('one', 'two')]
    text = stage(usd.prim('PointInstancer', 'p', '', points, body('b', BAR)), *scenes)
    text = made(tmp_path, text, scene=True).replace('\n# ', '\n')
    assert (
        '  instances of points: these bodies are there once, where they are described: p\n' in text
    )
    assert 'the gravity and the switches of the first one: two\n' in text
    assert 'instances' not in made(tmp_path, stage(body('b', BAR)), scene=True)


def test_masses_that_mujoco_takes_from_shapes(tmp_path: Path) -> None:
    text = stage(body('b', BAR), SCENE % 'uniform token mjc:compiler:inertiaFromGeom = "true"')
    assert '#   masses that MuJoCo changes: they are' in made(tmp_path, text)
    assert 'masses that' not in made(tmp_path, text.replace('"true"', '"auto"'))


def test_mistakes(tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.usda', bars('double mjc:damping = -1'))
    with pytest.raises(InputError, match='/j1 mjc:damping: it is negative, got -1.0') as caught:
        imported(path)
    assert 'expected zero or more' in str(caught.value)


def test_places_that_single_precision_moves(tmp_path: Path) -> None:
    """Two balls at one place of a body: in the file they are a few nanometres apart."""
    at, end = (0.3, 0.2, 0.1), np.array((0.3, 0.2, 0.1)) + 3e-9
    text = stage(
        body('b', BAR),
        body('c', BAR, at=at),
        body('d', BAR, at=end.tolist()),
        joint('Prismatic', 's', (('', ORIGIN), ('/b', ORIGIN)), usd.axis('X')),
        joint('Spherical', 'one', (('/b', at), ('/c', ORIGIN))),
        f'def PhysicsSphericalJoint "two" {{\nrel physics:body0 = </b>\nrel physics:body1 = </d>\n'
        f'point3f physics:localPos0 = {numbers(at)}\n}}',
    )
    simulate(made(tmp_path, text, scene=True)).step(1)
