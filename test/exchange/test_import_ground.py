"""Parts of the ground and of surfaces that an imported robot does not have are listed."""

from __future__ import annotations

from pathlib import Path

import pytest

import support.imported_robots as robots
from alf_ros import InputError, Simulation
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

K = 1e5
BALL = '<geometry><sphere><radius>0.1</radius></sphere></geometry>'
PLANE = '<geometry><plane><normal>0 0 1</normal></plane></geometry>'
J = '<ixx>0.008</ixx><iyy>0.008</iyy><izz>0.008</izz>'


def sdf(surface: str = '', ground: str = PLANE, more: str = '', gravity: str = '0 0 -9.8') -> str:
    """A ball on the shape of a static model, whose link has no mass."""
    return f"""<sdf version="1.9"><world name="w"><gravity>{gravity}</gravity>
<model name="ground"><static>1</static><link name="l"><collision name="c">{ground}</collision>
</link></model>{more}
<model name="ball"><pose>0 0 0.1 0 0 0</pose><link name="b">
<inertial><mass>2</mass><inertia>{J}</inertia></inertial>
<collision name="c">{BALL}
{surface}
</collision></link></model></world></sdf>"""


def surface(text: str) -> str:
    return f'<surface>{text}</surface>'


def listed(folder: Path, source: str, name: str = 'it.sdf') -> list[str]:
    """The kinds of losses in the head of the file."""
    text = imported(saved(folder, name, source), contact=K)
    return [line[4:].split(':')[0] for line in text.split('\n') if line.startswith('#   ')]


ALWAYS = ['contact between bodies', 'law of contact', 'names, changed']
SLIP = '<friction><ode><mu>0.7</mu><mu2>0.7</mu2><slip1>0.1</slip1></ode></friction>'
BULLET = '<friction><bullet><friction>%s</friction><friction2>%s</friction2>%s</bullet></friction>'
TORSION = '<friction><torsional><coefficient>%s</coefficient>%s</torsional></friction>'


@pytest.mark.parametrize(
    ('given', 'kind'),
    [
        ('', None),
        (SLIP, 'slip of contact'),
        (BULLET % (0.3, 0.3, ''), 'friction of Bullet'),
        (BULLET % (1, 1, ''), None),
        (BULLET % (1, 1, '<rolling_friction>0.1</rolling_friction>'), 'friction of contact'),
        (TORSION % (0.5, '<patch_radius>0.02</patch_radius>'), 'friction of contact'),
        (TORSION % (0.5, '<surface_radius>0.02</surface_radius>'), None),
        (TORSION % (0.0, '<patch_radius>0.02</patch_radius>'), None),
        (TORSION % (0.5, ''), None),
        ('<friction><mu>0.2</mu></friction>', 'unknown elements'),
        ('<frictoin><ode><mu>0.2</mu></ode></frictoin>', 'unknown elements'),
        (SLIP.replace('slip1', 'slip'), 'unknown elements'),
    ],
)
def test_surfaces_of_an_sdf(given: str, kind: str | None, tmp_path: Path) -> None:
    """Also of the plane, which a ball without a surface of its own touches."""
    expected = sorted(ALWAYS + ([] if kind is None else [kind]))
    assert sorted(listed(tmp_path, sdf(surface(given)))) == expected
    assert sorted(listed(tmp_path, sdf(ground=PLANE + surface(given)))) == expected


def test_a_plane_that_something_passes_through_is_listed(tmp_path: Path) -> None:
    mask = surface('<contact><collide_bitmask>0x02</collide_bitmask></contact>')
    assert 'filters of contact' in listed(tmp_path, sdf(ground=PLANE + mask))


@pytest.mark.parametrize(
    ('mu', 'message'),
    [
        ('much', "it.sdf:7: ball::b c: not usable numbers, got 'much'; expected a number"),
        ('nan', "it.sdf:7: ball::b c: not usable numbers, got 'nan'; expected a number"),
        ('-1', 'it.sdf:7: ball::b c: negative mu, got -1.0; expected 0 or more'),
    ],
)
def test_friction_that_cannot_be_has_its_line(mu: str, message: str, tmp_path: Path) -> None:
    given = surface(f'<friction><ode><mu>{mu}</mu></ode></friction>')
    with pytest.raises(InputError, match=message):
        imported(saved(tmp_path, 'it.sdf', sdf(given)))


def test_friction_of_gazebo_that_cannot_be_has_its_line(tmp_path: Path) -> None:
    foot = robots.link('foot', (0.0, 0.0, 0.0), 1.0, (0.01, 0.01, 0.01, 0, 0, 0))
    foot = foot.replace('</link>', '<collision/></link>')
    gazebo = '<gazebo reference="foot">\n<mu1>-0.5</mu1></gazebo>'
    path = saved(tmp_path, 'it.urdf', robots.robot(foot, gazebo))
    with pytest.raises(InputError, match=r'it.urdf:6: foot: negative mu1, got -0.5; expected 0'):
        imported(path, floating=True)


@pytest.mark.parametrize(
    ('given', 'told'),
    [
        ('<collision><surface/></collision>', 'collision of foot'),
        ('<collision><max_contacts>4</max_contacts></collision>', ''),
        ('</gazebo><gazebo reference="fot"><mu1>0.2</mu1>', 'mu1 of fot'),
    ],
)
def test_surfaces_of_gazebo_that_are_not_read(given: str, told: str, tmp_path: Path) -> None:
    """A collision in an extension, and friction of a link that is not there."""
    foot = robots.link('foot', (0.0, 0.0, 0.0), 1.0, (0.01, 0.01, 0.01, 0, 0, 0))
    gazebo = f'<gazebo reference="foot">{given}</gazebo>'
    path = saved(tmp_path, 'it.urdf', robots.robot(foot, gazebo))
    lost = 'physics of Gazebo: what these extensions do to the motion is missing'
    text = imported(path, floating=True)
    assert f'#   {lost}: {told}\n' in text if told else lost not in text


SPHERE = '<geometry><sphere radius="0.1"/></geometry>'


@pytest.mark.parametrize(
    ('collision', 'told'),
    [
        (SPHERE, ''),
        (f'<orgin xyz="0 0 1"/>{SPHERE}', 'orgin of foot'),
        (f'{SPHERE}<contact_coefficients mu="0.1"/>', 'contact_coefficients of foot'),
        (SPHERE.replace('</', '<ball/></', 1), 'ball of foot'),
        (f'{SPHERE}<verbose value="x"/>', ''),
        (f'<origin xyx="0 0 1"/>{SPHERE}', 'origin xyx of foot'),
        (SPHERE.replace('/>', ' length="1"/>'), 'sphere length of foot'),
    ],
)
def test_collisions_of_a_urdf_with_what_it_does_not_have(
    collision: str, told: str, tmp_path: Path
) -> None:
    foot = robots.link('foot', (0.0, 0.0, 0.0), 1.0, (0.01, 0.01, 0.01, 0, 0, 0))
    foot = foot.replace('</link>', f'<collision>{collision}</collision></link>')
    text = imported(saved(tmp_path, 'it.urdf', robots.robot(foot)), floating=True)
    assert f'motion is missing: {told}\n' in text if told else 'unknown' not in text


BOX = '<geometry><box><size>9 9 0.1</size></box></geometry>'
TABLE = f"""<model name="table"><static>1</static><link name="top"><collision name="c">{BOX}
</collision></link></model>"""
FIXED = 'contact with fixed shapes: bodies pass through these: of what does not move only planes '


def test_fixed_shapes_of_an_sdf(tmp_path: Path) -> None:
    """A floor of another shape than a plane stops nothing."""
    for source, name in ((sdf(ground=BOX), 'ground::l c'), (sdf(more=TABLE), 'table::top c')):
        text = imported(saved(tmp_path, 'it.sdf', source), contact=K)
        assert f'#   {FIXED}hold something: box {name}\n' in text
    assert 'fixed shapes' not in imported(saved(tmp_path, 'it.sdf', sdf()), contact=K)


FLOORS = """<mujoco><asset><hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset>
<worldbody><geom name="floor" type="box" size="5 5 1"/><geom type="hfield" hfield="h"/>
<geom name="ghost" size="1" contype="0" conaffinity="2"/>
<geom name="partner" size="1" contype="0" conaffinity="0"/>
<body name="table"><geom name="top" type="cylinder" size="1 1"/></body>
<body name="base"><geom name="foot" size="1"/><body><geom size="1"/>
<body name="arm"><joint axis="0 1 0"/><geom name="hand" size="1" pos="2 0 0"/></body></body></body>
</worldbody><contact><pair geom1="hand" geom2="partner"/></contact></mujoco>"""


def test_fixed_shapes_of_an_mjcf(tmp_path: Path) -> None:
    """Not of the base that carries the arm, nor those that the masks let it pass through."""
    pytest.importorskip('mujoco')
    text = imported(saved(tmp_path, 'it.xml', FLOORS), contact=K)
    names = 'box floor, hfield geom1, sphere partner, cylinder top'
    assert f'#   {FIXED}hold something: {names}\n' in text


def test_a_ball_rolls_down_as_gravity_of_the_world_has_it(tmp_path: Path) -> None:
    """5/7 of the gravity along the plane; the gravity of the world is not along -z."""
    source = sdf(gravity='1.7 0.6 -9.65').replace(
        '0.1 0 0 0</pose>', f'{0.1 - LOW!r} 0 0 0</pose>'
    )
    simulation = Simulation(
        scene_from_text(imported(saved(tmp_path, 'it.sdf', source), contact=K))
    )
    simulation.step(300)  # it slips a little until friction holds it
    early = simulation.sample().velocities['ball__b_at']
    simulation.step(200)
    gained = simulation.sample().velocities['ball__b_at'] - early
    assert gained == pytest.approx([5 / 7 * 0.2 * 1.7, 5 / 7 * 0.2 * 0.6, 0.0], abs=1e-7)


LOW = (2.0 * 9.65 / K) ** (2.0 / 3.0)  # m, at which the ground carries the ball


LINK = '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'


@pytest.mark.parametrize(
    ('collision', 'told'),
    [
        ('<origin xyz="0 0 x"/>\n' + SPHERE, 'line 4: origin xyz 0 0 x'),
        ('\n<geometry><sphere radius="-1"/></geometry>', 'line 5: sphere radius -1'),
    ],
)
def test_collisions_of_a_urdf_that_cannot_be_have_their_line(
    collision: str, told: str, tmp_path: Path
) -> None:
    text = f'<robot name="r">\n<link name="b">{LINK}\n<collision>\n{collision}\n</collision>'
    path = saved(tmp_path, 'it.urdf', f'{text}</link></robot>')
    text = imported(path, floating=True, contact=K, ground=0.0)
    assert f'these pass through the ground: b ({told})\n' in text


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('0.1</radius>', 'big</radius>', 'line 6: sphere radius big'),
        (BALL, f'<pose>0 0 x 0 0 0</pose>{BALL}', 'line 6: pose 0 0 x 0 0 0'),
    ],
)
def test_collisions_of_an_sdf_that_cannot_be_have_their_line(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    text = imported(saved(tmp_path, 'it.sdf', sdf().replace(old, new)), contact=K)
    assert f'these pass through the ground: ball::b_c ({told})\n' in text


@pytest.mark.parametrize(
    ('normal', 'message'),
    [('0 0 x', 'not usable numbers'), ('0 0 0', 'the normal of a plane has no direction')],
)
def test_a_plane_of_an_sdf_that_cannot_be(normal: str, message: str, tmp_path: Path) -> None:
    path = saved(tmp_path, 'it.sdf', sdf(ground=PLANE.replace('0 0 1', normal)))
    with pytest.raises(InputError, match=f'it.sdf:2: .*{message}'):
        imported(path, contact=K)


@pytest.mark.parametrize(
    ('friction', 'message'), [('inf', 'not a finite number'), ('-0.3', 'a negative coefficient')]
)
def test_friction_of_an_mjcf_that_cannot_be_has_its_line(
    friction: str, message: str, tmp_path: Path
) -> None:
    pytest.importorskip('mujoco')
    text = f"""<mujoco><worldbody><geom type="plane" size="1 1 1" priority="-1"/>
<body><freejoint/>
<geom name="foot" size="0.1" friction="{friction} 0 0"/></body></worldbody></mujoco>"""
    with pytest.raises(InputError, match=f'it.xml:3: geom foot: friction: {message}'):
        imported(saved(tmp_path, 'it.xml', text), contact=K)


def test_fixed_shapes_of_a_urdf(tmp_path: Path) -> None:
    """A table beside the arm is listed; the base that carries the arm is not."""
    collision = f'<collision>{SPHERE}</collision>'
    links = ''.join(
        f'<link name="{name}">{LINK}{collision}</link>' for name in ('base', 'arm', 'table')
    )
    joints = """<joint name="j" type="continuous"><parent link="base"/><child link="arm"/>
<axis xyz="0 1 0"/></joint>
<joint name="t" type="fixed"><parent link="base"/><child link="table"/></joint>"""
    path = saved(tmp_path, 'it.urdf', f'<robot name="r">{links}{joints}</robot>')
    lines = [line for line in imported(path).split('\n') if 'fixed shapes' in line]
    assert [line.rpartition(': ')[2] for line in lines] == ['sphere table']


def test_friction_of_gazebo_that_counts_is_not_listed(tmp_path: Path) -> None:
    text = f'<robot name="r"><link name="b">{LINK}<collision>{SPHERE}</collision></link>'
    gazebo = '<gazebo reference="b"><mu1>0.5</mu1><mu2>0.5</mu2><kp>1</kp></gazebo></robot>'
    path = saved(tmp_path, 'it.urdf', text + gazebo)
    assert '#   gazebo: kp of b\n' in imported(path, floating=True, contact=K, ground=0.0)
    assert '#   gazebo: mu1 of b, mu2 of b, kp of b\n' in imported(path, floating=True)
