"""`tf`: the frame of every body in the world, flat, so that closed loops do not matter.

The bytes are put together here, because tf2_msgs comes only with a ROS 2 installation.
"""

from __future__ import annotations

from collections.abc import Callable

from alf_ros.logs.cdr import Encoder, Template
from alf_ros.model.compile import Model
from alf_ros.ros.messages.templates import WORLD
from alf_ros.simulation.display_geometry import Display, poses
from alf_ros.simulation.kinematics import Kinematics
from alf_ros.simulation.sensors import Sensors


def transforms(
    model: Model, display: Display, sensors: Sensors | None = None
) -> Callable[[Kinematics, int], bytes] | None:
    """The writer of a tf2_msgs/TFMessage: `world` to each body, and to each of the `sensors` with
    a frame of its own; None without bodies."""
    if not model.body_names:
        return None
    mounted = sensors.frames if sensors is not None else {}
    message = Encoder()
    message.integer(len(model.body_names) + len(mounted))
    stamps, blocks = [], []
    for name in (*model.body_names, *mounted):
        stamps.append(message.stamp())
        message.text(WORLD)
        message.text(display.frame_prefix + name)
        blocks.append((message.numbers(7), 7))  # translation x y z, rotation x y z w
    template = Template(message.data, stamps, blocks)

    def write(sample: Kinematics, ns: int) -> bytes:
        template.stamp(ns)
        frames = [*poses(sample), *(frame(sample) for frame in mounted.values())]
        for block, pose in zip(template.blocks, frames, strict=True):
            block[:] = pose
        return template.bytes()

    return write
