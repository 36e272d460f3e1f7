"""Closing loops with gears, racks, threads and couplings, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from alf_ros import Closure, InputError, Simulation, load_scene
from support.geared_five_bar import START, A, B, D, geared_five_bar, height

ROD = {'mass': 1, 'inertia': 'rod'}
WHEEL = {'mass': 1, 'inertia': {'about_com': 0.02}, 'com': [0, 0]}
REVOLUTE = {'type': 'revolute'}
SLIDES = {'type': 'prismatic', 'axis': [1, 0]}


def mechanism(**sections: Any) -> dict[str, Any]:
    """A planar mechanism."""
    return {'alf': 1, 'space': 'planar', **sections}


def pair(radii: list[float], internal: bool) -> dict[str, Any]:
    """Two wheels on fixed centres, at the angles 0 and 0."""
    return mechanism(
        points={
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [abs(radii[0] - radii[1]) if internal else sum(radii), 0], 'fixed': True},
            'A': {'at': [0.1, 0]},
            'B': {'at': [sum(radii) + 0.1, 0]},
        },
        bodies={'one': {'points': ['O', 'A'], **WHEEL}, 'two': {'points': ['C', 'B'], **WHEEL}},
        joints={
            'left': {**REVOLUTE, 'between': ['ground', 'one'], 'at': 'O'},
            'right': {**REVOLUTE, 'between': ['ground', 'two'], 'at': 'C'},
            'mesh': {
                'type': 'gear',
                'between': ['one', 'two'],
                'centres': ['O', 'C'],
                'radii': radii,
                'internal': internal,
            },
        },
    )


@pytest.mark.parametrize(
    ('radii', 'internal', 'ratio'),
    [
        ([0.2, 0.3], False, -2.0 / 3.0),
        ([0.8, 0.3], True, 8.0 / 3.0),
        ([0.3, 0.8], True, 3.0 / 8.0),
        ([0.48, 0.02], False, -24.0),
    ],
)
def test_gears_keep_their_phase_over_turns(
    radii: list[float], internal: bool, ratio: float
) -> None:
    closure = Closure(pair(radii, internal), ['left'])
    for angle in (*np.arange(0.0, 40.0, 0.17), 300.0, -50.0):
        posture = closure.close({'left': angle}, rates={'left': 1.0})
        rounding = 1e-12 * max(1.0, abs(angle) / 30.0)
        assert posture.joints['right'] == pytest.approx(ratio * angle, rel=1e-15, abs=rounding)
        assert posture.joint_rates['right'] == pytest.approx(ratio, abs=1e-12)
        assert posture.effort_map[0].tolist() == pytest.approx([1.0, ratio], abs=1e-12)
    assert posture.travel('left') == (-math.inf, math.inf)


END = math.acos((D / 2 - B) / A)  # where both rods lie on the line between P1 and P2


def test_a_geared_five_bar_and_its_travel() -> None:
    closure = Closure(geared_five_bar(False), ['left'])
    for angle in np.linspace(START, 2.0, 40).tolist():
        posture = closure.close({'left': angle}, rates={'left': 1.0})
        np.testing.assert_allclose(posture.points['P'], [D / 2, height(angle)], atol=1e-12)
        assert posture.joints['right'] == pytest.approx(math.pi - angle, abs=1e-12)
        assert posture.closed_to < 1e-14
        h = 1e-6
        slope = (height(angle + h) - height(angle - h)) / (2.0 * h)
        np.testing.assert_allclose(posture.velocities['P'], [0.0, slope], atol=1e-9)
    assert posture.travel('left') == pytest.approx((-END, END), abs=1e-8)
    assert closure.close({'left': END - 1e-6}).distance < 0.02 * posture.distance


def test_the_guide_takes_the_gears_through_dead_points() -> None:
    """P goes up and down between both ends; the cranks continue where it turns back."""
    closure = Closure(geared_five_bar(True), ['guide'])
    angles = np.concatenate([np.arange(START, 2.0, 0.02), np.arange(2.0, -2.0, -0.015)])
    values, missed = closure.follow(height(angles)[:, None])
    first = closure.joint_names.index('left')
    turn = np.flatnonzero(np.diff(np.sign(np.diff(height(angles)))))
    assert turn.size == 2  # where the motion turns back, and at the top
    np.testing.assert_allclose(values[:, first], angles, atol=1e-6)
    np.testing.assert_allclose(values[:, first] + values[:, first + 1], np.pi, atol=1e-12)
    assert missed.max() < 1e-12


def test_the_effort_map_with_gears_is_the_simulators() -> None:
    fields = {
        'mechanism': geared_five_bar(False),
        'drives': {'hold': {'joint': 'left', 'angle': START}},
        'effects': {},
    }
    simulation = Simulation(load_scene(fields))
    simulation.apply_effort('knee', 0.7)
    held = simulation.sample().drives[2][0]
    posture = Closure(geared_five_bar(False), ['left']).close({'left': START})
    tau = np.array([0.7 if name == 'knee' else 0.0 for name in posture.joints])
    assert float(held) == pytest.approx(-float(posture.effort_map[0] @ tau), rel=1e-9)


def slider_crank(
    points: dict[str, Any], bodies: dict[str, Any], joints: dict[str, Any]
) -> dict[str, Any]:
    """Crank and coupler (0.3 m, 0.8 m) at a crank angle of 0.7 rad, and what moves at B."""
    x, y = 0.3 * math.cos(0.7), 0.3 * math.sin(0.7)
    return mechanism(
        points={
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [x, y]},
            'B': {'at': [float(stroke(0.7)), 0]},
            **points,
        },
        bodies={
            'crank': {'points': ['O', 'A'], **ROD},
            'coupler': {'points': ['A', 'B'], **ROD},
            **bodies,
        },
        joints={
            'pin': {**REVOLUTE, 'between': ['ground', 'crank'], 'at': 'O'},
            'knee': {**REVOLUTE, 'between': ['crank', 'coupler'], 'at': 'A'},
            **joints,
        },
    )


def crank_with_rack() -> dict[str, Any]:
    """A slider-crank; the slider is a rack that turns a pinion of 0.05 m."""
    slider = float(stroke(0.7))
    return slider_crank(
        points={
            'E': {'at': [slider + 0.4, 0]},
            'C': {'at': [1.0, 0.05], 'fixed': True},
            'S': {'at': [1.05, 0.05]},
        },
        bodies={
            'bar': {'points': ['B', 'E'], **ROD},
            'pinion': {'points': ['C', 'S'], **WHEEL},
        },
        joints={
            'wrist': {**REVOLUTE, 'between': ['coupler', 'bar'], 'at': 'B'},
            'guide': {
                'type': 'prismatic',
                'between': ['ground', 'bar'],
                'at': 'B',
                'axis': [1, 0],
            },
            'axle': {**REVOLUTE, 'between': ['ground', 'pinion'], 'at': 'C'},
            'teeth': {
                'type': 'rack',
                'between': ['bar', 'pinion'],
                'at': 'C',
                'radius': 0.05,
                'on': {'through': [slider, 0], 'direction': [1, 0]},
            },
        },
    )


def stroke(angle: Any) -> Any:
    """x of the slider (m) at a crank angle (rad)."""
    return 0.3 * np.cos(angle) + np.sqrt(0.64 - (0.3 * np.sin(angle)) ** 2)


def test_a_crank_drives_a_rack_and_its_pinion() -> None:
    closure = Closure(crank_with_rack(), ['pin'])
    drawn = closure.close({'pin': 0.7})
    for angle in np.arange(0.7, 15.0, 0.1).tolist():
        posture = closure.close({'pin': angle})
        moved = posture.joints['guide'] - drawn.joints['guide']
        turned = posture.joints['axle'] - drawn.joints['axle']
        assert moved == pytest.approx(stroke(angle) - stroke(0.7), abs=1e-12)
        assert turned == pytest.approx((stroke(angle) - stroke(0.7)) / 0.05, abs=2e-12)


def test_a_pinion_drives_the_crank_through_its_dead_points() -> None:
    closure = Closure(crank_with_rack(), ['axle'])
    angles = np.arange(0.7, 14.0, 0.03)
    turned = (stroke(angles) - stroke(0.7)) / 0.05
    values, missed = closure.follow(closure.start['axle'] + turned[:, None])
    assert missed.max() < 1e-11
    np.testing.assert_allclose(values[:, closure.joint_names.index('pin')], angles, atol=1e-5)


def test_a_rack_on_a_turning_arm() -> None:
    """Two active joints; the wheel turns with the arm, and by s / r on it."""
    arm = mechanism(
        points={
            'O': {'at': [0, 0], 'fixed': True},
            'A': {'at': [1, 0]},
            'C': {'at': [0.3, 0.2]},
            'D': {'at': [0.4, 0.2]},
            'T': {'at': [0.5, 0.2]},
        },
        bodies={
            'arm': {'points': ['O', 'A'], **ROD},
            'wheel': {'points': ['C', 'D'], **WHEEL},
            'slide': {'points': ['C', 'T'], **ROD},
        },
        joints={
            'hub': {**REVOLUTE, 'between': ['ground', 'arm'], 'at': 'O'},
            'axle': {**REVOLUTE, 'between': ['slide', 'wheel'], 'at': 'C'},
            'guide': {'type': 'prismatic', 'between': ['arm', 'slide'], 'at': 'C', 'axis': [1, 0]},
            'edge': {
                'type': 'rack',
                'between': ['arm', 'wheel'],
                'at': 'C',
                'radius': 0.2,
                'on': {'through': [0, 0], 'direction': [1, 0]},
            },
        },
    )
    closure = Closure(arm, ['hub', 'guide'])
    begin = closure.start['guide']
    for s in np.linspace(0.0, 12.0, 90).tolist():
        posture = closure.close({'hub': 2.0 * s, 'guide': begin + s}, {'hub': 2.0, 'guide': 1.0})
        assert posture.joints['axle'] == pytest.approx(-s / 0.2, abs=2e-12)
        assert posture.joint_rates['axle'] == pytest.approx(-5.0, abs=1e-11)
        spoke = posture.points['D'] - posture.points['C']
        angle = 2.0 * s - s / 0.2
        np.testing.assert_allclose(
            spoke, [0.1 * math.cos(angle), 0.1 * math.sin(angle)], atol=1e-12
        )


def test_a_planetary_gear_after_willis() -> None:
    """Sun 0.03 m in a fixed ring of 0.09 m: the carrier turns a quarter as far."""
    closure = Closure('planetary_gear', ['shaft'])
    for angle in np.arange(0.0, 30.0, 0.3).tolist():
        posture = closure.close({'shaft': angle})
        assert posture.joints['output'] == pytest.approx(angle / 4.0, abs=1e-12)
        assert posture.joints['pin0'] == pytest.approx(-0.75 * angle, abs=1e-12)


def lift(angle: Any) -> Any:
    """Length of the screw jack's actuator (m) at the angle of its hinge (rad)."""
    angle = math.radians(15.0) + angle
    return np.hypot(0.8 * np.cos(angle) - 0.55, 0.8 * np.sin(angle) + 0.55)


@pytest.mark.parametrize('active', ['bearing', 'hinge'])
def test_the_thread_of_a_screw_jack(active: str) -> None:
    """1 m of thread in 100 turns; the lid at an angle has a length of the actuator."""
    closure = Closure('screw_jack', [active])
    angles = np.arange(0.0, 0.4, 0.004)
    turned = (lift(angles) - lift(0.0)) * 2.0 * math.pi / 0.01
    table = np.array(turned if active == 'bearing' else angles)
    values, missed = closure.follow(table[:, None])
    found = dict(zip(closure.joint_names, values.T, strict=True))
    np.testing.assert_allclose(found['hinge'], angles, atol=1e-12)
    np.testing.assert_allclose(found['bearing'], turned, atol=1e-9)
    assert missed.max() < 1e-12


def crank_with_wheel(kind: str) -> dict[str, Any]:
    """A slider-crank with a wheel (0.1 m) for a slider, on a line; or a blade."""
    keys: dict[str, dict[str, Any]] = {
        'no_slip': {'radius': 0.1, 'on': {'through': [0, -0.1], 'direction': [1, 0]}},
        'blade': {'axis': [1, 0]},
    }
    return slider_crank(
        points={'S': {'at': [float(stroke(0.7)) + 0.1, 0]}},
        bodies={'wheel': {'points': ['B', 'S'], **WHEEL}},
        joints={
            'axle': {**REVOLUTE, 'between': ['coupler', 'wheel'], 'at': 'B'},
            'rim': {'type': kind, 'between': ['ground', 'wheel'], 'at': 'B', **keys[kind]},
        },
    )


def test_a_wheel_on_a_line_of_the_plane_rolls_back_to_its_angle() -> None:
    closure = Closure(crank_with_wheel('no_slip'), ['pin'])
    for angle in np.arange(0.7, 15.0, 0.1).tolist():
        posture = closure.close({'pin': angle})
        spoke = posture.points['S'] - posture.points['B']
        turned = -(stroke(angle) - stroke(0.7)) / 0.1
        np.testing.assert_allclose(posture.points['B'], [stroke(angle), 0.0], atol=1e-12)
        np.testing.assert_allclose(
            spoke, [0.1 * math.cos(turned), 0.1 * math.sin(turned)], atol=1e-12
        )


def test_what_is_non_holonomic_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        Closure(crank_with_wheel('blade'), ['pin'])
    assert str(caught.value) == (
        'joints.rim: a joint of type blade binds velocities only (it is non-holonomic): '
        'its position depends on the path, not on the active joints'
    )


def test_a_gripper_with_a_mimic_joint() -> None:
    """Two four-bar fingers; one motor turns both, the second one against it, over dead points."""
    points: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for side, sign in (('left', -1.0), ('right', 1.0)):
        for name, x, y in (('O', 0.1, 0.0), ('C', 0.4, 0.0), ('A', 0.1, 0.1), ('B', 0.4, 0.25)):
            fixed = {'fixed': True} if name in 'OC' else {}
            points[f'{side}_{name}'] = {'at': [sign * x, y], **fixed}
        for name, ends in (('crank', 'OA'), ('rod', 'AB'), ('finger', 'CB')):
            bodies[f'{side}_{name}'] = {'points': [f'{side}_{end}' for end in ends], **ROD}
        for name, parent, child, at in (
            ('motor', None, 'crank', 'O'),
            ('knee', 'crank', 'rod', 'A'),
            ('wrist', 'rod', 'finger', 'B'),
            ('hinge', None, 'finger', 'C'),
        ):
            between = [f'{side}_{parent}' if parent else 'ground', f'{side}_{child}']
            joints[f'{side}_{name}'] = {**REVOLUTE, 'between': between, 'at': f'{side}_{at}'}
    fields = mechanism(
        points=points,
        bodies=bodies,
        joints=joints,
        couplings={'mimic': {'joints': {'left_motor': 1, 'right_motor': 1}}},
    )
    closure = Closure(fields, ['left_motor'])
    begin = closure.start['left_motor']
    for angle in np.linspace(0.0, 20.0, 150).tolist():
        posture = closure.close({'left_motor': begin + angle}, rates={'left_motor': 1.0})
        left, right = posture.points['left_B'], posture.points['right_B']
        np.testing.assert_allclose(left * [-1.0, 1.0], right, atol=1e-12)
        assert posture.joint_rates['right_motor'] == pytest.approx(-1.0, abs=1e-12)
        fingers = posture.rates[[posture.model.coordinate_names.index(n) for n in HINGES], 0]
        assert fingers[0] == pytest.approx(-fingers[1], abs=1e-10)


HINGES = ('left_hinge', 'right_hinge')


def test_a_rack_has_no_end_after_many_turns() -> None:
    """Rounding of the angle is more than the gap of closed loops, and no dead point."""
    pinion = Closure('rack_and_pinion', active=['axle'])
    assert pinion.close({'axle': 1100.0}).joints['guide'] == pytest.approx(55.0, abs=1e-10)
    pinion.restart()
    assert pinion.close(pinion.start).travel('axle') == (-math.inf, math.inf)
