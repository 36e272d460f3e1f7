"""A joint of each type, between two bodies that lie askew and hang together by it alone."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros import Simulation
from alf_ros.scene.scene import Scene, scene_from_text

PLANE = """
mechanism:
  alf: 1
  points:
    O: {{at: [0.1, 0.2], fixed: true}}
    A: {{at: [1, 0.5]}}
    A2: {{at: [{second}]}}
    B: {{at: [1.7, 1.3]}}
    C: {{at: [1.4, -0.2]}}
  bodies:
    one: {{points: [O, A, C], mass: 1.3, inertia: {{about_com: 0.2}}, com: [0.4, 0.1]}}
    two: {{points: [{at}, B], mass: 0.7, inertia: {{about_com: 0.1}}, com: [0.3, -0.2]}}
  joints:
    pin: {{type: revolute, between: [ground, one], at: O}}
    {more}joint: {joint}
effects: {{gravity: {{acceleration: [1.0, -9.81]}}}}
initial: {{velocities: {{A: [~, 0.8]}}}}
"""

SPACE = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {{at: [0.1, 0.2, -0.1], fixed: true}}
    A: {{at: [1, 0.5, 0.3]}}
    A2: {{at: [{second}]}}
    B: {{at: [1.7, 1.3, 0.1]}}
  bodies:
    one:
      {{points: [O, A], mass: 1.3, inertia: {{about_com: [0.1, 0.2, 0.15]}}, com: [0.4, 0.1, 0]}}
    two:
      points: [{at}, B]
      mass: 0.7
      inertia: {{about_com: [0.1, 0.12, 0.2, 0.01, -0.02, 0.005]}}
      com: [0.3, -0.2, 0.1]
  joints:
    ball: {{type: spherical, between: [ground, one], at: O}}
    joint: {joint}
effects: {{gravity: {{acceleration: [1.0, 0.5, -9.81]}}}}
initial: {{velocities: {{A: [~, 0.8, 0.3], B: [~, 0.4, ~]}}}}
"""


@dataclass(frozen=True)
class Case:
    """A joint, and how many of its child's freedoms it leaves. `shared`: at a point of both."""

    text: str
    free: int
    shared: bool = False
    pinned: bool = False  # to `one` besides: it keeps wheels where they touch


AXIS = '[0.3, -0.4, 1.0]'
LINE = 'on: {through: [0.2, 0.1], direction: [3, 1]}'
FLOOR = 'on: {through: [0, 0, 0], normal: [0.1, 0.2, 1]}'
PLANAR_CASES = {
    'revolute': Case('{type: revolute, between: [one, two], at: A}', 1, True),
    'slider': Case(f'{{type: slider, point: B, {LINE}}}', 2),
    'prismatic': Case('{type: prismatic, between: [one, two], at: A2, axis: [1, 2]}', 1),
    'weld': Case('{type: weld, between: [one, two], at: A2}', 0),
    'gear': Case(
        '{type: gear, between: [ground, two], centres: [O, A], '
        'radii: ["0.6*hypot(0.9, 0.3)", "0.4*hypot(0.9, 0.3)"]}',
        2,
        pinned=True,
    ),
    'rolling': Case(
        '{type: rolling, between: [ground, two], centres: [O, A2], '
        'radii: ["0.6*hypot(0.9, 0.3)", "0.4*hypot(0.9, 0.3)"]}',
        1,
    ),
    'rack': Case(
        '{type: rack, between: [one, two], at: A, radius: 0.4, '
        'on: {through: [0, 0.1], direction: [1, 0]}}',
        2,
        pinned=True,
    ),
    'blade': Case('{type: blade, between: [ground, two], at: B, axis: [2, 1]}', 2),
    'no_slip': Case(f'{{type: no_slip, between: [ground, two], at: B, radius: 0.4, {LINE}}}', 1),
}
SPATIAL_CASES = {
    'spherical': Case('{type: spherical, between: [one, two], at: A}', 3, True),
    'revolute': Case(f'{{type: revolute, between: [one, two], at: A2, axis: {AXIS}}}', 1),
    'universal': Case(
        '{type: universal, between: [one, two], at: A, axes: [[0, 0.6, 0.8], [1, 0, 0]]}', 2, True
    ),
    'cylindrical': Case(f'{{type: cylindrical, between: [one, two], at: A2, axis: {AXIS}}}', 2),
    'screw': Case(f'{{type: screw, between: [one, two], at: A2, axis: {AXIS}, pitch: 0.9}}', 1),
    'prismatic': Case(f'{{type: prismatic, between: [one, two], at: A2, axis: {AXIS}}}', 1),
    'planar': Case(f'{{type: planar, between: [one, two], at: A2, axis: {AXIS}}}', 3),
    'weld': Case('{type: weld, between: [one, two], at: A2}', 0),
    'perpendicular': Case(
        '{type: perpendicular, between: [one, two], axes: [[0, 0.6, 0.8], [1, 0, 0]]}', 5
    ),
    'distance': Case('{type: distance, between: [one, two], points: [A, B]}', 5),
    'no_slip': Case(f'{{type: no_slip, between: [ground, two], at: B, radius: 0.4, {FLOOR}}}', 3),
    'disk': Case(
        '{type: disk, between: [ground, two], at: B, radius: 0.4, axle: [1, 0.2, 0.4], '
        f'{FLOOR}}}',
        3,
    ),
}
CASES = [(2, kind) for kind in PLANAR_CASES] + [(3, kind) for kind in SPATIAL_CASES]


def scene_of(dimension: int, kind: str) -> Scene:
    case = (PLANAR_CASES if dimension == 2 else SPATIAL_CASES)[kind]
    apart = kind in ('perpendicular', 'distance', 'slider', 'blade', 'no_slip', 'disk')
    there = '0.8, 0.9, 0.6' if apart else '1, 0.5, 0.3'
    if dimension == 2:
        there = '0.8, 0.9' if apart else '1, 0.5'
    second = there
    together = case.shared or case.pinned
    more = 'hinge: {type: revolute, between: [one, two], at: A}\n    ' if case.pinned else ''
    text = (PLANE if dimension == 2 else SPACE).format(
        joint=case.text, at='A' if together else 'A2', second=second, more=more
    )
    if together:  # nothing may be of no body
        text = text.replace(f'    A2: {{at: [{second}]}}\n', '')
    return scene_from_text(text)


def simulation(dimension: int, kind: str) -> Simulation:
    return Simulation(scene_of(dimension, kind), integrator='dop853', step=2e-3)
