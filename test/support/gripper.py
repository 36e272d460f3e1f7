r"""A gripper of our own: a ram between two bell-cranks, which a spring opens, with a damper.

The ram goes up and down and moves two links; each link turns one finger. There are two closed
loops and one freedom. SI units (m, s, kg, rad).

              S
              |   ram
              P
            .' '.        links
        C0 o     o C1
           |\   /|
           | o   o |     F0, F1: pivots of the fingers
            \|   |/
             T0 ~ T1     the spring and the damper are between the tips
"""

from __future__ import annotations

from typing import Any

AXIS = {'through': [0, 0], 'direction': [0, 1]}
GRIPPER: dict[str, Any] = {
    'name': 'gripper',
    'mechanism': {
        'alf': 1,
        'name': 'gripper',
        'space': 'planar',
        'parameters': {'finger': 0.08, 'ram': 0.05, 'link': 0.02},  # kg
        'points': {
            'S': {'at': [0, 0.09]},
            'P': {'at': [0, 0.05]},
            'F0': {'at': [-0.03, 0], 'fixed': True},
            'F1': {'at': [0.03, 0], 'fixed': True},
            'C0': {'at': [-0.045, 0.02]},
            'C1': {'at': [0.045, 0.02]},
            'T0': {'at': [-0.02, -0.07]},
            'T1': {'at': [0.02, -0.07]},
        },
        'bodies': {
            'ram': {'points': ['P', 'S'], 'mass': 'ram', 'inertia': 'rod'},
            'link0': {'points': ['P', 'C0'], 'mass': 'link', 'inertia': 'rod'},
            'link1': {'points': ['P', 'C1'], 'mass': 'link', 'inertia': 'rod'},
            'finger0': {'points': ['F0', 'T0', 'C0'], 'mass': 'finger', 'inertia': 'rod'},
            'finger1': {'points': ['F1', 'T1', 'C1'], 'mass': 'finger', 'inertia': 'rod'},
        },
        'joints': {
            'drive': {'type': 'slider', 'between': ['ground', 'ram'], 'point': 'P', 'on': AXIS},
            'bush': {'type': 'slider', 'point': 'S', 'on': AXIS},
            'head0': {'type': 'revolute', 'between': ['ram', 'link0'], 'at': 'P'},
            'head1': {'type': 'revolute', 'between': ['ram', 'link1'], 'at': 'P'},
            'elbow0': {'type': 'revolute', 'between': ['link0', 'finger0'], 'at': 'C0'},
            'elbow1': {'type': 'revolute', 'between': ['link1', 'finger1'], 'at': 'C1'},
            'pivot0': {'type': 'revolute', 'between': ['ground', 'finger0'], 'at': 'F0'},
            'pivot1': {'type': 'revolute', 'between': ['ground', 'finger1'], 'at': 'F1'},
        },
    },
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'spring': {'return': {'between': ['T0', 'T1'], 'stiffness': 150.0, 'free_length': 0.055}},
        'damper': {'oil': {'between': ['T0', 'T1'], 'damping': 2.0}},
        'joint_friction': {'seal': {'joint': 'drive', 'viscous': 1.0}},
    },
    'solver': {'step': 2e-3, 'integrator': 'rk4'},
}
