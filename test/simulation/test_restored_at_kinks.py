"""A state at the very instant of a kink over time, such as a row of a table.

A run that is restored there continues bit for bit, and reads as the run that came there, also
where an input with that kink has been replaced.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import Scene, Simulation, load_scene
from alf_ros.effects.contract.trajectory import through
from alf_ros.simulation.side_by_side import SideBySide
from support.driven_mechanisms import TWO
from support.runs import bits
from support.thorough import combined

STEPS = 60
# rows of a drive on the grid of 0.01 s, of which some differ from k * 0.01 by rounding
ROWS = [[0, 0.785], [0.07, 0.8], [0.29, 1.1], [0.3, 1.2], [0.35, 1.15], [0.57, 1.0], [1.0, 0.5]]
LOAD = [[0, 0], [0.14, 2], [0.28, -1], [0.5, 0]]


def table_drive(**solver: Any) -> Scene:
    """A slider-crank that follows the rows, with an effort that follows others."""
    return load_scene(
        {
            'mechanism': 'slider_crank',
            'drives': {'motor': {'joint': 'crank_pin', 'angle': {'table': ROWS}}},
            'effects': {
                'gravity': {'acceleration': [0, -9.81]},
                'motor': {'push': {'joint': 'knee', 'effort': LOAD}},
            },
            'solver': {'step': 0.01, **solver},
        }
    )


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43_adaptive'])
def test_a_run_goes_on_from_every_state(integrator: str) -> None:
    scene = table_drive(integrator=integrator)
    run, again = Simulation(scene), Simulation(scene)
    before = run.state
    for _ in range(STEPS):
        run.step(1)
        again.restore(before)
        again.step(1)
        assert bits(again.state) == bits(run.state), run.t
        before = run.state


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive'])
def test_a_restored_state_reads_the_same(integrator: str) -> None:
    scene = table_drive(integrator=integrator)
    run, again = Simulation(scene), Simulation(scene)
    for _ in range(STEPS):
        run.step(1)
        again.restore(run.state)
        assert bits(again.state) == bits(run.state), run.t
        ours, theirs = run.sample(), again.sample()
        assert np.array_equal(ours.joint_positions, theirs.joint_positions), run.t
        assert ours.energy == theirs.energy, run.t


# a shoulder that turns, its acceleration jumping at a point of the grid; the lower bar is free
TURNING = '3*t + 20*abs(t - 0.25)*(t - 0.25) + 20*0.25*0.25'
INTEGRATORS = ['rk4', 'dop853', 'dop853_adaptive', 'esdirk43', 'esdirk43_adaptive']


def driven_arm(angle: str, effects: dict[str, Any], **solver: Any) -> Scene:
    """An arm whose first joint is driven."""
    drives = {'first': {'joint': 'shoulder', 'angle': angle}}
    return load_scene(
        {
            'mechanism': {**TWO, 'drives': drives},
            'effects': {'gravity': {'acceleration': [0, -9.81]}, **effects},
            'solver': {'step': 0.01, **solver},
        }
    )


def replace_effort(run: Simulation, k: int) -> None:
    """At step k: another effort on the elbow, with a knot there or without."""
    if k % 8 == 4:
        times = [k * run.h, (k + 4) * run.h, (k + 9) * run.h]
        run.apply_effort('elbow', through(times, [(0.1,), (-0.3,), (0.2 * k,)]))
    elif k % 8 == 0:
        run.apply_effort('elbow', 1.0)
    elif k % 8 == 2:
        run.clear_inputs()


@pytest.mark.parametrize(
    ('settings', 'integrator'), combined([{}, {'ledger': True}, {'watch': True}], INTEGRATORS)
)
def test_also_where_inputs_are_replaced(integrator: str, settings: dict[str, Any]) -> None:
    scene = driven_arm(TURNING, {}, integrator=integrator)
    run, again = Simulation(scene, **settings), Simulation(scene, **settings)
    for k in range(STEPS):
        replace_effort(run, k)
        again.restore(run.state)
        assert bits(again.state) == bits(run.state), run.t
        run.step(1)
        again.step(1)
        assert bits(again.state) == bits(run.state), run.t


@pytest.mark.parametrize('formulation', ['alf1', 'alf2_as_printed'])
def test_other_formulations_too(formulation: str) -> None:
    scene = table_drive(integrator='rk4', formulation=formulation)
    run, again = Simulation(scene), Simulation(scene)
    for _ in range(STEPS):
        run.step(1)
        again.restore(run.state)
        assert bits(again.state) == bits(run.state), run.t


@pytest.mark.parametrize('integrator', ['rk4', 'dop853', 'dop853_adaptive'])
def test_in_lanes_too(integrator: str) -> None:
    """Steps in lanes end at rows of tables in the same bits as single ones, which restored ones
    have, too."""
    effects = {'motor': {'push': {'joint': 'elbow', 'effort': LOAD}}}
    scene = driven_arm('3*t - 0.2*sin(t)', effects, integrator=integrator)
    members = [Simulation(scene) for _ in range(4)]
    alone = [Simulation(scene) for _ in range(4)]
    together = SideBySide(members)
    for row, t in enumerate([0.14, 0.28, 0.5]):
        for k, each in enumerate([*members, *alone]):
            each.apply_effort('elbow', 0.1 * (k % 4) + row)
            each.restore(each.state)
        steps = round(t / 0.01) - members[0].step_index
        together.step(steps)
        for one, other in zip(members, alone, strict=True):
            other.step(steps)
            assert bits(one.state) == bits(other.state)
            one.restore(one.state)
            assert bits(one.state) == bits(other.state)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_any_number_of_steps_in_a_call(integrator: str) -> None:
    """Corners at points of the grid where the step before, and one more, is rounded elsewhere."""
    corners = [k * 0.01 for k in range(1, 40) if (k - 1) * 0.01 + 0.01 != k * 0.01]
    assert len(corners) > 3
    for corner in corners:
        angle = f'3*t + 20*abs(t - {corner})*(t - {corner}) + 20*{corner}*{corner}'
        scene = driven_arm(angle, {}, integrator=integrator)
        single, many = Simulation(scene), Simulation(scene)
        for _ in range(8):
            many.step(5)
            for _ in range(5):
                single.step(1)
            assert bits(single.state) == bits(many.state), (corner, many.t)
