"""Stability, modes and linear models where loads have no potential, or damping gives energy.

Ziegler's column: two rods without mass, 2 kg and 1 kg at their ends, a torsion spring at the foot
of each, and a load P that follows the upper rod. Without damping it flutters from P = 7/2 - √2 on,
with equal dampers from 41/28 on: H. Ziegler, Die Stabilitätskriterien der Elastomechanik (1952).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from alf_ros import Scene, equilibrium, equilibrium_path, linearise, load_scene, modes
from support.thorough import thinned

UNDAMPED, DAMPED = 3.5 - math.sqrt(2.0), 41.0 / 28.0


def column(load: float, damping: float = 0.0) -> Scene:
    return load_scene(column_data(load, damping))


def column_data(load: float, damping: float) -> dict[str, Any]:
    springs = {
        name: {'joint': joint, 'stiffness': 1.0, 'damping': damping}
        for name, joint in (('lower', 'foot'), ('upper', 'knee'))
    }
    follower = {'on': 'upper', 'force': [-load, 0.0], 'at': 'B', 'frame': 'body'}
    return {
        'mechanism': {
            'alf': 1,
            'points': {
                'O': {'at': [0, 0], 'fixed': True},
                'A': {'at': [0, 1]},
                'B': {'at': [0, 2]},
            },
            'bodies': {'lower': weight(2.0, 'O', 'A'), 'upper': weight(1.0, 'A', 'B')},
            'joints': {
                'foot': {'type': 'revolute', 'between': ['ground', 'lower'], 'at': 'O'},
                'knee': {'type': 'revolute', 'between': ['lower', 'upper'], 'at': 'A'},
            },
        },
        'effects': {'torsion_spring': springs, 'constant_wrench': follower},
    }


def weight(mass: float, foot: str, end: str) -> dict[str, Any]:
    """A rod without mass, and a mass at its end."""
    return {'points': [foot, end], 'mass': mass, 'inertia': {'about_com': 0}, 'com': [1, 0]}


@pytest.mark.parametrize('damping', [0.0, 0.01, 0.3])
@pytest.mark.parametrize('beside', [-1e-3, 1e-3])
def test_the_load_from_which_a_column_flutters(damping: float, beside: float) -> None:
    # 41/28 is the limit of small damping: with c, P = 41/28 + c²/2
    critical = DAMPED + 0.5 * damping**2 if damping else UNDAMPED
    rest = equilibrium(column(critical + beside, damping))
    assert rest.stability == ('unstable' if beside > 0.0 else 'stable')
    assert not rest.conservative
    assert 'the loads have no potential' in rest.notes[0]
    growth = linearise(rest).eigenvalues.real.max()
    if damping or beside > 0.0:
        assert (growth > 0.0) == (beside > 0.0)


def test_modes_without_potential() -> None:
    """ω⁴ - (7/2 - P) ω² + 1/2 = 0."""
    load = 1.9
    squares = np.roots([1.0, -(3.5 - load), 0.5])
    wanted = np.sort(np.sqrt(squares)) / (2.0 * math.pi)
    rest = equilibrium(column(load))
    np.testing.assert_allclose(rest.frequencies, wanted, rtol=1e-12)
    damped = modes(column(load, 1e-5))
    np.testing.assert_allclose(damped.frequencies, wanted, rtol=1e-12)
    # of little damping the ratios are exact: those of the linear motion
    exact = linearise(column(load, 1e-5))
    order = np.argsort(exact.frequencies)
    np.testing.assert_allclose(
        damped.damping_ratios, np.asarray(exact.damping_ratios)[order], rtol=1e-6
    )
    shares = damped.potential_shares
    np.testing.assert_allclose(sum(shares.values()), np.ones(2), atol=1e-9)


def test_a_pair_that_flutters_has_no_frequency() -> None:
    rest = equilibrium(column(2.5))
    assert rest.stability == 'unstable'
    assert np.isnan(rest.frequencies).all() and np.isnan(rest.stiffness).all()
    assert 'flutter' in rest.notes[-1]
    assert np.linalg.matrix_rank(rest.directions) == 2


def test_stability_along_a_path_of_loads() -> None:
    """Against the eigenvalues of the linear motion at each point of the path."""
    path = equilibrium_path(column(1.0, 0.01), over='constant_wrench.force.0', end=-2.6)
    beyond = np.abs(path.values) - (DAMPED + 0.5 * 0.01**2)
    apart = np.abs(beyond) > 1e-6  # the flutter point is one of the path
    wanted = ['unstable' if b > 0.0 else 'stable' for b in beyond[apart]]
    assert [path.stability[k] for k in np.flatnonzero(apart)] == wanted
    assert set(wanted) == {'stable', 'unstable'} and (~apart).sum() == 1


@pytest.mark.parametrize('damping', thinned([0.0, 0.01, 0.3], keep=[0.3]))
def test_flutter_is_an_event_of_a_path(damping: float) -> None:
    path = equilibrium_path(column(1.0, damping), over='constant_wrench.force.0', end=-2.6)
    (event,) = path.events
    assert event.name == 'flutter 1' and (event.before, event.after) == ('stable', 'unstable')
    critical = DAMPED + 0.5 * damping**2 if damping else UNDAMPED
    assert event.value == pytest.approx(-critical, abs=1e-8)
    assert path.flutter_points == (event,) and not path.turns and not path.branch_points
    back = equilibrium_path(column(2.6, damping), over='constant_wrench.force.0', end=-1.0)
    assert back.events[0].value == pytest.approx(-critical, abs=1e-8)
    assert (back.events[0].before, back.events[0].after) == ('unstable', 'stable')


PENDULUM = {
    'mechanism': {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [0, -1]}},
        'bodies': {'rod': {'points': ['O', 'A'], 'mass': 2, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
    },
}
GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}


def test_damping_that_gives_energy() -> None:
    giving = {'between': ['A', 'ground'], 'at': [None, [1, 0]], 'table': [[-1, 5], [1, -5]]}
    rest = equilibrium(load_scene({**PENDULUM, 'effects': {**GRAVITY, 'damper': giving}}))
    assert rest.stability == 'unstable' and rest.conservative
    assert any('gives energy' in note for note in rest.notes)
    assert linearise(rest).eigenvalues.real.max() > 0.0


@pytest.mark.parametrize(
    ('law', 'holds'), [({'viscous': 0.1}, False), ({'dynamic': 0.1, 'radius': 0.1}, True)]
)
def test_only_dry_friction_holds(law: dict[str, float], holds: bool) -> None:
    friction = {'joint': 'pin', **law}
    rest = equilibrium(
        load_scene({**PENDULUM, 'effects': {**GRAVITY, 'joint_friction': friction}})
    )
    assert any('friction holds' in note for note in rest.notes) == holds


def beside_a_stiff_slider(scene: dict[str, Any], stiffness: float) -> Scene:
    """The scene, and 1 g on a spring, which has nothing to do with it."""
    mechanism, effects = scene['mechanism'], scene['effects']
    slide = {'type': 'slider', 'point': 'S', 'between': ['ground', 'block']}
    held = {'joint': 'slide', 'stiffness': stiffness, 'free_position': 0}
    springs = effects.get('torsion_spring', {})
    return load_scene(
        {
            'mechanism': {
                **mechanism,
                'points': {**mechanism['points'], 'S': {'at': [9, 0]}},
                'bodies': {
                    **mechanism['bodies'],
                    'block': {'points': ['S'], 'mass': 1e-3, 'inertia': 'point'},
                },
                'joints': {
                    **mechanism['joints'],
                    'slide': {**slide, 'on': {'through': [9, 0], 'direction': [0, 1]}},
                },
            },
            'effects': {**effects, 'torsion_spring': {**springs, 'stiff': held}},
        }
    )


@pytest.mark.parametrize('stiffness', [1e2, 1e6, 1e9])
@pytest.mark.parametrize('down', [-9.81, 9.81])
def test_a_pendulum_beside_a_stiff_slider(stiffness: float, down: float) -> None:
    """A standing one falls, a hanging one swings with its own frequency."""
    effects = {'gravity': {'acceleration': [0, down]}}
    found = beside_a_stiff_slider({**PENDULUM, 'effects': effects}, stiffness)
    rest = equilibrium(found, nearest=True)  # it is drawn at rest
    assert rest.stability == ('stable' if down < 0.0 else 'unstable')
    assert rest.stiffness[0] == pytest.approx(-1.5 * down, rel=1e-6)
    assert modes(rest).squares[0] == pytest.approx(-1.5 * down, rel=1e-6)


@pytest.mark.parametrize('stiffness', [1e2, 1e6, 1e9])
@pytest.mark.parametrize('damping', [0.0, 0.01])
def test_a_column_that_flutters_beside_a_stiff_slider(stiffness: float, damping: float) -> None:
    rest = equilibrium(beside_a_stiff_slider(column_data(2.5, damping), stiffness))
    assert rest.stability == 'unstable' and not rest.conservative
    held = equilibrium(beside_a_stiff_slider(column_data(1.2, damping), stiffness))
    assert held.stability == 'stable' and not held.conservative


@pytest.mark.parametrize('angle', [-2.8, -1.0, 0.3, 2.2])
def test_an_arm_that_a_spring_balances_everywhere(angle: float) -> None:
    """A spring of no free length with k h l = m g c: its stiffness and the one of reactions are
    equal and opposite."""
    c, h, length = 0.34, 0.7, 1.3
    end = [length * math.cos(angle), length * math.sin(angle)]
    rod = {'points': ['O', 'A'], 'mass': 2.0, 'com': [c, 0], 'inertia': {'about_com': 0.1}}
    spring = {'between': ['A', 'ground'], 'at': [None, [0, h]], 'free_length': 0}
    mechanism = {
        **PENDULUM['mechanism'],
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': end}},
        'bodies': {'rod': rod},
    }
    balance = {**spring, 'stiffness': 2.0 * 9.81 * c / (h * length)}
    rest = equilibrium(
        load_scene({'mechanism': mechanism, 'effects': {**GRAVITY, 'spring': balance}})
    )
    assert rest.stability == 'neutral' and rest.stiffness.tolist() == [0.0]


def test_outputs_without_a_slope() -> None:
    """Energies at rest, and points that do not move: the slope is 0, not NaN."""
    rest = equilibrium(load_scene({**PENDULUM, 'effects': GRAVITY}))
    names = ['energy', 'points.O.x', 'points.A.y', 'reactions.pin.force.y', 'points.A.x']
    found = linearise(rest, outputs=names)
    assert found.outputs == tuple(names) and not found.notes
    np.testing.assert_allclose(found.C[:4], np.zeros((4, 2)), atol=1e-9)
    # of unit mass: the moment of inertia is 2/3 kg m²
    np.testing.assert_allclose(np.abs(found.C[4]), [math.sqrt(1.5), 0.0], rtol=1e-9)
