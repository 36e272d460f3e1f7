"""`tf`: the frame of every body in the world, flat, so that closed loops do not matter.

The bytes are put together here, because tf2_msgs comes only with a ROS 2 installation.
"""

from __future__ import annotations

import struct

import numpy as np

from alf_ros.model.compile import Model
from alf_ros.ros.messages.templates import WORLD, Write
from alf_ros.simulation.display_geometry import Display, poses
from alf_ros.simulation.sample import Sample

_HEADER = b'\x00\x01\x00\x00'  # CDR, little endian; places count from behind it
_STAMP = struct.Struct('<iI')


class _Bytes:
    """CDR as it grows: every number at a multiple of its size."""

    def __init__(self) -> None:
        self.data = bytearray(_HEADER)

    def align(self, size: int) -> int:
        """Pad to a multiple of `size`; returns the place."""
        self.data += bytes(-(len(self.data) - len(_HEADER)) % size)
        return len(self.data)

    def integer(self, value: int) -> None:
        self.align(4)
        self.data += struct.pack('<I', value)

    def text(self, value: str) -> None:
        raw = value.encode() + b'\0'
        self.integer(len(raw))
        self.data += raw


def transforms(model: Model, display: Display) -> Write | None:
    """The writer of a tf2_msgs/TFMessage: `world` to each body; None without bodies."""
    if not model.body_names:
        return None
    message = _Bytes()
    message.integer(len(model.body_names))
    stamps, blocks = [], []
    for name in model.body_names:
        stamps.append(message.align(4))
        message.data += bytes(_STAMP.size)
        message.text(WORLD)
        message.text(display.frame_prefix + name)
        blocks.append(message.align(8))
        message.data += bytes(7 * 8)  # translation x y z, rotation x y z w
    data = message.data
    numbers = [np.frombuffer(data, np.float64, 7, at) for at in blocks]

    def write(sample: Sample, ns: int) -> bytes:
        stamp = divmod(ns, 1_000_000_000)
        for at, block, pose in zip(stamps, numbers, poses(sample), strict=True):
            _STAMP.pack_into(data, at, *stamp)
            block[:] = pose
        return bytes(data)

    return write
