"""Joint coordinates of many states at once, with their derivatives.

N states, K tangents, J joint coordinates. A joint coordinate is an angle of two quadratic forms of
q, or a quadratic form itself, so that all are computed for all states in one pass of numpy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Rows
from alf_ros.model.compile import Model

Slopes = Sequence[Mapping[str, Floats]]  # of each tangent: the slopes of `ParameterSlopes.arrays`


@dataclass(frozen=True, eq=False)
class StateArrays:
    """q, qd (N, blocks D), turns (N, angles), dq and dqd (N, K, blocks D): what a run passed."""

    q: Floats
    qd: Floats
    turns: Integers
    dq: Floats
    dqd: Floats


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Positions x and velocities v (N, J), rad or m, and their derivatives dx, dv (N, J, K)."""

    x: Floats
    v: Floats
    dx: Floats
    dv: Floats


class JointReadings:
    """Reads joint coordinates of a model; `slopes`: of its tangents, none without tangents."""

    def __init__(self, model: Model, slopes: Slopes = ()) -> None:
        D = model.layout.dimension
        self._angles = _Forms(model.system.angles, D, slopes, 'angle')
        self._lengths = _Forms(model.lengths, D, slopes, 'length')
        counted = model.system.angles.c.size // 2
        each = [(c.place if c.is_angle else counted + c.place, c.less) for c in model.coordinates]
        self._place, self._less = np.array(each, dtype=np.int64).reshape(-1, 2).T
        self.is_angle = np.array([c.is_angle for c in model.coordinates], dtype=bool)

    def read(self, of: StateArrays) -> JointMotion:
        """Of all joint coordinates, in the order of `Model.coordinate_names`."""
        form, rate, change, faster = self._angles.read(of)
        x, y, xd, yd = form[:, ::2], form[:, 1::2], rate[:, ::2], rate[:, 1::2]
        dx, dy, dxd, dyd = (part[..., k::2] for part in (change, faster) for k in (0, 1))
        square = x * x + y * y
        angle, spin = np.arctan2(y, x) + 2.0 * np.pi * of.turns, (x * yd - y * xd) / square
        x, y, xd, yd, s, spun = (each[:, None] for each in (x, y, xd, yd, square, spin))
        turned = (x * dy - y * dx) / s
        grown = 2.0 * spun * (x * dx + y * dy)
        spun_by = (dx * yd + x * dyd - dy * xd - y * dxd - grown) / s
        length, pace, longer, quicker = self._lengths.read(of)
        return JointMotion(
            self._chosen(angle, length),
            self._chosen(spin, pace),
            self._chosen(turned, longer).transpose(0, 2, 1),
            self._chosen(spun_by, quicker).transpose(0, 2, 1),
        )

    def _chosen(self, angles: Floats, lengths: Floats) -> Floats:
        each = np.concatenate([angles, lengths], axis=-1)
        found = each[..., self._place]
        relative = self._less >= 0
        found[..., relative] -= each[..., self._less[relative]]
        return found


class _Forms:
    """Quadratic forms c + Σ q_e · (b_e + ½ Σ T q), and their slopes."""

    def __init__(self, rows: Rows, D: int, slopes: Slopes, name: str) -> None:
        first, first_term = rows.first.astype(np.int64), rows.first_term.astype(np.int64)
        self._D, self._block = D, rows.block.astype(np.int64)
        self._term_block = rows.term_block.astype(np.int64)
        self._of_row = _sums(first)  # entries to rows
        self._of_entry = _sums(first_term)  # terms to entries
        self._b, self._c = rows.b.reshape(-1, D), rows.c
        self._T = rows.term.reshape(-1, D, D)
        entries, terms, forms = len(self._b), len(self._T), self._c.size
        self._db = _stacked(slopes, f'{name}_b', (entries, D))
        self._dc = _stacked(slopes, f'{name}_c', (forms,))
        self._dT = _stacked(slopes, f'{name}_term', (terms, D, D))

    def read(self, of: StateArrays) -> tuple[Floats, Floats, Floats, Floats]:
        """Values and rates (N, forms), and the derivatives of both (N, K, forms)."""
        q, v, dq, dv = (_blocks(each, self._D) for each in (of.q, of.qd, of.dq, of.dqd))
        at, going = q[:, self._block], v[:, self._block]
        bent = self._bent(self._T, q)
        gradient = self._b + bent
        value = self._c + self._rows(at * (self._b + 0.5 * bent))
        rate = self._rows(gradient * going)
        dat, dgoing = dq[:, :, self._block], dv[:, :, self._block]
        change = self._rows(gradient[:, None] * dat)
        faster = self._rows(gradient[:, None] * dgoing)
        faster += self._rows(self._bent(self._T, dq) * going[:, None])
        if len(self._db):
            own = np.einsum('tf,knta->knfa', self._of_entry, self._own_terms(q))
            own = own.transpose(1, 0, 2, 3)  # (N, K, entries, D)
            change += self._dc + self._rows(at[:, None] * (self._db + 0.5 * own))
            faster += self._rows((self._db + own) * going[:, None])
        return value, rate, change, faster

    def _own_terms(self, q: Floats) -> Floats:
        return np.einsum('ktab,ntb->knta', self._dT, q[:, self._term_block])

    def _bent(self, T: Floats, q: Floats) -> Floats:
        """T q of each entry (…, entries, D)."""
        each = np.einsum('tab,...tb->...ta', T, q[..., self._term_block, :])
        return np.einsum('te,...ta->...ea', self._of_entry, each)

    def _rows(self, entries: Floats) -> Floats:
        """(…, entries, D) -> (…, forms)."""
        return np.asarray(entries.sum(axis=-1) @ self._of_row)


def _sums(first: Integers) -> Floats:
    """(parts, wholes) 1 where a part belongs to a whole."""
    owner = np.repeat(np.arange(first.size - 1), np.diff(first))
    found = np.zeros((owner.size, first.size - 1))
    found[np.arange(owner.size), owner] = 1.0
    return found


def _stacked(slopes: Slopes, name: str, shape: tuple[int, ...]) -> Floats:
    return np.array([each[name] for each in slopes]).reshape(len(slopes), *shape)


def _blocks(array: Floats, D: int) -> Floats:
    return array.reshape(*array.shape[:-1], array.shape[-1] // D, D)
