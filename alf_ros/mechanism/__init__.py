"""The mechanism: points, bodies, joints and drives as frozen data, and its coordinates.

No YAML and no compiled code.
"""

from alf_ros.mechanism.parts import (
    GROUND,
    Bearing,
    Body,
    Coordinate,
    Coupling,
    Drive,
    Frame,
    Freedom,
    Joint,
    Mechanism,
    Numbers,
    Point,
    PrescribedBlock,
    Rotor,
    Vector,
)
from alf_ros.mechanism.visual_shapes import VisualShape

__all__ = [
    'GROUND',
    'Bearing',
    'Body',
    'Coordinate',
    'Coupling',
    'Drive',
    'Frame',
    'Freedom',
    'Joint',
    'Mechanism',
    'Numbers',
    'Point',
    'PrescribedBlock',
    'Rotor',
    'Vector',
    'VisualShape',
]
