"""A mesh that tests write: a prism over the shape of an L, 1 m wide and tall, 0.5 m thick."""

from __future__ import annotations

import struct

import numpy as np

from alf_ros.arrays import Floats

# The notch of the L is where x and y are above 0.4.
_L = np.array([[0, 0], [1, 0], [1, 0.4], [0.4, 0.4], [0.4, 1], [0, 1]])
_FLAT = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]


def _wedge() -> Floats:
    low = np.column_stack([_L, np.zeros(6)])
    high = low + [0, 0, 0.5]
    found = [[low[c], low[b], low[a]] for a, b, c in _FLAT]
    found += [[high[a], high[b], high[c]] for a, b, c in _FLAT]
    for k in range(6):
        n = (k + 1) % 6
        found += [[low[k], low[n], high[n]], [low[k], high[n], high[k]]]
    return np.array(found)


WEDGE = _wedge()  # (triangles, 3, 3) m


def ascii_stl(triangles: Floats) -> bytes:
    """The text of an STL file."""
    lines = ['solid test']
    for corners in triangles:
        lines += ['facet normal 0 0 0', 'outer loop']
        lines += [f'vertex {x:g} {y:g} {z:g}' for x, y, z in corners]
        lines += ['endloop', 'endfacet']
    return '\n'.join([*lines, 'endsolid test', '']).encode()


def binary_stl(triangles: Floats) -> bytes:
    """The bytes of an STL file."""
    records = (struct.pack('<12fH', *3 * [0.0], *each.ravel(), 0) for each in triangles)
    return bytes(80) + struct.pack('<I', len(triangles)) + b''.join(records)
