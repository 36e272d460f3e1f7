"""Positions of rest and natural frequencies of mechanisms with one freedom, at 30 digits.

    pip install mpmath==1.4.1
    python test/data/statics_30_digits.py > test/data/statics_30_digits.json

By hand, in one minimal coordinate θ: potential V(θ) and kinetic energy ½ m(θ) θ̇². At rest V' = 0,
and ω² = V'' / m. Nothing of alf_ros is used. Derivatives are differences of mpmath with 60 digits.
"""

from __future__ import annotations

import json
from collections.abc import Callable

from mpmath import acos, atan2, cos, diff, findroot, hypot, mp, mpf, nstr, sin, sqrt

mp.dps = 60
G = mpf('9.81')
Place = Callable[[mpf], mpf]


def bar(mass: mpf, x0: Place, y0: Place, x1: Place, y1: Place) -> tuple[Place, Place]:
    """The inertia m(θ) and the potential V(θ) of a slender rod between two points."""

    def inertia(angle: mpf) -> mpf:
        total = mpf(0)
        for a, b in ((x0, x1), (y0, y1)):
            u, v = diff(a, angle), diff(b, angle)
            total += mass * (u * u + u * v + v * v) / 3
        return total

    return inertia, lambda angle: mass * G * (y0(angle) + y1(angle)) / 2


def spring(stiffness: mpf, free: mpf, length: Place) -> Place:
    """The energy of a spring."""
    return lambda angle: stiffness * (length(angle) - free) ** 2 / 2


def rest(
    bars: list[tuple[Place, Place]],
    springs: list[Place],
    start: str,
    points: dict[str, list[Place]],
) -> dict[str, object]:
    """Of the position of rest near θ = `start`: θ, ω² (1/s²), and where points are (m)."""

    def V(angle: mpf) -> mpf:
        return sum(potential(angle) for _, potential in bars) + sum(s(angle) for s in springs)

    angle = findroot(lambda a: diff(V, a), mpf(start))
    inertia = sum(own(angle) for own, _ in bars)
    square = diff(V, angle, 2) / inertia
    places = {name: [nstr(each(angle), 30) for each in at] for name, at in points.items()}
    return {'angle': nstr(angle, 30), 'square': nstr(square, 30), 'points': places}


def zero(_: mpf) -> mpf:
    """A coordinate of a fixed point."""
    return mpf(0)


def fixed(x: int) -> Place:
    """Another one."""
    return lambda _: mpf(x)


def double_four_bar() -> list[dict[str, object]]:
    """IFToMM problem A02 with two four-bars, and a spring along the diagonal A0-B1."""

    def at(k: int) -> tuple[Place, Place]:
        return (lambda a: k + cos(a)), sin

    cranks = [bar(mpf(1), fixed(k), zero, *at(k)) for k in range(3)]
    couplers = [bar(mpf(1), *at(k), *at(k + 1)) for k in range(2)]
    diagonal = spring(mpf(100), mpf(1), lambda a: hypot(1 + cos(a), sin(a)))
    points = {f'B{k}': list(at(k)) for k in range(3)}
    return [rest(cranks + couplers, [diagonal], start, points) for start in ('-2.2', '1.2', '2')]


def four_bar() -> list[dict[str, object]]:
    """The crank-rocker of the library with a spring along the diagonal A-C, on its open branch."""
    a, b, c, d = mpf('0.10'), mpf('0.30'), mpf('0.25'), mpf('0.30')
    density = mpf('0.54')

    def diagonal(t: mpf) -> mpf:
        return hypot(d - a * cos(t), a * sin(t))

    def beta(t: mpf) -> mpf:
        f = diagonal(t)
        turn = acos((f * f + b * b - c * c) / (2 * f * b))
        return atan2(-a * sin(t), d - a * cos(t)) + turn

    def ax(t: mpf) -> mpf:
        return a * cos(t)

    def ay(t: mpf) -> mpf:
        return a * sin(t)

    def bx(t: mpf) -> mpf:
        return ax(t) + b * cos(beta(t))

    def by(t: mpf) -> mpf:
        return ay(t) + b * sin(beta(t))

    bars = [
        bar(density * a, zero, zero, ax, ay),
        bar(density * b, ax, ay, bx, by),
        bar(density * c, lambda t: d, zero, bx, by),
    ]
    springs = [spring(mpf(500), mpf('0.2'), diagonal)]
    return [rest(bars, springs, at, {'A': [ax, ay], 'B': [bx, by]}) for at in ('-0.31', '3.1')]


def slider_crank() -> list[dict[str, object]]:
    """The slider-crank of the library with a spring from A to the fixed point at (0.5, 1)."""

    def bx(t: mpf) -> mpf:
        return cos(t) + sqrt(1 - sin(t) ** 2)

    bars = [
        bar(mpf(1), zero, zero, cos, sin),
        bar(mpf(1), cos, sin, bx, zero),
    ]
    springs = [spring(mpf(60), mpf('0.3'), lambda t: hypot(cos(t) - mpf('0.5'), sin(t) - 1))]
    points = {'A': [cos, sin], 'B': [bx, zero]}
    return [rest(bars, springs, start, points) for start in ('0.8',)]


if __name__ == '__main__':
    found = {each.__name__: each() for each in (double_four_bar, four_bar, slider_crank)}
    print(json.dumps(found, indent=1))
