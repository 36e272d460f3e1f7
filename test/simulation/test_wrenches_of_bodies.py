"""Inputs as numbers beside a wrench that turns with its body, or that acts at a point of it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, equilibrium_path, gradient, linearise, load_scene
from alf_ros.errors import InputError
from alf_ros.simulation.input_values import Wrench
from alf_ros.simulation.named_inputs import named_inputs
from alf_ros.simulation.saved_states import as_data, from_data
from support.thorough import thinned

FORCE, TORQUE = 'wrenches.lower.force.x', 'wrenches.lower.torque.y'
QUANTITIES = [
    'reactions.shoulder.force',
    'reactions.elbow.torque',
    'joints.elbow.effort',
    'powers.motor.servo',
    'energy',
    'drives.crane.effort',
]
SPATIAL: dict[str, Any] = {
    'alf': 1,
    'space': 'spatial',
    'points': {
        'O': {'at': [0, 0, 0], 'fixed': True},
        'A': {'at': [0.7, 0, 0.1]},
        'B': {'at': [1.2, 0.4, 0]},
        'C': {'at': [1.0, 0.1, 0.6]},
    },
    'bodies': {
        'upper': {'points': ['O', 'A'], 'mass': 1.5, 'inertia': {'about_com': [0.02, 0.1, 0.09]}},
        'lower': {
            'points': ['A', 'B'],
            'mass': 0.8,
            'inertia': {'about_com': [0.01, 0.05, 0.05]},
        },
        'tip': {'points': ['B', 'C'], 'mass': 0.3, 'inertia': {'about_com': [0.01, 0.02, 0.02]}},
    },
    'joints': {
        'shoulder': {
            'type': 'revolute',
            'between': ['ground', 'upper'],
            'at': 'O',
            'axis': [0, 0, 1],
        },
        'elbow': {
            'type': 'revolute',
            'between': ['upper', 'lower'],
            'at': 'A',
            'axis': [0, 1, 0.3],
        },
        'wrist': {'type': 'spherical', 'between': ['lower', 'tip'], 'at': 'B'},
    },
    'drives': {'crane': {'joint': 'shoulder', 'angle': '0.4*t + 0.1*sin(3*t)'}},
}
EFFECTS = {
    'gravity': {'acceleration': [0, 0, -9.81]},
    'motor': {
        'servo': {'joint': 'elbow', 'position': 0.3, 'position_gain': 15, 'velocity_gain': 0.4}
    },
}
MASS, LENGTH, G = Decimal('1.3'), Decimal('0.8'), Decimal('9.81')
ZERO = Decimal(0)
MIDDLE, INERTIA = LENGTH / 2, MASS * LENGTH * LENGTH / 3
WRENCH: dict[str, Any] = {
    'force': [3.0, -1.0, 2.0],
    'torque': [0.2, 0.1, -0.3],
    'at': 'B',
    'frame': 'body',
}


def in_space(effects: dict[str, Any]) -> dict[str, Any]:
    return {'mechanism': SPATIAL, 'effects': effects, 'solver': {'step': 1e-3}}


# ------------------------------------------------------------------ a solution of many digits


def pendulum() -> Simulation:
    """A rod of 1.3 kg and 0.8 m that a force in its frame pushes round."""
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0.8, 0]}},
        'bodies': {'rod': {'points': ['O', 'A'], 'mass': 1.3, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
    }
    scene = load_scene(
        {
            'mechanism': mechanism,
            'effects': {'gravity': {'acceleration': [0, -9.81]}},
            'solver': {'step': 1e-3, 'integrator': 'dop853'},
        }
    )
    found = Simulation(scene, tangents=['wrenches.rod.force.x', 'wrenches.rod.force.y'])
    found.apply_wrench('rod', [2.0, 9.0], at='A', frame='body')
    return found


def swing(push: Sequence[Decimal], t: Decimal) -> tuple[Decimal, Decimal, Decimal]:
    """cos θ, sin θ and ω of the rod at t, by Taylor series of 40 terms, pushed in its middle in
    the world: J ω' = 9 L - m g l cos θ + l (u_y cos θ - u_x sin θ)."""
    c, s, w = Decimal(1), Decimal(0), Decimal(0)
    for _ in range(10):
        C, S, W = [c], [s], [w]
        for n in range(40):
            convolved = [sum((x[k] * W[n - k] for k in range(n + 1)), ZERO) for x in (C, S)]
            moment = MIDDLE * ((push[1] - MASS * G) * C[n] - push[0] * S[n])
            moment += 9 * LENGTH if n == 0 else 0
            C.append(-convolved[1] / (n + 1))
            S.append(convolved[0] / (n + 1))
            W.append(moment / INERTIA / (n + 1))
        c, s, w = (
            sum((x * (t / 10) ** n for n, x in enumerate(each)), ZERO) for each in (C, S, W)
        )
    return c, s, w


def reaction(push: Sequence[Decimal], t: Decimal) -> list[Decimal]:
    """The force on the rod in the pin, N: m a of its middle, less all other forces on it."""
    c, s, w = swing(push, t)
    moment = 9 * LENGTH + MIDDLE * ((push[1] - MASS * G) * c - push[0] * s)
    faster = moment / INERTIA
    ax, ay = (MIDDLE * x for x in (-faster * s - w * w * c, faster * c - w * w * s))
    own = 2 * c - 9 * s, 2 * s + 9 * c
    return [MASS * ax - own[0] - push[0], MASS * (ay + G) - own[1] - push[1]]


@pytest.mark.parametrize('axis', [0, 1])
def test_a_reaction_equals_differences_of_many_digits(axis: int) -> None:
    simulation = pendulum()
    simulation.step(300)
    with localcontext() as context:
        context.prec = 50
        h = Decimal('1e-15')
        ends = []
        for by in (-h, h):
            push = [Decimal(0), Decimal(0)]
            push[axis] = by
            ends.append(reaction(push, Decimal('0.3')))
        wanted = [float((more - less) / (2 * h)) for less, more in zip(*ends, strict=True)]
    name = f'wrenches.rod.force.{"xy"[axis]}'
    found = simulation.sample().tangents[name].of('reactions.pin.force')
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


# ------------------------------------------------------------------- the same by other numbers


@pytest.mark.parametrize('at', [None, 'B'])
def test_equals_an_effect_in_its_place(at: str | None) -> None:
    """The derivative by a number of an effect, at the same discrete motion."""
    held = {**WRENCH, 'at': at} if at else {k: v for k, v in WRENCH.items() if k != 'at'}
    own, more = {'on': 'lower', **held}, {'on': 'lower', 'force': [1, 0, 0], 'torque': [0, 1, 0]}
    both = {**EFFECTS, 'constant_wrench': {'own': own, 'more': more}}
    names = {FORCE: 'more.force.0', TORQUE: 'more.torque.1'}
    wanted = Simulation(load_scene(in_space(both)), tangents=list(names.values()))
    one = {**EFFECTS, 'constant_wrench': {'more': more}}
    found = Simulation(load_scene(in_space(one)), tangents=list(names))
    found.apply_wrench('lower', **held)
    for each in (wanted, found):
        each.step(250)
    for name, other in names.items():
        for quantity in QUANTITIES:
            there = np.atleast_1d(wanted.sample().tangents[other].of(quantity))
            here = np.atleast_1d(found.sample().tangents[name].of(quantity))
            size = np.abs(there).max()
            assert size > 1e-4
            np.testing.assert_allclose(here, there, rtol=0, atol=2e-8 * size, err_msg=quantity)


def test_close_to_a_singular_position() -> None:
    """Which this motion passes: reactions grow towards it, and their slopes stay known."""
    more = {'more': {'on': 'coupler', 'force': [1, 0]}}
    effects = {'gravity': {'acceleration': [0, -9.81]}, 'constant_wrench': more}
    initial = {'velocities': {'B': [-4.0, 0]}}
    scene = load_scene({'mechanism': 'slider_crank', 'effects': effects, 'initial': initial})
    names = ['wrenches.coupler.force.x', 'more.force.0']
    simulation = Simulation(scene, tangents=names, step=1e-3)
    simulation.apply_wrench('coupler', [0.0, 0.5], 0.2, at='B', frame='body')
    simulation.step(380)
    sizes = []
    while simulation.t < 0.6:
        simulation.step()
        try:
            found, wanted = (
                np.asarray(simulation.sample().tangents[name].of('reactions.knee.force'))
                for name in names
            )
        except InputError:  # in the steps beside it
            continue
        sizes.append(float(np.abs(wanted).max()))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-7 * sizes[-1])
    assert max(sizes) > 1e3 and len(sizes) > 200


def test_equals_differences_of_runs() -> None:
    """Of the wrench in the world that a second effect holds; the first one turns."""
    simulation = Simulation(load_scene(in_space(EFFECTS)), tangents=[FORCE, f'{FORCE}[50:120]'])
    simulation.apply_wrench('lower', **WRENCH)
    simulation.step(200)
    own = {'on': 'lower', **WRENCH}

    def end(by: float) -> np.ndarray[Any, Any]:
        more = {'on': 'lower', 'force': [by, 0, 0]}
        effects = {**EFFECTS, 'constant_wrench': {'own': own, 'more': more}}
        other = Simulation(load_scene(in_space(effects)))
        other.step(200)
        return other.sample().reactions['shoulder'].force

    h, weights = 0.05, (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    slopes = [w / h * (end(k * h) - end(-k * h)) for k, w in enumerate(weights, 1)]
    wanted = np.sum(slopes, axis=0)
    found = simulation.sample().tangents[FORCE].of('reactions.shoulder.force')
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    within = simulation.sample().tangents[f'{FORCE}[50:120]'].of('reactions.shoulder.force')
    assert np.abs(np.asarray(within) - wanted).max() > 1e-3


@pytest.mark.parametrize(
    'of',
    thinned(['joints.elbow.effort', 'drives.crane.effort'], keep=['drives.crane.effort']),
)
def test_gradients_equal_tangents(of: str) -> None:
    """Where the number acts in all steps, in some, and in the last ones."""
    names = [FORCE, TORQUE, f'{FORCE}[20:60]', f'{FORCE}[90:]', 'lower.mass']
    followed = Simulation(load_scene(in_space(EFFECTS)), tangents=names)
    plain = Simulation(load_scene(in_space(EFFECTS)))
    for each in (followed, plain):
        each.apply_wrench('lower', **WRENCH)
    followed.step(100)
    found = gradient(plain, f'final({of})', names, duration=0.1)
    slopes = [found.by[name] for name in names]
    wanted = [followed.sample().tangents[name].of(of) for name in names]
    np.testing.assert_allclose(slopes, np.array(wanted), rtol=1e-7, atol=1e-9)


# --------------------------------------------------------------------------- linear models, rest


def test_a_linear_model_beside_it() -> None:
    """As beside the same wrench of an effect."""
    effects = {**EFFECTS, 'constant_wrench': {'own': {'on': 'lower', **WRENCH}}}
    held = Simulation(load_scene(in_space(EFFECTS)))
    held.apply_wrench('lower', **WRENCH)
    of_effect = Simulation(load_scene(in_space(effects)))
    inputs, outputs = [FORCE, TORQUE], ['joints.elbow.position', 'reactions.wrist.force.z']
    found, wanted = (linearise(each, inputs=inputs, outputs=outputs) for each in (held, of_effect))
    for name in 'ABCD':
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-8)


def test_positions_of_rest_beside_it() -> None:
    """At rest the moments about the pin balance: of the weight, of the force that turns with the
    rod, and of the force in the world."""
    simulation = Simulation(pendulum().scene)
    simulation.apply_wrench('rod', [0.5, 1.0], at='A', frame='body')
    path = equilibrium_path(simulation, over='wrenches.rod.force.x', end=4.0)
    assert len(path) > 3
    angles = path['joints.pin.position']
    moments = 1.0 * 0.8 - 0.4 * (1.3 * 9.81 * np.cos(angles) + path.values * np.sin(angles))
    np.testing.assert_allclose(moments, 0.0, atol=1e-8)


# ----------------------------------------------------------------------------------- saved states


def test_a_state_with_both_is_saved() -> None:
    """And its run repeats bit for bit."""
    simulation = Simulation(load_scene(in_space(EFFECTS)))
    simulation.apply_wrench('lower', **WRENCH)
    assert 'added' not in as_data(simulation.state)['inputs']
    (by,) = named_inputs(simulation.model, simulation.scene.effects, [FORCE])
    pushed = replace(simulation.state, inputs=by.added(simulation.state.inputs, 1.5))
    again = from_data(json.loads(json.dumps(as_data(pushed))), simulation.state)
    ends = []
    for state in (pushed, replace(again, h=pushed.h)):
        simulation.restore(state)
        simulation.step(20)
        ends.append(simulation.state.q.tobytes())
    assert again.inputs == pushed.inputs
    assert ends[0] == ends[1]


def test_a_wrench_that_is_added_is_checked() -> None:
    simulation = Simulation(load_scene(in_space(EFFECTS)))
    inputs = replace(simulation.state.inputs, added={'nothing': Wrench((0.0, 0.0, 1.0))})
    with pytest.raises(InputError, match='unknown body or point'):
        simulation.restore(replace(simulation.state, inputs=inputs))
