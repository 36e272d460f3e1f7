"""Small mechanisms whose motion under one effect has a closed form."""

from __future__ import annotations

from alf_ros import Simulation
from alf_ros.scene.scene import scene_from_text

# a point mass in the plane, free; m = 2 kg
MASS = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    P: {at: [1, 0]}
  bodies:
    mass: {points: [P], mass: 2.0, inertia: point}
"""
# a rotor in balance on a pin, along x; J = 0.5 kg m²
ROTOR = """
mechanism:
  alf: 1
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [1, 0]}
  bodies:
    rotor: {points: [O, A], mass: 1.0, inertia: {about_com: 0.5}, com: [0, 0]}
  joints:
    pin: {type: revolute, between: [ground, rotor], at: O}
"""
ROTOR_IN_SPACE = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [1, 0, 0]}
  bodies:
    rotor: {points: [O, A], mass: 1.0, inertia: {about_com: [1, 1, 0.5]}, com: [0, 0, 0]}
  joints:
    pin: {type: revolute, between: [ground, rotor], at: O, axis: [0, 0, 1]}
"""
# two rotors in balance, pinned to each other, free; J = 0.5 and 0.25 kg m²
TWO_ROTORS = """
mechanism:
  alf: 1
  points:
    P: {at: [0, 0]}
    A: {at: [1, 0]}
    B: {at: [0, 1]}
  bodies:
    one: {points: [P, A], mass: 1.0, inertia: {about_com: 0.5}, com: [0, 0]}
    two: {points: [P, B], mass: 1.0, inertia: {about_com: 0.25}, com: [0, 0]}
  joints:
    pin: {type: revolute, between: [one, two], at: P}
"""
# a disc, or a ball, of radius 0.1 m, free; J = ½ m r², or 2/5 m r², m = 2 kg
DISC = """
mechanism:
  alf: 1
  points:
    C: {at: [0, 0.1]}
    R: {at: [1, 0.1]}
  bodies:
    disc: {points: [C, R], mass: 2.0, inertia: {about_com: 0.01}, com: [0, 0]}
"""
BALL = """
mechanism:
  alf: 1
  space: spatial
  points:
    C: {at: [0, 0, 0.1]}
  bodies:
    ball: {points: [C], mass: 2.0, inertia: {about_com: [0.008, 0.008, 0.008]}}
"""


def simulate(
    mechanism: str, effects: str, velocities: str = '', positions: str = '', step: float = 1e-3
) -> Simulation:
    """The mechanism with effects and initial values, in the text of a scene."""
    scene = scene_from_text(
        f'{mechanism}\neffects: {{{effects}}}\n'
        f'initial: {{velocities: {{{velocities}}}, positions: {{{positions}}}}}\n'
    )
    return Simulation(scene, step=step, integrator='dop853')
