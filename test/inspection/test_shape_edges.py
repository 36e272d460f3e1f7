"""Edges of shapes in the drawing of `check`."""

from __future__ import annotations

import math

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.inspection.mechanism_plot import Picture
from alf_ros.inspection.shape_edges import edges
from alf_ros.inspection.soundness import examine
from alf_ros.mechanism import VisualShape
from alf_ros.scene.scene import load_scene

AT, TURNED = (0.3, -0.2, 0.5), (0.0, math.pi / 2.0, 0.0)  # z of the shape is x of the body


def corners(shape: VisualShape) -> Floats:
    return np.vstack(edges(shape)) - AT


def test_of_a_box() -> None:
    found = corners(VisualShape('box', (0.2, 0.4, 0.6), AT, TURNED))
    assert np.abs(found) == pytest.approx(np.tile([0.3, 0.2, 0.1], (len(found), 1)))
    assert len(np.unique(found.round(9), axis=0)) == 8


def test_of_a_cylinder() -> None:
    found = corners(VisualShape('cylinder', (0.1, 0.6), AT, TURNED))
    assert np.hypot(found[:, 1], found[:, 2]) == pytest.approx(np.full(len(found), 0.1))
    assert np.abs(found[:, 0]) == pytest.approx(np.full(len(found), 0.3))


def test_of_a_capsule_and_a_mesh() -> None:
    found = corners(VisualShape('capsule', (0.1, 0.6), AT, TURNED))
    axis = np.clip(found[:, 0], -0.3, 0.3)
    from_axis = np.linalg.norm(found - np.column_stack([axis, 0.0 * axis, 0.0 * axis]), axis=1)
    assert from_axis.max() == pytest.approx(0.1)
    assert np.abs(found[:, 0]).max() == pytest.approx(0.4)
    assert edges(VisualShape('mesh', (1.0, 1.0, 1.0), file='/x.stl')) == []


def test_the_picture_has_room_for_them() -> None:
    """A wheel on an axle: its point is the only place that the drawing had."""
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'spatial',
                'points': {'C': {'at': [0, 0, 0.5], 'fixed': True}},
                'bodies': {
                    'wheel': {
                        'points': ['C'],
                        'mass': 1.0,
                        'inertia': {'about_com': [0.1, 0.2, 0.1]},
                        'shapes': [{'cylinder': {'radius': 0.4, 'length': 0.1}}],
                    }
                },
                'joints': {
                    'hub': {
                        'type': 'revolute',
                        'between': ['ground', 'wheel'],
                        'at': 'C',
                        'axis': [0, 0, 1],
                    }
                },
            }
        }
    )
    picture = Picture(examine(scene))
    assert (picture.low[:2] < -0.4).all() and (picture.high[:2] > 0.4).all()
    assert {colour for colour, _ in picture.shapes} == {'#0072b2'}
