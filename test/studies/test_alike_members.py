"""Members of one structure are made together, each with the bits that it has alone."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, columns, load_scene
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.model import penalty
from alf_ros.scene.overrides import with_changes
from alf_ros.simulation import alike_members
from alf_ros.simulation.alike_members import AlikeMembers
from alf_ros.simulation.member_numbers import Likeness, unlike
from alf_ros.simulation.member_readings import readable
from alf_ros.studies.ensemble import members_together
from alf_ros.studies.ensemble.distributions import normal, uniform
from alf_ros.studies.ensemble.member import Member, run_member
from alf_ros.studies.ensemble.members_together import run_members
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of
from support.thorough import thinned

FIXED: dict[str, list[Any]] = {'solver.integrator': ['dop853'], 'solver.step': [0.02]}
ADAPTIVE = {'solver.integrator': ['dop853_adaptive'], 'solver.tolerance': [1e-8]}
DOWN, DAMPING = 'gravity.acceleration.1', 'torsion_spring.damping'
KEPT = [
    'final(energy)',
    'max(kinetic_energy)',
    'points.A',
    'mean(velocities.A.x)',
    'integral(crank_pin.position)',
    {'crossing': 'points.A.y', 'value': 0.1},
    {'at': [0.2, 0.4], 'of': 'norm(velocities.A)'},
]
FIVE = {
    'mechanism': {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [1, 0]},
            'C': {'at': [0.5, 0.4]},
            'B': {'at': [1.6, 0.5]},
        },
        'bodies': {
            'arm': {'points': ['O', 'A', 'C'], 'mass': 1, 'inertia': {'about_com': 0.1},
                    'com': [0.5, 0.1]},
            'rod': {'points': ['A', 'B'], 'mass': 0.5, 'inertia': 'rod'},
        },
        'joints': {
            'crank_pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'},
            'elbow': {'type': 'revolute', 'between': ['arm', 'rod'], 'at': 'A'},
        },
    },
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'torsion_spring': {'joint': 'elbow', 'stiffness': 3, 'free_position': 0.2},
    },
    'initial': {'velocities': {'A': [None, 1.5]}},
}  # fmt: skip
STOPPED = {
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_stop': {'joint': 'crank_pin', 'upper': 1.2, 'stiffness': 1e4},
    },
    'initial': {'velocities': {'B': [-4, 0]}},
}
STUDIES: list[tuple[Any, dict[str, Any]]] = [
    ('slider_crank', {'coupler.mass': normal(1, 0.05), **FIXED}),
    ('slider_crank', {'m': uniform(0.5, 2), DOWN: uniform(-10, -9), **ADAPTIVE}),
    ('slider_crank', {'initial.velocities.B.0': uniform(-4.2, -3.8), **FIXED}),
    (
        'slider_crank',
        {'crank.inertia': ['rod', '{about_com: 0.1}'], 'coupler.mass': uniform(1, 2), **FIXED},
    ),
    (FIVE, {'arm.mass': uniform(1, 2), 'arm.com.1': uniform(-0.1, 0.1), **FIXED}),
    (FIVE, {'torsion_spring.stiffness': uniform(1, 9), 'rod.mass': uniform(1, 2), **ADAPTIVE}),
    (
        FIVE,
        {'arm.inertia.about_com': uniform(0, 1), 'torsion_spring.damping': uniform(0, 1), **FIXED},
    ),
    (STOPPED, {'joint_stop.upper': uniform(0.8, 1.3), **FIXED}),
    (STOPPED, {'joint_stop.upper': uniform(0.8, 1.3), **ADAPTIVE}),
    ('four_bar', {'b': uniform(0.29, 0.31), 'c': uniform(0.24, 0.26), **FIXED}),
    ('four_bar', {'d': uniform(0.29, 0.31), 'density': uniform(1, 2), **ADAPTIVE}),
    ('spatial_slider_crank', {'l': uniform(0.29, 0.31), 'y': uniform(0.09, 0.1), **FIXED}),
]


# lengths, and places of which one on an axis makes another structure
LENGTHS: list[tuple[Any, dict[str, Any]]] = [
    ('slider_crank', {'L': normal(1, 0.05), 'coupler.mass': normal(1, 0.05), **FIXED}),
    ('slider_crank', {'L': normal(1, 0.05), DOWN: uniform(-10, -9), **ADAPTIVE}),
    (FIVE, {'C.at.1': uniform(0.1, 0.6), 'arm.com.1': ['0', '0.2'], **FIXED}),
]


# numbers that are read together, of which no scenes are made; the structures of each
TOGETHER: list[tuple[Any, dict[str, Any], int]] = [
    ('slider_crank', {'coupler.mass': normal(1, 0.05), 'crank.mass': uniform(0.5, 2)}, 1),
    ('slider_crank', {'L': normal(1, 0.05), DOWN: uniform(-10, -9)}, 1),
    ('four_bar', {'b': uniform(0.29, 0.31), 'd': uniform(0.29, 0.31)}, 1),
    ('spatial_slider_crank', {'coupler.mass': uniform(0.4, 0.6), 'slider.mass': uniform(1, 3)}, 1),
    (FIVE, {'arm.mass': uniform(1, 2), 'C.at.1': uniform(0.1, 0.6), DOWN: ['-9.7']}, 1),
    (FIVE, {'rod.mass': uniform(1, 2), 'arm.com.1': ['0', '0.2']}, 2),
    (STOPPED, {'joint_stop.upper': uniform(0.8, 1.3), 'L': uniform(1, 1.1)}, 1),
]
READ_TOGETHER = [
    'final(energy)',
    'max(norm(velocities.A))',
    'min(points.A)',
    'points.A.x',
    {'at': [0.2, 0.4], 'of': 'norm(points.A)'},
]


def study(scene: Any, vary: dict[str, Any], **more: Any) -> Study:
    found = load_scene(scene)
    settings = {'members': 2 * width() + 3, 'seed': 3, 'duration': 0.6, 'period': 0.04, **more}
    return study_of(found, vary, outputs=settings.pop('outputs', KEPT), **settings)


def is_as_alone(made: Study, k: int, member: Member) -> None:
    """Member k has the bits, or the reason, of its single run."""
    alone = run_member(made, k)
    assert member.reason == alone.reason
    for array, own in zip(member.arrays, alone.arrays, strict=True):
        assert array.tobytes() == own.tobytes()


@pytest.mark.parametrize('n', thinned(range(len(STUDIES)), keep=[1, 3, 6, 7, 10, 11]))
def test_members_have_the_bits_of_their_single_runs(n: int, monkeypatch: Any) -> None:
    made = study(*STUDIES[n])
    monkeypatch.setattr(members_together, '_side_by_side', lambda study, members: {})
    counts: list[int] = []
    run = AlikeMembers.run

    def counted(self: AlikeMembers, *given: Any) -> Any:
        found = run(self, *given)
        counts.append(int(found[2].sum()))
        return found

    monkeypatch.setattr(AlikeMembers, 'run', counted)
    found = run_members(made, range(made.members))
    assert sum(counts) == made.members
    assert len(made.idle) == 1 and not pickle.loads(pickle.dumps(made)).idle
    for k in range(0, made.members, 3):
        assert not found[k].reason
        is_as_alone(made, k, found[k])


@pytest.mark.parametrize('n', [0, 9, 11])
def test_penalties_that_fit_what_rounding_leaves(n: int, monkeypatch: Any) -> None:
    """As of light parts, here of all: each member has a penalty of its own."""
    monkeypatch.setattr(penalty, '_LIGHT', 0.0)
    monkeypatch.setattr(penalty, '_ROUNDED', 1e-10)
    made = study(*STUDIES[n])
    found = run_members(made, range(made.members))
    for k in range(0, made.members, 3):
        assert not found[k].reason
        is_as_alone(made, k, found[k])


@pytest.mark.parametrize('n', range(len(LENGTHS)))
def test_each_structure_has_members(n: int, monkeypatch: Any) -> None:
    made = study(*LENGTHS[n], members=16 * width())
    monkeypatch.setattr(members_together, '_side_by_side', lambda study, members: {})
    alone: list[int] = []

    def counted(study: Study, k: int) -> Any:
        alone.append(k)
        return run_member(study, k)

    monkeypatch.setattr(members_together, 'run_member', counted)
    found = run_members(made, range(made.members))
    # a crank's end is its point, also where the length has no exact inverse
    assert made.idle[0].known == (1 if made.name == 'slider_crank' else 2)
    assert len(alone) <= 2 * width()
    for k in range(0, made.members, 7):
        is_as_alone(made, k, found[k])


@pytest.mark.parametrize('n', thinned(range(len(TOGETHER)), keep=[1, 3, 5, 6]))
def test_members_that_are_read_together_need_no_scenes(n: int, monkeypatch: Any) -> None:
    scene, vary, structures = TOGETHER[n]
    made = study(scene, {**vary, **FIXED}, members=14 * width(), outputs=READ_TOGETHER)
    run_members(made, range(8 * width()))  # structures are learnt, and both ways compared
    scenes: list[int] = []
    of = Study.scene_of

    def counted(self: Study, k: int) -> Any:
        scenes.append(k)
        return of(self, k)

    members = range(8 * width(), made.members)
    with monkeypatch.context() as patch:
        patch.setattr(Study, 'scene_of', counted)
        found = run_members(made, members)
    assert not scenes and made.idle[0].known == structures
    for k in range(8 * width(), made.members, 7):
        is_as_alone(made, k, found[k - 8 * width()])


def test_members_whose_numbers_came_out_otherwise_are_read_one_by_one(monkeypatch: Any) -> None:
    made = study('slider_crank', {'L': normal(1, 0.05), **FIXED}, outputs=KEPT[:2], members=64)
    product = columns.dot

    def rounded(first: Any, second: Any) -> Any:
        found = product(first, second)
        return found * (1.0 + 2.0**-52) if isinstance(found, columns.Column) else found

    monkeypatch.setattr('alf_ros.model.constraints.row.dot', rounded)
    found = run_members(made, range(made.members))
    monkeypatch.undo()
    is_as_alone(made, 60, found[60])


def test_two_registers_of_members_at_once(monkeypatch: Any) -> None:
    half = width() // 2  # two of these are one register here, for which code exists
    monkeypatch.setattr(alike_members, 'width', lambda: half)
    vary = {'coupler.mass': normal(1, 0.05), **FIXED}
    count = 70 * half
    made = study('slider_crank', vary, members=count, outputs=READ_TOGETHER, duration=0.4)
    found = run_members(made, range(made.members))
    assert made.idle[0].most == 32 * half
    for k in (0, 1, 2 * width() + 1, 32 * half, count - 1):
        is_as_alone(made, k, found[k])


def test_a_member_that_fails_or_differs_in_more_is_run_alone() -> None:
    masses = ['1', '-1', '0', '1.1', '2*m', '1/(m-1)', '1.2', *['1.3'] * (2 * width())]
    vary = {'coupler.mass': masses, 'solver.integrator': ['dop853'] * len(masses)}
    made = study('slider_crank', vary, sampling='table', members=None, outputs=KEPT[:3])
    found = run_members(made, range(made.members))
    for k, member in enumerate(found):
        is_as_alone(made, k, member)
    assert 'negative mass' in found[1].reason and not found[2].reason
    assert not found[4].reason and found[5].reason and not found[6].reason


@pytest.mark.parametrize(
    ('scene', 'name', 'values', 'refused'),
    [
        ('slider_crank', 'L', ['1', '0', '1.1', '-1', '1/(m-1)', '1e-12', '1e12'], 3),
        ('four_bar', 'O.at.0', ['0', '0.01', '0.3', '1', '0'], 3),  # speeds contradict lengths
        ('four_bar', 'crank.length', ['0.1', '0.1', '5', '0.1'], 1),  # cannot be closed
    ],
)
def test_lengths_that_are_refused(scene: str, name: str, values: list[str], refused: int) -> None:
    values = [*values, *values[:1] * (2 * width())]
    vary: dict[str, Any] = {name: values}
    for key, settings in FIXED.items():
        vary[key] = settings * len(values)
    made = study(scene, vary, sampling='table', members=None, outputs=KEPT[:3])
    found = run_members(made, range(made.members))
    for k, member in enumerate(found):
        is_as_alone(made, k, member)
    assert sum(bool(each.reason) for each in found) == refused


def test_members_almost_without_mass() -> None:
    """A solve for their first velocities ends where rounding lets it: each is made alone."""
    made = study(
        'slider_crank',
        {'coupler.mass': [1e-12], 'crank.mass': uniform(0.0, 1e-3)},
        members=40,
        seed=3,
        duration=0.05,
        outputs=['energy', 'velocities.A'],
    )
    for k, member in enumerate(run_members(made, range(40))):
        is_as_alone(made, k, member)


def test_members_that_nobody_is_like_are_built_one_by_one() -> None:
    vary = {'L': uniform(0.9, 1.1), 'solver.iterations': [*range(10, 90)]}
    made = study('slider_crank', vary, members=5 * width(), outputs=KEPT[:2])
    found = run_members(made, range(made.members))
    assert made.idle[0].known == 0
    is_as_alone(made, 5, found[5])


def test_a_structure_whose_members_start_in_other_ways_is_forgotten() -> None:
    made = study('n_four_bar', {'L': uniform(0.9, 1.1), **FIXED}, outputs=KEPT[:1], duration=0.1)
    found = run_members(made, range(made.members))
    assert made.idle[0].known == 0
    assert run_members(made, range(made.members))[3].arrays[0] == found[3].arrays[0]
    assert run_member(made, 3).arrays[0].tobytes() == found[3].arrays[0].tobytes()


def test_numbers_only_of_scenes_that_differ_in_numbers() -> None:
    first = Simulation(load_scene('slider_crank'))
    numbers = Likeness(first).numbers_of
    other = {
        'L': '1.0625',
        'mechanism.joints.guide.on.direction': '[1, 0.1]',
        'coupler.mass': '1.1',
        DOWN: '-9.7',
        'initial.velocities.B.0': '-3.9',
        'crank.inertia': '{about_com: 0.1}',
    }
    for name, text in other.items():
        assert numbers(with_changes(first.scene, {name: text})) is not None
    more = {
        'mechanism.points.C': '{at: [0, 0], fixed: true}',
        'initial.velocities': '{B: [-4, 0], A: [0, 0]}',
        'solver.step': '0.01',
        'effects': '{}',
    }
    for name, text in more.items():
        assert numbers(with_changes(first.scene, {name: text})) is None


@pytest.mark.parametrize(
    ('name', 'why'),
    [
        ('bricard', 'redundant'),
        ('wiper', 'functions of time'),
        ('rack_and_pinion', 'rows of velocities'),
    ],
)
def test_the_others_are_told_why(name: str, why: str) -> None:
    assert why in unlike(Simulation(load_scene(name)))


def test_readings_that_need_more_than_states() -> None:
    first = Simulation(load_scene('slider_crank'))
    assert readable(first, ['crank_pin.force']) is None
    assert readable(first, ['energy', 'reactions.knee.torque']) is None
    found = readable(first, ['points.A.y', 'energy', 'knee.velocity'])
    assert found is not None
    assert [each.name for each in found] == ['points.A', 'energy', 'joints.knee.velocity']


def test_a_second_run_repeats_the_first() -> None:
    made = study('slider_crank', {'coupler.mass': normal(1, 0.05), **FIXED})
    first = Simulation(made.scene_of(0))
    quantities = readable(first, ['energy', 'points.A'])
    assert quantities is not None
    alike = AlikeMembers(first, quantities)
    numbers = [alike.numbers_of(made.scene_of(k)) for k in range(5)]
    known = [each for each in numbers if each is not None]
    t, values, good = alike.run(known, 0.6, made.times.tolist())
    assert good.all() and t.shape == made.times.shape
    alike.run(known[::-1], 0.3, [0.0])
    again = alike.run(known, 0.6, made.times.tolist())
    for one, other in zip(values, again[1], strict=True):
        assert one.tobytes() == other.tobytes()
    assert np.isfinite(values[0]).all()
