"""Ports of Fast DDS that a killed process left unfinished do not keep a node from starting."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from alf_ros.ros import unborn_ports
from support.ros_node import Peer, SimulatorProcess

SHARED = Path('/dev/shm')


def test_only_old_empty_ports_of_the_domain_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    for name, content, age in (
        ('fastdds_port8161', b'', 60.0),
        ('fastrtps_port8399', b'', 60.0),
        ('fastdds_port8165', b'x', 60.0),
        ('fastdds_port8400', b'', 60.0),
        ('fastdds_port8149', b'', 60.0),
        ('fastdds_port8161_el', b'', 60.0),
    ):
        (tmp_path / name).write_bytes(content)
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    found = {path.name for path in unborn_ports.remove(tmp_path)}
    assert found == {'fastdds_port8161', 'fastrtps_port8399'}
    assert len(list(tmp_path.iterdir())) == 4
    assert capsys.readouterr().err.count('a killed process left it unfinished\n') == 2
    assert unborn_ports.remove(tmp_path / 'none') == []
    monkeypatch.setenv('ROS_DOMAIN_ID', '²')
    assert unborn_ports.remove(tmp_path) == []


def test_a_young_one_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that is making a port gives it a size; one that was killed never does."""
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    monkeypatch.setattr(unborn_ports, '_AGE', 1.0)
    unfinished, made = tmp_path / 'fastdds_port8161', tmp_path / 'fastdds_port8163'
    unfinished.touch()
    made.touch()
    later = time.time() + 3600.0  # by a clock that was put back since
    os.utime(unfinished, (later, later))
    timer = threading.Timer(0.3, made.write_bytes, [b'x'])
    timer.start()
    assert unborn_ports.remove(tmp_path) == [unfinished]
    timer.join()
    assert list(tmp_path.iterdir()) == [made]


@pytest.mark.skipif(not os.access(SHARED, os.W_OK), reason='no shared memory to write')
@pytest.mark.parametrize('age', [60.0, 0.0])
def test_a_node_starts_beside_them(tmp_path: Path, peer: Peer, age: float) -> None:
    """The ports of the participants 1 to 4 are empty files: Fast DDS alone would wait for them."""
    first = 7400 + 250 * int(os.environ['ROS_DOMAIN_ID'])
    ports = [SHARED / f'fastdds_port{first + 11 + 2 * k}' for k in range(1, 5)]
    ports = [path for path in ports if not path.exists() or path.stat().st_size == 0]
    for path in ports:
        path.touch()
        os.utime(path, (time.time() - age,) * 2)
    assert ports
    with SimulatorProcess(tmp_path) as node:
        node.wait_running()
        assert 'a killed process left it unfinished' in node.output
        assert node.stop() == 0
