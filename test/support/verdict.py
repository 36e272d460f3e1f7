"""The verdict on a scene: it runs with finite numbers, or is refused in one line."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection

import numpy as np

from alf_ros import Simulation
from alf_ros.errors import AlfError, InputError
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.sample import Sample

RAN, REFUSED, STOPPED = 'ran', 'refused', 'stopped'
STEPS = 3


def verdict(text: str) -> tuple[str, str]:
    """The outcome and details: RAN, REFUSED before it ran, STOPPED by a failed step, or a fault.

    A warning counts as a fault: a user of a command would see it.
    """
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        try:
            simulation = Simulation(scene_from_text(text, 'mutant.yaml'))
            bad = list(_not_finite(simulation.sample()))
            simulation.step(STEPS)
            bad += _not_finite(simulation.sample())
        except AlfError as error:
            said = str(error)
            if '\n' in said or not 10 < len(said) < 700:
                return 'not one clear line', said
            return (REFUSED if isinstance(error, InputError) else STOPPED), said
        except Exception as error:
            return type(error).__name__, ''.join(traceback.format_exc()[-1500:])
    return ('not finite', ', '.join(bad)) if bad else (RAN, '')


_LIMITS = ('qdd', 'joint_efforts', 'lam', 'reaction_forces', 'reaction_torques')


def _not_finite(sample: Sample) -> Iterator[str]:
    for name in (
        'q qd qdd energy body_poses joint_positions joint_velocities joint_efforts phi phi_dot '
        'lam reaction_forces reaction_torques'
    ).split():
        values = np.asarray(getattr(sample, name))
        if name in _LIMITS and sample._limits is not None:
            values = values[~np.isnan(values)]  # what has no limit there says so
        if not np.all(np.isfinite(values)):
            yield name
    if not np.all(np.isfinite(list(sample.powers.values()))):
        yield 'powers'


def serve(connection: Connection) -> None:
    """Answer each text with its verdict, until there are no more."""
    connection.send((RAN, ''))  # all is imported
    while True:
        try:
            text = connection.recv()
        except EOFError:
            return
        connection.send(verdict(text))
