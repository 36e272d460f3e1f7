"""States on the way of a run: the same from one call as from many; efforts packed once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.reactions import ReactionsOf

STEPS = np.array([0, 1, 2, 30, 31, 47, 60])


@pytest.mark.parametrize(
    ('name', 'settings'),
    [
        ('slider_crank', {'integrator': 'rk4', 'step': 2e-3}),
        ('slider_crank', {'integrator': 'dop853_adaptive', 'step': 0.05}),
        ('slider_crank', {'integrator': 'esdirk43_adaptive', 'step': 0.02}),
        ('slider_crank', {'integrator': 'rk4', 'step': 2e-2, 'tangents': ['L', 'coupler.mass']}),
        ('delta_robot', {'integrator': 'rk4', 'step': 5e-3, 'tangents': ['arm', 'state.0']}),
    ],
)
def test_a_trail_has_the_states_of_single_steps(name: str, settings: dict[str, Any]) -> None:
    """To rounding, through singular positions, also where these are watched for; with efforts."""
    scene = load_scene(name)
    alone, along = (Simulation(scene, **settings) for _ in range(2))
    joint = along.model.coordinate_names[0]
    trail, states = along._trail(STEPS), [alone.state]
    for effort, last in ((0.3, 31), (-0.2, int(STEPS[-1]))):
        along.apply_effort(joint, effort)
        along._step_along(last - along.step_index, trail)
        alone.apply_effort(joint, effort)
        while alone.step_index < last:
            alone.step()
            if alone.step_index in STEPS:
                states.append(alone.state)
    found = trail.arrays
    K, whole = len(settings.get('tangents', ())), states[0].q.size
    for k, state in enumerate(states):
        tangents = state.tangents.reshape(K, 2, whole)
        for one, other in (
            (found.q, state.q),
            (found.qd, state.qd),
            (found.turns, state.turns),
            (found.dq, tangents[:, 0]),
            (found.dqd, tangents[:, 1]),
        ):
            # a call for many steps linearises where single ones do again: equal to rounding
            assert np.allclose(one[k], other, rtol=1e-12, atol=1e-12)
    assert len(found.q) == STEPS.size


def test_other_formulations_leave_no_trail() -> None:
    simulation = Simulation(load_scene('slider_crank'), formulation='baumgarte', integrator='rk4')
    with pytest.raises(InputError, match='alf2 alone'):
        simulation._step_along(3, simulation._trail(STEPS))
    simulation.step(3)


@pytest.mark.parametrize('name', ['slider_crank', 'delta_robot_controlled', 'stewart_platform'])
def test_efforts_that_change_are_packed_as_they_are_anew(name: str) -> None:
    """Whatever was held before: other efforts, more of them, fewer, a wrench among them."""
    simulation = Simulation(load_scene(name), integrator='rk4', step=1e-3)
    model, random = simulation.model, np.random.default_rng(5)
    joints = [each.name for each in model.coordinates if each.freedom.alone]
    body = next(each for each in model.body_names if model.layout.turns(each))
    for turn in range(12):
        if turn % 5 == 4:
            simulation.clear_inputs()
        for joint in random.permutation(joints)[: random.integers(1, len(joints) + 1)].tolist():
            simulation.apply_effort(joint, float(random.normal()))
        if turn % 3 == 2:
            simulation.apply_wrench(body, tuple(random.normal(size=model.layout.dimension)))
        simulation.step()
        applied = simulation._run.applied
        anew = Applied(model, simulation.scene.effects, applied.inputs, ReactionsOf(model))
        one, other = applied.assembled.effects, anew.assembled.effects
        assert one.params.tobytes() == other.params.tobytes()
        assert one.slots.tobytes() == other.slots.tobytes()
        assert one.params_at.tobytes() == other.params_at.tobytes()
