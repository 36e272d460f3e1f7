"""Derivatives through kinks of forces that the motion crosses, against differences of runs."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alf_ros import Scene, Simulation, StepError, gradient, load_scene
from alf_ros.arrays import Floats
from alf_ros.scene.overrides import with_changes
from support.recordings import changed
from support.thorough import thinned

DURATION = 1.2  # s
STENCIL = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))  # of sixth order
EXACT: dict[str, Any] = {'step': 1e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-13}
EFFECTS: dict[str, dict[str, Any]] = {
    'table': {
        'torsion_spring': {
            'cord': {
                'joint': 'pin',
                'table': [[-2, -1000], [-0.8, 0], [1, 0]],
                'free_position': 0.0,
            }
        }
    },
    'stop': {'joint_stop': {'end': {'joint': 'pin', 'lower': -0.8, 'stiffness': 900}}},
    'ground': {
        'ground_contact': {
            'floor': {'on': 'A', 'through': [0, -0.7], 'stiffness': 3000, 'exponent': 1}
        }
    },
    'limit': {
        'motor': {'servo': {'joint': 'pin', 'position': 0.5, 'position_gain': 60, 'limit': 9}}
    },
}


def pendulum(kind: str) -> Scene:
    """It falls from the side, and meets the kink several times."""
    return load_scene(
        {
            'name': kind,
            'mechanism': {
                'alf': 1,
                'space': 'planar',
                'parameters': {'m': 1.0},
                'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
                'bodies': {'bar': {'points': ['O', 'A'], 'mass': 'm', 'inertia': 'rod'}},
                'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
            },
            'effects': {'gravity': {'acceleration': [0, -9.81]}, **EFFECTS[kind]},
        }
    )


def angle(scene: Scene, **settings: Any) -> float:
    simulation = Simulation(scene, **settings)
    simulation.step(round(DURATION / simulation.h))
    return simulation.sample().joints['pin'].position


def check_derivatives(scene: Scene) -> None:
    """By tangents and by gradients, with errors near the errors of the motion."""
    true = 0.0
    for k, weight in STENCIL:
        more, less = (
            angle(changed(scene, {'m': 1.0 + sign * k * 1e-3}), **EXACT) for sign in (1.0, -1.0)
        )
        true += weight * (more - less) / 1e-3
    for settings, error in ((EXACT, 1e-7), ({'step': 1e-3, 'integrator': 'rk4'}, 1e-4)):
        simulation = Simulation(scene, tangents=['m'], **settings)
        simulation.step(round(DURATION / simulation.h))
        tangent = simulation.sample().tangents['m'].joints['pin'].position
        assert tangent == pytest.approx(true, rel=error)
        found = gradient(Simulation(scene, **settings), 'final(pin.position)', ['m'], DURATION)
        assert found.by['m'] == pytest.approx(tangent, rel=1e-10)


@pytest.mark.parametrize('kind', EFFECTS)
def test_derivatives_are_those_of_runs(kind: str) -> None:
    """Without pieces they were off by 1e-2 to 0.5."""
    check_derivatives(pendulum(kind))


def test_pieces_do_not_move_the_motion() -> None:
    """But for its own error at the kinks; without kinks on the way it has the same bits."""
    scene = pendulum('stop')
    for settings, off in ((EXACT, 1e-11), ({'step': 1e-3, 'integrator': 'rk4'}, 1e-5)):
        followed = Simulation(scene, tangents=['m'], **settings)
        plain = Simulation(scene, **settings)
        for simulation in (followed, plain):
            simulation.step(round(0.3 / simulation.h))
        assert followed.state.q.tobytes() == plain.state.q.tobytes()
        for simulation in (followed, plain):
            simulation.step(round(0.9 / simulation.h))
        assert np.abs(followed.state.q - plain.state.q).max() < off


@pytest.mark.parametrize('integrator', ['rk4', 'dop853_adaptive', 'esdirk43_adaptive'])
def test_a_start_at_rest_on_the_edge_of_a_stop(integrator: str) -> None:
    """Pieces of a first step came no nearer to the edge; with a tolerance the run ended there."""
    edge, k, g, m = float(np.arctan2(0.8, 0.6)), 900.0, 9.81, 1.0
    stop = f'{{joint: pin, lower: {edge!r}, stiffness: {k}, exponent: 1}}'
    changes = {'mechanism.points.A.at': '[0.6, 0.8]', 'effects.joint_stop.end': stop}
    scene = with_changes(pendulum('stop'), changes)
    simulation = Simulation(
        scene, integrator=integrator, step=1e-3, tolerance=1e-10, tangents=['m']
    )
    simulation.step(100)

    def rates(t: float, y: Floats) -> list[float]:
        x, v, dx, dv = y
        a = 3.0 * k / m * (edge - x) - 1.5 * g * np.cos(x)
        da = -3.0 * k / m**2 * (edge - x) - 3.0 * k / m * dx + 1.5 * g * np.sin(x) * dx
        return [v, a, dv, da]

    y = solve_ivp(rates, (0.0, 0.1), [edge, 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-14).y[:, -1]
    sample = simulation.sample()
    found = sample.joints['pin'], sample.tangents['m'].joints['pin']
    assert found[0].position == pytest.approx(y[0], abs=1e-8)
    assert [found[1].position, found[1].velocity] == pytest.approx(y[2:], rel=3e-6)
    assert simulation.evaluations < 12_000


HEAD = '''"""A torque on a joint."""

from dataclasses import dataclass, field

from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import Measures, numbers_of, push, scalar

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'joint', 'doc': 'its joint'})
    torque: float = field(metadata={'kind': 'number', 'unit': 'N m', 'doc': 'before'})
    behind: float = field(metadata={'kind': 'number', 'unit': 'N m', 'doc': 'beyond the position'})


def pack(effects, layout):
    measures = Measures(layout)
    for effect in effects:
        measures.add_coordinate(effect.parameters.joint)
        measures.give([effect.parameters.torque, effect.parameters.behind])
    return measures.packed()
'''
SNAP = """

@contract.force
def force(t, q, qd, near, slots, params, Q):
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        x, _ = scalar(q, qd, near, slots, params, n)
        if x < -0.8:
            push(q, slots, params, n, params[at + 1], Q)
        else:
            push(q, slots, params, n, params[at], Q)
"""
SIDE = """

@contract.side
def side(t, q, qd, near, slots, params):
    x, _ = scalar(q, qd, near, slots, params, 0)
    return 1.0 if x < -0.8 else 0.0
"""


@pytest.fixture(scope='module')
def snaps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The files of an effect that tells its sides and of one that does not: compiled once."""
    folder = tmp_path_factory.mktemp('snaps')
    files = {'side': folder / 'told' / 'snap.py', 'comparisons': folder / 'seen' / 'snap.py'}
    for name, file in files.items():
        file.parent.mkdir()
        file.write_text(HEAD + SNAP + (SIDE if name == 'side' else ''), 'utf-8')
    return files


@pytest.mark.parametrize(
    ('told', 'integrator', 'behind'),
    thinned(
        product(
            ['side', 'comparisons'], ['rk4', 'dop853_adaptive', 'esdirk43'], [3.0, 3.001, 2.0]
        ),
        # each integrator but rk4 compiles an effect again: one of both effects for each
        keep=lambda told, integrator, behind: (
            (integrator == 'rk4' and (told == 'side') == (behind == 2.0))
            or (behind == 3.001 and (told == 'side') == (integrator == 'dop853_adaptive'))
        ),
    ),
)
def test_a_force_that_jumps_has_no_derivatives(
    snaps: dict[str, Path], told: str, behind: float, integrator: str
) -> None:
    """It is named where it jumps, and is none if both torques are one. An effect that does not
    tell its sides is known by the comparisons of its force."""
    numbers = {'joint': 'pin', 'torque': 3.0, 'behind': behind}
    springs = {name: {'joint': 'pin', 'stiffness': 0.1} for name in ('one', 'other')}
    EFFECTS['snap'] = {'torsion_spring': springs, str(snaps[told]): {'snap': numbers}}
    scene = pendulum('snap')
    settings: dict[str, Any] = {'step': 0.01, 'integrator': integrator}
    after = Simulation(scene, **settings)
    after.step(100)
    assert after.sample().joints['pin'].position < -0.9
    simulation = Simulation(scene, tangents=['m'], **settings)
    if behind == 3.0:
        simulation.step(100)
        return
    said = 'a force jumps where it comes to another branch, and derivatives end there: snap'
    with pytest.raises(StepError, match=said):
        simulation.step(100)
    assert -0.8 < simulation.sample().joints['pin'].position < -0.6
    with pytest.raises(StepError, match=said):
        gradient(Simulation(scene, **settings), 'final(pin.position)', ['m'], 1.0)


LAW = """

@contract.force
def force(t, q, qd, near, slots, params, Q):
    x, _ = scalar(q, qd, near, slots, params, 0)
    at = numbers_of(slots, 0)
    push(q, slots, params, 0, {}, Q)
"""
KINKS = {
    'if': 'params[at] * (-0.8 - x) if x < -0.8 else 0.0',
    'max': 'params[at] * max(0.0, -0.8 - x)',
    'max of three': 'params[at] * max(-0.1, 0.0, -0.8 - x)',
    'abs': '0.5 * params[at] * (abs(0.8 + x) - 0.8 - x)',
    'floor': '-params[at] * (x + 0.8) * min(1, abs(math.floor((x + 0.8) / 9)))',
}


def with_law(law: str, folder: Path, head: str = HEAD) -> Scene:
    """The pendulum with an own effect that does not tell its sides."""
    file = folder / 'law.py'
    file.write_text(f'import math\n{head}{LAW.format(law)}', 'utf-8')
    EFFECTS['law'] = {str(file): {'law': {'joint': 'pin', 'torque': 300.0, 'behind': 0.4}}}
    return pendulum('law')


@pytest.mark.parametrize('spelled', thinned(KINKS, keep=['floor', 'if']))
def test_kinks_of_own_effects_are_known_by_their_code(spelled: str, tmp_path: Path) -> None:
    """However they are written. Without it, adaptive steps of 1e-13 were off by 7e-6."""
    check_derivatives(with_law(KINKS[spelled], tmp_path))


@pytest.mark.parametrize(
    ('instant', 't'),
    thinned(
        [('0.4312', 0.431), ('params[at + 1]', 0.4)], keep=lambda instant, t: instant != '0.4312'
    ),
)
def test_a_force_that_jumps_at_an_instant(instant: str, t: float, tmp_path: Path) -> None:
    """Its effect must give the instant: only then it is known whether a number moves it."""
    scene = with_law(f'0.01 * params[at] if t > {instant} else 0.0', tmp_path)
    said = 'a force jumps at an instant, .*: law.*Packed.instants'
    for settings in (EXACT, {'step': 1e-3, 'integrator': 'rk4'}):
        simulation = Simulation(scene, tangents=['law.behind'], **settings)
        with pytest.raises(StepError, match=said):
            simulation.step(round(DURATION / simulation.h))
        assert simulation.t == pytest.approx(t, abs=1e-9)
        with pytest.raises(StepError, match=said):
            gradient(Simulation(scene, **settings), 'final(pin.position)', ['m'], 1.0)


TABLE = """
from alf_ros.effects.contract.piecewise import instants, interpolate, pieces

ROWS = [[-3.0, 8.0], [-0.9, 5.0], [-0.4, 1.0], [0.1, -1.0], [0.5, 0.0]]
TABLE = pieces(ROWS, cubic={})
"""


@pytest.mark.parametrize(
    ('cubic', 'x', 'same'),
    thinned(
        [(True, 'x', True), (False, 'x', False), (False, 't', True)],
        keep=lambda cubic, x, same: x == 't' or not same,
    ),
)
def test_a_spline_and_known_instants_take_no_pieces(
    cubic: bool, x: str, same: bool, tmp_path: Path
) -> None:
    """A spline has no kinks, and adaptive steps end at instants that an effect gives: derivatives
    leave the bits of the motion."""
    head = HEAD + TABLE.format(cubic)
    head = head.replace('parameters.behind]', 'parameters.behind, *TABLE]')
    if x == 't':
        said = 'contract.Packed(found.slots, found.params, found.directions, instants=times)'
        given = f'found = measures.packed()\n    times = instants(ROWS)\n    return {said}'
        head = head.replace('return measures.packed()', given)
    scene = with_law(f'interpolate(params, at + 2, {x})', tmp_path, head)
    settings: dict[str, Any] = {'step': 1e-3, 'integrator': 'rk4'}
    followed, plain = Simulation(scene, tangents=['m'], **settings), Simulation(scene, **settings)
    for simulation in (followed, plain):
        simulation.step(600)
    assert plain.sample().joints['pin'].position < -1.0
    assert (followed.state.q.tobytes() == plain.state.q.tobytes()) == same
