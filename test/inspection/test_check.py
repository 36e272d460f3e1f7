"""`python -m alf_ros check`: its verdicts on sound and unsound mechanisms, and its pictures."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from alf_ros import Simulation, load_scene
from alf_ros import __main__ as program
from alf_ros.inspection import mechanism_plot
from alf_ros.inspection.answer import BAD, NOTE, OK
from alf_ros.inspection.soundness import Soundness, examine, table
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.resources import folder
from alf_ros.scene.library import load
from alf_ros.scene.scene import scene_from_text
from support.some_scenes import SOME_SCENES
from support.thorough import thinned


def answers(found: Soundness) -> dict[str, tuple[str, str]]:
    return {each.question: (each.verdict, each.answer) for each in found.answers}


@cache
def examined(name: str) -> Soundness:
    """A scene of the library, examined once for all tests here."""
    return examine(load_scene(name))


@pytest.mark.parametrize('name', SOME_SCENES)
def test_the_library_is_sound(name: str) -> None:
    found = examined(name)
    assert found.sound, table(found, name)


def four_bar(lengths: tuple[float, float, float], mass: float = 1.0, more: str = '') -> str:
    a, b, c = lengths
    return f"""
mechanism:
  alf: 1
  points:
    O: {{at: [0, 0], fixed: true}}
    C: {{at: [4, 0], fixed: true}}
    A: {{at: [0, 1]}}
    B: {{at: [3, 2]}}
    {more.partition('|')[0]}
  bodies:
    crank: {{points: [O, A], length: {a}, mass: {mass}, inertia: rod}}
    coupler: {{points: [A, B], length: {b}, mass: 1, inertia: rod}}
    rocker: {{points: [C, B], length: {c}, mass: 1, inertia: rod}}
    {more.partition('|')[2].partition('|')[0]}
  joints:
    pin: {{type: revolute, between: [ground, crank], at: O}}
    knee: {{type: revolute, between: [crank, coupler], at: A}}
    wrist: {{type: revolute, between: [coupler, rocker], at: B}}
    foot: {{type: revolute, between: [ground, rocker], at: C}}
    {more.rpartition('|')[2]}
"""


def test_how_far_each_point_moved() -> None:
    found = examine(scene_from_text(four_bar((1.0, 3.0, 2.5))))
    verdict, text = answers(found)['loops']
    places = found.q.reshape(-1, 2)
    moved = {
        name: float(np.linalg.norm(places[found.model.layout.of_point[name]] - at))
        for name, at in (('A', (0.0, 1.0)), ('B', (3.0, 2.0)))
    }
    assert verdict == NOTE
    for name, distance in moved.items():
        assert f'{name} {distance:.3g} m' in text
    assert 'closed as drawn' in answers(examine(load_scene('slider_crank')))['loops'][1]


def test_loops_that_cannot_be_closed() -> None:
    found = examine(scene_from_text(four_bar((1.0, 1.0, 1.0))))
    verdict, text = answers(found)['loops']
    assert verdict == BAD and 'cannot be closed' in text and '_length is off by' in text
    assert not found.sound


def test_a_structure_cannot_move() -> None:
    tie = 'T: {at: [2, 3]}|tie: {points: [T, A], mass: 1, inertia: rod}\n    ' + (
        'tie2: {points: [T, B], mass: 1, inertia: rod}\n    '
        'stay: {points: [T, C], mass: 1, inertia: rod}'
    )
    joints = (
        'a: {type: revolute, between: [crank, tie], at: A}\n    '
        'b: {type: revolute, between: [rocker, tie2], at: B}\n    '
        'c: {type: revolute, between: [ground, stay], at: C}\n    '
        't: {type: revolute, between: [tie, tie2], at: T}\n    '
        's: {type: revolute, between: [tie, stay], at: T}'
    )
    drawn = 1.0, 10.0**0.5, 5.0**0.5
    found = examine(scene_from_text(four_bar(drawn, more=f'{tie}|{joints}')))
    assert answers(found)['mobility'] == (BAD, 'none: it is a structure and cannot move')


def test_drives_take_freedoms() -> None:
    bars = four_bar((1.0, 3.0, 2.0))
    assert 'drives' not in answers(examine(scene_from_text(bars)))
    one = bars + '  drives:\n    one: {joint: pin, angle: pi/2 + t}\n'
    assert answers(examine(scene_from_text(one)))['drives'] == (
        OK,
        '1 motion for 1 freedom; none left free',
    )
    start = Simulation(scene_from_text(one)).sample().joints['foot'].position
    two = one + f'    two: {{joint: foot, angle: {start} + t}}\n'
    assert answers(examine(scene_from_text(two)))['drives'] == (
        BAD,
        '2 motions for 1 freedom: they take 1 only, and jam elsewhere',
    )
    far = bars + '  drives:\n    one: {joint: pin, angle: -pi/2}\n'
    verdict, text = answers(examine(scene_from_text(far)))['drives']
    assert verdict == BAD and 'cannot be closed' in text or 'more than a right angle' in text


def test_a_free_direction_without_mass() -> None:
    """A bar without mass that hangs from the coupler may swing in no time."""
    joint = 'h: {type: revolute, between: [coupler, bar], at: B}'
    more = f'H: {{at: [3, 0]}}|bar: {{points: [B, H], mass: 0}}|{joint}'
    found = examine(scene_from_text(four_bar((1.0, 3.0, 2.5), more=more)))
    verdict, text = answers(found)['mass']
    assert verdict == BAD
    assert '1 free direction:' in text and text.endswith('the bodies that carry H')


def test_a_slender_rod_may_turn_about_itself_without_inertia() -> None:
    """A universal joint holds it, so that it has an orientation; its end is free."""
    found = examine(
        scene_from_text("""
mechanism:
  alf: 1
  space: spatial
  points: {A: {at: [0, 0, 0], fixed: true}, B: {at: [1, 0, 0]}, C: {at: [2, 1, 0]}}
  bodies:
    arm: {points: [A, B], mass: 1, inertia: rod}
    hand: {points: [B, C], mass: 1, inertia: rod}
  joints:
    shoulder: {type: revolute, between: [ground, arm], at: A, axis: [0, 0, 1]}
    elbow: {type: universal, between: [arm, hand], at: B, axes: [[0, 0, 1], [1, 1, 0]]}
""")
    )
    mass = 'none in 1 free direction: hand may turn without inertia'
    assert answers(found)['mass'] == (BAD, mass)


def test_a_body_alone_is_sound() -> None:
    point = (
        '{alf: 1, points: {A: {at: [0, 0]}}, bodies: {a: {points: [A], mass: 1, inertia: point}}}'
    )
    found = examine(scene_from_text(f'mechanism: {point}'))
    assert found.sound and answers(found)['mobility'][1] == '2 freedoms'


def test_mass_may_be_missing_where_nothing_is_free() -> None:
    assert answers(examine(scene_from_text(four_bar((1.0, 3.0, 2.5), 0.0))))['mass'][0] == OK


def test_a_singular_start() -> None:
    text = load_scene('slider_crank').text
    text = text.replace('L*cos(pi/4), L*sin(pi/4)', '0, L').replace('2*L*cos(pi/4)', '0')
    found = examine(scene_from_text(text.replace('B: [-4.0, 0]', 'B: [0, 0]')))
    assert found.sound and answers(found)['initial position'][0] == NOTE
    assert '1 freedom more' in answers(found)['initial position'][1]
    assert answers(found)['redundant rows'] == (OK, 'none')  # those of ordinary positions


@pytest.mark.parametrize(
    'name, where',
    [
        ('slider_crank', {'A': [[0, 1], [0, -1]], 'B': [[0, 0]]}),
        ('double_four_bar', {'B0': [[1, 0], [-1, 0]], 'B2': [[3, 0], [1, 0]]}),
        ('change_point', {'A': [[-1, 0]], 'B': [[1, 0]]}),
        ('n_four_bar', {'B0': [[1, 0], [-1, 0]]}),
    ],
)
def test_every_singular_position_is_found(name: str, where: dict[str, list[list[float]]]) -> None:
    found = examine(load_scene(name))
    assert found.walk.whole
    for point, expected in where.items():
        block = found.model.layout.of_point[point]
        places = {tuple(np.round(q.reshape(-1, 2)[block], 4) + 0.0) for q in found.walk.singular}
        assert places == {tuple(map(float, place)) for place in expected}
    for q in found.walk.singular:
        at = Linearised(found.model, q)
        assert np.abs(at.phi).max() < 1e-9
        assert at.singular_values[at.model.n - 2] < 1e-5


def test_no_singular_position_where_there_is_none() -> None:
    for name in ('four_bar', 'jansen_leg', 'spatial_slider_crank', 'bricard'):
        found = examined(name)
        assert found.walk.whole and not found.walk.singular, name


@pytest.mark.parametrize('off', [1e-4, -1e-6, 1e-9, -1e-10])
def test_the_walk_stays_on_its_curve_where_another_one_is_near(off: float) -> None:
    """The sense in which coupler and rocker follow each other: a crank that turns all the way
    round keeps it, and one that turns back just before it would lie flat changes it."""
    found = examine(scene_from_text(four_bar((1.0, 3.0, 2.0 + off))))
    assert found.walk.whole and not found.walk.singular
    places = np.array(found.walk.positions).reshape(len(found.walk.positions), -1, 2)
    of = found.model.layout.of_point
    A, B = places[:, of['A']], places[:, of['B']]
    coupler, rocker = B - A, B - np.array([4.0, 0.0])
    senses = coupler[:, 0] * rocker[:, 1] - coupler[:, 1] * rocker[:, 0]
    changes = bool((senses > 1e-9).any() and (senses < -1e-9).any())
    assert changes == (off < 0.0)


def test_freedoms_of_velocity_and_of_position() -> None:
    mobility = {
        name: answers(examined(name))['mobility'][1]
        for name in (
            'rolling_disk',
            'chaplygin_sleigh',
            'double_pendulum',
            'bricard',
            'rack_and_pinion',
            'planetary_gear',
            'screw_jack',
        )
    }
    assert mobility == {
        'rolling_disk': '2 freedoms of velocity, 4 of position',
        'chaplygin_sleigh': '2 freedoms of velocity, 3 of position',
        'double_pendulum': '2 freedoms',
        'bricard': '1 freedom',
        'rack_and_pinion': '1 freedom',  # its row can be integrated
        'planetary_gear': '1 freedom',
        'screw_jack': '1 freedom',
    }


def test_redundancy_by_name() -> None:
    cart = answers(examined('differential_drive_cart'))
    assert cart['redundant rows'][1].startswith('1, among the rows of ')
    assert {'left', 'right'} <= set(cart['redundant rows'][1].replace(',', '').split())
    assert cart['reactions'][1].endswith('bodies: left (force y), right (force y)')
    wishbone = answers(examined('double_wishbone'))
    assert wishbone['redundant rows'] == (NOTE, '2, among the rows of lower, upper')


# ------------------------------------------------------------------------------------ the command


def check(*argv: str) -> int:
    return program.main(['check', *argv])


def test_a_sound_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check('four_bar', '--folder', str(tmp_path)) == 0
    out = capsys.readouterr().out
    assert out.startswith('four_bar: is this mechanism sound?\n') and '\nsound\n' in out
    assert max(map(len, out.splitlines()[:-1])) <= 100


def test_an_unsound_one_is_drawn_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'short.yaml').write_text(four_bar((1.0, 1.0, 1.0)))
    assert check(str(tmp_path / 'short.yaml'), '--folder', str(tmp_path)) == 1
    assert 'NOT SOUND' in capsys.readouterr().out
    assert (tmp_path / 'short.png').stat().st_size > 5000


@pytest.mark.parametrize(
    'argv, said',
    [
        (['slidercrank'], "did you mean 'slider_crank'?"),
        (['nowhere.yaml'], 'nowhere.yaml'),
        (['n_four_bar', '--set', 'M=3'], 'no such parameter'),
        (['n_four_bar', '--set', 'N=three'], 'NAME=NUMBER'),
        (['n_four_bar', '--sett', 'N=3'], '--help'),
        ([], '--help'),
    ],
)
def test_what_cannot_be_read_is_one_line(
    argv: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check(*argv) == 2
    err = capsys.readouterr().err
    assert err.count('\n') == 1 and said in err


def test_a_mechanism_alone_and_parameters() -> None:
    path = folder('mechanisms')[0] / 'n_four_bar.yaml'
    scene = load(str(path), {'N': 3.0})
    assert (scene.name, scene.effects, len(scene.mechanism.bodies)) == ('n_four_bar', (), 7)
    assert load('n_four_bar', {}).effects  # of a name that both have, the scene


@pytest.mark.parametrize(
    'name',
    thinned(
        [
            'slider_crank',
            'scissor_lift',
            'rolling_disk',
            'governor',
            'planetary_gear',
            'rack_and_pinion',
            'screw_jack',
        ],
        keep=['slider_crank', 'rolling_disk', 'rack_and_pinion'],
    ),
)
def test_the_picture_shows_the_mechanism(name: str, tmp_path: Path) -> None:
    """Every symbol draws, and the colours of the bodies are there."""
    assert check(name, '--folder', str(tmp_path)) == 0
    picture = imread(tmp_path / f'{name}.png')[:, :, :3]
    assert picture.shape[0] > 150 and picture.shape[1] > 400
    blue = np.array([0x00, 0x72, 0xB2]) / 255.0
    shades = np.abs(picture - blue).max(axis=2)
    assert (shades < 0.3).sum() > 20
    assert 0.002 < (picture.min(axis=2) < 0.9).mean() < 0.5  # neither empty nor full


@pytest.mark.thorough
def test_without_matplotlib_it_answers_all_the_same(tmp_path: Path) -> None:
    code = (
        'import sys; sys.modules["matplotlib"] = None\n'
        'from alf_ros.__main__ import main\n'
        f'sys.exit(main(["check", "pendulum", "--folder", {str(tmp_path)!r}]))'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert 'no picture' in done.stderr and '\nsound\n' in done.stdout


def test_wheels_that_depend_on_each_other_are_closed_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A gap that rolling rows would hold is closed with slip, in a few decompositions."""
    simulation = Simulation(load_scene('wheeled_robot'))
    here = Linearised(simulation.model, simulation.state.q)
    assert here.rank < here.phi.size
    counted: list[Any] = []
    svd = np.linalg.svd

    def counting(matrix: Any) -> Any:
        counted.append(matrix)
        return svd(matrix)

    monkeypatch.setattr(np.linalg, 'svd', counting)
    for direction in here.free.T:
        counted.clear()
        there = here.closed(0.05 * simulation.model.size * direction, here.rank)
        assert there is not None and np.abs(there.phi).max() < 1e-12 * simulation.model.size
        assert len(counted) < 6


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('com', [0.1, 0.0])
def test_a_pendulum_of_one_place_is_drawn(com: float, tmp_path: Path) -> None:
    """An imported pendulum has no point but its joint."""
    found = examine(
        scene_from_text(f"""
mechanism:
  alf: 1
  space: spatial
  points: {{O: {{at: [0, 0, 0], fixed: true}}}}
  bodies:
    bob: {{points: [O], mass: 1, com: [{com}, 0, 0], inertia: {{about_com: [0.01, 0.01, 0.01]}}}}
  joints:
    pin: {{type: revolute, between: [ground, bob], at: O, axis: [0, 1, 0]}}
effects: {{gravity: {{acceleration: [0, 0, -9.81]}}}}
""")
    )
    assert found.sound
    mechanism_plot.draw(tmp_path / 'it.png', found)
    picture = imread(tmp_path / 'it.png')[:, :, :3]
    assert (picture < 0.9).any(axis=2).mean() > 0.005


CORD = """
from dataclasses import dataclass, field

from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, push, scalar

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={{'kind': 'coordinate', 'doc': 'its joint'}})


def pack(effects, layout):
    measures = Measures(layout)
    for effect in effects:
        measures.add_coordinate(effect.parameters.joint)
    return measures.packed()


@contract.force
def force(t, q, qd, near, slots, params, Q):
    x, v = scalar(q, qd, near, slots, params, 0)
    push(q, slots, params, 0, -30.0 * x - 0.1 * v, Q)


@contract.potential
def potential(t, q, near, slots, params):
    x, _ = scalar(q, q, near, slots, params, 0)
    return {} * x * x
"""


@pytest.mark.parametrize(('half', 'off'), [(15.0, ''), (30.0, 'by 50 %'), (-15.0, 'by 200 %')])
def test_a_potential_belongs_to_its_force(half: float, off: str, tmp_path: Path) -> None:
    file = tmp_path / 'cord.py'
    file.write_text(CORD.format(half), 'utf-8')
    effects = {str(file): {'cord': {'joint': 'crank_pin'}}}
    scene = load_scene({'name': 'corded', 'mechanism': 'slider_crank', 'effects': effects})
    said = [each.answer for each in examine(scene).answers if each.question == 'energy']
    assert len(said) == bool(off)
    assert all(each.endswith(f'cord {off}') for each in said)
