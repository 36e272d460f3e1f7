"""Motions through singular positions whose exact course is known: scene, times, exact q."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

from alf_ros.arrays import Floats
from alf_ros.scene.scene import Scene, load_scene
from alf_ros.studies.exact import one_freedom as exact

TEN_SECONDS = tuple(0.1 * k for k in range(101))


@dataclass(frozen=True)
class ExactMotion:
    """A scene, the times (s) of comparison, and its exact q (times, n), m.

    `start` tells motions of the same mechanism apart; `driven`: its energy is not constant.
    """

    mechanism: str
    start: str
    scene: Callable[[], Scene]
    times: tuple[float, ...]
    exact: Callable[[], Floats]
    driven: bool = False


@cache
def paper(name: str) -> ExactMotion:
    """The slider-crank of 6.2 or the two four-bars of 6.3, 10 s and 11 or 10 passes."""
    if name == 'slider_crank':
        alone, theta, rate = exact.slider_crank(), math.pi / 4, 2 * math.sqrt(2)
    else:
        alone, theta, rate = exact.four_bars(2), math.pi / 2, -1.0
    solution = cache(partial(alone.motion, theta, rate, TEN_SECONDS))
    return ExactMotion(name, 'as drawn', partial(load_scene, name), TEN_SECONDS, solution)


@cache
def four_bars(n: int, times: tuple[float, ...] = TEN_SECONDS[:16]) -> ExactMotion:
    """`n` four-bars; 1.5 s of it have two passes, at about 0.7 s and 1.2 s."""
    solution = cache(partial(exact.four_bars(n).motion, math.pi / 2, -1.0, times))
    return ExactMotion(
        'n_four_bar', f'N={n}', partial(load_scene, 'n_four_bar', {'N': n}), times, solution
    )


@cache
def change_point() -> ExactMotion:
    """The general four-bar, 4 s and 4 passes."""
    times, name = TEN_SECONDS[:41], 'change_point'
    solution = cache(partial(exact.change_point, times))
    return ExactMotion(name, 'as drawn', partial(load_scene, name), times, solution)


@cache
def start(
    name: str, offset: float, rate: float, times: tuple[float, ...] = TEN_SECONDS[:31]
) -> ExactMotion:
    """3 s from `offset` (rad) beyond the singular position, at `rate` (rad/s)."""
    crank = name == 'slider_crank'
    alone = exact.slider_crank() if crank else exact.four_bars(2)
    theta = math.pi / 2 + offset if crank else offset
    points = ('A', 'B') if crank else ('B0', 'B1', 'B2')

    def by_point(values: Floats) -> dict[str, list[float]]:
        return dict(zip(points, values.reshape(-1, 2).tolist(), strict=True))

    source = {
        'mechanism': name,
        'effects': {'gravity': {'acceleration': [0, -exact.GRAVITY]}},
        'initial': {
            'positions': by_point(alone.position(theta)),
            'velocities': by_point(alone.tangent(theta) * rate),
        },
    }
    solution = cache(partial(alone.motion, theta, rate, times))
    where = f'{offset:g} rad beyond it at {rate:g} rad/s'
    return ExactMotion(name, where, partial(load_scene, source), times, solution)
