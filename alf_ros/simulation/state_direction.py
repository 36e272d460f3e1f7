"""A direction of the state, which tangents follow like a number of the scene.

A tangent is linear in where it begins. The direction `state.0` begins where the restored
`State.tangents` says. The scene does not change with it.
"""

from __future__ import annotations

import re

from alf_ros.simulation.still_scene import StillScene

_NAME = re.compile(r'state\.\d+')


def is_direction(name: str) -> bool:
    """Whether the name is of a direction of the state: `state.0`, `state.1`, …"""
    return _NAME.fullmatch(name) is not None


class StateDirection(StillScene):
    """The slopes by a direction of the state."""
