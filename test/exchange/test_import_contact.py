"""Contact of imported robots with the ground: statics, friction and rolling with a closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import support.imported_robots as robots
from alf_ros import InputError, Simulation
from alf_ros.arrays import Floats
from alf_ros.commands import import_
from alf_ros.effects.contract import Effect
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

G, K, MASS, R = 9.81, 1e5, 2.0, 0.1


def depth(load: float) -> float:
    """m, at which k δ^1.5 carries a load, N."""
    return float((load / K) ** (2.0 / 3.0))


def world(*bodies: str, ground: str = 'friction="0.5"', more: str = '', pull: float = 0.0) -> str:
    return f"""<mujoco model="it"><option gravity="{pull} 0 {-G}"/>
<worldbody><geom name="floor" type="plane" size="1 1 .1" {ground}/>{''.join(bodies)}</worldbody>
{more}</mujoco>"""


def body(name: str, geom: str, z: float, x: float = 0.0) -> str:
    return f"""<body name="{name}" pos="{x!r} 0 {z!r}"><freejoint/>
 <geom name="{name}_geom" mass="{MASS}" friction="0.3" {geom}/></body>"""


def ball(z: float, geom: str = '') -> str:
    return body('ball', f'type="sphere" size="{R}" {geom}', z)


def contacts(text: str) -> list[Effect]:
    return [each for each in scene_from_text(text).effects if each.kind == 'ground_contact']


def read(folder: Path, source: str, **wishes: Any) -> str:
    pytest.importorskip('mujoco')
    return imported(saved(folder, 'it.xml', source), contact=K, **wishes)


def test_a_ball_at_rest_carries_its_weight(tmp_path: Path) -> None:
    rest = R - depth(MASS * G)
    sim = Simulation(scene_from_text(read(tmp_path, world(ball(rest)))))
    sim.step(300)
    assert sim.sample().points['ball_at'] == pytest.approx([0.0, 0.0, rest], abs=1e-9)


def test_an_impact_leaves_slowly(tmp_path: Path) -> None:
    """1 m/s come, less than 0.1 m/s go: the ball never rises by more than v²/2g. The solver fits
    the ground before something touches it."""
    text = read(tmp_path, world(ball(R + 0.5 / G)))
    assert '# The integrator is implicit because of the stiff effect ground_contact.' in text
    sim = Simulation(scene_from_text(text))
    heights = [sample.points['ball_at'][2] for sample in sim.run(1.0)]
    after = heights[heights.index(min(heights)) :]
    assert min(heights) < R and max(after) < R + 0.5 * 0.1**2 / G


def test_a_foot_that_slides_ends_in_rolling(tmp_path: Path) -> None:
    """The moment of momentum about the place of contact stays: 5/7 of the speed."""
    text = read(tmp_path, world(ball(R - depth(MASS * G))))
    text += 'initial: {velocities: {ball_at: [0.7, 0, 0]}}\n'
    sim = Simulation(scene_from_text(text))
    sim.step(500)
    assert sim.sample().velocities['ball_at'] == pytest.approx([0.5, 0.0, 0.0], abs=1e-7)


@pytest.mark.parametrize('pull', [1.0, 2.4, 2.6, 4.0])
def test_a_box_holds_within_the_cone_of_friction(pull: float, tmp_path: Path) -> None:
    """v' = pull - mu g v / sqrt(v^2 + slip^2): it creeps up to mu g, and slides beyond."""
    mu, slip, duration = 0.25, 0.01, 0.4
    low = 0.01 - depth(MASS * G / 4.0)
    box = body('box', 'type="box" size="0.2 0.1 0.01"', low).replace('"0.3"', f'"{mu}"')
    text = read(tmp_path, world(box, ground='friction="0.1"', pull=pull))
    assert len(contacts(text)) == 8
    sim = Simulation(scene_from_text(text))
    sim.step(round(duration / 1e-3))

    def rate(_: float, v: Floats) -> Floats:
        return np.asarray(pull - mu * G * v / np.sqrt(v**2 + slip**2))

    slid = solve_ivp(rate, (0.0, duration), [0.0], 'LSODA', rtol=1e-10, atol=1e-12).y[0, -1]
    speed = sim.sample().velocities['box_at'][0]
    assert speed == pytest.approx(slid, rel=2e-3)
    assert (slid < 0.05) == (pull < mu * G)


HOPPER = f"""<mujoco model="hopper"><compiler angle="radian"/><option gravity="0 0 -{G}"/>
<worldbody><geom name="floor" type="plane" size="1 1 .1" friction="0.8"/>
<body name="trunk" pos="0 0 0.72"><joint name="x" type="slide" axis="1 0 0"/>
 <joint name="z" type="slide" axis="0 0 1"/><joint name="pitch" axis="0 1 0"/>
 <geom type="box" size="0.2 0.1 0.05" mass="4" contype="0" conaffinity="0"/>
 <body name="thigh" euler="0 0.7 0"><joint name="hip" axis="0 1 0" stiffness="60" damping="1"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" contype="0" conaffinity="0"/>
  <body name="shank" pos="0 0 -0.4" euler="0 -1.2 0">
   <joint name="knee" axis="0 1 0" stiffness="90" damping="1"/>
   <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" contype="0" conaffinity="0"/>
   <geom name="foot" type="sphere" size="0.04" friction="0.5" pos="0 0 -0.4"/>
</body></body></body></worldbody></mujoco>"""


def test_a_leg_that_lands_on_its_foot(tmp_path: Path) -> None:
    """Against MuJoCo's M, bias and Jacobian, with the law as the documents state it."""
    mujoco = pytest.importorskip('mujoco')
    model = mujoco.MjModel.from_xml_string(HOPPER)
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, joints = mujoco.MjData(model), ('x', 'z', 'pitch', 'hip', 'knee')
    foot, deepest = model.geom('foot'), [0.0]

    def rate(_: float, y: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = np.split(y, 2)
        data.qfrc_applied[:] = 0.0
        mujoco.mj_forward(model, data)
        depth = 0.04 - data.geom_xpos[foot.id][2]
        if depth > 0.0:
            deepest.append(depth)
            place = data.geom_xpos[foot.id] - np.array([0.0, 0.0, 0.04])
            J = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, J, None, place, foot.bodyid[0])
            v = J @ data.qvel
            N = K * depth**1.5 * max(0.0, 1.0 - 10.0 * v[2])
            slip = np.array([v[0], v[1], 0.0])
            F = -0.8 * N * slip / np.sqrt(slip @ slip + 1e-4) + np.array([0.0, 0.0, N])
            data.qfrc_applied[:] = J.T @ F
            mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc])

    times = np.linspace(0.0, 0.25, 6)
    wanted = (
        solve_ivp(
            rate, (0.0, 0.25), np.zeros(10), 'DOP853', times, rtol=1e-9, atol=1e-11, max_step=2e-3
        )
        .y[:5]
        .T
    )
    sim = Simulation(
        scene_from_text(read(tmp_path, HOPPER)), integrator='dop853_adaptive', tolerance=1e-11
    )
    for sample, row in zip(sim.run(0.25, every=50), wanted, strict=True):
        found = [sample.joints[name].position for name in joints]
        assert found == pytest.approx(row, abs=1e-7)
    assert max(deepest) > 1e-3 and abs(wanted[-1]).min() > 1e-3


PAIR = '<contact><pair geom1="floor" geom2="ball_geom" friction="0.9 0.9 0 0 0"/></contact>'
FRICTION = {
    'the larger one': ('friction="0.5"', '', '', 0.5),
    'of the higher priority': ('friction="0.5"', 'priority="1"', '', 0.3),
    'none': ('condim="1"', 'condim="1"', '', 0.0),
    'of the pair': ('contype="0"', 'contype="0"', PAIR, 0.9),
}


@pytest.mark.parametrize('name', FRICTION)
def test_friction_of_two_geoms(name: str, tmp_path: Path) -> None:
    ground, geom, more, expected = FRICTION[name]
    text = read(tmp_path, world(ball(R, geom), ground=ground, more=more))
    (found,) = contacts(text)
    assert found.parameters.friction == expected and found.parameters.radius == R


APART = {
    'masks': ('contype="2" conaffinity="4"', '', ''),
    'exclude': ('', '<contact><exclude body1="world" body2="ball"/></contact>', ''),
    'flag': ('', '<option><flag contact="disable"/></option>', ''),
}


@pytest.mark.parametrize('name', APART)
def test_geoms_that_pass_through_the_ground_do_so_here(name: str, tmp_path: Path) -> None:
    geom, more, _ = APART[name]
    text = read(tmp_path, world(ball(R, geom), more=more))
    assert not contacts(text) and 'contact' not in text


def test_a_turned_plane_with_a_margin(tmp_path: Path) -> None:
    ground = 'pos="0 0 -1" euler="0 90 0" margin="0.02"'
    (found,) = contacts(read(tmp_path, world(ball(0.0), ground=ground)))
    assert found.parameters.normal == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert found.parameters.through == pytest.approx([0.02, 0.0, -1.0])


@pytest.mark.parametrize(
    ('ground', 'geom'),
    [
        ('margin="0.02"', 'margin="0.03"'),
        ('margin="0.02" gap="0.004"', 'margin="0.03" gap="0.01"'),
        ('', 'gap="0.01"'),
    ],
)
def test_the_plane_is_where_mujoco_lets_two_margins_touch(
    ground: str, geom: str, tmp_path: Path
) -> None:
    """MuJoCo pushes from `includemargin` on."""
    mujoco = pytest.importorskip('mujoco')
    source = world(ball(R - 0.02, geom), ground=ground)
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(source))
    mujoco.mj_forward(model, data)
    (found,) = contacts(read(tmp_path, source))
    height = float(np.dot(found.parameters.through or np.zeros(3), [0.0, 0.0, 1.0]))
    assert height == pytest.approx(data.contact.includemargin[0], abs=1e-12)


def test_an_option_for_all_contact(tmp_path: Path) -> None:
    """Its flag gives all geoms and pairs the same margin and friction; their gaps stay."""
    option = '<option o_margin="0.05" o_friction="0.2 9 9 9 9"><flag override="%s"/></option>'
    mujoco = pytest.importorskip('mujoco')
    for more in ('', PAIR):
        geom = ball(R, 'gap="0.01"')
        source = world(geom, more=option % 'enable' + more)
        data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(source))
        mujoco.mj_forward(model, data)
        expected = data.contact.includemargin[0]
        assert expected >= 0.04
        (on,) = contacts(read(tmp_path, source))
        assert on.parameters.friction == 0.2
        assert on.parameters.through == pytest.approx([0.0, 0.0, expected])
        (off,) = contacts(read(tmp_path, world(geom, more=option % 'disable' + more)))
        assert off.parameters.friction == (0.9 if more else 0.5)


@pytest.mark.parametrize(('dims', 'friction', 'is_told'), [(3, 0.2, True), (1, 0.0, False)])
def test_two_coefficients_of_a_pair_or_of_an_option(
    dims: int, friction: float, is_told: bool, tmp_path: Path
) -> None:
    """MuJoCo has one for each direction; here the smaller one acts, and the report says so."""
    for along, across in ((0.2, 0.9), (0.9, 0.2)):
        pair = PAIR.replace('0.9 0.9', f'{along} {across}').replace('/>', f' condim="{dims}"/>')
        option = f"""<option o_friction="{along} {across} 0 0 0"><flag override="enable"/></option>
<default><geom condim="{dims}"/></default>"""
        for more in (pair, option):
            text = read(tmp_path, world(ball(R), more=more))
            (found,) = contacts(text)
            assert found.parameters.friction == friction
            assert (f'{TWO}ball_geom\n' in text) == is_told


def test_a_second_pair_of_the_same_shapes_is_listed(tmp_path: Path) -> None:
    """MuJoCo has both; the first one acts here."""
    second = PAIR.replace('0.9 0.9', '0.3 0.3').removeprefix('<contact>')
    text = read(tmp_path, world(ball(R), more=PAIR.removesuffix('</contact>') + second))
    (found,) = contacts(text)
    assert found.parameters.friction == 0.9
    assert 'the first pair of two geoms acts alone: ball_geom\n' in text


def test_what_does_not_come_along_is_listed(tmp_path: Path) -> None:
    """Contact first, each with its consequence."""
    bodies = (
        body('wheel', 'type="ellipsoid" size="0.1 0.1 0.02"', 1.0),
        body('leg', 'type="capsule" size="0.05 0.2" condim="4"', 0.2, 1.0),
    )
    text = read(tmp_path, world(*bodies))
    assert len(contacts(text)) == 2
    for line in (
        'contact of other shapes: these pass through the ground: ellipsoid wheel_geom',
        'contact between bodies: they pass through each other (2)',
        'contact as drawn: these are drawn in the ground, which pushes them out at the start: '
        'leg by 0.05 m',
        'law of contact: its stiffness is that of --contact; no impact leaves the ground faster '
        'than 0.1 m/s',
        'friction of contact: bodies spin and roll on the ground without resistance: leg',
    ):
        assert f'#   {line}\n' in text
    bare = imported(str(tmp_path / 'it.xml'), scene=True)
    line = 'bodies pass through the ground: a robot that nothing else holds falls (1)'
    assert f'#   contact with the ground (see --contact): {line}\n' in bare
    assert 'law of contact' not in bare and not contacts(bare)


# ------------------------------------------------------------------------------------ URDF and SDF


def test_a_ground_for_a_urdf(tmp_path: Path) -> None:
    """A ball whose centre is in a fixed link of the foot, which is turned and moved."""
    foot = robots.link('foot', (0.0, 0.0, 0.0), MASS, (0.01, 0.01, 0.01, 0, 0, 0))
    collision = f"""<collision><origin xyz="0.3 0 0"/><geometry><sphere radius="{R}"/></geometry>
</collision></link>"""
    fixed = """<joint name="held" type="fixed"><parent link="foot"/><child link="pad"/>
<origin xyz="0 0 0.5" rpy="0 1.5707963267948966 0"/></joint>"""
    pad = f'<link name="pad">{collision}'
    path = saved(tmp_path, 'it.urdf', robots.robot(foot, fixed, pad))
    text = imported(path, floating=True, contact=K, ground=-1.0)
    (found,) = (each.parameters for each in contacts(text))
    assert found.at == pytest.approx([0.0, 0.0, 0.2], abs=1e-12) and found.radius == R
    assert found.through == (0.0, 0.0, -1.0) and found.friction == 1.0
    line = 'contact: bodies pass through each other and through the ground (see --ground) (1)'
    assert f'#   {line}\n' in imported(path, floating=True)


TWO = '#   friction in two directions: the smallest coefficient acts in all directions: '


@pytest.mark.parametrize(
    ('given', 'friction', 'is_told'),
    [
        ('<mu1>0.3</mu1><mu2>0.3</mu2>', 0.3, False),
        ('<mu1>0.3</mu1>', 0.3, True),
        ('<mu1>0.9</mu1><mu2> 0.4 </mu2>', 0.4, True),
        ('<kp>1e5</kp>', 1.0, False),
    ],
)
def test_friction_of_gazebo(given: str, friction: float, is_told: bool, tmp_path: Path) -> None:
    """Of the link; a coefficient that is absent is 1, as in Gazebo."""
    ball = f'<collision><geometry><sphere radius="{R}"/></geometry></collision></link>'
    foot = robots.link('foot', (0.0, 0.0, 0.0), MASS, (0.01, 0.01, 0.01, 0, 0, 0))
    foot = foot.replace('</link>', ball)
    gazebo = f'<gazebo reference="foot">{given}</gazebo>'
    path = saved(tmp_path, 'it.urdf', robots.robot(foot, gazebo))
    text = imported(path, floating=True, contact=K, ground=-1.0)
    (found,) = (each.parameters for each in contacts(text))
    assert found.friction == friction
    assert (f'{TWO}foot\n' in text) == is_told


def test_friction_of_gazebo_that_is_no_number(tmp_path: Path) -> None:
    foot = robots.link('foot', (0.0, 0.0, 0.0), MASS, (0.01, 0.01, 0.01, 0, 0, 0))
    foot = foot.replace('</link>', '<collision/></link>')
    gazebo = '<gazebo reference="foot"><mu1>much</mu1></gazebo>'
    path = saved(tmp_path, 'it.urdf', robots.robot(foot, gazebo))
    with pytest.raises(InputError, match="foot: not usable numbers, got 'much'"):
        imported(path, floating=True)


SDF = f"""<sdf version="1.9"><world name="w">
<model name="ground"><static>true</static><link name="l"><collision name="c">
 <pose>0 0 -0.5 0 0 0</pose><geometry><plane><normal>0 0 2</normal></plane></geometry>
 <surface><friction><ode><mu>0.6</mu></ode></friction></surface></collision></link></model>
<model name="robot"><pose>0 0 1 0 0 0</pose><link name="foot">
 <inertial><mass>2</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
 <collision name="tip"><pose>0 0.2 0 0 0 0</pose><geometry><sphere><radius>{R}</radius></sphere>
 </geometry></collision></link></model></world></sdf>"""


def test_the_ground_of_an_sdf(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.sdf', SDF), contact=K)
    (found,) = (each.parameters for each in contacts(text))
    assert found.at == pytest.approx([0.0, 0.2, 0.0]) and found.radius == R
    assert found.through == (0.0, 0.0, -0.5) and found.normal in ((), (0.0, 0.0, 1.0))
    assert found.friction == 0.6
    assert f'{TWO}ground c\n' in text
    alike = SDF.replace('</mu>', '</mu><mu2>0.6</mu2>')
    assert TWO not in imported(saved(tmp_path, 'it.sdf', alike), contact=K)
    rough = SDF.replace('</mu>', '</mu><mu2>0.2</mu2>')
    text = imported(saved(tmp_path, 'it.sdf', rough), contact=K)
    (found,) = (each.parameters for each in contacts(text))
    assert found.friction == 0.2 and f'{TWO}ground c\n' in text
    assert '#   contact between bodies: they pass through each other (1)\n' in text


@pytest.mark.parametrize(
    ('more', 'is_told'),
    [
        ('<collide_bitmask>0x02</collide_bitmask>', True),
        ('<collide_without_contact>1</collide_without_contact>', True),
        ('<collide_bitmask>0xffff</collide_bitmask>', False),
    ],
)
def test_filters_of_contact_are_listed(more: str, is_told: bool, tmp_path: Path) -> None:
    surface = f'<surface><contact>{more}</contact></surface>'
    end = '</collision></link></model></world>'
    assert end in SDF
    text = imported(saved(tmp_path, 'it.sdf', SDF.replace(end, surface + end)), contact=K)
    line = 'filters of contact: these meet the ground whatever their bitmask: robot::foot_tip'
    assert (f'#   {line}\n' in text) == is_told


def test_options_that_cannot_be(tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.xml', world(ball(R)))
    with pytest.raises(InputError, match="--contact: not a stiffness, got '?-1"):
        import_.main([path, '--contact', '-1'])
    with pytest.raises(InputError, match='--ground: not a finite number'):
        import_.main([path, '--ground', 'inf'])
    with pytest.raises(InputError, match='--ground: not for MJCF'):
        import_.main([path, '--ground', '0'])


def wheel(name: str, y: float) -> str:
    """A hinged wheel beside the base, its cylinder along its hinge."""
    return f"""<body name="{name}" pos="0 {y} 0"><joint name="{name}_hinge" axis="0 1 0"/>
 <geom name="{name}_rim" type="cylinder" size="{R} 0.02" euler="90 0 0" mass="0.5" friction="1"/>
</body>"""


def test_a_cart_rolls_on_cylinders_and_slides_on_its_caster(tmp_path: Path) -> None:
    """Down a slope, with two wheels of J = ½ m R²: (M + 2 J / R²) v̇ = M g sin α."""
    slope, low = 1.5, R - depth(9.0 * G / 5.0)
    cart = f"""<body name="base" pos="0 0 {low!r}"><freejoint/>
 <geom type="box" size="0.2 0.1 0.02" mass="7" contype="0" conaffinity="0"/>{wheel('left', 0.2)}
 {wheel('right', -0.2)}<geom name="caster" type="sphere" size="{R / 2}" pos="-0.2 0 {-R / 2}"
 mass="1" friction="0" priority="1"/></body>"""
    text = read(tmp_path, world(cart, pull=slope))
    touching = contacts(text)
    assert len(touching) == 5
    assert [each.parameters.axle for each in touching].count(()) == 1
    sim = Simulation(scene_from_text(text))
    sim.step(200)
    before = sim.sample().velocities['left_hinge_at'][0]
    sim.step(300)
    gained = sim.sample().velocities['left_hinge_at'][0] - before
    assert gained == pytest.approx(0.3 * slope * 9.0 / (9.0 + 0.5), rel=1e-3)


@pytest.mark.parametrize('lean', [0.0, 25.0])
def test_a_cylinder_comes_to_rest_on_its_face(lean: float, tmp_path: Path) -> None:
    """Its rim is rounded by 1e-3 rad, so it stands higher by R / 1000 than a point would."""
    post = body('post', f'type="cylinder" size="{R} 0.1" euler="{lean} 0 0"', 0.2)
    sim = Simulation(scene_from_text(read(tmp_path, world(post))))
    sim.step(1500)
    assert sim.sample().points['post_at'][2] == pytest.approx(
        0.1 - depth(MASS * G) + 1e-3 * R, abs=1e-7
    )
