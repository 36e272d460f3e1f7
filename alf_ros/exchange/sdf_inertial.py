"""The `<inertial>` of a link of SDF."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import FramePose
from alf_ros.exchange.sdf_frames import pose_of
from alf_ros.exchange.sdf_values import Refuse, number

MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')


def states_mass(inertial: ElementTree.Element | None) -> bool:
    """Whether it has a mass, and not the default of SDF."""
    return inertial is not None and bool((inertial.findtext('mass') or '').strip())


def inertial_of(
    inertial: ElementTree.Element | None, refuse: Refuse, name: str
) -> tuple[float, FramePose, Floats]:
    """Mass (kg), pose in the frame of the link, and inertia (3, 3) there, kg m^2.

    Where something is absent they are as SDF has it: 1 kg, and 1 kg m^2 about every axis. Raises
    the error.
    """
    pose, inertia = (None if inertial is None else inertial.find(t) for t in ('pose', 'inertia'))
    frame = pose_of(pose, refuse, name)
    mass = number(inertial, 'mass', 1.0, refuse, name)
    ixx, ixy, ixz, iyy, iyz, izz = (
        number(inertia, key, float(key[1] == key[2]), refuse, name) for key in MOMENTS
    )
    return mass, frame, np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
