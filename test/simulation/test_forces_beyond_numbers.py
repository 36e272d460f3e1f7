"""Forces near the end of the range of numbers: a sample raises, and has no NaN without a word."""

import numpy as np
import pytest

from alf_ros import Simulation, StepError
from alf_ros.arrays import Floats
from alf_ros.ros.simulator import diagnostics
from alf_ros.scene.scene import load_scene, scene_from_text
from alf_ros.simulation.sample_reader import SampleReader, mask

FREE = """
mechanism:
  alf: 1
  points: {P: {at: [0, 0]}}
  bodies: {ball: {points: [P], mass: 1.0, inertia: point}}
effects: {gravity: {acceleration: [0, -9.81]}}
solver: {step: 0.01}
"""


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


def test_energies_are_finite_or_raise() -> None:
    """A free mass may be so fast that its speed is a number and its energy is none."""
    simulation = Simulation(scene_from_text(FREE), ledger=True)
    reader = SampleReader(simulation, {'energy': (np.zeros(1),), 'work': (np.zeros(3),)})
    wanted = {key: mask((key,)) for key in ('energy', 'work')}
    simulation.apply_wrench('ball', force=(1e150, 0.0))
    simulation.step()
    assert simulation.sample().energy == pytest.approx(0.5e296)
    assert all(map(reader.read, wanted.values()))
    simulation.apply_wrench('ball', force=(1e200, 0.0))
    simulation.step()
    assert not any(map(reader.read, wanted.values()))
    sample = simulation.sample()
    for read in ('energy', 'kinetic_energy', 'works'):
        with pytest.raises(StepError, match='energies exceed the range of numbers'):
            getattr(sample, read)
    for report in (diagnostics.energy(sample, 0.0), diagnostics.work(sample, 0.0)):
        assert report.level == diagnostics.ERROR
        assert 'energies exceed the range of numbers' in report.message
