"""Impossible inertias, and the least change that makes them possible.

The principal moments J of a body follow from positive second moments s of its mass: J = (s_y +
s_z, s_z + s_x, s_x + s_y), so none is negative and none exceeds the sum of the others. The nearest
such J, in the Frobenius norm, has the principal axes of the given one, because the condition is on
the moments alone: it is T s with s ≥ 0 and |T s - J| least (Lawson & Hanson, Solving Least Squares
Problems, ch. 23).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Robot

_T = np.ones((3, 3)) - np.eye(3)
_ROUNDED = 1e-15  # of mass times the square of the robot's size
_HARDLY = 1e-8  # of the largest moment: rounding may hide less
_ALLOWED = 1e-9  # of the largest moment: what the loader takes for rounding


def nearest(J: Floats) -> tuple[Floats, float]:
    """(3, 3) the nearest inertia that a body can have, and how far off it is, of the norm of J."""
    from scipy.optimize import nnls

    moments, axes = np.linalg.eigh(J)
    size = float(np.abs(moments).max())
    if size == 0.0:
        return J, 0.0
    moments = moments / size
    second, _ = nnls(_T, moments)
    found = _T @ second
    change = float(np.linalg.norm(found - moments) / np.linalg.norm(moments))
    return size * (axes @ np.diag(found) @ axes.T), change


def is_possible(J: Floats) -> bool:
    """Whether a body can have this inertia (3, 3), as the loader judges it."""
    low, middle, high = np.linalg.eigvalsh(J)
    return bool(low >= -1e-3 * _ALLOWED * high and low + middle >= high * (1.0 - _ALLOWED))


def may_lack(robot: Robot) -> bool:
    """Whether a part has no mass, or turns about an axis without inertia, or with hardly any."""
    moments = np.linalg.eigvalsh([part.inertia for part in robot.parts])
    least = _HARDLY * moments.max(initial=0.0)
    return bool((moments[:, 0] <= least).any()) or any(part.mass == 0.0 for part in robot.parts)


def checked(robot: Robot, repair: bool) -> None:
    """Repair the impossible inertias of a robot, or refuse them, and negative masses. Raises
    InputError.

    Rounding from the sum over the links of a part is set to zero.
    """
    for part in robot.parts:
        if part.mass < 0.0:
            own = next((link for link in part.links if link.mass < 0.0), part)
            raise robot.error(own.name, 'negative mass', own.at, value=own.mass)
    size = max([0.0, *(float(np.abs(part.com).max()) for part in robot.parts)])
    for n, part in enumerate(robot.parts):
        if 0.0 < np.abs(part.inertia).max() <= _ROUNDED * part.mass * size**2:
            robot.parts[n] = replace(part, inertia=np.zeros((3, 3)))
        if part.mass > 0.0 and not robot.parts[n].inertia.any():
            robot.leave('inertia: there is none', part.name)
    wrong = [n for n, part in enumerate(robot.parts) if not is_possible(part.inertia)]
    if not wrong:
        return
    changes = {n: nearest(robot.parts[n].inertia) for n in wrong}
    if not repair:
        part, most = robot.parts[wrong[0]], max(change for _, change in changes.values())
        # a sum of possible inertias is possible
        first = next((link for link in part.links if not is_possible(link.inertia)), part)
        others = f' (and {len(wrong) - 1} more)' if len(wrong) > 1 else ''
        raise robot.error(
            first.name,
            f'no body has such an inertia: each principal moment is at most the sum of the '
            f'others{others}',
            first.at,
            value=[float(f'{moment:.6g}') for moment in np.linalg.eigvalsh(first.inertia)],
            expected=f'--repair-inertia, which changes them by {100.0 * most:.2g} % at most',
        )
    for n, (J, change) in changes.items():
        robot.leave('inertia, repaired', f'{robot.parts[n].name} by {100.0 * change:.2g} %')
        robot.parts[n] = replace(robot.parts[n], inertia=J)
