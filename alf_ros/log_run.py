"""A run written to a log without a node: the same topics, bytes and journal as those of a node."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros import provenance
from alf_ros.display import Display
from alf_ros.logs import journal
from alf_ros.readings import READINGS
from alf_ros.recorder import Recorder, Split
from alf_ros.saved_states import as_data
from alf_ros.settings import Setup
from alf_ros.simulation import State
from alf_ros.stamps import stamp_ns
from alf_ros.topics import LATCHED, RELIABLE, TOPICS

RECORDED = tuple(reading.name for reading in READINGS.values())


def full_names(node: str = '/simulator') -> dict[str, str]:
    """Where the topics of a simulator of this name are, if nothing is remapped."""
    below = {topic.name: f'{node}/{topic.key}' for topic in TOPICS}
    return {name: full if name[0] == '~' else f'/{name}' for name, full in below.items()}


class LogRun:
    """Writes the run of `setup` into a new log below `folder`; `about` is added to what it says of
    itself; `name`: of its folder. Nothing is dropped: `send` waits for the disk when it has to.

    Raises InputError if the log cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        setup: Setup,
        *,
        state: State | None = None,
        ahead: int = 0,
        topics: Mapping[str, str] | None = None,
        recorded: Collection[str] = RECORDED,
        about: Mapping[str, Any] | None = None,
        split: Split | None = None,
        name: str = '',
    ) -> None:
        names = dict(topics or full_names())
        self._topics = [topic for topic in TOPICS if topic.name in recorded]
        self._names = names
        self._journal, self._scene = (
            f'{names["~/energy"].rpartition("/")[0]}/{key}' for key in ('inputs', 'scene')
        )
        self._ahead, self._seal = ahead, ''
        simulation = setup.simulation
        said = provenance.start(setup.scene, simulation.solver, setup.steps, ahead, names)
        said.update(about or {})
        if state is not None:
            simulation.restore(state)
            said['state'] = as_data(state)
        record = provenance.record(said, setup.scene)
        self.recorder = Recorder(folder, setup.scene.name, record, split=split, name=name)
        self.use(setup)
        self.note({'kind': 'start', **said})

    def use(self, setup: Setup) -> None:
        """Go on with another setup, at the same state."""
        self.setup = setup
        model = setup.simulation.model
        made = ((topic, topic.make(model, Display())) for topic in self._topics)
        self._writers = [(topic, write) for topic, write in made if write is not None]
        self._write_text(self._scene, setup.scene.text)

    def note(self, entry: dict[str, Any]) -> None:
        """Write to the journal what acts from the next step on."""
        simulation = self.setup.simulation
        place = {'step': simulation.step_index, 't': simulation.t}
        text, self._seal = journal.chained({**place, **entry}, self._seal)
        self._write_text(self._journal, text)

    def send(self) -> None:
        """Write the present state. Raises StepError if it cannot be evaluated."""
        sample, stamp = self.setup.simulation.sample(), self._stamp
        for topic, write in self._writers:
            name = self._names[topic.name]
            self.recorder.write(name, topic.type, topic.qos, stamp, write(sample, stamp))
        while self.recorder.waiting > self.recorder.queue_size // 2 and not self.recorder.error:
            time.sleep(0.01)

    def close(self) -> None:
        """End the log. Raises OSError if it could not be written."""
        self.recorder.close()
        if self.recorder.error:
            raise OSError(self.recorder.error)

    @property
    def _stamp(self) -> int:
        return stamp_ns(self.setup.simulation.t, self._ahead)

    def _write_text(self, topic: str, text: str) -> None:
        qos = LATCHED if topic == self._scene else RELIABLE
        data = serialize_message(String(data=text))
        self.recorder.write(topic, String, qos, self._stamp, data, essential=True)
