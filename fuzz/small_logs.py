"""Small logs to change, written in one thread and in the same chunks every time: a case has the
same changes in every process."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from alf_ros import load_scene
from alf_ros.logs import provenance
from alf_ros.ros.recording.mcap_file import LogFile
from alf_ros.ros.recording.run_writer import RECORDED, RunWriter, full_names
from alf_ros.simulation import setup as settings

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

SCENES = {'slider_crank': True, 'rolling_disk': False}  # whether with the ledger of works
TICKS = 12
PUSHED = (3, 6)  # ticks that begin with another wrench
CHUNK = 5  # ticks


def small_logs(folder: Path) -> list[bytes]:
    """A log of each scene, written in `folder`."""
    return [_log(folder / f'{scene}.mcap', scene, ledger) for scene, ledger in SCENES.items()]


def _log(path: Path, scene: str, ledger: bool) -> bytes:
    setup = settings.made(load_scene(scene), {}, ledger=ledger)
    simulation, names = setup.simulation, full_names()
    said = provenance.start(setup, 0, names)
    file = LogFile(path, provenance.record(said, setup.scene))
    numbers: dict[str, int] = {}

    def write(
        topic: str,
        kind: type,
        qos: QoSProfile,
        stamp: int,
        data: bytes,
        essential: bool = False,
    ) -> None:
        numbers[topic] = numbers.get(topic, 0) + 1
        file.add(topic, kind, qos, stamp, data, numbers[topic])

    run = RunWriter(write, setup, 0, names, RECORDED)
    run.note({'kind': 'start', **said})
    run.send()
    for tick in range(1, TICKS + 1):
        if tick in PUSHED:
            force = [1.0 / tick] + [0.0] * (simulation.model.layout.dimension - 1)
            on = simulation.model.body_names[-1]
            wrench = {'name': on, 'torque': 0.0, 'force': force, 'frame': 'world'}
            simulation.apply_wrench(**wrench)
            run.note({'kind': 'wrench', 'cause': 'command', **wrench})
        simulation.step(setup.steps)
        run.send()
        if tick % CHUNK == 1:
            file.flush()
    file.finish()
    return path.read_bytes()
