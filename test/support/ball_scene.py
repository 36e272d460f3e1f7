"""A scene with balls that stand for revolutes in a row: a crank, and two rods on balls."""

BALLS = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [0.4, 0, 0]}
    B: {at: [0.6, 0.1, -0.2]}
    C: {at: [0.8, 0.3, -0.1]}
  bodies:
    crank: {points: [O, A], mass: 1, inertia: {about_com: [0.01, 0.02, 0.03]}}
    upper: {points: [A, B], mass: 1, inertia: {about_com: [0.01, 0.02, 0.02]}}
    lower: {points: [B, C], mass: 1, inertia: {about_com: [0.01, 0.02, 0.02]}}
  joints:
    pin: {type: revolute, between: [ground, crank], at: O, axis: [0, 1, 0]}
    hip:
      type: spherical
      between: [crank, upper]
      at: A
      angles: {yaw: [0, 0, 1], roll: [1, 0, 0], pitch: [0, 1, 0]}
    knee:
      type: spherical
      between: [lower, upper]
      at: B
      angles: {first: [1, 0, 0], second: [0, 1, 0], third: [0.6, 0, -0.8]}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  torsion_spring: {joint: pin, stiffness: 2}
"""
NAMES = 'pin', 'yaw', 'roll', 'pitch', 'first', 'second', 'third'
