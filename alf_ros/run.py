"""A run of a scene from t = 0: its ticks, what they publish, and its log."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros.errors import StepError
from alf_ros.messages import stamp_ns
from alf_ros.outputs import Outputs
from alf_ros.provenance import versions
from alf_ros.recorder import Recorder
from alf_ros.scene import Scene
from alf_ros.simulation import Simulation


class Run:
    """Ticks of `steps` solver steps; after `duration` (simulated s, 0: never) it is `over`.

    A failed step leaves the last good state and its reason in `failure`. Every `begin` makes a log
    of its own in `log_folder`, so that a log is always one run from its start.
    """

    def __init__(
        self,
        scene: Scene,
        simulation: Simulation,
        outputs: Outputs,
        steps: int,
        duration: float,
        log_folder: Path | None,
    ) -> None:
        self.simulation = simulation
        self.recorder: Recorder | None = None
        self.failure: StepError | None = None
        self.initial_energy = 0.0
        self._scene, self._outputs, self._steps, self._folder = scene, outputs, steps, log_folder
        self._last_step = max(1, round(duration / simulation.h)) if duration else 0

    @property
    def over(self) -> bool:
        """Whether the duration has been reached."""
        return 0 < self._last_step <= self.simulation.step_index

    def begin(self) -> None:
        """Start from the initial state. Raises InputError if there can be no log."""
        self.close()
        self.simulation.reset()
        self.failure = None
        scene = self._scene
        about = {
            'scene': scene.name,
            'scene_sha256': scene.hash,
            'solver': dataclasses.asdict(self.simulation.solver),
            'steps_per_tick': self._steps,
            'versions': versions(),
        }
        if self._folder is not None:
            info = {k: v if isinstance(v, str) else json.dumps(v) for k, v in about.items()}
            info['scene_text'] = scene.text
            self.recorder = Recorder(self._folder, scene.name, info)
        self._outputs.record(self.recorder)
        data = serialize_message(String(data=scene.text))
        self._outputs.scene.send(data, stamp_ns(self.simulation.t))
        self.note({'kind': 'start', **about})
        self.initial_energy = self.simulation.sample().energy
        self.send()

    def tick(self) -> None:
        """Make one tick's steps, fewer at the end of the run, and send what came out."""
        steps = self._steps
        if self._last_step:
            steps = min(steps, self._last_step - self.simulation.step_index)
        try:
            self.simulation.step(steps)
        except StepError as error:
            self.failure = error
        else:
            self.failure = None
            self.send()

    def send(self, record: bool = True) -> None:
        """Publish and log the present state."""
        try:
            self._outputs.send(self.simulation.sample(), record)
        except StepError as error:
            self.failure = error

    def note(self, entry: dict[str, Any]) -> None:
        """Write to the journal what acts from the step that follows the steps made so far."""
        if self._outputs.journal.wanted:
            step, t = self.simulation.step_index, self.simulation.t
            text = json.dumps({'step': step, 't': t, **entry})
            self._outputs.journal.send(serialize_message(String(data=text)), stamp_ns(t))

    def close(self) -> None:
        """End the log."""
        if self.recorder is not None:
            self._outputs.record(None)
            self.recorder.close()
            self.recorder = None

    def __str__(self) -> str:
        return f't = {self.simulation.t:.9g} s, step {self.simulation.step_index}'
