"""Small mechanisms whose motion under one effect has a closed form."""

from __future__ import annotations

import math
from typing import Any

from alf_ros import Simulation, load_scene
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
# a rod on a pin, along x; L = 1 m, m = 2 kg
PENDULUM = """
mechanism:
  alf: 1
  space: planar
  parameters: {L: 1.0}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [L, 0]}
  bodies:
    rod: {points: [O, A], mass: 2.0, inertia: rod}
  joints:
    pin: {type: revolute, between: [ground, rod], at: O}
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
# a skate on an incline, across it
SKATE_RATE = 1.3  # rad/s
SKATE_DOWNHILL = 9.81 * math.sin(0.2)

SKATE = f"""
mechanism:
  alf: 1
  points: {{A: {{at: [0, 0]}}, B: {{at: [1, 0]}}}}
  bodies:
    skate: {{points: [A, B], mass: 2.0, inertia: {{about_com: 0.3}}, com: [0, 0]}}
  joints:
    edge: {{type: blade, between: [ground, skate], at: A, axis: [1, 0]}}
effects:
  gravity: {{acceleration: [{SKATE_DOWNHILL}, 0]}}
initial:
  velocities: {{A: [0, 0], B: [0, {SKATE_RATE}]}}
"""
# a body in space on a ball joint, under gravity
TOP = {
    'mechanism': {
        'alf': 1,
        'space': 'spatial',
        'points': {
            'O': {'at': [0.1, 0.2, 0.3], 'fixed': True},
            'P': {'at': [1.0, 0.5, 0.9]},
            'Q': {'at': [0.4, 1.1, 0.6]},
            'R': {'at': [0.2, 0.3, 1.4]},
        },
        'bodies': {
            'top': {
                'points': ['O', 'P', 'Q', 'R'],
                'mass': 2,
                'com': [0.5, 0.1, 0.2],
                'inertia': {'about_com': [0.1, 0.2, 0.25]},
            }
        },
        'joints': {'ball': {'type': 'spherical', 'between': ['ground', 'top'], 'at': 'O'}},
    },
    'effects': {'gravity': {'acceleration': [0, 0, -9.81]}},
}


def simulate(
    mechanism: str, effects: str, velocities: str = '', positions: str = '', step: float = 1e-3
) -> Simulation:
    """The mechanism with effects and initial values, in the text of a scene."""
    scene = scene_from_text(
        f'{mechanism}\neffects: {{{effects}}}\n'
        f'initial: {{velocities: {{{velocities}}}, positions: {{{positions}}}}}\n'
    )
    return Simulation(scene, step=step, integrator='dop853')


def rubbing_pendulum(friction: dict[str, Any], **velocities: Any) -> Simulation:
    """A pendulum of 1 m and 2 kg, drawn along x, with friction in its pin."""
    return Simulation(
        load_scene(
            {
                'mechanism': {
                    'alf': 1,
                    'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                    'bodies': {'rod': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
                    'joints': {
                        'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}
                    },
                },
                'effects': {
                    'gravity': {'acceleration': [0, -9.81]},
                    'joint_friction': {'joint': 'pin', **friction},
                },
                'initial': {'velocities': velocities},
                'solver': {'step': 1e-3, 'integrator': 'dop853'},
            }
        )
    )
