"""Saved states: whole ones with values changed, and damaged."""

from __future__ import annotations

import json
from random import Random

from spoiling import damaged, scratch, spoil


class Harness:
    SUFFIX = '.json'

    def __init__(self) -> None:
        from alf_ros import Simulation, load_scene
        from alf_ros.simulation.saved_states import SavedStates

        self._scene = load_scene('slider_crank')
        self._simulation = Simulation(self._scene)
        self._simulation.step(3)
        self._simulation.apply_wrench('crank', [1.0, 0.0])
        self._simulation.apply_effort('crank_pin', 0.5)
        self._folder = scratch('states')
        SavedStates(self._folder).save('case', self._scene, self._simulation)
        self._path = self._folder / self._scene.name / 'case.json'
        self._whole = self._path.read_text()

    def make(self, random: Random) -> bytes:
        """A file of a state."""
        document = {'': json.loads(self._whole)}
        for _ in range(random.choice((1, 1, 2))):
            spoil(document, random)
        try:
            data = json.dumps(document.get('')).encode()
        except RecursionError:
            data = b'[' * 5000
        return damaged(data, random) if random.randrange(4) == 0 else data

    def check(self, case: bytes) -> str:
        """A state that can be gone on from, with finite numbers, or one line."""
        import numpy as np

        from alf_ros.errors import AlfError
        from alf_ros.simulation.saved_states import SavedStates

        self._path.write_bytes(case)
        simulation, end = self._simulation, 'ran'
        before = simulation.state
        try:
            state, _step, _q = SavedStates(self._folder).find('case', self._scene, before)
            simulation.restore(state)
            simulation.step(1)
            numbers = np.concatenate([simulation.state.q, simulation.state.qd])
            assert np.isfinite(numbers).all(), 'silent: not finite'
            assert simulation.t >= 0.0, 'silent: a time before zero'
        except AlfError as error:
            assert str(error).isprintable() and len(str(error)) < 700
            end = 'refused'
        finally:
            simulation.restore(before)
        return end
