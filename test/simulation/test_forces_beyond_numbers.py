"""Forces near the end of the range of numbers: a sample raises, and has no NaN without a word."""

import numpy as np
import pytest

from alf_ros import Simulation, StepError
from alf_ros.arrays import Floats
from alf_ros.scene.scene import load_scene


@pytest.mark.parametrize(('name', 'body'), [('slider_crank', 'coupler'), ('delta_robot', 'plate')])
def test_reactions_are_finite_and_proportional_or_raise(name: str, body: str) -> None:
    simulation = Simulation(load_scene(name))
    along = np.eye(simulation.model.layout.dimension)[0]

    def forces(size: float) -> Floats:
        simulation.apply_wrench(body, force=size * along)
        return np.array([each.force for each in simulation.sample().reactions.values()])

    large, larger = forces(1e200), forces(1e300)
    assert np.abs(large).max() > 1e198
    assert larger == pytest.approx(1e100 * large, rel=1e-9, abs=1e-9 * np.abs(larger).max())
    simulation.apply_wrench(body, force=1.7e308 * along)
    message = 'exceed the range of numbers; take smaller forces'
    with pytest.raises(StepError, match=message):
        _ = simulation.sample().qdd
    with pytest.raises(StepError, match=message):
        _ = list(simulation.sample().reactions.values())
