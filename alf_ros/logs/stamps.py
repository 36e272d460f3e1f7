"""Stamps: the simulated time as ROS tells it."""

from __future__ import annotations


def stamp_ns(t: float, ahead: int = 0) -> int:
    """Stamp (ns) of the simulated time `t` (s), to the nearest nanosecond, and `ahead` (ns) more.

    A stamp of zero means "no time yet" in ROS, so the initial state at t = 0 is stamped 1 ns.
    """
    return max(1, round(t * 1e9) + ahead)
