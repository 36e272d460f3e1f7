"""`tf`: the frame of every body in the world, flat, so that closed loops do not matter.

The bytes are put together here, because tf2_msgs comes only with a ROS 2 installation.
"""

from __future__ import annotations

from alf_ros.logs.cdr import Encoder, Template
from alf_ros.ros.messages.templates import WORLD, Write
from alf_ros.simulation.display_geometry import Display, poses
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sensors import Sensors
from alf_ros.simulation.simulation import Simulation


def transforms(simulation: Simulation, display: Display) -> Write | None:
    """The writer of a tf2_msgs/TFMessage: `world` to each body, and to each sensor with a frame of
    its own; None without bodies."""
    model = simulation.model
    if not model.body_names:
        return None
    sensors = Sensors(simulation.scene)
    message = Encoder()
    message.integer(len(model.body_names) + len(sensors.framed))
    stamps, blocks = [], []
    for name in (*model.body_names, *sensors.framed):
        stamps.append(message.stamp())
        message.text(WORLD)
        message.text(display.frame_prefix + name)
        blocks.append((message.numbers(7), 7))  # translation x y z, rotation x y z w
    template = Template(message.data, stamps, blocks)

    def write(sample: Sample, ns: int) -> bytes:
        template.stamp(ns)
        frames = [*poses(sample), *(sensors.frame(sample, label) for label in sensors.framed)]
        for block, pose in zip(template.blocks, frames, strict=True):
            block[:] = pose
        return template.bytes()

    return write
