"""Shares of redundant reactions against elastic bearings, computed independently."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.inspection.soundness import examine
from alf_ros.simulation.sample import Reaction, Sample
from alf_ros.simulation.sample_reader import fits
from support.paths import ROOT

G = 9.81
GRAVITY = {'gravity': {'acceleration': [0, 0, -G]}}
HINGES = (0.1, 0.9, 1.9)  # m


def at_start(mechanism: dict[str, Any], effects: dict[str, Any] | None = None) -> Sample:
    scene = load_scene({'mechanism': mechanism, 'effects': effects or GRAVITY})
    return Simulation(scene, step=1e-3, integrator='rk4').sample()


def door(bearings: list[dict[str, float]]) -> dict[str, Any]:
    """A door of 30 kg on three hinges about z; its centre of mass at x = 0.4, y = 0.05, z = 1."""
    joints: dict[str, Any] = {}
    for n, bearing in enumerate(bearings):
        joints[f'h{n}'] = {
            'type': 'revolute',
            'between': ['ground', 'door'],
            'at': f'H{n}',
            'axis': [0, 0, 1],
        }
        if bearing:
            joints[f'h{n}']['stiffness'] = bearing
    points: dict[str, Any] = {
        f'H{n}': {'at': [0, 0, z], 'fixed': True} for n, z in enumerate(HINGES)
    }
    points['E'] = {'at': [1, 0, HINGES[0]]}
    return {
        'alf': 1,
        'space': 'spatial',
        'points': points,
        'bodies': {
            'door': {
                'points': [*points],
                'mass': 30.0,
                'inertia': {'about_com': [3, 3, 3]},
                # x of the body goes up along the hinges, y to E, z = x × y to +y of the world
                'com': [0.9, 0.4, 0.05],
            }
        },
        'joints': joints,
    }


def cross(r: Floats) -> Floats:
    """(3, 3) θ × r as a matrix times θ."""
    return np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]], dtype=float)


def elastic_door(k: list[float], kappa: list[float], scale: float) -> tuple[Floats, Floats]:
    """Forces and torques (3, 3) on a rigid door on elastic hinges that is at rest: the stiffness
    matrix of five deflections (the door is held about z, where nothing loads it at rest)."""
    weight = np.array([0.0, 0.0, -30.0 * G])
    load = np.concatenate([weight, np.cross([0.4, 0.05, 1.0], weight)])
    K, ways = np.zeros((6, 6)), []
    for each, stiff, z in zip(k, kappa, HINGES, strict=True):
        B = np.hstack([np.eye(3), cross(np.array([0.0, 0.0, z]))])
        K += scale * (each * B.T @ B + stiff * np.diag([0, 0, 0, 1, 1, 0]))
        ways.append(B)
    u = np.zeros(6)
    u[:5] = np.linalg.solve(K[:5, :5], load[:5])
    forces = [-scale * each * B @ u for each, B in zip(k, ways, strict=True)]
    torques = [-scale * stiff * np.array([u[3], u[4], 0.0]) for stiff in kappa]
    return np.array(forces), np.array(torques)


@pytest.mark.parametrize(
    ('k', 'kappa'),
    [([1e8] * 3, [1.0] * 3), ([1e8, 2e8, 5e8], [1e6, 3e6, 2e6]), ([3e5, 1e6, 1e5], [10.0] * 3)],
)
def test_a_door_on_three_hinges(k: list[float], kappa: list[float]) -> None:
    bearings = [{'translation': a, 'rotation': b} for a, b in zip(k, kappa, strict=True)]
    sample = at_start(door(bearings))
    found = [sample.reactions[f'h{n}'] for n in range(3)]
    for scale in (1e3, 1e6):  # the shares of elastic hinges at rest do not depend on it
        forces, torques = elastic_door(k, kappa, scale)
        for each, force, torque in zip(found, forces, torques, strict=True):
            assert each.force == pytest.approx(force, rel=1e-6, abs=1e-6 * 30 * G)
            assert each.torque == pytest.approx(torque, rel=1e-6, abs=1e-6 * 30 * G)
            assert not (each.indeterminate or each.open_force.any() or each.open_torque.any())


def test_rigid_hinges_leave_components_open() -> None:
    rigid = at_start(door([{}, {}, {}])).reactions
    for each in rigid.values():
        # the torque about the hinges is 0, all else may be shared differently
        assert each.open_force.all() and each.open_torque.tolist() == [True, True, False]
    partly = at_start(door([{'translation': 1e8}] * 3)).reactions
    for each in partly.values():
        assert not each.open_force.any() and each.open_torque.tolist() == [True, True, False]
        assert each.force == pytest.approx([0.0, 0.0, 10.0 * G], abs=1e-8)  # moments are rigid


def table(k: list[float], at: tuple[float, float]) -> dict[str, Any]:
    """A table of 20 kg on four legs that hang vertically; its centre of mass at x, y."""
    corners = [(0.6, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.6, -0.4)]
    points: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for n, ((x, y), stiff) in enumerate(zip(corners, k, strict=True)):
        points[f'T{n}'] = {'at': [x, y, 0.0]}
        points[f'C{n}'] = {'at': [x, y, 0.8], 'fixed': True}
        joints[f'leg{n}'] = {
            'type': 'distance',
            'between': ['ground', 'top'],
            'points': [f'C{n}', f'T{n}'],
            'stiffness': {'translation': stiff},
        }
    com = [0.6 - at[0], 0.4 - at[1], 0.0]  # from T0; x of the body points to T1, along -x
    return {
        'alf': 1,
        'space': 'spatial',
        'points': points,
        'bodies': {
            'top': {
                'points': [f'T{n}' for n in range(4)],
                'mass': 20.0,
                'inertia': {'about_com': [1, 2, 3]},
                'com': com,
            }
        },
        'joints': joints,
    }


@pytest.mark.parametrize('k', [[1e6] * 4, [1e6, 3e6, 2e6, 5e6]])
@pytest.mark.parametrize('at', [(0.0, 0.0), (0.25, -0.1)])
def test_a_table_on_four_legs(k: list[float], at: tuple[float, float]) -> None:
    """Three deflections of a rigid top on four springs."""
    sample = at_start(table(k, at))
    ways = np.array([[1, x, y] for x, y in ((0.6, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.6, -0.4))])
    stiff = np.diag(k)
    # as drawn nothing turns or sinks: the balance of rest
    u = np.linalg.solve(ways.T @ stiff @ ways, 20.0 * G * np.array([1.0, *at]))
    expected = stiff @ ways @ u
    found = [sample.reactions[f'leg{n}'].force[2] for n in range(4)]
    assert found == pytest.approx(expected.tolist(), rel=1e-8)
    assert sum(found) == pytest.approx(20.0 * G, rel=1e-12)


def test_a_wishbone_on_two_bushings() -> None:
    """Along the line between two ball joints, the force is shared as their stiffness."""
    text = (ROOT / 'config' / 'mechanisms' / 'double_wishbone.yaml').read_text('utf-8')
    plain = at_start(_mapping(text), GRAVITY)
    text = text.replace('at: DF}', 'at: DF, stiffness: {translation: 3e7}}')
    text = text.replace('at: DR}', 'at: DR, stiffness: {translation: 1e7}}')
    shared = at_start(_mapping(text), GRAVITY)
    assert shared.qdd == pytest.approx(plain.qdd, abs=1e-12)
    front, rear = (shared.reactions[f'lower_{end}'] for end in ('front', 'rear'))
    along = front.force[0] + rear.force[0]  # the line is along x
    assert abs(along) > 1.0
    assert front.force[0] == pytest.approx(0.75 * along, rel=1e-9)
    for axis in (1, 2):  # these are determined
        assert front.force[axis] == pytest.approx(
            plain.reactions['lower_front'].force[axis], abs=1e-8
        )
    assert not front.indeterminate and plain.reactions['lower_front'].indeterminate
    assert plain.reactions['lower_front'].open_force.tolist() == [True, False, False]
    assert shared.reactions['upper_front'].indeterminate  # has no stiffness
    again = at_start(_mapping(text), GRAVITY)  # whatever is read first
    assert again.lam.tolist() == shared.lam.tolist()


def _mapping(text: str) -> dict[str, Any]:
    import yaml

    found: dict[str, Any] = yaml.safe_load(text)
    return found


def test_shares_follow_a_motion() -> None:
    """A swinging door: forces of the hinges add up to what the motion needs, and are shared."""
    bearings = [{'translation': 1e8, 'rotation': 1.0}] * 3
    tilted = {'gravity': {'acceleration': [0, 3.0, -G]}}
    scene = load_scene({'mechanism': door(bearings), 'effects': tilted})
    simulation = Simulation(scene, step=1e-3, integrator='rk4')
    rigid = load_scene({'mechanism': door([{}, {}, {}]), 'effects': tilted})
    other = Simulation(rigid, step=1e-3, integrator='rk4')
    for each in (simulation, other):
        each.step(300)
    assert simulation.state.q.tolist() == other.state.q.tolist()  # not a bit of the motion
    sample, plain = simulation.sample(), other.sample()
    total = sum(sample.reactions[f'h{n}'].force for n in range(3))
    assert total == pytest.approx(sum(plain.reactions[f'h{n}'].force for n in range(3)), abs=1e-9)
    heights = np.array(HINGES)
    forces = np.array([sample.reactions[f'h{n}'].force for n in range(3)])
    for axis in (0, 1):  # deflections of a rigid line on equal springs are linear in the height
        line = np.polyfit(heights, forces[:, axis], 1)
        assert np.polyval(line, heights) == pytest.approx(forces[:, axis], abs=1e-5)
    assert not fits(simulation) and fits(other)


def test_check_names_what_is_open() -> None:
    said = {a.question: a.answer for a in examine(load_scene('double_wishbone')).answers}
    assert 'lower_front (force x)' in said['reactions']
    bearings = [{'translation': 1e8, 'rotation': 1e3}] * 3
    scene = load_scene({'mechanism': door(bearings), 'effects': GRAVITY})
    said = {a.question: a.answer for a in examine(scene).answers}
    assert said['reactions'] == 'all determinate, shared by bearings'


@pytest.mark.parametrize('soft', [(0, 1, 2), (0, 2), (0,), (2,)])
def test_check_and_samples_name_the_same(soft: tuple[int, ...]) -> None:
    """Hinges that are soft in translation only, or not at all: their torques stay open."""
    mechanism = door([{'translation': 1e6}] * 3)
    for n in {0, 1, 2} - set(soft):
        del mechanism['joints'][f'h{n}']['stiffness']
    found = at_start(mechanism).reactions
    names = [
        f'{name} ({", ".join(_open_axes(reaction))})'
        for name, reaction in found.items()
        if reaction.indeterminate
    ]
    said = {a.question: a.answer for a in examine(load_scene({'mechanism': mechanism})).answers}
    assert said['reactions'].endswith(f'and bearings: {", ".join(names)}') and names


def _open_axes(reaction: Reaction) -> Iterator[str]:
    for kind, flags in (('force', reaction.open_force), ('torque', reaction.open_torque)):
        axes = ''.join(axis for axis, flag in zip('xyz', flags, strict=True) if flag)
        if axes:
            yield f'{kind} {axes}'


@pytest.mark.parametrize(
    ('stiffness', 'words'),
    [
        ({}, 'nothing is stiff'),
        ({'translation': 0.0}, 'not a stiffness'),
        ({'translation': -1.0}, 'not a stiffness'),
        ({'axial': 1.0}, "got 'axial'"),
    ],
)
def test_refusals(stiffness: dict[str, float], words: str) -> None:
    mechanism = door([{'translation': 1e8}] * 3)
    mechanism['joints']['h1']['stiffness'] = stiffness
    with pytest.raises(InputError, match=words):
        load_scene({'mechanism': mechanism})


def test_a_joint_without_torque_has_no_stiffness_against_rotation() -> None:
    legs = table([1e6] * 4, (0.0, 0.0))
    legs['joints']['leg2']['stiffness'] = {'translation': 1e6, 'rotation': 1e3}
    with pytest.raises(InputError, match='distance joint transmits no torque'):
        load_scene({'mechanism': legs})


def test_friction_on_reactions_is_refused() -> None:
    friction = {'joint_friction': {'joint': 'h0', 'dynamic': 0.1, 'radius': 0.01}}
    bearings = [{'translation': 1e8}] * 3
    scene = load_scene({'mechanism': door(bearings), 'effects': {**GRAVITY, **friction}})
    with pytest.raises(InputError, match='does not support the stiffness of bearings'):
        Simulation(scene, step=1e-3, integrator='rk4').step()


def test_a_table_at_rest_carries_its_weight_with_rigid_legs_too() -> None:
    """Four parallel legs are a singular position. At rest in it, rows balance the weight."""
    mechanism = table([1e6] * 4, (0.0, 0.0))
    for joint in mechanism['joints'].values():
        del joint['stiffness']
    sample = at_start(mechanism)
    legs = [sample.reactions[f'leg{n}'] for n in range(4)]
    assert sum(leg.force[2] for leg in legs) == pytest.approx(20.0 * G, rel=1e-12)
    for n in range(2):  # of opposite legs: no moment
        assert legs[n].force[2] == pytest.approx(legs[n + 2].force[2], rel=1e-9)
    assert all(leg.indeterminate for leg in legs) and sample.diagnostics.singular
