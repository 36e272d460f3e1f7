"""Equilibrium paths of a column in space, which buckles to two sides at nearly the same load."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros import equilibrium_path, load_scene
from alf_ros.scene.scene import Scene


def column(across: float) -> Scene:
    """An upright bar in space (1 m), held at its top by springs of 100 N/m and of `across`."""
    half, other = 50.0, 0.5 * across
    springs = {
        f's{n}': {
            'between': ['B', 'ground'],
            'at': [None, [x, y, 1.0]],
            'stiffness': k,
            'free_length': 3.0,
        }
        for n, (x, y, k) in enumerate([(3, 0, half), (-3, 0, half), (0, 3, other), (0, -3, other)])
    }
    points = {'O': {'at': [0, 0, 0], 'fixed': True}, 'B': {'at': [0, 0, 1.0]}}
    rod = {'points': ['O', 'B'], 'mass': 1.0, 'inertia': 'point', 'com': [1.0, 0, 0]}
    foot = {'type': 'spherical', 'between': ['ground', 'rod'], 'at': 'O'}
    bar = {'alf': 1, 'space': 'spatial', 'points': points, 'bodies': {'rod': rod}}
    load = {'constant_wrench': {'load': {'on': 'B', 'force': [0, 0, 0]}}}
    return load_scene(
        {'mechanism': {**bar, 'joints': {'foot': foot}}, 'effects': {'spring': springs, **load}}
    )


def test_stability_between_two_branch_points_of_a_step() -> None:
    """A column buckles at P = k L."""
    path = equilibrium_path(column(100.1), over='load.force.2', end=-300.0)
    first, second = path.branch_points
    np.testing.assert_allclose([first.value, second.value], [-100.0, -100.1], rtol=1e-11)
    assert (first.before, first.after, second.before) == ('stable', 'unstable', 'unstable')


@pytest.mark.thorough
def test_three_branch_points_within_a_step() -> None:
    """The column falls over until it hangs, where its number turns: there it crosses the path
    that hangs, and on both sides it becomes unstable sideways."""
    path = equilibrium_path(column(100.001), over='load.force.2', end=-300.0)
    (side,) = path.follow('branch 1')
    assert [event.kind for event in side.events] == 3 * ['branch']
    left, middle, right = (side.points['B'][event.index] for event in side.events)
    np.testing.assert_allclose(middle, [0.0, 0.0, -1.0], atol=1e-3)
    np.testing.assert_allclose(left, right * [-1.0, 1.0, 1.0], atol=1e-6)
    pull, root = 1.0 - 3.0 / np.sqrt(13.0), 27.0 / 13.0**1.5
    assert side.events[1].value == pytest.approx(100.0 * (root - pull) - 100.001 * pull, rel=1e-6)
    for event, moves in zip(side.events, 'yxy', strict=True):
        assert int(np.argmax(np.abs(event.direction))) == 'xyz'.index(moves)
