"""Symbols of joints and limbs of bodies, on the page and in markers, at any position."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import MarkerArray

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.logs import load
from alf_ros.logs.report.summary import account
from alf_ros.ros.messages.markers import markers
from alf_ros.simulation.display_geometry import Display
from support.log_files import make

GRAVITY = {'gravity': {'acceleration': [0.0, -9.81]}}
CYLINDER: dict[str, Any] = {  # a ram whose rod slides in a barrel that turns; the joint is at no
    'mechanism': {  # point of the rod
        'alf': 1,
        'space': 'planar',
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'E': {'at': [0.4, 0]},
            'T': {'at': [0.9, 0]},
            'S': {'at': [0.7, 0]},
        },
        'bodies': {
            'barrel': {'points': ['O', 'E'], 'mass': 1, 'inertia': 'rod'},
            'rod': {'points': ['T', 'S'], 'mass': 1, 'inertia': 'rod'},
        },
        'joints': {
            'foot': {'type': 'revolute', 'between': ['ground', 'barrel'], 'at': 'O'},
            'ram': {
                'type': 'prismatic',
                'between': ['barrel', 'rod'],
                'at': 'E',
                'axis': [1, 0],
            },
        },
    },
    'effects': GRAVITY,
}


def drawn(simulation: Simulation) -> dict[str, Floats]:
    """Places of markers by namespace."""
    data = markers(simulation.model, Display(force_scale=0.1))(simulation.sample(), 1)
    found = deserialize_message(data, MarkerArray).markers
    return {m.ns: np.array([(p.x, p.y, p.z) for p in m.points]).reshape(-1, 3) for m in found}


def test_a_slider_lies_on_its_rail() -> None:
    simulation = Simulation(load_scene('slider_crank'))
    simulation.step(300)
    lines = drawn(simulation)['symbols'].reshape(-1, 2, 3)
    rail, *box = lines
    slider = simulation.sample().points['B'][0]
    assert slider != pytest.approx(simulation.model.q[2], abs=0.1)
    assert np.ptp(rail[:, 1]) == 0.0
    assert rail[:, 0].mean() == pytest.approx(slider)
    corners = np.array(box).reshape(-1, 3)
    assert corners.mean(axis=0) == pytest.approx([slider, 0.0, 0.0], abs=1e-9)
    assert corners[:, 1].min() == pytest.approx(rail[0, 1])


def test_a_cylinder_shows_its_guide_its_limb_and_its_reaction() -> None:
    simulation = Simulation(load_scene(CYLINDER))
    simulation.step(200)
    sample, found = simulation.sample(), drawn(simulation)
    along = sample.points['E'] / np.linalg.norm(sample.points['E'])
    assert abs(along[1]) > 0.1
    lines = found['symbols'].reshape(-1, 2, 3)[..., :2]
    guide = lines[0, 1] - lines[0, 0]
    assert abs(guide @ along) == pytest.approx(np.linalg.norm(guide))
    place = sample.points['T'] + 0.5 * (sample.points['E'] - sample.points['O']) / 0.4 * -1.0
    assert lines[0].mean(axis=0) == pytest.approx(place)
    limb = found['links'].reshape(-1, 2, 3)[-1, :, :2]
    assert limb == pytest.approx(np.array([sample.points['T'], place]))
    arrows = found['reactions'].reshape(-1, 6, 3)[..., :2]
    assert len(arrows) == 2
    assert arrows[1, 0] == pytest.approx(place)
    force = sample.reactions['ram'].force
    assert np.linalg.norm(force) > 1.0
    assert arrows[1, 1] - place == pytest.approx(0.1 * np.array(force))


def test_the_page_has_the_same(tmp_path: Path) -> None:
    path, simulation = make(tmp_path, CYLINDER, ticks=100)
    motion = account(load(path.parent)).motion
    assert motion is not None
    found, last = drawn(simulation), motion.places[-1]
    assert last[motion.symbols] == pytest.approx(found['symbols'], abs=1e-9)
    assert last[motion.links] == pytest.approx(found['links'], abs=1e-9)
    (_, points, forces) = motion.forces[0]
    tails = found['reactions'].reshape(-1, 6, 3)[:, 0]
    assert sorted(map(tuple, np.round(last[points], 9))) == sorted(map(tuple, np.round(tails, 9)))
    assert forces.shape[1] == 2
