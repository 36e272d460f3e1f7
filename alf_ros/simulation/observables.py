"""Values of a topic from a sample: names and arrays, the same for a message and for a re-run.

A reading of many things at one instant; all SI, world frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.model.constraints import drives
from alf_ros.simulation import state_vector
from alf_ros.simulation.sample import Sample


@dataclass(frozen=True)
class Reading:
    """The topic `name`, and the `fields` of its message that hold numbers.

    `names(sample)` (k,) says what the numbers are of; `values(sample)` gives an array for each
    field, (k,), or (k, 6) for force and torque.
    """

    name: str
    fields: tuple[str, ...]
    names: Callable[[Sample], tuple[str, ...]]
    values: Callable[[Sample], tuple[Floats, ...]]

    @property
    def key(self) -> str:
        """The name without '~/'."""
        return self.name.rpartition('/')[2]


def _wrenches(sample: Sample) -> tuple[Floats]:
    D = sample.model.layout.dimension
    wrenches = np.zeros((len(sample.model.joint_names), 6))
    wrenches[:, :D] = sample.reaction_forces
    wrenches[:, 3 if D == 3 else 5 :] = sample.reaction_torques
    return (wrenches,)


def joint_state_names(model: Model) -> tuple[str, ...]:
    """Names of the joint coordinates, and of the angles of balls."""
    return model.coordinate_names + model.mechanism.ball_angles


def energy_names(effects: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the energies (J): the whole, the kinetic part, and what each effect stores."""
    return ('total', 'kinetic', *effects)


def _joint_states(sample: Sample) -> tuple[Floats, ...]:
    """Of the joint coordinates, then of the angles of balls, on which no effort acts."""
    coordinates = sample.joint_positions, sample.joint_velocities, sample.joint_efforts
    angles, rates = sample.angles_of_balls
    if not angles.size:
        return coordinates
    parts = zip(coordinates, (angles, rates, np.zeros(angles.size)), strict=True)
    return tuple(np.concatenate(pair) for pair in parts)


_JOINT_STATE = 'position', 'velocity', 'effort'
JOINT_STATES = Reading(
    'joint_states',
    _JOINT_STATE,
    lambda sample: joint_state_names(sample.model),
    _joint_states,
)
REACTIONS = Reading('~/reactions', ('wrench',), lambda sample: sample.model.joint_names, _wrenches)
CONSTRAINTS = Reading(
    '~/constraints',
    _JOINT_STATE,
    lambda sample: sample.model.row_names,
    lambda sample: (sample.phi, sample.phi_dot, sample.lam),
)
DRIVES = Reading(
    '~/drives',
    _JOINT_STATE,
    lambda sample: drives.motion_names(sample.model.mechanism),
    lambda sample: sample.drives,
)
ENERGY = Reading(
    '~/energy', ('data',), lambda sample: ('energy',), lambda sample: (np.array([sample.energy]),)
)
ENERGY_PARTS = Reading(
    '~/energy_stamped',
    ('position',),
    lambda sample: energy_names(tuple(sample.stored)),
    lambda sample: (np.array([sample.energy, sample.kinetic_energy, *sample.stored.values()]),),
)
STATE = Reading(
    '~/state',
    ('position', 'velocity'),
    lambda sample: state_vector.names(sample.model, sample.state),
    lambda sample: state_vector.values(sample.model, sample.state),
)
WORK = Reading(
    '~/work',
    ('position',),
    lambda sample: tuple(sample.works),
    lambda sample: (np.array([*sample.works.values()]),),
)
READINGS = {
    reading.key: reading
    for reading in (
        STATE,
        JOINT_STATES,
        REACTIONS,
        CONSTRAINTS,
        DRIVES,
        ENERGY,
        ENERGY_PARTS,
        WORK,
    )
}
