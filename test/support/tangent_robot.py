"""A four-bar with an effect of every kind, and numbers of all kinds that it changes with."""

from __future__ import annotations

from support.thorough import LONG

ROBOT = """
mechanism:
  alf: 1
  space: planar
  parameters: {a: 1.0, m: 2.0}
  points:
    O: {at: [0, 0], fixed: true}
    W: {at: [2, 1.5], fixed: true}
    C: {at: [2.2, 0.1], fixed: true}
    A: {at: [0, a]}
    B: {at: [2, 1.2]}
  bodies:
    crank: {points: [O, A], mass: m, inertia: {about_com: 0.3}, com: [0.4, 0.1]}
    coupler: {points: [A, B], mass: 1.0, inertia: rod}
    rocker: {points: [C, B], mass: 0.5, inertia: {about_com: 0.2}}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O}
    knee: {type: revolute, between: [crank, coupler], at: A}
    wrist: {type: revolute, between: [coupler, rocker], at: B}
    foot: {type: revolute, between: [ground, rocker], at: C}
effects:
  gravity: {acceleration: [0.3, -9.81]}
  spring: {pull: {between: [A, W], stiffness: 40, free_length: 0.8}}
  damper: {oil: {between: [B, W], damping: 1.5}}
  torsion_spring: {coil: {joint: knee, stiffness: 3, damping: 0.1}}
  joint_friction:
    rub: {joint: foot, viscous: 0.2, dynamic: 0.1, load: 10, radius: 0.02, slip: 0.1}
  tendon:
    cord: {path: [A, [coupler, ~], W], weights: [1, 0.5], stiffness: 9, free_length: 1, damping: 1}
    belt: {joints: [[pin, 0.5], [knee, -1]], stiffness: 2, friction: 0.3, slip: 0.1}
  motor:
    drive: {joint: pin, position: [[0, 0], [1, 2]], position_gain: 20, velocity_gain: 1,
            armature: 0.07}
  drag: {air: {on: coupler, linear: 0.2, quadratic: 0.3, wind: [1, 0]}}
initial: {velocities: {A: [1.5, ~]}}
solver: {step: 1.0e-3}
"""
NUMBERS = (
    'm',
    'a',
    'coupler.mass',
    'crank.inertia.about_com',
    'crank.com.1',
    'mechanism.points.C.at.0',
    'mechanism.points.B.at.1',
    'gravity.acceleration.0',
    'pull.stiffness',
    'pull.free_length',
    'oil.damping',
    'coil.stiffness',
    'rub.dynamic',
    'rub.viscous',
    'cord.weights.1',
    'cord.damping',
    'belt.joints.0.1',
    'belt.friction',
    'drive.position_gain',
    'drive.position.1.1',
    'drive.armature',
    'air.quadratic',
    'air.wind.0',
    'initial.velocities.A.0',
)
# Eight have the code of many tests; for more of them each effect would be compiled again.
AT_ONCE = len(NUMBERS) if LONG else 8
GROUPS = [NUMBERS[k : k + AT_ONCE] for k in range(0, len(NUMBERS), AT_ONCE)]
