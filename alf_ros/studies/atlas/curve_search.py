"""All curves of positions that a search from many places finds, and the nodes where they meet.

From each start a curve is followed both ways. Where it ends in a singular position, all branches
there are followed too. A start that lies on a known piece finds nothing new.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.inspection.branches_report import Branches, reported
from alf_ros.logs.progress import Report, silent
from alf_ros.model import assembly, singular_branches
from alf_ros.model.handedness import Handedness
from alf_ros.model.sure_step import BESIDE, SAME, change
from alf_ros.studies.atlas.configuration_curve import (
    CurveSpace,
    Piece,
    followed,
)
from alf_ros.studies.atlas.random_places import RandomPlaces

_SAME = 1e-4  # of the size: two nodes that are one
_ALONG = 0.7  # least product of the direction in which a piece arrives and that of its branch
_MOST_NODES = 200
_MOST_STARTS = 50  # times the patience


@dataclass(frozen=True, eq=False)
class Node:
    """A singular position where pieces end: `q` (blocks D, m); what it is; and directions (k, n)
    in which curves leave it."""

    q: Floats
    report: Branches
    directions: Floats


@dataclass(eq=False)
class CurveSearch:
    """The pieces and nodes found so far.

    drawn (blocks D, m): around which random starts are; starts: how many there were, vain: of them
    since the last find, finds: how many found something new; hits: how many starts closed on each
    piece; closed_starts: starts that closed at all; mirrored: of these with a body as its mirror
    image; rigid_starts: where redundant rows let nothing move.
    """

    space: CurveSpace
    dependent: int
    drawn: Floats
    pieces: list[Piece] = field(default_factory=list)
    nodes: list[Node] = field(default_factory=list)
    hits: list[int] = field(default_factory=list)
    starts: int = 0
    vain: int = 0
    finds: int = 0
    closed_starts: int = 0
    mirrored: int = 0
    rigid_starts: int = 0
    _left: list[set[int]] = field(default_factory=list)  # directions of a node not followed yet

    def __post_init__(self) -> None:
        self._handedness = Handedness(self.space.model)

    def start_at(self, q: Floats) -> None:
        """Follow the curve through q (blocks D, m), if it is a new one."""
        space = self.space
        at = space.at(q)
        self.closed_starts += 1
        if self._handedness.is_mirrored(q):
            self.mirrored += 1
            return
        if at.rank > space.rank:
            self.rigid_starts += 1
            return
        if at.rank < space.rank or space.sigma(at) < BESIDE:
            return
        known = self._piece_at(q)
        if known >= 0:
            self.hits[known] += 1
            return
        self._follow(q, at.free[:, -1])
        while any(self._left):
            node = next(n for n, left in enumerate(self._left) if left)
            which = self._left[node].pop()
            self._leave(node, which)

    def search(self, patience: int, seed: int, report: Report = silent) -> None:
        """Start at random places until `patience` of them in a row found nothing new. `report`
        takes the part that is done if the others find nothing new, 0 to 1."""
        model = self.space.known
        places, random = RandomPlaces(model, self.drawn, seed), np.random.default_rng(seed)
        while self.vain < patience and self.starts < _MOST_STARTS * patience:
            report(self.starts / (self.starts + patience - self.vain))
            known = [piece.q[random.integers(len(piece.q))] for piece in self.pieces]
            before = len(self.pieces)
            try:
                self.start_at(assembly.close(model, {}, places.place(self.starts, known)))
            except AssemblyError:
                pass
            self.starts += 1
            found = len(self.pieces) > before
            self.finds += found
            self.vain = 0 if found else self.vain + 1

    def circuits(self) -> list[int]:
        """The number of the circuit of each piece: pieces that meet in a node are of one."""
        of = list(range(len(self.pieces)))

        def root(n: int) -> int:
            while of[n] != n:
                n = of[n]
            return n

        first: dict[int, int] = {}
        for n, piece in enumerate(self.pieces):
            for end in piece.ends:
                if end >= 0:
                    of[root(n)] = root(first.setdefault(end, n))
        roots = [root(n) for n in range(len(self.pieces))]
        numbers = {r: k for k, r in enumerate(dict.fromkeys(roots), 1)}
        return [numbers[r] for r in roots]

    # -------------------------------------------------------------------------------- following

    def _follow(self, q: Floats, direction: Floats) -> None:
        """A piece through a position that is not singular, both ways."""
        one = followed(self.space, q, direction, from_node=False)
        if one.piece.closed:
            self._keep(one.piece, 1)
            return
        other = followed(self.space, q, -direction, from_node=False)
        first = self._arrived(other.node, other.piece)
        last = self._arrived(one.node, one.piece)
        back = other.piece.reversed()
        whole = Piece(
            back.q[:-1] + one.piece.q,
            back.tangents[:-1] + one.piece.tangents,
            back.sigma[:-1] + one.piece.sigma,
            complete=one.piece.complete and other.piece.complete,
        )
        whole.ends = (first, last)
        self._keep(whole, 1)

    def _leave(self, node: int, which: int) -> None:
        """A piece from a node, along one of its directions."""
        here = self.nodes[node]
        found = followed(self.space, here.q, here.directions[which], from_node=True)
        found.piece.ends = (node, self._arrived(found.node, found.piece))
        if len(found.piece.q) > 1:
            self._keep(found.piece)

    def _keep(self, piece: Piece, hits: int = 0) -> None:
        """Keep a piece, unless it is a known one: a start beside a node is nearer to it than all
        positions known there, so only its piece tells."""
        known = self._piece_at(piece.q[int(np.argmax(piece.sigma))])
        if known >= 0 and not piece.singular:
            self.hits[known] += hits
            return
        self.pieces.append(piece)
        self.hits.append(hits)

    def _arrived(self, q: Floats | None, piece: Piece) -> int:
        """The node of an end; the direction in which the piece came to it is followed already, and
        is its tangent there."""
        if q is None:
            return -1
        node = self._node(q)
        here = self.nodes[node]
        if len(here.directions):
            last = piece.q[-1] - piece.q[-2]
            back = -last[: self.space.model.n] / np.linalg.norm(last[: self.space.model.n])
            products = here.directions @ back
            best = int(np.argmax(products))
            if products[best] > _ALONG:
                self._left[node].discard(best)
                piece.tangents[-1] = -here.directions[best]
        return node

    # ------------------------------------------------------------------------------------ nodes

    def _node(self, q: Floats) -> int:
        """The number of the node at q, a new one if it is not known."""
        same = _SAME * self.space.model.size
        for number, node in enumerate(self.nodes):
            if np.abs(q - node.q).max() < same:
                return number
        n = self.space.model.n
        here = singular_branches.position(self.space.known, q)
        lines = [b.directions[0][:n] for b in here.branches if b.dimension == 1]
        directions = [sign * d / np.linalg.norm(d) for d in lines for sign in (1.0, -1.0)]
        report = reported(here, self.dependent)
        self.nodes.append(Node(q, report, np.array(directions).reshape(-1, n)))
        few = len(self.nodes) <= _MOST_NODES
        self._left.append(set(range(len(directions))) if few else set())
        return len(self.nodes) - 1

    def _piece_at(self, q: Floats) -> int:
        """The number of the piece that q lies on, -1 if it is none."""
        n, space = self.space.model.n, self.space
        here = space.at(q)
        for number, piece in enumerate(self.pieces):
            if piece.singular:
                continue
            places = np.array([each[:n] for each in piece.q])
            gaps = np.linalg.norm(places - q[:n], axis=1)
            gaps[np.array(piece.sigma) < BESIDE] = np.inf  # Φ_q tells nothing there
            nearest = int(np.argmin(gaps))
            if gaps[nearest] < 1.5 * space.longest:
                if change(space.at(piece.q[nearest]), here, space.rank) < SAME:
                    return number
        return -1
