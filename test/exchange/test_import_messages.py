"""Mistakes around an import end in one line that names file, line, key, value and the cure."""

from __future__ import annotations

from pathlib import Path

import pytest

import support.imported_robots as robots
from alf_ros import Closure, InputError, Simulation, load_scene
from alf_ros.commands.import_ import main
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

XACRO = (
    '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}'
    '<link name="base"/><link name="bar"><inertial><mass value="{}"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="pin" type="continuous"><parent link="base"/><child link="bar"/></joint></robot>'
)
SIZE = '<xacro:arg name="size" default="1"/>'


@pytest.mark.parametrize(
    ('inside', 'mass'),
    [
        (SIZE, '$(arg size)'),
        ('', '$(arg size)'),
        (SIZE, "${float(xacro.arg('size')) * 1.0}"),
        ("<xacro:property name='s' value='1'/>" + SIZE.replace('"size"', '"${chr(115)}ize"'), '2'),
    ],
)
def test_arguments_that_a_xacro_names_are_taken(inside: str, mass: str, tmp_path: Path) -> None:
    """Declared, only used, used in an expression, declared by a computed name."""
    pytest.importorskip('xacro')
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(inside, mass))
    assert 'mass: 2' in imported(path, arguments={'size': '2'})


def test_an_argument_of_an_sdf_is_taken_and_of_other_formats_refused(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    sdf = f"""<sdf version="1.9" xmlns:xacro="http://www.ros.org/wiki/xacro">{SIZE}<model name="m">
    <link name="bar"><inertial><mass>$(arg size)</mass></inertial></link></model></sdf>"""
    path = saved(tmp_path, 'it.sdf.xacro', sdf)
    assert 'mass: 2' in imported(path, arguments={'size': '2'})
    with pytest.raises(InputError, match="--argument: no such argument, got 'sice'"):
        main([path, '--argument', 'sice=2'])
    plain = sdf.replace('xacro', 'x')
    for name, text in (('it.sdf', plain), ('it.xml', '<mujoco/>'), ('it.usda', '')):
        with pytest.raises(InputError, match="--argument: for xacro only, got 'size'"):
            main([saved(tmp_path, name, text), '--argument', 'size=2'])


def test_a_file_that_a_xacro_lacks_is_named_once(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    include = '<xacro:include filename="no.xacro"/>'
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(include, 1))
    with pytest.raises(InputError) as caught:
        imported(path)
    said = f'xacro cannot expand it: No such file or directory: {tmp_path / "no.xacro"}'
    assert caught.value.message == said


def test_a_plane_for_formats_that_take_none(tmp_path: Path) -> None:
    for name, text, of in (('it.xml', '<mujoco/>', 'MJCF'), ('it.usda', '', 'USD')):
        with pytest.raises(InputError, match=f'--ground: not for {of}'):
            main([saved(tmp_path, name, text), '--ground', '0'])


def test_an_argument_of_an_included_file_is_taken(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    other = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
    saved(tmp_path, 'other.xacro', other.format(SIZE))
    inside = '<xacro:include filename="other.xacro"/>'
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(inside, '$(arg size)'))
    assert 'mass: 2' in imported(path, arguments={'size': '2'})


def test_an_argument_that_a_xacro_lacks_is_refused(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(SIZE, '$(arg size)'))
    message = "--argument: no such argument, got 'sice'; did you mean 'size'?"
    with pytest.raises(InputError, match=message):
        main([path, '--argument', 'sice:=2'])
    path = saved(tmp_path, 'none.urdf.xacro', XACRO.format('', '1'))
    with pytest.raises(InputError, match="no such argument, got 'size'; expected no --argument"):
        main([path, '--argument', 'size=2'])


@pytest.mark.parametrize('prefix', ['', '/nowhere'])
def test_a_package_that_is_not_found_is_one_line(prefix: str, tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip('xacro')
    monkeypatch.setenv('AMENT_PREFIX_PATH', prefix)
    inside = '<xacro:include filename="$(find no_such_robot)/a.xacro"/>'
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(inside, '1'))
    with pytest.raises(InputError) as caught:
        imported(path)
    message = str(caught.value)
    assert "$(find ...) finds no package, got 'no_such_robot'; expected a sourced ROS" in message
    assert 'Error' not in message and '\n' not in message and caught.value.exit_code == 2


@pytest.mark.parametrize('site', ['www.ros.org/wiki', 'ros.org/wiki', 'wiki.ros.org'])
def test_a_xacro_is_known_by_its_prefix(site: str, tmp_path: Path) -> None:
    """Whatever address is declared, and whatever the name of the file ends in."""
    pytest.importorskip('xacro')
    inside = '<xacro:property name="m" value="2.5"/>'
    source = XACRO.format(inside, '${m}').replace('www.ros.org/wiki', site)
    assert site in source
    assert 'mass: 2.5' in imported(saved(tmp_path, 'it.urdf', source))


def test_packages_that_are_found_are_not_named(tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip('xacro')
    pytest.importorskip('ament_index_python')
    packages = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    packages.mkdir(parents=True)
    for name in ('there', 'also_there'):
        (packages / name).touch()
        (tmp_path / 'share' / name).mkdir()
    (tmp_path / 'share' / 'there' / 'a.xacro').write_text('<robot/>')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    inside = ''.join(
        f'<xacro:include filename="$(find {name})/a.xacro"/>'
        for name in ('there', 'no_such_robot', 'also_there', 'no_such_hand')
    )
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format(inside, '1'))
    with pytest.raises(InputError, match="finds no package, got 'no_such_robot, no_such_hand'"):
        imported(path)


def test_macros_that_nothing_calls_are_told(tmp_path: Path) -> None:
    pytest.importorskip('xacro')
    text = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="arm"/></robot>'
    with pytest.raises(InputError, match='macros alone: it has no link; expected the file that'):
        imported(saved(tmp_path, 'it.urdf.xacro', text))


def test_a_number_of_a_link_has_its_line(tmp_path: Path) -> None:
    """Not of a xacro, whose text is another one after its expansion."""
    source = robots.double_pendulum().replace('<mass value="1.0"/>\n', '<mass value="1.0"/>')
    lines = source.split('\n')
    number = next(n for n, line in enumerate(lines) if 'name="lower"' in line)
    lines[number] = lines[number].replace('mass value="1.0"', 'mass value="abc"')
    path = saved(tmp_path, 'it.urdf', '\n'.join(lines))
    with pytest.raises(InputError) as caught:
        imported(path)
    expected = "link lower: mass value: not a number, got 'abc'; expected a number"
    assert str(caught.value) == f'{path}:{number + 1}: {expected}'
    pytest.importorskip('xacro')
    path = saved(tmp_path, 'it.urdf.xacro', XACRO.format('', 'abc'))
    with pytest.raises(InputError) as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}: link bar: mass value: not a number')


def test_numbers_of_other_programs_are_not_looked_at(tmp_path: Path) -> None:
    """An element of a simulator, within a link, with names that URDF has too."""
    other = '<link name="lower"><contact><limit lower="soft"/></contact>'
    source = robots.double_pendulum().replace('<link name="lower">', other)
    assert other in source and imported(saved(tmp_path, 'it.urdf', source))


def test_a_folder_is_no_file_but_a_corpus(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='a folder; expected a file; `import --corpus '):
        main([str(tmp_path)])
    with pytest.raises(InputError, match='--corpus: no robot files below this folder.*urdf'):
        main(['--corpus', str(tmp_path)])


@pytest.mark.parametrize(
    ('text', 'line', 'message'),
    [
        ('loops:\n  a: {b: [1, 2\n\n\n', 2, 'not YAML.*the file ends in it'),
        ('loops:\n  a: {b: [1,\n\n\n', 2, 'not YAML.*the file ends in it'),
        ('loops:\n  a: "b\n\n\n', 2, 'not YAML.*the file ends in it'),
        ('{', 1, 'not YAML.*the file ends in it'),
        ('# nothing\n', 1, 'the file is empty'),
    ],
)
def test_the_end_of_a_yaml_file_has_a_line(
    text: str, line: int, message: str, tmp_path: Path
) -> None:
    """A line of the file: the one where it begins, or the last one."""
    urdf = saved(tmp_path, 'it.urdf', robots.four_bar())
    side = saved(tmp_path, 'loops.yaml', text)
    with pytest.raises(InputError, match=f'loops.yaml:{line}: {message}'):
        imported(urdf, loops=side)


@pytest.mark.parametrize('name', ['it.urdf', 'folder/it.sdf', 'it.xml', 'it.usda', 'it.xacro'])
def test_a_robot_file_is_no_scene(name: str) -> None:
    """The message has the command that makes one."""
    expected = f'python -m alf_ros import {name} --scene -o OUT.yaml'
    for use in (load_scene, lambda name: Closure(name, [])):
        with pytest.raises(InputError, match='a robot file') as caught:
            use(name)
        assert expected in str(caught.value)
    with pytest.raises(InputError, match='a robot file'):
        load_scene({'mechanism': name})


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('sholder', "no such joint, got 'sholder'; did you mean 'shoulder'"),
        ('held', "not a joint with one coordinate, got 'held'"),
    ],
)
def test_a_wrong_position_in_a_side_file_has_its_line(
    name: str, message: str, tmp_path: Path
) -> None:
    """Such a position was called one of --set."""
    held = '<link name="l"/><joint name="held" type="fixed"><parent link="base"/><child link="l"/>'
    robot = robots.double_pendulum().replace('</robot>', f'{held}</joint></robot>')
    side = saved(tmp_path, 'side.yaml', f'loops: {{}}\npositions:\n  {name}: 0.1\n')
    with pytest.raises(InputError) as caught:
        main([saved(tmp_path, 'it.urdf', robot), '--loops', side])
    assert str(caught.value).startswith(f'{side}:3: positions.{name}: {message}')


def test_a_wrong_link_in_a_side_file_has_its_line(tmp_path: Path) -> None:
    loop = '{type: spherical, between: [lower, uper]}'
    side = saved(tmp_path, 'side.yaml', f'loops:\n  eye: {loop}\n')
    path = saved(tmp_path, 'it.urdf', robots.double_pendulum())
    with pytest.raises(InputError) as caught:
        main([path, '--loops', side])
    assert str(caught.value).startswith(f'{side}:2: loops.eye.between[1]: ')
    assert "got 'uper'; did you mean 'upper'" in str(caught.value)


URDF = """<robot name="r"><link name="base"/>
<link name="a"><inertial>
<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"/>
<joint name="p" type="continuous"><parent link="base"/><child link="a"/>
<axis xyz="0 1 0"/></joint>
<joint name="q" type="fixed"><parent link="a"/><child link="b"/></joint>
MORE</robot>"""


@pytest.mark.parametrize(
    ('old', 'new', 'line', 'message'),
    [
        ('<mass value="1"/>', '<mass/>', 3, 'link a: mass: it has no value'),
        ('<axis xyz="0 1 0"/>', '<axis/>', 6, 'joint p: axis: it has no xyz'),
        ('izz="1"', '', 3, 'Required attribute not set in XML: izz in '),
        ('continuous', 'continous', 5, 'Invalid joint type: continous in '),
        ('<link name="b"/>', '<link/>', 4, 'Required attribute not set in XML: name in '),
        ('<link name="b"/>', '<link name="a"/>', 4, 'a: a name of two links'),
        ('name="q"', 'name="p"', 7, 'p: a name of two joints'),
        ('0 1 0', '0 0 0', 5, 'p: zero is no direction'),
        ('link="a"/><child link="b"', 'link="c"/><child link="b"', 7, "q: no such link, got 'c'"),
        ('link="base"/><child', 'link="b"/><child', 2, 'a: this link is its own ancestor'),
        ('MORE', '<gazebo reference="a"><gravity>no</gravity></gazebo>', 8,
         "a: neither true nor false, got 'no'"),
        ('MORE', '<constraint name="l" type="weld"><parent link="c"/></constraint>', 8,
         "l: no such link, got 'c'"),
        ('MORE', '<gazebo><joint name="l" type="ball"><parent>b</parent><child>base</child>'
         '<pose relative_to="a">1 0 0 0 0 0</pose></joint></gazebo>', 8,
         "l: no frame for relative_to here, got 'a'; expected base"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_urdf_has_its_line(
    old: str, new: str, line: int, message: str, tmp_path: Path
) -> None:
    path = saved(tmp_path, 'it.urdf', URDF.replace(old, new).replace('MORE', ''))
    with pytest.raises(InputError) as caught:
        imported(path)
    assert str(caught.value).startswith(f'{path}:{line}: {message}')


@pytest.mark.parametrize(('encoding', 'line'), [('utf-16', 1), ('latin-1', 3)])
def test_a_xacro_is_in_utf_8(encoding: str, line: int, tmp_path: Path) -> None:
    """The package xacro reads nothing else; its message had the first byte, and no line."""
    pytest.importorskip('xacro')
    head = f'<?xml version="1.0" encoding="{encoding}"?>\n'
    robot = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n{}</robot>'
    part = tmp_path / 'part.xacro'
    part.write_bytes((head + robot).format('<link name="ä"/>').encode(encoding))
    whole = saved(tmp_path, 'it.xacro', robot.format('<xacro:include filename="part.xacro"/>'))
    for path in (str(part), whole):
        with pytest.raises(InputError) as caught:
            imported(path)
        assert str(caught.value).startswith(f'{part}:{line}: not in UTF-8, and xacro reads no')


@pytest.mark.parametrize('name', ['it.urdf', 'it.sdf', 'it.xacro'])
def test_an_unknown_encoding_is_one_line(name: str, tmp_path: Path) -> None:
    """It was a traceback."""
    head = '<?xml version="1.0" encoding="uft-8"?>'
    text = head + (robots.SDF if name == 'it.sdf' else URDF.replace('MORE', ''))
    with pytest.raises(InputError, match='not XML: unknown encoding: uft-8'):
        imported(saved(tmp_path, name, text))


def _is_text(line: str) -> bool:
    return not line.startswith('#')


@pytest.mark.parametrize('name', ['it.urdf', 'it.sdf'])
def test_comments_and_declarations_that_are_no_xml_are_read(name: str, tmp_path: Path) -> None:
    """As the parser of Gazebo and ROS reads them. Mistakes keep their lines."""
    text = robots.SDF if name == 'it.sdf' else URDF.replace('MORE', '')
    plain = imported(saved(tmp_path, name, text))
    odd = '\n <!-- a -- b:c -->\n<?xml version="1.0"?>\n<!-- gz topic --\n -- -->\n' + text
    odd = odd.replace('</link>', '<gz::priority>1</gz::priority><a::b::c/></link>', 1)
    found = imported(saved(tmp_path, name, odd))
    assert [*filter(_is_text, found.split('\n'))] == [*filter(_is_text, plain.split('\n'))]
    lines = []
    for source in (text, odd):
        with pytest.raises(InputError, match='zero is no direction') as caught:
            imported(saved(tmp_path, name, source.replace('0 1 0', '0 0 0')))
        lines.append(int(str(caught.value).split(':')[1]))
    assert lines[1] == lines[0] + 5


def test_a_urdf_without_required_zeros_and_with_a_namespace(tmp_path: Path) -> None:
    """Many files have no products of inertia, and limits without effort and velocity."""
    limited = URDF.replace('MORE', '').replace(
        '<axis xyz="0 1 0"/>',
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/>',
    )
    plain = imported(saved(tmp_path, 'it.urdf', limited))
    odd = limited.replace('<robot ', '<robot xmlns="http://drake.mit.edu" ')
    for zero in (' ixy="0"', ' ixz="0"', ' iyz="0"', ' effort="0"', ' velocity="0"'):
        assert zero in odd
        odd = odd.replace(zero, '')
    found = imported(saved(tmp_path, 'it.urdf', odd))
    assert [*filter(_is_text, found.split('\n'))] == [*filter(_is_text, plain.split('\n'))]
    for told in ('there is none: they count as 0: ixy of a, ixz of a, iyz of a', 'p has none'):
        assert told in found and told not in plain


@pytest.mark.parametrize('kind', ['ball', 'spherical', 'universal'])
def test_joints_that_drake_and_bullet_read(kind: str, tmp_path: Path) -> None:
    """The weight of a body on a universal joint about x and y cannot turn it about z."""
    text = URDF.replace('MORE', '').replace('continuous', kind)
    text = text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><dynamics damping="1"/>')
    found = imported(saved(tmp_path, 'it.urdf', text), scene=True)
    of_drake = text.replace('<joint name="p"', '<drake:joint name="p"')
    of_drake = of_drake.replace('</joint>', '</drake:joint>', 1)
    assert found == imported(saved(tmp_path, 'it.urdf', of_drake), scene=True)
    assert ('p: {type: spherical, between: [ground, a]' in found) == (kind != 'universal')
    listed = 'springs, armature: these joints have none: p' in found
    assert listed == (kind == 'spherical')  # of Bullet, which has no damping there
    assert ('drag: {p: {"on": a, spin: 1.0}}' in found) == (kind == 'ball')
    simulation = Simulation(scene_from_text(found))
    assert simulation.model.n - simulation.model.system.rank == (2 if kind == 'universal' else 3)


def test_a_fixed_link_that_isaac_keeps_moves_nothing(tmp_path: Path) -> None:
    text = URDF.replace('MORE', '').replace('type="fixed"', 'type="fixed" dont_collapse="true"')
    assert 'unknown attributes' not in imported(saved(tmp_path, 'it.urdf', text), scene=True)


PARAM = '<param name="initial_value">{}</param>'
CONTROL = f"""<ros2_control><joint name="p"><state_interface name="position">
{PARAM}</state_interface></joint></ros2_control>"""


@pytest.mark.parametrize('x', ['nan', '1e300', '0,3'])
def test_a_position_of_ros2_control_is_a_number(x: str, tmp_path: Path) -> None:
    """Others ended in tracebacks of numpy."""
    path = saved(tmp_path, 'it.urdf', URDF.replace('MORE', CONTROL.format(x)))
    with pytest.raises(InputError, match=f"it.urdf:9: p: not usable numbers, got '{x}'"):
        imported(path)


@pytest.mark.parametrize(
    ('x', 'told'),
    [
        ('nan', '2: key k: qpos: not a finite number'),
        ('1e300', '2: key k: qpos: not a usable number'),
    ],
)
def test_a_position_can_be_computed_with(x: str, told: str, tmp_path: Path) -> None:
    """Others ended in tracebacks of numpy."""
    path = saved(tmp_path, 'it.urdf', URDF.replace('MORE', ''))
    with pytest.raises(InputError, match="--set: not a usable number for 'p', got "):
        imported(path, positions={'p': float(x)})
    source = f"""<mujoco><worldbody><body><joint name="p" type="slide"/><geom size="1"/></body>
    </worldbody><keyframe><key name="k" qpos="{x}"/></keyframe></mujoco>"""
    with pytest.raises(InputError, match=f'it.xml:{told}'):
        imported(saved(tmp_path, 'it.xml', source), key='k')


TWO_LINKS = """<robot name="r"><link name="base"/>
<link name="a">
 <inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<link name="b">
 <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="2" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<joint name="p" type="continuous"><parent link="base"/><child link="a"/>
 <dynamics damping="1" friction="2"/></joint>
<joint name="q" type="fixed"><parent link="a"/><child link="b"/></joint>
<transmission name="t"><joint name="p"/></transmission></robot>"""
THE_SAME = """<sdf version="1.9"><model name="r">
<link name="a"><inertial><mass>3</mass></inertial></link>
<link name="b">
 <inertial><mass>2</mass><inertia><izz>2</izz></inertia></inertial>
</link>
<joint name="p" type="revolute"><parent>world</parent><child>a</child><axis><dynamics>
 <damping>1</damping><friction>2</friction><spring_stiffness>3</spring_stiffness>
</dynamics></axis></joint>
<joint name="q" type="fixed"><parent>a</parent><child>b</child></joint></model></sdf>"""


@pytest.mark.parametrize(
    ('name', 'source', 'old', 'new', 'line', 'message'),
    [
        ('it.urdf', TWO_LINKS, '"2"/><inertia', '"-5"/><inertia', 6, 'b: negative mass, got -5'),
        ('it.urdf', TWO_LINKS, 'izz="2"', 'izz="9"', 6, 'b: no body has such an inertia: each'),
        ('it.urdf', TWO_LINKS, 'damping="', 'damping="-', 8, 'p: negative damping, got -1.0'),
        ('it.urdf', TWO_LINKS, 'friction="', 'friction="-', 8, 'p: negative friction, got -2.0'),
        ('it.urdf', TWO_LINKS, '<dynamics', '<limit effort="-4" velocity="1"/><dynamics', 9,
         "p: negative effort, got -4.0; expected 0 or more"),
        ('it.sdf', THE_SAME, '<mass>2', '<mass>-5', 4, 'b: negative mass, got -5.0'),
        ('it.sdf', THE_SAME, '<izz>2', '<izz>9', 4, 'b: no body has such an inertia: each'),
        ('it.sdf', THE_SAME, '<damping>', '<damping>-', 6, 'p: negative damping, got -1.0'),
        ('it.sdf', THE_SAME, '<friction>', '<friction>-', 6, 'p: negative friction, got -2.0'),
        ('it.sdf', THE_SAME, 'ness>3', 'ness>-3', 6, 'p: negative stiffness, got -3.0'),
    ],
)  # fmt: skip
def test_an_impossible_number_has_its_line(
    name: str, source: str, old: str, new: str, line: int, message: str, tmp_path: Path
) -> None:
    """Also of a link that is fixed to a heavier one, which has the name of both."""
    imported(path := saved(tmp_path, name, source), scene=True)
    saved(tmp_path, name, source.replace(old, new))
    with pytest.raises(InputError) as caught:
        imported(path, scene=True)
    assert str(caught.value).startswith(f'{path}:{line}: {message}')


def test_rounding_is_no_position_of_a_joint(tmp_path: Path) -> None:
    """An export has 2e-16 rad for zero."""
    path = saved(tmp_path, 'it.urdf', robots.double_pendulum())
    assert 'zero of joints' not in imported(path, positions={'elbow': 2e-16})
    assert 'zero of joints' in imported(path, positions={'elbow': 2e-9})
