"""Where a scene starts: no body is a mirror image of itself, and teeth mesh as they are drawn."""

from __future__ import annotations

import math
from typing import Any

import pytest

from alf_ros import Simulation, load_scene
from alf_ros.errors import AssemblyError
from alf_ros.inspection.soundness import examine

ARM: dict[str, Any] = {
    'alf': 1,
    'space': 'spatial',
    'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'A': {'at': [0.5, 0, 0]}},
    'bodies': {
        'arm': {
            'points': ['O', 'A'],
            'mass': 2,
            'inertia': {'about_com': [0.01, 0.05, 0.05]},
            'com': [0.25, 0, 0],
        }
    },
    'joints': {
        'pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O', 'axis': [0, 1, 0]}
    },
}
NUT: dict[str, Any] = {
    **ARM,
    'points': {'O': {'at': [0, 0, 0]}, 'A': {'at': [0.5, 0, 0]}},
    'joints': {'nut': {**ARM['joints']['pin'], 'type': 'screw', 'pitch': 0.1}},
}
_WHEEL = {'mass': 1, 'inertia': {'about_com': 0.01}, 'com': [0, 0]}
WHEELS: dict[str, Any] = {
    'alf': 1,
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'P': {'at': [0.3, 0], 'fixed': True},
        'A': {'at': [0.1, 0]},
        'B': {'at': [0.5, 0]},
    },
    'bodies': {
        'small': {'points': ['O', 'A'], **_WHEEL},
        'large': {'points': ['P', 'B'], **_WHEEL},
    },
    'joints': {
        'a': {'type': 'revolute', 'between': ['ground', 'small'], 'at': 'O'},
        'b': {'type': 'revolute', 'between': ['ground', 'large'], 'at': 'P'},
    },
}
GEARS = {
    **WHEELS,
    'joints': {
        **WHEELS['joints'],
        'teeth': {
            'type': 'gear',
            'between': ['small', 'large'],
            'centres': ['O', 'P'],
            'radii': [0.1, 0.2],
        },
    },
}
COUPLED = {**WHEELS, 'couplings': {'belt': {'joints': {'a': 1, 'b': 2}}}}


def angles(mechanism: dict[str, Any], **keys: Any) -> dict[str, float]:
    """The joint angles at the start, rad."""
    sample = Simulation(load_scene({'mechanism': mechanism, **keys})).sample()
    return {name: joint.position for name, joint in sample.joints.items()}


@pytest.mark.parametrize(
    'positions', [{'A': [-0.5, 0, 0]}, {'A': [-0.5, 0, 0], 'arm_z': [0, 0, 1]}]
)
def test_a_body_is_no_mirror_image_of_itself(positions: dict[str, list[float]]) -> None:
    """The mirror image of a body has the same lengths and the same right angles."""
    source = {'mechanism': ARM, 'initial': {'positions': positions}}
    with pytest.raises(AssemblyError, match='body arm would be its mirror image'):
        Simulation(load_scene(source))
    found = examine(load_scene(source))
    assert not found.sound and 'mirror image' in str(found.answers)


def test_half_a_turn_is_no_mirror_image() -> None:
    positions = {'A': [-0.5, 0, 0], 'arm_z': [0, 0, -1]}
    assert abs(angles(ARM, initial={'positions': positions})['pin']) == pytest.approx(math.pi)


@pytest.mark.parametrize(
    ('positions', 'angle'),
    [({'O': [0, 0.02, 0]}, 0.4 * math.pi), ({'A': [0, None, -0.5]}, 0.5 * math.pi)],
)
def test_a_nut_starts_on_its_thread(positions: dict[str, Any], angle: float) -> None:
    scene = load_scene({'mechanism': NUT, 'initial': {'positions': positions}})
    sample = Simulation(scene).sample()
    assert sample.joints['nut'].position == pytest.approx(angle, abs=1e-9)
    assert sample.points['O'][1] == pytest.approx(0.1 * angle / (2.0 * math.pi), abs=1e-12)


@pytest.mark.parametrize('mechanism', [GEARS, COUPLED])
@pytest.mark.parametrize(
    ('keys', 'turned'),
    [
        ({'initial': {'positions': {'A': [0.0, 0.1]}}}, 0.5 * math.pi),
        ({'drives': {'motor': {'joint': 'a', 'angle': '0.3 + t'}}}, 0.3),
    ],
)
def test_what_meshes_starts_as_it_is_drawn(
    mechanism: dict[str, Any], keys: dict[str, Any], turned: float
) -> None:
    assert angles(mechanism, **keys) == pytest.approx({'a': turned, 'b': -0.5 * turned}, abs=1e-9)


@pytest.mark.parametrize(('mechanism', 'name'), [(GEARS, 'teeth'), (COUPLED, 'belt')])
def test_positions_between_the_teeth_are_refused(mechanism: dict[str, Any], name: str) -> None:
    positions = {'A': [0.0, 0.1], 'B': [0.5, 0.0]}
    with pytest.raises(AssemblyError, match=f'{name} is off by'):
        angles(mechanism, initial={'positions': positions})
