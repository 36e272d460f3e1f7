"""Atlases against closed forms: circuits, travel limits, singular positions, transmission.

Three seeds of the search; twenty with make thorough ARGS=test/studies/test_atlas.py.
"""

from __future__ import annotations

import csv
import functools
import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Atlas, InputError, atlas
from alf_ros import __main__ as program
from alf_ros.errors import AssemblyError
from alf_ros.model.dense_linearisation import Linearised
from support.browser import CHROMIUM, Browser
from support.thorough import LONG, thinned

SEEDS = range(20 if LONG else 3)
found_of = functools.cache(atlas)  # what several tests look at
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason='no chromium')


def four_bar(a: float, b: float, c: float, d: float) -> dict[str, Any]:
    """Crank a, coupler b, rocker c on a ground of d; drawn closed."""
    reach = min(d, b + c - a) if a + d > b + c else d
    cosine = (a * a + d * d - reach * reach) / (2 * a * d)
    theta = 0.9 * math.acos(max(-1.0, min(1.0, cosine))) + 0.05
    A = np.array([a * math.cos(theta), a * math.sin(theta)])
    f = math.hypot(d - A[0], A[1])
    along = (np.array([d, 0.0]) - A) / f
    x = (f * f + b * b - c * c) / (2 * f)
    B = A + x * along + math.sqrt(b * b - x * x) * np.array([-along[1], along[0]])
    rod = {'mass': 1.0, 'inertia': 'rod'}
    return {
        'alf': 1,
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'C': {'at': [d, 0], 'fixed': True},
            'A': {'at': A.tolist()},
            'B': {'at': B.tolist()},
        },
        'bodies': {
            'crank': {'points': ['O', 'A'], **rod},
            'coupler': {'points': ['A', 'B'], **rod},
            'rocker': {'points': ['C', 'B'], **rod},
        },
        'joints': {
            'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
            'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
            'wrist': {'type': 'revolute', 'between': ['coupler', 'rocker'], 'at': 'B'},
            'foot': {'type': 'revolute', 'between': ['ground', 'rocker'], 'at': 'C'},
        },
    }


def values(found: Atlas, kind: str) -> list[float]:
    return sorted(turning.value for turning in found.turnings if turning.kind == kind)


# ------------------------------------------------------------------------------- one freedom


def test_a_crank_and_rocker() -> None:
    a, b, c, d = 1.0, 3.0, 2.5, 3.2
    found = atlas(four_bar(a, b, c, d), 'pin', output='foot', bar=['A', 'B'])
    assert found.limits() == {1: (-math.inf, math.inf), 2: (-math.inf, math.inf)}
    assert [count for _, _, count in found.counts()] == [2]
    assert not found.nodes and not values(found, 'travel limit')
    # dead points of the rocker: crank and coupler in line
    wanted = []
    for reach in (b + a, b - a):
        inner = math.acos((d * d + reach * reach - c * c) / (2 * d * reach))
        wanted += [inner, -inner] if reach > b else [inner - math.pi, math.pi - inner]
    assert values(found, 'dead point') == pytest.approx(sorted(wanted), abs=1e-9)
    for piece in found.pieces:
        theta = piece.over
        f2 = a * a + d * d - 2 * a * d * np.cos(theta)
        mu = np.arccos((b * b + c * c - f2) / (2 * b * c))
        assert piece.transmission == pytest.approx(np.minimum(mu, np.pi - mu), abs=1e-9)
        # ψ' / θ' = a sin(θ - φ) / (c sin(ψ - φ)), φ of the coupler
        q = piece.q.reshape(len(piece.q), -1, 2)
        of = found.model.layout.of_point
        A, B = q[:, of['A']], q[:, of['B']]
        phi = np.arctan2(*(B - A).T[::-1])
        psi = np.arctan2(*(B - [d, 0.0]).T[::-1])
        ratio = a * np.sin(theta - phi) / (c * np.sin(psi - phi))
        assert piece.velocity_ratio == pytest.approx(ratio, abs=1e-9)
        assert piece.velocity_ratio * piece.advantage == pytest.approx(1.0, abs=1e-12)


def test_an_atlas_tells_how_far_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[float] = []
    (sheet,) = atlas('four_bar', 'crank_pin', starts=5, report=told.append).sheets
    assert len(told) == sheet.starts  # the last five found nothing new
    last = range(len(told) - 5, len(told))
    assert told[-5:] == [k / sheet.starts for k in last]
    told.clear()
    over = ['B.x', 'B.y']
    both = atlas('double_pendulum', over, levels=3, starts=2, report=told.append)
    assert len(told) == sum(sheet.starts for sheet in both.sheets)
    assert [int(3 * part + 1e-9) for part in told] == sorted(int(3 * p + 1e-9) for p in told)
    monkeypatch.setattr('alf_ros.commands.progress._LINES', 0.0)
    assert program.main(['atlas', 'four_bar', '--over', 'crank_pin', '--starts', '5']) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == sheet.starts and lines[-1].startswith('atlas  ')


def test_travel_limits_of_a_rocker() -> None:
    a, b, c, d = 1.0, 3.0, 2.5, 3.2
    found = atlas(four_bar(a, b, c, d), 'foot')
    wanted = []
    for reach in (b + a, b - a):
        inner = math.acos((d * d + c * c - reach * reach) / (2 * d * c))
        wanted += [math.pi - inner, inner - math.pi]
    assert values(found, 'travel limit') == pytest.approx(sorted(wanted), abs=1e-9)
    limits = sorted(found.limits().values())
    assert np.array(limits) == pytest.approx(np.sort(wanted).reshape(2, 2), abs=1e-9)
    assert [count for _, _, count in found.counts()] == [0, 2, 0, 2, 0]


def test_a_triple_rocker_is_one_circuit() -> None:
    a, b, c, d = 2.0, 1.0, 2.2, 4.0
    found = atlas(four_bar(a, b, c, d), 'pin')
    end = math.acos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    assert [*found.limits()[1]] == pytest.approx([-end, end], abs=1e-9)
    ((branches,),) = [[len(piece.branches()) for piece in found.pieces]]
    assert branches >= 2


def gap_angle(p: float, q: float, r: float, s: float) -> float:
    """The least inner angle of neighbours p, q in a four-bar with r, s, without cancellation."""
    squares = ((r - s) ** 2 - (p - q) ** 2) / (4 * p * q)
    return 2 * math.asin(math.sqrt(max(0.0, squares)))


@pytest.mark.parametrize('off', thinned([1e-3, 1e-5, 1e-7, 1e-10], keep=[1e-3, 1e-10]))
def test_curves_that_nearly_cross_are_two_or_one(off: float) -> None:
    """Two circuits of full turns on one side of a change point; on the other side one, of a crank
    that turns back just before it would lie flat."""
    a, c, d = 1.0, 2.5, 1.5
    two = atlas(four_bar(a, 3.0 - off, c, d), 'pin', starts=30)
    assert not two.nodes and all(piece.piece.closed for piece in two.pieces)
    assert two.limits() == {1: (-math.inf, math.inf), 2: (-math.inf, math.inf)}
    one = atlas(four_bar(a, 3.0 + off, c, d), 'pin', starts=30)
    assert not one.nodes and [piece.piece.closed for piece in one.pieces] == [True]
    end = gap_angle(a, d, 3.0 + off, c)
    assert [*one.limits()[1]] == pytest.approx([end, 2 * math.pi - end], abs=1e-8)


@pytest.mark.parametrize('off', thinned([1e-4, 1e-6, 1e-9], keep=[1e-9]))
def test_near_two_change_points_there_is_one_circuit(off: float) -> None:
    """A parallelogram and a kite that miss both of their crossings. The kite goes round its fold,
    where the crank nearly stands still."""
    for lengths in ((1.0, 2.0 + off, 1.0, 2.0), (1.0, 2.0 + off, 2.0, 1.0)):
        a, b, c, d = lengths
        found = atlas(four_bar(*lengths), 'pin', starts=30)
        assert not found.nodes and [piece.piece.closed for piece in found.pieces] == [True]
        end = gap_angle(a, d, b, c)
        limits = sorted(turn.value for turn in found.turnings)
        assert limits == pytest.approx([-end, end], abs=1e-8)


@pytest.mark.parametrize('off', [1e-12, -1e-12])
def test_curves_nearer_than_the_resolution_cross(off: float) -> None:
    found = atlas(four_bar(1.0, 3.0 + off, 2.5, 1.5), 'pin', starts=30)
    assert [node.report.kind for node in found.nodes] == ['crossing']
    assert [piece.piece.ends for piece in found.pieces] == [(0, 0), (0, 0)]


def test_a_start_beside_a_node_makes_no_second_piece() -> None:
    """A four-bar near a kite. The search starts between the node and the nearest position of a
    piece, where Φ_q changes by more than itself to that position."""
    lengths = 2.0320866916651292, 1.3286501560913364, 1.330030918127784, 2.030705929628682
    mechanism = four_bar(*lengths)
    mechanism['points']['A']['at'] = [2.03, -0.082]
    mechanism['points']['B']['at'] = [0.702, -0.059]
    for body, length in zip(('crank', 'coupler', 'rocker'), lengths, strict=False):
        mechanism['bodies'][body]['length'] = length
    for seed in (0, 11):
        found = atlas(mechanism, 'foot', seed=seed)
        assert [piece.piece.ends for piece in found.pieces] == [(0, 0), (0, 0)], seed
        assert [count for *_, count in found.counts() if count] == [2], seed


def test_the_transmission_angle_in_a_node() -> None:
    """At a change point all bars are in line: 0, with the tangents of the branches."""
    a, b, c, d = 1.0, 3.0, 2.5, 1.5
    found = atlas(four_bar(a, b, c, d), 'pin', output='foot', bar=['A', 'B'])
    for piece in found.pieces:
        for end in (0, -1):
            assert piece.transmission[end] == pytest.approx(0.0, abs=1e-9)


def test_the_slider_crank_has_four_pieces_and_two_nodes() -> None:
    found = atlas('slider_crank', 'B.x')
    assert len(found.pieces) == 4 and len(found.nodes) == 2
    assert {*map(frozenset, (piece.piece.ends for piece in found.pieces))} == {frozenset({0, 1})}
    assert values(found, 'travel limit') == pytest.approx([-2.0, 2.0], abs=1e-9)
    assert all(node.report.kind == 'crossing' for node in found.nodes)
    places = sorted(round(float(node.report.points['A'][1]), 12) for node in found.nodes)
    assert places == [-1.0, 1.0]


def test_both_branches_at_every_change_point_of_the_library() -> None:
    """Pieces and nodes by hand: each node of k branches ends 2 k pieces."""
    for name, pieces, nodes, ends in (
        ('slider_crank', 4, 2, 4),
        ('change_point', 2, 1, 4),
        ('double_four_bar', 12, 4, 6),
    ):
        found = found_of(name)
        assert (len(found.pieces), len(found.nodes)) == (pieces, nodes), name
        at = [end for piece in found.pieces for end in piece.piece.ends]
        assert [at.count(node) for node in range(nodes)] == [ends] * nodes, name
        assert all(piece.piece.complete for piece in found.pieces), name


def test_the_linkage_of_peaucellier() -> None:
    """The crank goes 120 degrees each way, on four ways each: D on the line, or on A."""
    found = atlas('peaucellier')
    assert (len(found.pieces), len(found.nodes)) == (12, 8)
    third = 2.0 * math.pi / 3.0
    assert [*found.limits()[1]] == pytest.approx([-third, third], abs=1e-9)
    assert [count for *_, count in found.counts()] == [0, 4, 0]


def test_on_every_position_the_loops_close() -> None:
    for name in ('slider_crank', 'double_four_bar', 'bricard'):
        found = found_of(name)
        for piece in found.pieces:
            lengths = [np.linalg.norm(q - r) for q, r in itertools.pairwise(piece.q)]
            assert max(lengths) < 0.2 * found.model.size
            for q in piece.q[::7]:
                assert np.abs(Linearised(found.model, q).phi).max() < 1e-12 * found.model.size


@pytest.mark.thorough
def test_no_part_is_mirrored_or_turned_round() -> None:
    """An RSSR and a spatial slider-crank have two circuits each; mirrored bodies are none."""
    for name in ('spatial_four_bar', 'spatial_slider_crank'):
        assert len(atlas(name).limits()) == 2, name


def jansen_positions(lengths: Mapping[str, float], angle: float) -> int:
    """By circles that meet, dyad by dyad."""
    v = lengths

    def meet(p: complex, r: float, q: complex, s: float) -> list[complex]:
        d = abs(q - p)
        x = (d * d + r * r - s * s) / (2 * d)
        if abs(x) > r:
            return []
        h = math.sqrt(r * r - x * x) * 1j
        return [p + (q - p) / d * (x + h), p + (q - p) / d * (x - h)]

    X, Z = v['m_'] * complex(math.cos(angle), math.sin(angle)), complex(-v['a_'], -v['l_'])
    return sum(
        len(meet(U, v['h_'], V, v['i_']))
        for Y in meet(X, v['j_'], Z, v['b_'])
        for W in meet(Z, v['d_'], Y, v['e_'])
        for V in meet(X, v['k_'], Z, v['c_'])
        for U in meet(W, v['f_'], V, v['g_'])
    )


@pytest.mark.thorough
def test_all_positions_of_a_leg() -> None:
    found = atlas('jansen_leg')
    lengths = {
        'a_': 0.38, 'b_': 0.415, 'c_': 0.393, 'd_': 0.401, 'e_': 0.558, 'f_': 0.394, 'g_': 0.367,
        'h_': 0.657, 'i_': 0.49, 'j_': 0.5, 'k_': 0.619, 'l_': 0.078, 'm_': 0.15,
    }  # fmt: skip
    for low, high, count in found.counts():
        assert count == jansen_positions(lengths, 0.5 * (low + high)), (low, high)


def test_every_seed_finds_all_circuits() -> None:
    found = [len(atlas('four_bar', starts=80, seed=seed).limits()) for seed in SEEDS]
    assert found == [2] * len(SEEDS)


# ------------------------------------------------------------------------------- two freedoms


def test_the_workspace_of_two_bars() -> None:
    """Between two circles, with two positions at each place."""
    found = atlas('double_pendulum', ['B.x', 'B.y'], levels=[-1.5, -0.1, 0.05, 1.1])
    radii = np.hypot(*found.boundary.T)
    outer, inner = 1.8, 0.2
    assert np.minimum(abs(radii - outer), abs(radii - inner)).max() < 1e-9
    assert [len(sheet.pieces) for sheet in found.sheets] == [1, 2, 2, 1]
    for n, sheet in enumerate(found.sheets):
        y = sheet.level
        edges = [-math.sqrt(outer**2 - y * y), math.sqrt(outer**2 - y * y)]
        if abs(y) < inner:
            edges += [-math.sqrt(inner**2 - y * y), math.sqrt(inner**2 - y * y)]
        counts = [2, 0, 2] if abs(y) < inner else [2]
        told = found.counts(n)
        assert [count for *_, count in told] == counts
        assert [low for low, *_ in told] == pytest.approx(sorted(edges)[:-1], abs=1e-9)


def test_levels_without_a_second_coordinate_are_refused() -> None:
    with pytest.raises(InputError, match='levels: there is no second coordinate, got 3'):
        atlas('four_bar', 'crank_pin', levels=3)


def test_levels_cover_the_range_of_the_second_coordinate() -> None:
    found = atlas('double_pendulum', ['B.x', 'B.y'], levels=3, starts=5)
    assert [sheet.level for sheet in found.sheets] == pytest.approx([-1.2, 0.0, 1.2], abs=1e-6)
    round_ = atlas('double_pendulum', ['shoulder', 'elbow'], levels=2, starts=5)
    assert [sheet.level for sheet in round_.sheets] == pytest.approx([-math.pi / 2, math.pi / 2])
    assert all(limits == (-math.inf, math.inf) for limits in round_.limits().values())


def test_a_coordinate_may_be_held() -> None:
    found = atlas('double_pendulum', 'shoulder', hold={'elbow': 1.0})
    (piece,) = found.pieces
    B = piece.q.reshape(len(piece.q), -1, 2)[:, found.model.layout.of_point['B']]
    wanted = math.sqrt(1.0 + 0.64 + 1.6 * math.cos(1.0))
    assert np.hypot(*B.T) == pytest.approx(wanted, abs=1e-12)
    assert found.limits() == {1: (-math.inf, math.inf)}


# ------------------------------------------------------------------------------- files


def test_the_table(tmp_path: Path) -> None:
    found = atlas('slider_crank', output='B.x')
    found.write_csv(tmp_path / 'map.csv')
    with open(tmp_path / 'map.csv', encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == sum(len(piece.q) for piece in found.pieces)
    for row in rows:
        x, y = float(row['A.x, m']), float(row['A.y, m'])
        assert math.hypot(x, y) == pytest.approx(1.0, abs=1e-10)
        assert min(abs(float(row['B.x, m']) - each) for each in (0.0, 2 * x)) < 1e-9


@needs_chromium
def test_the_page_in_a_browser(tmp_path: Path) -> None:
    file = tmp_path / 'map.html'
    atlas('slider_crank', 'B.x', output='crank_pin', bar=['A', 'B']).write_html(file)
    assert 'http' not in file.read_text('utf-8').replace('http-equiv', '')
    with Browser(file.as_uri(), tmp_path / 'profile') as page:
        page.until("document.querySelectorAll('#tables tr').length > 6")
        title = page.run("document.getElementById('title').textContent")
        assert title == 'slider_crank: positions over B.x'
        assert 'circuit 1' in page.run("document.getElementById('reading').textContent")
        # no number is rounding, and no table is wider than its place
        assert 'e-' not in page.run("document.getElementById('tables').textContent")
        tables = "[...document.querySelectorAll('#tables div')]"
        assert page.run(f'{tables}.every((each) => each.scrollWidth <= each.clientWidth)')
        assert not page.complaints


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = ['-o', str(tmp_path / 'a.html'), '--csv', str(tmp_path / 'a.csv')]
    assert program.main(['atlas', 'change_point', '--over', 'crank_pin', *files]) == 0
    out = capsys.readouterr().out
    assert 'crossing, 2 branches' in out and 'full turns' in out
    assert (tmp_path / 'a.html').stat().st_size > 20_000
    assert (tmp_path / 'a.csv').read_text('utf-8').startswith('circuit,piece,branch,')
    hold = ['--over', 'shoulder', '--hold', 'elbow=1', '--starts', '5']
    assert program.main(['atlas', 'double_pendulum', *hold]) == 0


@pytest.mark.parametrize(
    'given, said',
    [
        ({'over': 'crank'}, "did you mean 'crank_pin'"),
        ({'over': 'O.x'}, 'this point is fixed'),
        ({'over': ['crank_pin', 'knee']}, '1 freedom, but 2 to map over'),
        ({'over': ['crank_pin', 'crank_pin']}, 'not one or two coordinates'),
        ({'over': 'joints.crank_pin.position'}, 'no such coordinate.*expected crank_pin'),
        ({'over': 'crank_pin.efort'}, 'no such coordinate.*expected crank_pin'),
        ({'over': 'points.B.z'}, "no such coordinate.*did you mean 'points.B.[xy]'"),
        ({'output': 'B.z'}, 'no such coordinate'),
        ({'bar': ['A', 'A']}, 'not a bar'),
        ({'bar': ['O', 'B']}, 'no body has both points'),
        ({'hold': {'crank_pin': 0.0}}, 'held and mapped over'),
        ({'hold': {'knee': math.nan}}, 'finite number'),
        ({'starts': 0}, 'whole number from 1'),
    ],
)
def test_what_cannot_be_mapped_is_one_line(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        atlas('slider_crank', **given)
    assert '\n' not in str(error.value)


def test_what_rolls_and_has_other_freedoms_is_refused() -> None:
    with pytest.raises(InputError, match='binds velocities'):
        atlas('rolling_disk')
    with pytest.raises(InputError, match='couplings.worm: a coupling binds velocities'):
        atlas('two_finger_gripper', 'motor0')
    with pytest.raises(InputError, match='2 freedoms, but 1 to map over'):
        atlas('double_pendulum')
    with pytest.raises(InputError, match='hold others at a value'):
        atlas('stewart_platform')


def three_cranks(e: float) -> dict[str, Any]:
    """Three cranks of a plate on a row of pins; the end of the last is drawn too high by e (m)."""
    rod = {'mass': 1.0, 'inertia': 'rod'}
    pins = {name: {'at': [k, 0.0], 'fixed': True} for k, name in enumerate('ABC')}
    ends = {'D': [0.3, 0.8], 'E': [1.3, 0.8], 'F': [2.3, 0.8 + e]}
    cranks = {f'crank{k}': ('ABC'[k], 'DEF'[k]) for k in range(3)}
    plate = {'points': [*'DEF'], 'mass': 1, 'inertia': {'about_com': 0.3}, 'com': [1, 0]}
    bodies = {name: {'points': [*ends], **rod} for name, ends in cranks.items()}
    joints: dict[str, Any] = {}
    for name, (pin, end) in cranks.items():
        joints[f'{name}_pin'] = {'type': 'revolute', 'between': ['ground', name], 'at': pin}
        joints[f'{name}_end'] = {'type': 'revolute', 'between': [name, 'plate'], 'at': end}
    return {
        'alf': 1,
        'points': {**pins, **{name: {'at': at} for name, at in ends.items()}},
        'bodies': {**bodies, 'plate': plate},
        'joints': joints,
    }


@pytest.mark.parametrize('e', [0.0, 1e-9])
def test_redundant_lengths_are_adjusted_as_in_a_simulation(e: float) -> None:
    found = atlas(three_cranks(e), 'crank0_pin', starts=40)
    assert found.limits() == {1: (-math.inf, math.inf)}
    assert ('adjusted so that they agree: crank2 by' in found.statement) == (e > 0.0)


def test_redundant_lengths_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(AssemblyError, match='redundant constraints contradict each other'):
        atlas(three_cranks(1e-7), 'crank0_pin', starts=5)
