"""A run written to a log without a node: the same topics, bytes and journal as from a node."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from alf_ros.logs import journal, provenance
from alf_ros.logs.log import node_of
from alf_ros.logs.resume import Resumed
from alf_ros.logs.stamps import message_stamp, stamp_ns
from alf_ros.ros.messages.topics import LATCHED, RELIABLE, TOPICS
from alf_ros.ros.recording.recorder import Recorder, Split
from alf_ros.simulation.display_geometry import Display
from alf_ros.simulation.observables import ENERGY_PARTS, READINGS
from alf_ros.simulation.saved_states import as_data
from alf_ros.simulation.setup import Setup
from alf_ros.simulation.state import State

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_CLOSE = 2e-9  # s: stamps are whole nanoseconds
_ROUNDED = 4  # of the last places of large times
_PLACE = ('step', 't', 'seal')  # of an entry, in its own journal
# `~/energy` says the same in fewer bytes
RECORDED = tuple(each.name for each in READINGS.values() if each is not ENERGY_PARTS)


def full_names(node: str = '/simulator') -> dict[str, str]:
    """Where the topics of a simulator of this name are, if nothing is remapped."""
    below = {topic.name: f'{node}/{topic.key}' for topic in TOPICS}
    return {name: full if name[0] == '~' else f'/{name}' for name, full in below.items()}


class Write(Protocol):
    """Takes a serialised message: topic, type, QoS, stamp (ns), data."""

    def __call__(
        self,
        topic: str,
        kind: type,
        qos: QoSProfile,
        stamp: int,
        data: bytes,
        essential: bool = False,
    ) -> None: ...


class RunWriter:
    """The messages of the run of `setup`, given to `write` as a node would publish them.

    `names`: where the topics are, by the name users write; `recorded`: the recorded topics; scene
    and journal are always recorded. Stamps are `ahead` (ns) of the simulated time.
    """

    def __init__(
        self,
        write: Write,
        setup: Setup,
        ahead: int,
        names: Mapping[str, str],
        recorded: Collection[str],
    ) -> None:
        self._write, self._ahead, self._names = write, ahead, names
        self._topics = [topic for topic in TOPICS if topic.name in recorded]
        below = node_of(names)
        self._journal, self._scene = (
            names.get(f'~/{key}', f'{below}/{key}') for key in ('inputs', 'scene')
        )
        self._seal = ''
        self.use(setup)

    @property
    def topics(self) -> dict[str, tuple[type, QoSProfile]]:
        """Type and QoS of everything that is written, by topic."""
        texts: dict[str, tuple[type, QoSProfile]] = {
            self._scene: (String, LATCHED),
            self._journal: (String, RELIABLE),
        }
        return texts | {self._names[t.name]: (t.type, t.qos) for t in self._topics}

    def use(self, setup: Setup) -> None:
        """Continue with another setup, at the same state."""
        self.setup = setup
        simulation = setup.simulation
        made = ((topic, topic.make(simulation, Display())) for topic in self._topics)
        self._writers = [(topic, write) for topic, write in made if write is not None]
        self._write_text(self._scene, setup.scene.text)

    def note(self, entry: dict[str, Any]) -> None:
        """Write the inputs that act from the next step to the journal."""
        simulation = self.setup.simulation
        place = {'step': simulation.step_index, 't': simulation.t}
        text, self._seal = journal.chained({**place, **entry}, self._seal)
        self._write_text(self._journal, text)

    def send(self) -> None:
        """Write the present state. Raises StepError if it cannot be evaluated, or has no stamp."""
        sample = self.setup.simulation.sample()
        stamp = message_stamp(sample.t, self._ahead, sample.t)
        for topic, write in self._writers:
            name = self._names[topic.name]
            self._write(name, topic.type, topic.qos, stamp, write(sample, stamp))

    @property
    def _stamp(self) -> int:
        return stamp_ns(self.setup.simulation.t, self._ahead)

    def _write_text(self, topic: str, text: str) -> None:
        qos = LATCHED if topic == self._scene else RELIABLE
        data = serialize_message(String(data=text))
        self._write(topic, String, qos, self._stamp, data, essential=True)


class LogRun(RunWriter):
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
        names = full_names() | dict(topics or {})
        simulation = setup.simulation
        said = provenance.start(setup, ahead, names)
        said.update(about or {})
        if state is not None:
            simulation.restore(state)
            said['state'] = as_data(state)
        record = provenance.record(said, setup.scene)
        self.recorder = Recorder(folder, setup.scene.name, record, split=split, name=name)
        super().__init__(self.recorder.write, setup, ahead, names, recorded)
        self.note({'kind': 'start', **said})

    def send(self) -> None:
        """Write the present state. Raises StepError if it cannot be evaluated."""
        super().send()
        while self.recorder.waiting > self.recorder.queue_size // 2 and not self.recorder.error:
            time.sleep(0.01)

    def close(self) -> None:
        """End the log. Raises OSError if it could not be written."""
        self.recorder.close()
        if self.recorder.error:
            raise OSError(self.recorder.error)


def ticks(run: RunWriter, resumed: Resumed, end: float) -> Iterator[float]:
    """Make and write the ticks of a resumed log up to `end` (s), each entry of its journal at its
    time. A request ends a tick early: ticks end at the instants of the log that are a whole
    number of steps.

    Yields the time (s) after each. Raises InputError, StepError.
    """
    rerun, entries, instants = resumed.rerun, resumed.rest, iter(resumed.instants)
    instant = next(instants, math.inf)

    def due(t: float) -> bool:
        return bool(entries) and entries[0]['t'] < t - 0.5 * rerun.simulation.h

    def act() -> None:
        entry = entries.pop(0)
        rerun.act({**entry, 'step': round(entry['t'] / rerun.simulation.h)})
        if entry['kind'] == 'settings':
            run.use(Setup(rerun.scene, rerun.simulation, rerun.steps_per_tick))
        run.note({key: value for key, value in entry.items() if key not in _PLACE})

    while True:
        while due(rerun.simulation.t + rerun.simulation.h):  # inputs from this instant
            act()
        h = rerun.simulation.h
        while instant < rerun.simulation.t + 0.5 * h or _is_between(instant, h):
            instant = next(instants, math.inf)
        tick = min(rerun.simulation.t + run.setup.tick, instant, end)
        if tick < rerun.simulation.t + 0.5 * rerun.simulation.h:
            return
        while due(tick):
            act()
        rerun.go_to(round(tick / rerun.simulation.h))
        run.send()
        yield rerun.simulation.t


def _is_between(instant: float, h: float) -> bool:
    """Whether a logged instant (s) lies between steps of h (s), as with steps that the log does
    not have."""
    close = _CLOSE + _ROUNDED * math.ulp(instant)
    return instant < math.inf and abs(instant - round(instant / h) * h) > close
