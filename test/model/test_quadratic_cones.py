"""Common zeros of quadratic forms, against cones that are known."""

from __future__ import annotations

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.model.quadratic_cones import CROSSING, CURVED, MANY, SHAKY, subspaces

NOISE = 1e-7


def product(one: Floats, two: Floats) -> Floats:
    return 0.5 * (np.outer(one, two) + np.outer(two, one))


def disguised(forms: Floats, seed: int = 0) -> tuple[Floats, Floats, Floats]:
    """The forms in a turned basis, mixed with one another; the turn; and a basis to work in."""
    random = np.random.default_rng(seed)
    k, r, _ = forms.shape
    turn = np.linalg.qr(random.standard_normal((r, r)))[0]
    mixed = np.tensordot(random.standard_normal((k, k)), turn @ forms @ turn.T, 1)
    return mixed, turn, turn.T.copy()


@pytest.mark.parametrize('n', [1, 2, 5, 12, 30])
def test_a_chain_has_a_line_for_each_begin(n: int) -> None:
    """b_k (b_k - b_k+1) = 0: zero up to one of them, and equal from there on."""
    e = np.eye(n + 1)
    forms = np.array([product(e[k], e[k] - e[k + 1]) for k in range(n)])
    mixed, turn, local = disguised(forms)
    kind, found = subspaces(mixed, NOISE, local)
    assert kind == CROSSING and len(found) == n + 1
    lines = sorted(np.abs(line[0] @ turn).round(9).tolist() for line in found)
    wanted = [np.where(np.arange(n + 1) >= k, (n + 1 - k) ** -0.5, 0.0) for k in range(n + 1)]
    assert lines == pytest.approx(np.array(sorted(w.tolist() for w in wanted)), abs=1e-8)


@pytest.mark.parametrize('n', [1, 3, 6])
def test_conditions_apart_multiply(n: int) -> None:
    random = np.random.default_rng(1)
    forms = np.zeros((n, 2 * n, 2 * n))
    for k in range(n):
        a, b = random.standard_normal((2, 2))
        forms[k, 2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = product(a, b)
    mixed, _, local = disguised(forms)
    kind, found = subspaces(mixed, NOISE, local)
    assert kind == CROSSING and [len(each) for each in found] == [n] * 2**n
    for each in found:
        assert each @ each.T == pytest.approx(np.eye(n), abs=1e-12)
        assert np.abs(each @ mixed @ each.T).max() < 1e-11


@pytest.mark.parametrize('seed', range(5))
def test_products_at_random(seed: int) -> None:
    """Every choice of factors is a subspace, in whatever basis."""
    random = np.random.default_rng(seed)
    forms = np.array([product(*pair) for pair in random.standard_normal((3, 2, 6))])
    kind, found = subspaces(forms, NOISE, random.standard_normal((6, 6)))
    assert kind == CROSSING and [len(each) for each in found] == [3] * 8
    for each in found:
        assert np.abs(each @ forms @ each.T).max() < 1e-11


def test_kinds() -> None:
    assert subspaces(np.eye(3)[None], NOISE, np.eye(3))[0] == SHAKY
    assert subspaces(np.diag([1.0, 1.0, -1.0])[None], NOISE, np.eye(3))[0] == CURVED
    kind, found = subspaces(np.diag([1.0, 0.0, 0.0])[None], NOISE, np.eye(3))
    assert kind == CROSSING and len(found) == 1 and len(found[0]) == 2
    random = np.random.default_rng(0)
    forms = random.standard_normal((8, 9, 9))
    assert subspaces(forms + forms.transpose(0, 2, 1), NOISE, np.eye(9))[0] == MANY
