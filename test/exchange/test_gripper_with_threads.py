"""A gripper like the one of the PR2: a screw of two threads moves two parallelogram fingers.

Of its rows many depend on others; rows of its threads bind velocities only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved

LENGTH, START, ASIDE, BASE = 0.09, 0.3, 0.03, 0.05  # m, rad, m, m
PITCH, MASS, MOMENT, LOSS, PULL = 0.2, 0.1, 1e-4, 0.002, 4.0  # m, kg, kg m^2, N m s, m/s^2
TIP = BASE + LENGTH * float(np.cos(START))


def link(name: str, x: float, y: float) -> str:
    moments = ''.join(f'<{each}>{MOMENT}</{each}>' for each in ('ixx', 'iyy', 'izz'))
    return f"""<link name="{name}"><pose>{x!r} {y!r} 0 0 0 0</pose><inertial><mass>{MASS}</mass>
<inertia>{moments}</inertia></inertial></link>"""


def joint(name: str, kind: str, ends: tuple[str, str], axis: str, more: str = '') -> str:
    return f"""<joint name="{name}" type="{kind}">
<parent>{ends[0]}</parent><child>{ends[1]}</child><axis><xyz>{axis}</xyz><dynamics><damping>{LOSS}</damping></dynamics></axis>{more}</joint>"""


def gripper() -> str:
    parts = [link('slider', TIP, 0.0), link('screw', TIP, 0.0)]
    parts.append(joint('slide', 'prismatic', ('world', 'slider'), '1 0 0'))
    parts.append(joint('motor', 'revolute', ('slider', 'screw'), '0 1 0'))
    for name, side in (('l', 1.0), ('r', -1.0)):
        y, inner = side * ASIDE, side * 0.01
        finger, tip, bar = (f'{name}_{each}' for each in ('finger', 'tip', 'bar'))
        parts.append(link(finger, BASE, y) + link(bar, BASE, y - inner))
        parts.append(link(tip, TIP, y + side * LENGTH * float(np.sin(START))))
        at = f'<pose>0 {-inner!r} 0 0 0 0</pose>'
        thread = f'<thread_pitch>{side * 2.0 * np.pi / PITCH!r}</thread_pitch>'
        parts += [
            joint(f'{name}_pin', 'revolute', ('world', finger), '0 0 1'),
            joint(f'{name}_knuckle', 'revolute', (finger, tip), '0 0 1'),
            joint(f'{name}_bar_pin', 'revolute', ('world', bar), '0 0 1'),
            joint(f'{name}_bar_tip', 'revolute', (bar, tip), '0 0 1', at),
            joint(f'{name}_thread', 'screw', ('screw', tip), '0 1 0', thread),
        ]
    return f"""<sdf version="1.6"><world name="w"><gravity>{PULL} 0 0</gravity>
<model name="m">{''.join(parts)}</model></world></sdf>"""


def reference(seconds: float) -> Floats:
    """The angles of the left finger and of the screw against the drawing, rad, by Lagrange's
    equation in the angle a of the finger: x = L cos a of tips and slider, y = L sin a of a tip."""

    def rate(_: float, y: Floats) -> tuple[float, float]:
        a, speed = y
        x, turn = -LENGTH * np.sin(a), 2.0 * np.pi / PITCH * LENGTH * np.cos(a)  # per da
        inertia = 2.0 * MASS * (x**2 + LENGTH**2) + 4.0 * MOMENT + MOMENT * turn**2
        slope = 2.0 * MASS * x * -LENGTH * np.cos(a)
        slope += MOMENT * turn * -2.0 * np.pi / PITCH * LENGTH * np.sin(a)
        losses = LOSS * (x**2 + 3.0 * turn**2 + 8.0)
        return speed, (4.0 * MASS * PULL * x - slope * speed**2 - losses * speed) / inertia

    found = solve_ivp(rate, (0.0, seconds), (START, 0.0), 'DOP853', rtol=1e-12, atol=1e-13)
    a = found.y[0, -1]
    return np.array([a - START, 2.0 * np.pi / PITCH * LENGTH * (np.sin(a) - np.sin(START))])


def test_the_fingers_move_as_lagrange_says(tmp_path: Path) -> None:
    text = imported(saved(tmp_path, 'it.sdf', gripper()), scene=True)
    assert 'Changes of the motion' not in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=5e-4)
    simulation.step(800)
    joints = simulation.sample().joints
    expected = reference(0.4)
    ours = [joints[name].position for name in ('l_pin', 'motor')]
    assert ours == pytest.approx(expected, abs=1e-8) and abs(expected).min() > 0.05
    assert joints['r_pin'].position == pytest.approx(-expected[0], abs=1e-8)
