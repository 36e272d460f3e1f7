"""The panels of the page, in order: the quantities in each, with their unit."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple


class Panel(NamedTuple):
    """`log`: the values go over decades; `steps`: each holds until the next."""

    title: str
    unit: str
    log: bool = False
    steps: bool = False


PANELS = {
    'position.angle': Panel('Joint angles', 'rad'),
    'position.length': Panel('Joint displacements', 'm'),
    'position': Panel('Joint positions', 'rad or m'),
    'velocity.angle': Panel('Joint rates', 'rad/s'),
    'velocity.length': Panel('Joint velocities', 'm/s'),
    'velocity': Panel('Joint velocities', 'rad/s or m/s'),
    'effort.angle': Panel('Joint torques', 'N m'),
    'effort.length': Panel('Joint forces', 'N'),
    'effort': Panel('Joint efforts', 'N m or N'),
    'force': Panel('Reaction forces, of parent on child', 'N'),
    'torque': Panel('Reaction torques, of parent on child', 'N m'),
    'energy': Panel('Mechanical energy', 'J'),
    'work': Panel('Work of each effect', 'J'),
    'violation': Panel('Constraint violation', 'as the constraints are written', log=True),
    'distance': Panel('Distance to a singular position', '0 at it, 1 far away', log=True),
    'step_error': Panel('Estimated errors of the steps', 'of the size', log=True),
    'iterations': Panel('Iterations of a solve', '', steps=True),
    'cost': Panel('Cost of a step, lateness of a tick', 's', log=True, steps=True),
    'ordered_effort': Panel('Efforts commanded', 'N m or N', steps=True),
    'ordered_position': Panel('Positions commanded', 'rad or m', steps=True),
    'wrench': Panel('Forces commanded', 'N', steps=True),
}
# Of errors only the peaks count.
PEAKS = ('violation',)
_OF_JOINTS = ('position', 'velocity', 'effort')


def place(panel: str, name: str, angles: Collection[str] | None) -> str:
    """The panel in which a signal is drawn: joints by their unit, where `angles` tells which of
    them turn."""
    if panel not in _OF_JOINTS or angles is None:
        return panel
    return f'{panel}.{"angle" if name in angles else "length"}'


def panel(key: str) -> Panel:
    """The panel of a topic; topics that others added have a panel of their own."""
    return PANELS.get(key) or Panel(key, 'as recorded')


def ordered(keys: Collection[str]) -> list[str]:
    """Panels in the order of the page."""
    return [key for key in PANELS if key in keys] + sorted(set(keys) - PANELS.keys())
