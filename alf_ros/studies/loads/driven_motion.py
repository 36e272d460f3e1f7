"""The motion whose loads are asked for, and the mechanism that actuators are to move so."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.carried_positions import blocks_of, same_blocks
from alf_ros.model.prescribed import prescribe
from alf_ros.scene.scene import Scene
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.studies.loads.inverse_dynamics import Motion

_STEP = 1e-3  # s: never taken


def moving(motion: Scene | Simulation) -> Simulation:
    """A simulation of one's own that makes the motion. Raises InputError without drives."""
    if isinstance(motion, Simulation):
        return copy.copy(motion)
    if not motion.mechanism.drives:
        raise InputError(
            'the scene has no drives', key='motion', expected='drives, or a Simulation that moves'
        )
    simulation = Simulation(motion)
    model = simulation.model
    if model.n > round(model.system.rank):
        return simulation  # forces decide on the freedoms that are left
    # nothing is integrated: the step is the way between two closed positions
    step = motion.solver.step
    return Simulation(replace(motion, effects=()), step=step, integrator='rk4')


def undriven(motion: Scene | Simulation, without: Sequence[str]) -> Simulation:
    """The mechanism of a motion without its drives, with its effects, except some, and the inputs
    held. Raises InputError for an unknown effect."""
    scene = motion if isinstance(motion, Scene) else motion.scene
    labels = [effect.label for effect in scene.effects]
    for name in without:
        if name not in labels:
            raise InputError('no such effect', key='without', value=name, choices=labels)
    bare = replace(
        scene.at_rest(),
        mechanism=replace(scene.mechanism, drives=()),
        effects=tuple(e for e in scene.effects if e.label not in without),
        document=SceneDocument(''),
    )
    simulation = Simulation(bare, step=_STEP, integrator='rk4', formulation='alf2')
    if isinstance(motion, Simulation):
        simulation._run.hold(motion.state.inputs)
    return simulation


class Carrier:
    """Samples of a motion as states of the mechanism without drives."""

    def __init__(self, of: Simulation, to: Simulation) -> None:
        self._to, self._from = to, of
        self._after, self._before = same_blocks(of.model.layout, to.model.layout)

    def motion(self, samples: Sequence[Sample]) -> Motion:
        """q, q̇ and q̈ of the samples, without loads of friction."""
        model, state = self._to.model, self._to.state
        shape = len(samples), model.q.size
        q, qd, qdd = np.tile(state.q, (shape[0], 1)), np.zeros(shape), np.zeros(shape)
        for k, sample in enumerate(samples):
            prescribe(model.system, sample.t, q[k], qd[k], qdd[k])
            given = sample.state.q, sample.state.qd, blocks_of(sample.model, sample.qdd)
            for to, values in zip((q[k], qd[k], qdd[k]), given, strict=True):
                self._carry(values, to)
        return Motion(
            t=np.array([sample.t for sample in samples]),
            q=q,
            qd=qd,
            qdd=qdd,
            turns=np.array([sample.state.turns for sample in samples]),
            loads=np.zeros((shape[0], state.loads.size // model.layout.dimension)),
        )

    def _carry(self, values: Floats, to: Floats) -> None:
        D = self._to.model.layout.dimension
        to.reshape(-1, D)[self._after] = values.reshape(-1, D)[self._before]

    def state(self, motion: Motion, k: int) -> State:
        """Instant k of a motion."""
        turns = motion.turns[k].copy()
        return self._to.state.moved(motion.q[k].copy(), motion.qd[k].copy(), turns)
