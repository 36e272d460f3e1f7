"""Branches of singular positions by name: in `check`, `branches`, scenes and `place`.

Directions are compared with exact ones.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import AssemblyError, Branches, InputError, Simulation, branches, load_scene
from alf_ros import __main__ as program
from alf_ros.inspection.answer import NOTE
from alf_ros.inspection.branches_report import reported
from alf_ros.inspection.soundness import examine
from alf_ros.model import ordinary_positions, singular_branches
from alf_ros.model.singular_location import located
from alf_ros.scene.scene import Scene
from alf_ros.studies.exact import one_freedom
from support.singular_starts import FLAT, GRAVITY, IN_LINE, answers, change_point, scene, slope

SHAKY = {  # a point between two collinear bars
    'alf': 1,
    'points': {
        'O': {'at': [-1, 0], 'fixed': True},
        'C': {'at': [1, 0], 'fixed': True},
        'A': {'at': [0, 0]},
    },
    'bodies': {
        'left': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'right': {'points': ['A', 'C'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'o': {'type': 'revolute', 'between': ['ground', 'left'], 'at': 'O'},
        'a': {'type': 'revolute', 'between': ['left', 'right'], 'at': 'A'},
        'c': {'type': 'revolute', 'between': ['ground', 'right'], 'at': 'C'},
    },
}
# Watt's linkage: M leaves the line x = 0 with the third power of y; here it is also guided there.
WATT = {
    'alf': 1,
    'points': {
        'O': {'at': [-2, 0.5], 'fixed': True},
        'C': {'at': [2, -0.5], 'fixed': True},
        'A': {'at': [0, 0.5]},
        'B': {'at': [0, -0.5]},
        'M': {'at': [0, 0]},
    },
    'bodies': {
        'left': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'right': {'points': ['C', 'B'], 'mass': 1, 'inertia': 'rod'},
        'coupler': {'points': ['A', 'B', 'M'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'o': {'type': 'revolute', 'between': ['ground', 'left'], 'at': 'O'},
        'c': {'type': 'revolute', 'between': ['ground', 'right'], 'at': 'C'},
        'a': {'type': 'revolute', 'between': ['left', 'coupler'], 'at': 'A'},
        'b': {'type': 'revolute', 'between': ['right', 'coupler'], 'at': 'B'},
        'm': {'type': 'slider', 'point': 'M', 'on': {'through': [0, 0], 'direction': [0, 1]}},
    },
}


def upright(**initial: Any) -> Scene:
    at = {'positions': {'A': [0, 1], 'B': [0, 0]}} | initial
    return load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY, 'initial': at})


def ratio(found: Branches, name: str, of: str, to: str, axis: int) -> float:
    (direction,) = found[name].directions
    return float(direction[of][axis] / direction[to][axis])


# -------------------------------------------------------------------------------- exact directions


def test_the_slider_crank_has_the_branches_b_0_and_b_2a() -> None:
    found = branches(upright())
    assert (found.kind, found.gained) == ('crossing', 1)
    assert [branch.name for branch in found.branches] == ['1', '2']
    assert ratio(found, '1', 'B', 'A', 0) == pytest.approx(2.0, abs=1e-12)
    assert ratio(found, '2', 'B', 'A', 0) == pytest.approx(0.0, abs=1e-12)
    for branch in found.branches:
        (direction,) = branch.directions
        assert direction['A'][0] > 0.0 and abs(direction['A'][1]) < 1e-12  # as printed
    # rows of length 1: (y_A), (y_A - y_B) / √2, (y_B) in this position
    (n,) = found.null_vectors
    assert n['coupler_length'] == 1.0 and not found.redundant
    assert abs(n['crank_length']) == pytest.approx(math.sqrt(0.5), abs=1e-12)
    assert n['guide'] == pytest.approx(-n['crank_length'], abs=1e-12)
    assert found.text == 'crossing, 2 branches: A: [1, 0] with 1) B: [2, 0], or 2) B: [0, 0]'
    assert repr(found) == f'<Branches: {found.text}>'


def test_the_general_change_point() -> None:
    found = branches(scene('change_point', IN_LINE))
    assert found.kind == 'crossing' and len(found.branches) == 2
    wanted = []
    for sign in (1.0, -1.0):
        _, d = slope(change_point(sign), math.pi)
        wanted.append(d[3] / d[1])
    for name, exact in zip('12', sorted(wanted, key=lambda r: -abs(r)), strict=True):
        assert ratio(found, name, 'B', 'A', 1) == pytest.approx(exact, abs=1e-9)


def test_two_four_bars_that_lie_flat() -> None:
    found = branches(scene('double_four_bar', FLAT))
    assert found.gained == 2 and len(found.null_vectors) == 2
    rates = [
        [branch.directions[0][f'B{k}'][1] / branch.directions[0]['B2'][1] for k in range(3)]
        for branch in found.branches
    ]
    assert np.array(rates) == pytest.approx(np.array([[1, 1, 1], [0, 1, 1], [0, 0, 1]]), abs=1e-10)


def test_the_present_of_a_run_counts() -> None:
    simulation = Simulation(load_scene('slider_crank'))
    with pytest.raises(InputError, match=r'not in a singular position: its distance σ is 0\.\d+$'):
        branches(simulation)
    simulation.place('crank', [0, 0, math.pi / 2], branch=1)
    assert ratio(branches(simulation), '1', 'B', 'A', 0) == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize('off', [0.0, 1e-9, -1e-9])
def test_numbers_do_not_depend_on_the_last_digits(off: float) -> None:
    at = {'positions': {f'B{k}': [k + 1, off * (k + 1)] for k in range(3)}}
    found = branches(load_scene({'mechanism': 'double_four_bar', 'initial': at}))
    still = [[abs(b.directions[0][f'B{k}'][1]) < 1e-3 for k in range(3)] for b in found.branches]
    assert still == [[False, False, False], [True, False, False], [True, True, False]]


# ------------------------------------------------------------------------------------- other kinds


def test_infinitesimal_mobility() -> None:
    found = branches(load_scene({'mechanism': SHAKY}))
    assert found.kind == 'infinitesimal mobility only' and not found.branches
    assert 'A may yield, but no motion begins' in found.text


def test_a_higher_order_is_said_as_such() -> None:
    found = branches(load_scene({'mechanism': WATT}))
    assert found.kind == 'higher order'
    assert 'to second order nothing rules out any of 1 freedom' in found.text


def test_permanent_redundancy() -> None:
    with pytest.raises(InputError) as error:
        branches(load_scene('double_wishbone'))
    said = str(error.value)
    assert said.endswith(
        '2 rows depend on others everywhere, among them lower_length, upper_length'
    )
    # at a crossing it is told apart
    found = examine(load_scene('scissor_lift')).singular[0]
    assert (found.gained, len(found.null_vectors), len(found.redundant)) == (2, 2, 18)


def test_more_freedoms_for_good() -> None:
    """Where the rhombus of Peaucellier's linkage is folded, D turns freely about B."""
    parameters = load_scene('peaucellier').mechanism
    at = {point.name: np.array(point.at) for point in parameters.points}
    arm, side = np.linalg.norm(at['B'] - at['O']), np.linalg.norm(at['B'] - at['A'])
    A = at['P'] + np.array([0.0, -np.linalg.norm(at['A'] - at['P'])])
    f = np.linalg.norm(A)
    x = (f * f + arm * arm - side * side) / (2 * f)
    B = (x * A + math.sqrt(arm * arm - x * x) * np.array([-A[1], A[0]])) / f
    D = B + side * np.array([math.cos(0.4), math.sin(0.4)])
    folded = {'A': A.tolist(), 'B': B.tolist(), 'C': B.tolist(), 'D': D.tolist()}
    scene = load_scene({'mechanism': 'peaucellier', 'initial': {'positions': folded}})
    simulation = Simulation(scene)
    found = reported(singular_branches.position(simulation.model, simulation.state.q), 0)
    assert found.kind == 'more freedoms' and '2 freedoms in place of 1' in found.text
    # on this motion one row is redundant, and no position nearby is another
    with pytest.raises(InputError, match='1 row depends on others everywhere, among them arm_b'):
        branches(scene)


def test_where_a_motion_with_more_freedoms_begins() -> None:
    """The crank turns 120 degrees each way: there both parts of the rhombus lie on the arms."""
    found = examine(load_scene('peaucellier')).singular
    ends = [each for each in found if 'a branch of 2 freedoms' in each.text]
    angles = [math.atan2(e.points['A'][1], e.points['A'][0] - 0.15) for e in ends]
    assert ends and np.abs(angles) == pytest.approx(2.0 * math.pi / 3.0, abs=1e-9)


def test_no_such_branch() -> None:
    with pytest.raises(InputError, match="no such branch, got '3'"):
        branches(upright())['3']
    with pytest.raises(InputError, match='not in a singular position'):
        branches('slider_crank')
    with pytest.raises(InputError, match='not a scene'):
        branches(5)  # type: ignore[arg-type]


# -------------------------------------------------------------------------------------- in `check`


def test_check_names_what_it_finds() -> None:
    found = {each.question: each for each in examine(load_scene('slider_crank')).answers}
    assert found['singular positions'].answer.startswith('2 found (')
    kind = found['  2 of them']
    assert kind.verdict == NOTE
    assert kind.answer == (
        'crossing, 2 branches: A: [1, 0] with 1) B: [2, 0], or 2) B: [0, 0]; '
        'first at A [0, 1], B [0, 0]'
    )
    text = answers(load_scene('change_point'))['  1 of them'][1]
    assert 'A: [0, 1] with 1) B: [0, 1.58], or 2) B: [0, -0.3798]; at A [-1, 0], B [1, 0]' in text


def test_check_finds_all_positions_from_one_of_them() -> None:
    """A parallelogram drawn flat, of bars 0.5 and 1 m: it is flat again half a turn later."""
    points: dict[str, Any] = {
        'O': {'at': [0, 0], 'fixed': True},
        'C': {'at': [1, 0], 'fixed': True},
        'A': {'at': [0.5, 0]},
        'B': {'at': [1.5, 0]},
    }
    bodies = {
        name: {'points': list(ends), 'mass': 1, 'inertia': 'rod'}
        for name, ends in (('crank', 'OA'), ('coupler', 'AB'), ('rocker', 'CB'))
    }
    joints = {
        'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
        'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
        'wrist': {'type': 'revolute', 'between': ['coupler', 'rocker'], 'at': 'B'},
        'hip': {'type': 'revolute', 'between': ['ground', 'rocker'], 'at': 'C'},
    }
    flat: dict[str, Any] = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    found = {each.question: each for each in examine(load_scene({'mechanism': flat})).answers}
    assert found['initial position'].answer.startswith('singular: 1 freedom more')
    assert found['singular positions'].answer.startswith('2 found (')
    flat['drives'] = {'motor': {'joint': 'pin', 'angle': '0.1 + t'}}
    found = {each.question: each for each in examine(load_scene({'mechanism': flat})).answers}
    assert found['drives'].verdict == NOTE
    assert 'does not tell which branch is meant' in found['drives'].answer


def test_positions_found_are_exact() -> None:
    for name, point, places in (
        ('slider_crank', 'A', [[0, 1], [0, -1]]),
        ('change_point', 'A', [[-1, 0]]),
        ('double_four_bar', 'B2', [[3, 0], [1, 0]]),
    ):
        found = [each.points[point] for each in examine(load_scene(name)).singular]
        order = np.argsort([-each.sum() for each in found])
        assert np.array(found)[order] == pytest.approx(np.array(places), abs=1e-12)


def test_a_position_beside_a_singular_one_is_moved_into_it() -> None:
    scene = load_scene('slider_crank')
    at = {'positions': {'A': [1e-4, math.sqrt(1 - 1e-8)]}}
    simulation = Simulation(load_scene({'mechanism': 'slider_crank', 'initial': at}))
    model = simulation.model
    q = located(model, simulation.state.q).reshape(-1, 2)
    assert q[model.layout.of_point['A']] == pytest.approx([0, 1], abs=1e-12)
    far = Simulation(scene)
    ordinary = far.state.q
    assert np.array_equal(located(far.model, ordinary), ordinary)
    assert not ordinary_positions.within(far.model, ordinary, 0)


def test_json_of_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'found.json'
    argv = ['check', 'slider_crank', '--folder', str(tmp_path), '--json', str(path)]
    assert program.main(argv) == 0
    capsys.readouterr()
    data = json.loads(path.read_text())
    assert data['sound'] and data['freedoms'] == 1 and data['all_the_way_round']
    first = data['singular_positions'][0]
    assert first['kind'] == 'crossing' and first['points']['A'] == pytest.approx([0, 1])
    assert [branch['name'] for branch in first['branches']] == ['1', '2']


# ---------------------------------------------------------------------------------- asking for one


@pytest.mark.parametrize('branch, b', [(1, 2.0), (2, 0.0)])
def test_a_scene_asks_for_a_branch(branch: int, b: float) -> None:
    simulation = Simulation(upright(velocities={'A': [1, 0]}, branch=branch))
    assert simulation.sample().velocities['B'] == pytest.approx([b, 0], abs=1e-12)
    assert simulation.scene.branch == branch


def test_what_a_scene_cannot_ask_for() -> None:
    said: dict[str, dict[str, Any]] = {
        'branch 2 is a direction, not a speed: give the velocity of something': {'branch': 2},
        'no branch 3: the position has 2': {'branch': 3, 'velocities': {'A': [1, 0]}},
        'do not fit branch 2, A: [1, 0] m/s': {'branch': 2, 'velocities': {'B': [1, 0]}},
    }
    for words, initial in said.items():
        with pytest.raises(AssemblyError, match='initial.branch') as error:
            Simulation(upright(**initial))
        assert words in str(error.value) and '\n' not in str(error.value)
    away = {'branch': 1, 'velocities': {'B': [1, 0]}}
    with pytest.raises(AssemblyError, match='initial.branch: not in a singular position'):
        Simulation(load_scene({'mechanism': 'slider_crank', 'initial': away}))
    with pytest.raises(InputError, match='1 or more'):
        upright(branch=0)
    with pytest.raises(InputError, match='not a whole number'):
        upright(branch=1.5)


FOLDED = one_freedom.OneFreedom(  # both rods turn as one about the pin
    lambda theta, rate: -1.5 * one_freedom.GRAVITY * math.cos(theta),
    lambda theta: np.array([np.cos(theta), np.sin(theta), 0.0, 0.0]),
    lambda theta: np.array([-np.sin(theta), np.cos(theta), 0.0, 0.0]),
    lambda theta: (2.0 / 3.0, 0.0),
)


@pytest.mark.parametrize(
    'branch, alone', [(1, one_freedom.slider_crank()), (2, FOLDED)], ids=['both', 'folded']
)
def test_a_body_is_placed_on_a_branch(branch: int, alone: one_freedom.OneFreedom) -> None:
    simulation = Simulation(
        load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY}), step=1e-3
    )
    simulation.place('crank', [0, 0, math.pi / 2], [0, 0, 2.0], branch=branch)
    assert simulation.sample().velocities['B'][0] == pytest.approx(
        [-4.0, 0.0][branch - 1], abs=1e-9
    )
    simulation.step(250)
    wanted = alone.motion(math.pi / 2, 2.0, [0.0, 0.25])[-1]
    assert simulation.sample().q == pytest.approx(wanted, abs=1e-9)


def test_without_a_twist_the_nearest_motion_of_the_branch() -> None:
    """Beside the position ω = 2 rad/s; the folded rods keep the momentum along their branch."""
    simulation = Simulation(upright(velocities={'B': [-4, 0]}))
    simulation.place('crank', branch=2)
    found = simulation.sample().velocities
    # <v, d> of M over <d, d>: v = (-2, -4), d = (1, 0); rods of mass m: m/6 [[4, 1], [1, 2]]
    a = (-2.0 * 4.0 - 4.0 * 1.0) / 4.0
    assert found['A'] == pytest.approx([a, 0], abs=1e-12)
    assert found['B'] == pytest.approx([0, 0], abs=1e-12)


def test_a_branch_is_refused_where_there_is_none() -> None:
    simulation = Simulation(load_scene('slider_crank'))
    state = simulation.state
    with pytest.raises(InputError, match='not in a singular position'):
        simulation.place('crank', [0, 0, 1.0], branch=1)
    for wrong in (0, 1.5, 'one'):
        with pytest.raises(InputError, match='branch'):
            simulation.place('crank', [0, 0, math.pi / 2], branch=wrong)  # type: ignore[arg-type]
    assert np.array_equal(simulation.state.q, state.q)
