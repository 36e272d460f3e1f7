"""A run made again from the scene and the journal of its log."""

from __future__ import annotations

from alf_ros import Simulation
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.saved_states import read_curve
from support.ros_node import Messages, journal


def repeat(log: Messages) -> dict[int, list[float]]:
    """Joint positions by stamp, from the scene and the journal in a log alone."""
    scene = scene_from_text(log['/simulator/scene'][0][1].data)
    start, *inputs = journal(log)
    simulation = Simulation(scene, **start['solver'])
    found = {}
    for stamp, _ in log['/joint_states']:
        step = round(stamp * 1e-9 / simulation.h)
        while inputs and inputs[0]['step'] < step:
            entry = inputs.pop(0)
            simulation.step(entry['step'] - simulation.step_index)
            if entry['kind'] == 'wrench':
                keys = ('name', 'force', 'torque', 'frame')
                simulation.apply_wrench(**{key: entry[key] for key in keys})
            elif entry['kind'] == 'target':
                position = read_curve(entry['position'])
                simulation.apply_target(entry['name'], position, entry['velocity'])
            else:
                simulation.apply_effort(entry['name'], read_curve(entry['effort']))
        simulation.step(step - simulation.step_index)
        found[stamp] = list(simulation.sample().joint_positions)
    return found
