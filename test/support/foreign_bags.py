"""MCAP files as rosbag2 writes them, by the writer of another package."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mcap_ros2.writer import Writer

_BAR = '=' * 80
_HEADER = f"""{_BAR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_BAR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINTS = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_HEADER}"""
WRENCH = f"""std_msgs/Header header
Wrench wrench
{_BAR}
MSG: geometry_msgs/Wrench
Vector3 force
Vector3 torque
{_BAR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_HEADER}"""
_TYPES = {'sensor_msgs/msg/JointState': JOINTS, 'geometry_msgs/msg/WrenchStamped': WRENCH}
Message = tuple[str, str, int, Mapping[str, Any]]  # topic, type, stamp (ns), content


def joints(topic: str, stamp: int, names: Sequence[str], **values: Sequence[float]) -> Message:
    """A JointState."""
    content: dict[str, Any] = {'header': _header(stamp), 'name': list(names)}
    for key in ('position', 'velocity', 'effort'):
        content[key] = [float(x) for x in values.get(key, ())]
    return topic, 'sensor_msgs/msg/JointState', stamp, content


def wrench(topic: str, stamp: int, force: Sequence[float], frame: str = '') -> Message:
    """A WrenchStamped without torque."""
    parts = {'force': dict(zip('xyz', force, strict=True)), 'torque': dict.fromkeys('xyz', 0.0)}
    content = {'header': _header(stamp, frame), 'wrench': parts}
    return topic, 'geometry_msgs/msg/WrenchStamped', stamp, content


def written(folder: Path, messages: Sequence[Message], late: int = 7_000_000) -> Path:
    """A bag: one file in a folder; it was written `late` (ns) after the stamps of the headers."""
    folder.mkdir()
    with open(folder / 'bag_0.mcap', 'wb') as stream:
        writer = Writer(stream)
        schemas = {kind: writer.register_msgdef(kind, text) for kind, text in _TYPES.items()}
        for number, (topic, kind, stamp, content) in enumerate(messages):
            when = stamp + late
            writer.write_message(topic, schemas[kind], content, when, when, number)
        writer.finish()
    return folder


def _header(stamp: int, frame: str = '') -> dict[str, Any]:
    seconds, rest = divmod(stamp, 1_000_000_000)
    return {'stamp': {'sec': seconds, 'nanosec': rest}, 'frame_id': frame}
