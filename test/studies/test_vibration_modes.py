"""Natural frequencies and shares of bodies, dense and by Lanczos, against closed forms."""

from __future__ import annotations

import runpy

import numpy as np
import pytest
import scipy.linalg

from alf_ros import InputError, equilibrium, load_scene, modes
from alf_ros.studies.statics.lowest_modes import lowest
from support.paths import ROOT
from support.statics_scenes import GRAVITY, KNOWN, chain, redundant_parallelogram, sprung

BENCHMARK = runpy.run_path(str(ROOT / 'benchmark' / 'modes.py'))


def test_a_chain_has_the_zeros_of_laguerre() -> None:
    found = modes(chain(6), count=4)
    zeros = np.polynomial.laguerre.lagroots([0.0] * 6 + [1.0])[:4]
    np.testing.assert_allclose(found.squares, 9.81 * zeros, rtol=1e-10)
    np.testing.assert_allclose(found.frequencies, np.sqrt(9.81 * zeros) / (2 * np.pi), rtol=1e-10)
    # all comes from the tension in the bars: gravity is constant
    np.testing.assert_allclose(found.potential_shares['reactions'], np.ones(4), atol=1e-9)
    np.testing.assert_allclose(found.damping_ratios, np.zeros(4), atol=1e-12)
    assert np.abs(found.shapes).max(axis=1) == pytest.approx(np.ones(4))


def test_shares_of_bodies_and_effects() -> None:
    """Of equal rods in a parallelogram a crank has 1/9 of the kinetic energy, a coupler 1/3."""
    known = KNOWN['double_four_bar'][0]
    near = {name: [float(x) for x in at] for name, at in known['points'].items()}
    found = modes(equilibrium(sprung('double_four_bar', near), nearest=True))
    assert found.squares[0] == pytest.approx(float(known['square']), rel=1e-10)
    shares = {name: share[0] for name, share in found.kinetic_shares.items()}
    cranks, couplers = (
        dict.fromkeys(('crank0', 'crank1', 'crank2'), 1 / 9),
        ('coupler1', 'coupler2'),
    )
    assert shares == pytest.approx(cranks | dict.fromkeys(couplers, 1 / 3))
    assert sum(share[0] for share in found.potential_shares.values()) == pytest.approx(1.0)
    assert found.potential_shares['gravity'][0] == 0.0


def test_shares_of_rotors() -> None:
    """A double pendulum with a rotor in each joint: the exact modes of two freedoms."""
    first, second = 0.2, 0.15  # kg m^2
    scene = load_scene(
        {
            'mechanism': 'double_pendulum',
            'effects': {
                **GRAVITY,
                'motor': {
                    'a': {'joint': 'shoulder', 'armature': first},
                    'b': {'joint': 'elbow', 'armature': second},
                },
            },
        }
    )
    found = modes(scene)
    mechanism = scene.mechanism
    upper, lower = (mechanism.bodies[k] for k in (0, 1))
    a, b = 1.0, 0.8  # m
    m, n = upper.mass, lower.mass
    bodies = {
        upper.name: np.array([[m * a**2 / 3, 0], [0, 0]]),
        lower.name: n * np.array([[a**2, a * b / 2], [a * b / 2, b**2 / 3]]),
        'motor.a.rotor': first * np.array([[1.0, 0.0], [0.0, 0.0]]),
        'motor.b.rotor': second * np.array([[1.0, -1.0], [-1.0, 1.0]]),
    }
    K = 9.81 * np.diag([m * a / 2 + n * a, n * b / 2])
    squares, vectors = scipy.linalg.eigh(K, sum(bodies.values()))
    np.testing.assert_allclose(found.squares, squares, rtol=1e-10)
    assert list(found.kinetic_shares) == list(bodies)
    for name, M in bodies.items():
        exact = np.einsum('ik,ij,jk->k', vectors, M, vectors)
        np.testing.assert_allclose(found.kinetic_shares[name], exact, atol=1e-10)
    np.testing.assert_allclose(sum(found.kinetic_shares.values()), [1.0, 1.0], rtol=1e-12)


def test_lanczos_finds_what_dense_matrices_find() -> None:
    rest = equilibrium(chain(10))
    dense = modes(rest, count=4)
    squares, motions = lowest(dense.instant, dense.lam, 4)
    np.testing.assert_allclose(squares, dense.squares, rtol=1e-10)
    overlap = np.abs(motions @ (dense.instant.M @ dense.motions.T))
    np.testing.assert_allclose(overlap, np.eye(4), atol=1e-8)


def test_lanczos_of_a_large_mechanism_with_waves() -> None:
    count = 310  # four-bars: 1240 coordinates, no dense matrix
    found = modes(BENCHMARK['row'](count), count=8)
    np.testing.assert_allclose(found.squares, BENCHMARK['exact'](count, 8), rtol=1e-9)


def test_redundant_and_unstable_mechanisms_have_modes() -> None:
    found = modes(redundant_parallelogram(np.pi / 2.0))
    assert found.squares[0] == pytest.approx(-9.81 * 2.5 / 2.0, rel=1e-11)
    assert np.isnan(found.frequencies[0])
    squares, _ = lowest(found.instant, found.lam, 1)  # the shift is below zero here
    assert squares[0] == pytest.approx(found.squares[0], rel=1e-9)


def test_refused() -> None:
    with pytest.raises(InputError, match='count'):
        modes(chain(1), count=0)
    rest = equilibrium(chain(3))
    found = modes(rest)
    with pytest.raises(InputError, match='lowest modes were not found'):
        lowest(found.instant, found.lam, 40)
    with pytest.raises(InputError, match='singular position'):
        modes(load_scene({'mechanism': 'slider_crank', 'effects': GRAVITY}))


def test_a_motion_without_stiffness_has_no_frequency() -> None:
    """A coin that hangs by its rim under the table rolls and turns freely; rounding is no ω²."""
    found = modes(load_scene('coin'))
    assert found.squares[:2].tolist() == [0.0, 0.0]
    assert found.squares[2] == pytest.approx(9.81 / (1.25 * 0.0129), rel=1e-8)
    assert np.isnan(found.damping_ratios[:2]).all()
