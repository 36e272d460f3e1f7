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
from alf_ros.simulation.state_trail import StateArrays

Slopes = Sequence[Mapping[str, Floats]]  # of each tangent: the slopes of `ParameterSlopes.arrays`


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Positions x and velocities v (N, J), rad or m, and their derivatives dx, dv (N, J, K)."""

    x: Floats
    v: Floats
    dx: Floats
    dv: Floats


class JointReadings:
    """Reads joint coordinates of a model; `slopes`: of its tangents, none without tangents;
    `joints`: the numbers of the coordinates to read, all by default."""

    def __init__(
        self, model: Model, slopes: Slopes = (), joints: Sequence[int] | None = None
    ) -> None:
        D, every = model.layout.dimension, model.coordinates
        read = every if joints is None else [every[n] for n in joints]
        places = {p for c in read if c.is_angle for p in (c.place, c.less) if p >= 0}
        angles = sorted(places)
        lengths = sorted({c.place for c in read if not c.is_angle})
        pairs = [form for p in angles for form in (2 * p, 2 * p + 1)]
        self._angles = _Forms(model.system.angles, D, slopes, 'angle', pairs)
        self._lengths = _Forms(model.lengths, D, slopes, 'length', lengths)
        self._turns = np.array(angles, dtype=np.int64)
        at = {place: n for n, place in enumerate(angles)}
        each = [
            (
                at[c.place] if c.is_angle else len(angles) + lengths.index(c.place),
                at.get(c.less, -1),
            )
            for c in read
        ]
        self._place, self._less = np.array(each, dtype=np.int64).reshape(-1, 2).T
        self.is_angle = np.array([c.is_angle for c in read], dtype=bool)

    def read(self, of: StateArrays) -> JointMotion:
        """Of the joint coordinates, in the order of `joints` or `Model.coordinate_names`."""
        form, rate, change, faster = self._angles.read(of)
        x, y, xd, yd = form[:, ::2], form[:, 1::2], rate[:, ::2], rate[:, 1::2]
        dx, dy, dxd, dyd = (part[..., k::2] for part in (change, faster) for k in (0, 1))
        square = x * x + y * y
        angle, spin = (
            np.arctan2(y, x) + 2.0 * np.pi * of.turns[:, self._turns],
            (x * yd - y * xd) / square,
        )
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
    """Quadratic forms c + Σ q_e · (b_e + ½ Σ T q) that are `asked` for, and their slopes.

    Of the blocks that these forms have, U, a gradient is G (N, forms, U D).
    """

    def __init__(
        self, rows: Rows, D: int, slopes: Slopes, name: str, asked: Sequence[int]
    ) -> None:
        forms = np.array(asked, dtype=np.int64)
        of_row = _sums(rows.first.astype(np.int64))[:, forms]  # entries to rows
        entries = np.flatnonzero(of_row.any(axis=1))
        of_entry = _sums(rows.first_term.astype(np.int64))[:, entries]  # terms to entries
        terms = np.flatnonzero(of_entry.any(axis=1))
        block = rows.block.astype(np.int64)[entries]
        term_block = rows.term_block.astype(np.int64)[terms]
        self._D, self._used = D, np.unique(np.concatenate([block, term_block]))
        self._block = np.searchsorted(self._used, block)
        self._term_block = np.searchsorted(self._used, term_block)
        self._of_row, self._of_entry = of_row[entries], of_entry[terms]
        self._at_block = _placed(self._of_row, self._block, self._used.size)
        of_term = self._of_entry @ self._of_row
        self._at_term_block = _placed(of_term, self._term_block, self._used.size)
        self._b, self._c = rows.b.reshape(-1, D)[entries], rows.c[forms]
        self._T = rows.term.reshape(-1, D, D)[terms]
        self._db = _stacked(slopes, f'{name}_b', (rows.block.size, D))[:, entries]
        self._dc = _stacked(slopes, f'{name}_c', (rows.c.size,))[:, forms]
        self._dT = _stacked(slopes, f'{name}_term', (rows.term_block.size, D, D))[:, terms]
        self._change = bool(self._db.any() or self._dc.any() or self._dT.any())

    def read(self, of: StateArrays) -> tuple[Floats, Floats, Floats, Floats]:
        """Values and rates (N, forms), and the derivatives of both (N, K, forms)."""
        q, v, dq, dv = (self._blocks(each) for each in (of.q, of.qd, of.dq, of.dqd))
        at, going = q[:, self._block], v[:, self._block]
        bent = np.einsum('tab,ntb->nta', self._T, q[:, self._term_block])
        bent = np.einsum('te,nta->nea', self._of_entry, bent)
        value = self._c + self._rows(at * (self._b + 0.5 * bent))
        gradient = self._b + bent
        rate = self._rows(gradient * going)
        G = self._spread(gradient, self._at_block)
        pushed = np.einsum('te,nea->nta', self._of_entry, going)
        H = self._spread(np.einsum('nta,tab->ntb', pushed, self._T), self._at_term_block)
        flat_dq, flat_dv = (each.reshape(*each.shape[:2], G.shape[1]) for each in (dq, dv))
        change, faster = flat_dq @ G, flat_dv @ G + flat_dq @ H
        if self._change:
            own = np.einsum('ktab,ntb->knta', self._dT, q[:, self._term_block])
            own = np.einsum('te,knta->nkea', self._of_entry, own)
            change += self._dc + self._rows(at[:, None] * (self._db + 0.5 * own))
            faster += self._rows((self._db + own) * going[:, None])
        return value, rate, change, faster

    def _spread(self, gradient: Floats, places: Floats) -> Floats:
        """(N, U D, forms) of gradients (N, parts, D) of the parts at these places."""
        found = np.tensordot(gradient, places, axes=(1, 0)).transpose(0, 3, 1, 2)
        columns = self._used.size * self._D
        return np.asarray(found.reshape(len(gradient), columns, self._c.size))

    def _rows(self, entries: Floats) -> Floats:
        """(…, entries, D) -> (…, forms)."""
        return np.einsum('...ea,ef->...f', entries, self._of_row)

    def _blocks(self, array: Floats) -> Floats:
        """(…, blocks D) -> (…, U, D)."""
        blocks = array.reshape(*array.shape[:-1], array.shape[-1] // self._D, self._D)
        return np.take(blocks, self._used, axis=-2)  # contiguous


def _placed(of_row: Floats, block: Integers, blocks: int) -> Floats:
    """(parts, forms, U) 1 where a part of a form is at a block."""
    found = np.zeros((*of_row.shape, blocks))
    found[np.arange(block.size), :, block] = of_row
    return found


def _sums(first: Integers) -> Floats:
    """(parts, wholes) 1 where a part belongs to a whole."""
    owner = np.repeat(np.arange(first.size - 1), np.diff(first))
    found = np.zeros((owner.size, first.size - 1))
    found[np.arange(owner.size), owner] = 1.0
    return found


def _stacked(slopes: Slopes, name: str, shape: tuple[int, ...]) -> Floats:
    return np.array([each[name] for each in slopes]).reshape(len(slopes), *shape)
