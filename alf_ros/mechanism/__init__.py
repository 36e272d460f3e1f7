"""What exists: points, bodies, joints and drives as frozen data, and its coordinates.

No YAML and no compiled code.
"""

from alf_ros.mechanism.parts import (
    ANGLES,
    GROUND,
    LENGTHS,
    Body,
    Coordinate,
    Drive,
    Frame,
    Joint,
    Mechanism,
    Numbers,
    Point,
    Prescribed,
    Rotor,
    Vector,
)

__all__ = [
    'ANGLES',
    'GROUND',
    'LENGTHS',
    'Body',
    'Coordinate',
    'Drive',
    'Frame',
    'Joint',
    'Mechanism',
    'Numbers',
    'Point',
    'Prescribed',
    'Rotor',
    'Vector',
]
