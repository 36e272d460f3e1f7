"""Mimic joints of PhysX in a USD stage: joints that turn together."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import support.usd_robots as usd
from alf_ros.arrays import Floats
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import simulate
from support.usd_robots import body, joint, made, massive, stage

pytest.importorskip('pxr')
G = 9.81
BOB = massive(2.0, (0.0, 0.0, -0.5), (0.1, 0.1, 0.05))
LIGHT = massive(0.5, (0.0, 0.0, -0.3), (0.02, 0.02, 0.01))


def mimic(kind: str, of: str, gearing: float, more: str = '') -> str:
    """A joint `gear` of the world and the second body, which mimics another one."""
    instance = 'rotY' if kind == 'Revolute' else 'transY'
    text = joint(
        kind,
        'gear',
        (('', (0, 0, 0)), ('/c', (0, 0, 0))),
        usd.axis('Y'),
        f'float physxMimicJoint:{instance}:gearing = {gearing}',
        f'rel physxMimicJoint:{instance}:referenceJoint = <{of}>',
        more,
        schemas='Drive:nothing',
    )
    return text.replace('PhysicsDriveAPI:nothing', f'PhysxMimicJointAPI:{instance}')


def two(second: str) -> str:
    first = joint('Revolute', 'pin', (('', (0, 0, 0)), ('/b', (0, 0, 0))), usd.axis('Y'))
    return stage(body('b', BOB), body('c', LIGHT), first, second)


@pytest.mark.parametrize('gearing', [-2.0, 0.5])
def test_a_pendulum_that_turns_another_one(gearing: float, tmp_path: Path) -> None:
    """y turns freely, x = -gearing y."""
    text = made(tmp_path, two(mimic('Revolute', '/pin', gearing)), scene=True)
    assert scene_from_text(text).mechanism.couplings[0].of == (('gear', 1.0), ('pin', gearing))
    assert 'mimic' not in text.partition('\nmechanism')[0]
    simulation = simulate(text)
    simulation.apply_effort('pin', 3.0)
    ratio = -gearing
    J = 0.1 + 2.0 * 0.25 + ratio**2 * (0.02 + 0.5 * 0.09)

    def rate(_: float, z: Floats) -> list[float]:
        y = z[0]
        weight = 2.0 * G * 0.5 * math.sin(y) + ratio * 0.5 * G * 0.3 * math.sin(ratio * y)
        return [z[1], (3.0 - weight) / J]

    found = solve_ivp(rate, (0.0, 0.3), [0.0, 0.0], 'DOP853', rtol=1e-12, atol=1e-13)
    simulation.step(300)
    sample = simulation.sample()
    angles = [sample.joints[name].position for name in ('pin', 'gear')]
    assert angles == pytest.approx(np.array([1.0, ratio]) * found.y[0, -1], abs=1e-7)
    assert abs(angles[0]) > 0.05


def test_mimics_that_cannot_be_kept_are_listed(tmp_path: Path) -> None:
    lines = {
        mimic('Prismatic', '/pin', 2.0): 'gear, a prismatic of a revolute',
        mimic('Revolute', '/nowhere', 2.0): 'gear',
        mimic('Spherical', '/pin', 2.0): 'gear',
        mimic('Revolute', '/gear', 2.0): 'gear',  # itself
    }
    for second, line in lines.items():
        text = made(tmp_path, two(second), scene=True)
        assert f'#   mimic: these joints are free: {line}' in text.split('\n')
        assert not scene_from_text(text).mechanism.couplings
    offset = 'float physxMimicJoint:rotY:offset = 20'
    text = made(tmp_path, two(mimic('Revolute', '/pin', 2.0, offset)))
    assert '#   phase of mimic: it stays as drawn, not as in the file: gear' in text.split('\n')


def test_schemas_that_usd_core_does_not_know_are_seen(tmp_path: Path) -> None:
    text = two(mimic('Revolute', '/pin', 2.0)).replace(
        'def PhysicsRevoluteJoint "pin"',
        'def PhysicsRevoluteJoint "pin" (prepend apiSchemas = ["PhysxTendonAxisRootAPI:t"])',
    )
    lines = made(tmp_path, text).split('\n')
    assert '#   tendons: they apply no force: pin' in lines
