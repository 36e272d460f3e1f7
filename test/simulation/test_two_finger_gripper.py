"""The underactuated gripper: five-bars in closed form, forces of its effects by virtual work."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Scene, Simulation, equilibrium, load_scene
from alf_ros.arrays import Floats
from alf_ros.mechanism import Body
from support.lagrange import Array, Reduced, distance, meet, planar, turned

# angles of driver1, inner0 and inner1: the worm turns driver0 the other way
DRIVER, INNER = np.array([0.0305, 0.055]), np.array([0.0125, 0.062])  # D and I of the right finger
LONG, SHORT, BENT = 0.055, 0.032, np.radians(45)
REST = np.arctan2(LONG * np.sin(BENT), LONG * np.cos(BENT) - SHORT)  # of the coupler on its stop
ROTOR = Body('rotor', ('D1', 'A1'), ((0.0, 0.0), (SHORT, 0.0)), 0.0, (0.0, 0.0), 2e-3)


def unit(angle: Any) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def along(direction: Array, x: float, y: float) -> Array:
    """The place (x, y) of a frame with this unit vector as its x axis."""
    return x * direction + y * turned(direction)


def finger(driver: Any, inner: Any) -> dict[str, Array]:
    """Points of the right finger for the angles of its driver and of its inner bar."""
    A, J = DRIVER + SHORT * unit(driver), INNER + LONG * unit(inner)
    coupler = np.sqrt(LONG**2 + SHORT**2 - 2.0 * LONG * SHORT * np.cos(BENT))
    side = np.hypot(0.018, 0.007)
    B = meet(J, side, A, coupler)
    level = along((B - J) / side, 0.018 / side, 0.007 / side)  # to the right, in the open hand
    pad = 0.03 - LONG * np.sin(np.radians(52))
    P, R = J + along(level, pad, 0.040), J + along(level, pad, 0.012)
    return {'I': INNER, 'D': DRIVER, 'A': A, 'J': J, 'B': B, 'P': P, 'R': R}


def places(q: Array) -> dict[str, Array]:
    right, left = finger(q[0], q[2]), finger(q[0], np.pi - q[1])
    mirror = np.array([-1.0, 1.0])
    found = {f'{name}0': mirror * place for name, place in left.items()}
    return found | {f'{name}1': place for name, place in right.items()}


def reduced(*more: Body) -> Reduced:
    """With the weight of the scene, towards the tips."""
    bodies = load_scene('two_finger_gripper').mechanism.bodies
    return planar([*bodies, *more], places, gravity=-9.81)


def coordinates(joints: Any) -> Floats:
    return np.array([joints[name].position for name in ('motor1', 'knuckle0', 'knuckle1')])


STEPS = 1e-30j * np.eye(3)


def stops(q: Floats) -> tuple[Floats, Floats]:
    """(2,) angles of the couplers beyond their stops, rad, and (2, 3) their gradients."""
    beyond, gradient = np.zeros(2), np.zeros((2, 3))
    now, near = places(q), [places(q + step) for step in STEPS]
    for k, sign in ((0, -1.0), (1, 1.0)):
        e, f = bars(now, k)
        beyond[k] = sign * np.arctan2(turned(e) @ f, e @ f) - REST
        for n, at in enumerate(near):
            de, df = (bar.imag * 1e30 for bar in bars(at, k))
            gradient[k, n] = sign * (turned(f) @ df - turned(e) @ de)
    return beyond, gradient


def bars(at: dict[str, Array], k: int) -> tuple[Array, Array]:
    """Unit vectors along the driver and the coupler of a finger."""
    D, A, B = at[f'D{k}'], at[f'A{k}'], at[f'B{k}']
    return (A - D) / distance(D, A), (B - A) / distance(A, B)


def touching(q: Array) -> Array:
    """(4,) depths: of the inner bars in the sides of the bar, of P0 and P1 in its roof, m."""
    at, depths = places(q), []
    for k, sign in ((0, -1.0), (1, 1.0)):
        knob = at[f'I{k}'] + along((at[f'J{k}'] - at[f'I{k}']) / LONG, 0.035, sign * 0.006)
        depths.append(0.022 - sign * knob[0])
    for k, sign in ((0, -1.0), (1, 1.0)):
        through, normal = np.array([sign * 0.022, 0.110]), np.array([sign * np.sqrt(3), 1.0]) / 2
        depths.append((through - at[f'P{k}']) @ normal)
    return np.array(depths)


def forces(q: Floats, qd: Floats, torque: float, damping: float) -> Floats:
    """(3,) generalised forces of all effects but the weight, by their laws."""
    Q = np.array([torque - damping * qd[0], 0.0, 0.0])
    beyond, gradient = stops(q)
    for x, dx in zip(beyond, gradient, strict=True):
        Q += 0.05 * (1.0 - x) * dx
        if x > 0.0:
            Q -= 400.0 * x**1.5 * max(0.0, 1.0 + 0.3 * (dx @ qd)) * dx
    depth = touching(q)
    slopes = np.array([touching(q + step).imag * 1e30 for step in STEPS]).T
    for x, dx in zip(depth, slopes, strict=True):
        if x > 0.0:
            Q -= 5e4 * x * max(0.0, 1.0 + 0.5 * (dx @ qd)) * dx
    return Q


def pushed(torque: float, damping: float = 0.4) -> Scene:
    """The scene with a motor that gives a torque, and has the damping of its controller."""
    scene = load_scene('two_finger_gripper')

    def changed(effect: Any) -> Any:
        if effect.kind != 'motor':
            return effect
        given = {'position': None, 'position_gain': 0.0, 'limit': None}
        given |= {'effort': torque, 'velocity_gain': damping}
        return replace(effect, parameters=replace(effect.parameters, **given))

    return replace(scene, effects=tuple(changed(effect) for effect in scene.effects))


def test_it_closes_parallel_and_then_wraps() -> None:
    """The five-bars, and the tip: it does not turn until the inner bar touches."""
    turns, widths = [], []
    for sample in Simulation(load_scene('two_finger_gripper')).run(3.0, every=60):
        q = coordinates(sample.joints)
        exact = places(q)
        for point, place in sample.points.items():
            assert place == pytest.approx(exact[point], abs=1e-11), point
        assert sample.points['P0'] == pytest.approx([-1, 1] * sample.points['P1'], abs=1e-9)
        pad = sample.points['P1'] - sample.points['R1']
        turn = np.arctan2(-pad[0], pad[1])
        if touching(q)[0] < 0.0:  # the give of the stop remains
            assert abs(turn) < 0.005
        turns.append(turn)
        widths.append(sample.points['P1'][0] - sample.points['P0'][0])
    assert max(widths) == pytest.approx(0.085, abs=1e-3)
    assert max(turns) > 0.4 and max(touching(q)) < 0.0


def test_a_grip_on_a_bar_is_in_balance() -> None:
    """At rest under a torque: virtual work of motor, springs, stops, bar and weight."""
    for torque, roofs in ((0.15, False), (3.0, True)):
        start = Simulation(pushed(torque))
        start.step(800)
        q = coordinates(equilibrium(start).joints)
        needed = reduced().efforts(q, np.zeros(3), np.zeros(3))
        given = forces(q, np.zeros(3), torque, 0.0)
        assert given == pytest.approx(needed, abs=1e-9)
        assert (touching(q) > 0.0).tolist() == [True, True, roofs, roofs]


def pinched(height: float, torque: float, stiffness: float) -> Any:
    """At rest on two walls 40 mm apart, which the pads meet at this part of their height."""
    scene = load_scene('two_finger_gripper').mechanism
    _, P, R, _ = next(np.array(body.local) for body in scene.bodies if body.name == 'tip1')
    x, y = R + height * (P - R)
    sides = {
        f'wall{k}': {
            'on': f'tip{k}',
            'at': [x, sign * y],
            'through': [sign * 0.02, 0.0],
            'normal': [sign, 0.0],
            'stiffness': stiffness,
        }
        for k, sign in ((0, -1.0), (1, 1.0))
    }
    couplers = {
        'stop0': {'joint': 'stop0', 'lower': '2*pi - rest', 'stiffness': 4e3},
        'stop1': {'joint': 'stop1', 'upper': 'rest', 'stiffness': 4e3},
    }
    effects = {
        'motor': {'joint': 'motor1', 'effort': torque, 'velocity_gain': 1.0, 'armature': 2e-3},
        'ground_contact': sides,
        'joint_stop': couplers,
        'torsion_spring': {
            'spring0': {'joint': 'stop0', 'stiffness': 0.05, 'free_position': '2*pi - rest - 1'},
            'spring1': {'joint': 'stop1', 'stiffness': 0.05, 'free_position': 'rest + 1'},
        },
    }
    solver = {'step': 0.1, 'integrator': 'dop853_adaptive'}
    closing = Simulation(
        load_scene({'mechanism': 'two_finger_gripper', 'effects': effects, 'solver': solver})
    )
    closing.step(8)  # from open hands a search would find other positions of rest
    return equilibrium(closing)


@pytest.mark.parametrize('height', [1.0, 0.6])
def test_the_force_of_the_pads_does_not_depend_on_the_height(height: float) -> None:
    """As the tips do not turn, the torque is 2 F l sin ψ, ψ the angle of the inner bars."""
    torque, stiffness = 1.0, 1e6
    rest = pinched(height, torque, stiffness)
    at = rest.points['R1'] + height * (rest.points['P1'] - rest.points['R1'])
    force = stiffness * (0.02 - at[0]) ** 1.5
    arm = LONG * np.sin(rest.joints['knuckle1'].position)
    assert force * 2.0 * arm == pytest.approx(torque, rel=1e-3)


def test_a_force_low_on_the_pads_turns_the_tips() -> None:
    """Below the point where the lines of coupler and inner bar cross, nothing holds the stop."""
    assert pinched(0.0, 1.0, 1e6).joints['stop1'].position < REST - 0.1


def test_a_closing_hand_by_lagrange() -> None:
    """Three freedoms with springs and stops, as the inner bars touch, integrated to 1e-10."""
    torque, damping, model = 1.5, 0.4, reduced(ROTOR)

    def rate(_: float, state: Floats) -> Floats:
        q, qd = state[:3], state[3:]
        return np.concatenate([qd, model.acceleration(q, qd, forces(q, qd, torque, damping))])

    sim = Simulation(pushed(torque), integrator='dop853_adaptive', step=1e-2, tolerance=1e-10)
    sim.step(12)
    names, joints = ('motor1', 'knuckle0', 'knuckle1'), sim.sample().joints
    start = coordinates(joints)
    assert max(touching(start)) < 0.0
    start = np.concatenate([start, [joints[name].velocity for name in names]])
    settings = {'rtol': 1e-10, 'atol': 1e-10, 'max_step': 1e-3}
    exact = solve_ivp(rate, (0.0, 0.02), start, 'DOP853', **settings).y[:, -1]
    sim.step(2)
    assert coordinates(sim.sample().joints) == pytest.approx(exact[:3], abs=1e-7)
    assert min(touching(exact[:3])[:2]) > 0.0
