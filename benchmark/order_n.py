"""How the cost of a step grows with the number of bodies: chain, ring, tree, ladder and truss.

    .venv/bin/python benchmark/order_n.py [--most 100000] [--shape NAME...]

Writes benchmark/results/order_n.csv, a row for each shape and size, and order_n.png. Each size
runs in a process of its own, so that its memory is its own. Where cvxopt is installed (pip install
cvxopt), its CHOLMOD factorises the same matrix: a supernodal code, for comparison.

- chain: bars hinged one to the next, hanging from its first point.
- ring: the same, closed, on a bar of its own.
- tree: every bar carries two more.
- ladder: the N four-bars of the library.
- truss: a lattice of bars, hinged where they meet.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Scene, Simulation, kernel, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
SIZES = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000)  # bars
LARGEST = {'truss': 10_000}  # its updates are counted in Python, and no longer of order n
STEP = 1e-4  # s
COLUMNS = (
    'shape,bars,coordinates,factor_blocks,fill,updates,updates_rcm,prepare_s,memory_mb,stage_us,'
    'factor_us,solve_us,cholmod_us'
).split(',')
Place = tuple[float, float]


def scene_of(places: Sequence[Place], bars: Sequence[tuple[int, int]], fixed: set[int]) -> Scene:
    """Bars between places, hinged where they meet; the first bar of a place holds the others."""
    points = {
        f'P{k}': {'at': list(at), 'fixed': True} if k in fixed else {'at': list(at)}
        for k, at in enumerate(places)
    }
    bodies = {
        f'b{n}': {'points': [f'P{i}', f'P{j}'], 'mass': 1.0, 'inertia': 'rod'}
        for n, (i, j) in enumerate(bars)
    }
    holds: dict[int, str] = dict.fromkeys(fixed, 'ground')
    joints: dict[str, Any] = {}
    for n, bar in enumerate(bars):
        for k in bar:
            if k in holds:
                between = [holds[k], f'b{n}']
                joints[f'j{len(joints)}'] = {'type': 'revolute', 'between': between, 'at': f'P{k}'}
            else:
                holds[k] = f'b{n}'
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    effects = {'gravity': {'acceleration': [0, -9.81]}}
    return load_scene({'name': 'order_n', 'mechanism': mechanism, 'effects': effects})


def chain(n: int) -> Scene:
    places = [(float(k), 0.0) for k in range(n + 1)]
    return scene_of(places, [(k, k + 1) for k in range(n)], {0})


def ring(n: int) -> Scene:
    m = n - 1  # and a bar that it hangs from
    radius = 0.5 / math.sin(math.pi / m)
    turns = [2.0 * math.pi * k / m for k in range(m)]
    places = [(radius * math.sin(turn), radius * math.cos(turn)) for turn in turns]
    bars = [(k, (k + 1) % m) for k in range(m)]
    return scene_of([*places, (0.0, radius + 1.0)], [(m, 0), *bars], {m})


def tree(n: int) -> Scene:
    """Bar k hangs from bar (k - 1) // 2."""
    places: list[Place] = [(0.0, 0.0)]
    bars = []
    for k in range(n):
        parent = (k + 1) // 2 if k else 0
        x, y = places[parent]
        slant = math.pi * (0.25 + 0.5 * (k % 2)) if k else 0.5 * math.pi
        places.append((x + math.cos(slant), y - math.sin(slant)))
        bars.append((parent, k + 1))
    return scene_of(places, bars, {0})


def ladder(n: int) -> Scene:
    return load_scene('n_four_bar', {'N': max(1, round((n - 1) / 2))})


def truss(n: int) -> Scene:
    """A lattice of s by s places has 2 s (s - 1) bars; it hangs from its upper corners. It is out
    of square: where all bars of a row are in line it is singular, and stages are interpolated."""
    s = max(2, round(math.sqrt(0.5 * n) + 0.5))
    places = [
        (k % s + 0.2 * math.sin(2.1 * k), -(k // s) + 0.2 * math.cos(3.7 * k))
        for k in range(s * s)
    ]
    bars = [(k, k + 1) for k in range(s * s) if (k + 1) % s]
    bars += [(k, k + s) for k in range(s * (s - 1))]
    return scene_of(places, bars, {0, s - 1})


SHAPES: dict[str, Callable[[int], Scene]] = {
    'chain': chain,
    'ring': ring,
    'tree': tree,
    'ladder': ladder,
    'truss': truss,
}


COLOURS = {
    'chain': '#0072b2',
    'ring': '#56b4e9',
    'tree': '#009e73',
    'ladder': '#d55e00',
    'truss': '#cc79a7',
}


def fastest(work: Callable[[], object], least: float = 0.2) -> float:
    """µs of a call: the fastest of at least five, for `least` s."""
    times: list[float] = []
    while len(times) < 5 or (sum(times) < least and len(times) < 1000):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e6 * min(times)


def measured(shape: str, n: int) -> dict[str, Any]:
    """One row."""
    SHAPES[shape](10)  # what is imported once
    Simulation(SHAPES[shape](10), step=STEP).step()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    started = time.perf_counter()
    scene = SHAPES[shape](n)
    simulation = Simulation(scene, step=STEP)
    simulation.step()
    prepared = time.perf_counter() - started
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    model, work = simulation.model, simulation._run.stepper.work
    system, unit = model.system, model.unit
    evaluations = simulation.evaluations
    simulation.step()
    stages = simulation.evaluations - evaluations
    q = simulation.state.q
    pattern = system.pattern
    factor = fastest(lambda: kernel.linearise(unit, system, work, q))
    x = np.ones(q.size)
    solve = fastest(lambda: kernel.solve(unit, pattern, work.diagonal, work.off, x), least=0.1)
    blocks = model.layout.movable
    below = pattern.row.size
    bound = neighbours(model)
    return {
        'shape': shape,
        'bars': len(model.mechanism.bodies),
        'coordinates': model.n,
        'factor_blocks': blocks + below,
        'fill': (blocks + below) / (blocks + len(bound)),
        'updates': updates(bound, np.arange(blocks)),
        'updates_rcm': updates(bound, cuthill_mckee(bound, blocks)),
        'prepare_s': prepared,
        'memory_mb': memory / 1024,
        'stage_us': fastest(simulation.step) / stages,
        'factor_us': factor,
        'solve_us': solve,
        'cholmod_us': cholmod(simulation, q),
    }


def neighbours(model: Any) -> set[tuple[int, int]]:
    """Pairs of movable blocks that a row or the masses bind: A below its diagonal."""
    rows, mass, n = model.system.rows, model.system.mass, model.layout.movable
    both = int(rows.both)
    pairs = {*zip(mass.i.tolist(), mass.j.tolist(), strict=True)}
    pairs |= {*zip(rows.i[:both].tolist(), rows.j[:both].tolist(), strict=True)}
    for first, end in zip(rows.first[:-1].tolist(), rows.movable.tolist(), strict=True):
        blocks = [b for b in rows.block[first:end].tolist() if b < n]
        pairs |= {(b, c) for b in blocks for c in blocks}
    return {(max(pair), min(pair)) for pair in pairs if pair[0] != pair[1]}


def cuthill_mckee(bound: set[tuple[int, int]], n: int) -> Any:
    """Place of every block in the order of George (1971): the reverse of Cuthill and McKee's."""
    import scipy.sparse as sparse
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    i, j = np.array(sorted(bound)).reshape(-1, 2).T
    half = sparse.coo_matrix((np.ones(i.size), (i, j)), shape=(n, n))
    place = np.empty(n, dtype=np.int64)
    place[reverse_cuthill_mckee((half + half.T).tocsr(), symmetric_mode=True)] = np.arange(n)
    return place


def updates(bound: set[tuple[int, int]], place: Any) -> int:
    """Products of blocks that a factorisation takes if the blocks are eliminated in this order."""
    below: list[set[int]] = [set() for _ in place]
    for i, j in bound:
        a, b = int(place[i]), int(place[j])
        below[min(a, b)].add(max(a, b))
    total = 0
    for column in below:
        rest = sorted(column)
        total += len(rest) * (len(rest) + 3) // 2
        if rest:
            below[rest[0]].update(rest[1:])
    return total


def cholmod(simulation: Simulation, q: Any) -> float:
    """µs of a numeric factorisation of the same A by CHOLMOD, its analysis made before."""
    try:
        import cvxopt
        from cvxopt import cholmod as library
    except ImportError:
        return math.nan
    model, work = simulation.model, simulation._run.stepper.work
    D, n = model.layout.dimension, model.layout.movable
    kernel.linearise(model.unit, model.system, work, q)
    # A = L D Lᵀ again, from its rows: only its numbers matter here
    i, j, a = matrix(model, q)
    A = cvxopt.spmatrix(a.tolist(), i.tolist(), j.tolist(), (n * D, n * D))
    library.options['supernodal'] = 2
    analysed = library.symbolic(A)
    return fastest(lambda: library.numeric(A, analysed))


def matrix(model: Any, q: Any) -> tuple[Any, Any, Any]:
    """The lower triangle of A at q as (row, column, value)."""
    import scipy.sparse as sparse

    system, D, n = model.system, model.layout.dimension, model.n
    rows = system.rows
    J = np.zeros((0, 0))
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian(model.unit, rows, q, g, g2)
    at, of, values = [], [], []
    both = int(rows.both)
    for r in range(rows.i.size):
        ends = [(int(rows.i[r]), 1.0)] + ([(int(rows.j[r]), -1.0)] if r < both else [])
        for block, sign in ends:
            for a in range(D):
                at.append(r)
                of.append(block * D + a)
                values.append(sign * g[r * D + a])
    for r in range(rows.movable.size):
        for e in range(int(rows.first[r]), int(rows.movable[r])):
            for a in range(D):
                at.append(rows.i.size + r)
                of.append(int(rows.block[e]) * D + a)
                values.append(g2[e * D + a])
    J = sparse.coo_matrix((values, (at, of)), shape=(rows.alpha.size, n)).tocsr()
    M = sparse.lil_matrix((n, n))
    mass = system.mass
    M.setdiag(np.repeat(mass.diagonal, D))
    M = M.tocsr()
    pairs = [
        sparse.coo_matrix(
            (mass.k, (mass.i.astype(int) * D + a, mass.j.astype(int) * D + a)), shape=(n, n)
        )
        for a in range(D)
    ]
    for pair in pairs:
        M = M + pair.tocsr() + pair.T.tocsr()
    A = sparse.tril(M + J.T @ sparse.diags(rows.alpha) @ J).tocoo()
    return A.row, A.col, A.data


def draw(found: list[dict[str, Any]]) -> None:
    """benchmark/results/order_n.png: cost of a stage, its parts, fill, and preparation."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 8.5), layout='constrained')
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots(2, 2)
    panels = (
        (axes[0, 0], 'stage_us', 'a stage, µs', 1.0),
        (axes[0, 1], 'stage_us', 'a stage, µs per bar', 0.0),
        (axes[1, 0], 'fill', 'blocks of the factor over blocks of A', 0.0),
        (axes[1, 1], 'prepare_s', 'from the file to the first step, s', 1.0),
    )
    for shape, colour in COLOURS.items():
        mine = [row for row in found if row['shape'] == shape]
        for panel, key, label, _ in panels:
            values = [row[key] / (row['bars'] if 'per bar' in label else 1.0) for row in mine]
            panel.plot(
                [row['bars'] for row in mine], values, 'o-', ms=3, color=colour, label=shape
            )
    for panel, _, label, _ in panels:
        panel.set(xscale='log', yscale='log', xlabel='bars', ylabel=label)
        panel.grid(color='0.9')
        panel.set_axisbelow(True)
    axes[1, 0].set_yscale('linear')
    axes[0, 0].legend()
    figure.savefig(RESULTS / 'order_n.png', dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--most', type=int, default=100_000, metavar='N', help='bars at most')
    parser.add_argument('--shape', nargs='+', choices=SHAPES, default=list(SHAPES))
    parser.add_argument('--one', nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.one[0], int(options.one[1]))))
        return
    found = []
    with open(RESULTS / 'order_n.csv', 'w', encoding='utf-8', newline='') as stream:
        print(about(), file=stream)
        table = csv.writer(stream, lineterminator='\n')
        table.writerow(COLUMNS)
        for shape in options.shape:
            for n in SIZES:
                if n > min(options.most, LARGEST.get(shape, n)):
                    continue
                command = [sys.executable, __file__, '--one', shape, str(n)]
                said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
                row = json.loads(said)
                found.append(row)
                cells = [row[key] for key in COLUMNS]
                table.writerow([f'{c:.4g}' if isinstance(c, float) else c for c in cells])
                print(
                    f'{shape:7}{row["bars"]:8} bars: stage {row["stage_us"]:10.1f} µs, '
                    f'{1e3 * row["stage_us"] / row["bars"]:7.1f} ns a bar; factor '
                    f'{row["factor_us"]:10.1f}, solve {row["solve_us"]:9.1f} µs, fill '
                    f'{row["fill"]:5.2f}, {row["updates"]} updates ({row["updates_rcm"]} with '
                    f'reverse Cuthill-McKee); first step after {row["prepare_s"]:.2f} s, '
                    f'{row["memory_mb"]:.0f} MB; CHOLMOD {row["cholmod_us"]:.1f} µs',
                    flush=True,
                )
    draw(found)


if __name__ == '__main__':
    main()
