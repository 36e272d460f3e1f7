"""Equality of every bit."""

from __future__ import annotations

from alf_ros import Sample
from alf_ros.simulation.state import State


def same(one: Sample | State, two: Sample | State) -> bool:
    """Whether place and velocities are the same numbers."""
    return one.q.tobytes() == two.q.tobytes() and one.qd.tobytes() == two.qd.tobytes()
