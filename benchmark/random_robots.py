"""Evaluations of random robots, beside an integration of their joint angles.

    .venv/bin/python benchmark/random_robots.py [--robots 40] [--seed 1]

Half of the robots are wrists: three to seven hinges in a row about random axes, each link half as
heavy and 0.7 times as long as the one before. The others are trees of random links. Motion,
errors and evaluations are as in `trees.py`, both with DOP853 and at an error of 1e-6 rad. Robots
whose joint angles cannot be integrated to 1e-8 rad, because their motion is chaotic, do not count.
Writes random_robots.csv.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tempfile
from pathlib import Path
from statistics import median

import mujoco
import numpy as np
from results_file import RESULTS  # sets the path

# isort: split
from trees import TOLERANCES, Simulated, Tree, cost

from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.logs.provenance import about
from alf_ros.scene.scene import scene_from_text

KNOWN = 1e-8  # rad
Random = np.random.Generator


def numbers(values: Floats) -> str:
    """As URDF has them."""
    return ' '.join(map(repr, values.tolist()))


def link(n: int, mass: float, com: Floats, inertia: Floats) -> str:
    """A link; its inertia (3, 3) about the centre of mass."""
    moments = {f'i{a}{b}': inertia['xyz'.index(a), 'xyz'.index(b)] for a, b in ('xx', 'yy', 'zz')}
    moments |= {'ixy': inertia[0, 1], 'ixz': inertia[0, 2], 'iyz': inertia[1, 2]}
    text = ' '.join(f'{key}="{float(value)!r}"' for key, value in moments.items())
    return (
        f'<link name="link{n}"><inertial><origin xyz="{numbers(com)}"/>'
        f'<mass value="{mass!r}"/><inertia {text}/></inertial></link>'
    )


def hinge(n: int, parent: str, at: Floats, turned: Floats, random: Random) -> str:
    """A hinge about a random axis."""
    axis = random.normal(size=3)
    return (
        f'<joint name="joint{n}" type="continuous"><parent link="{parent}"/>'
        f'<child link="link{n}"/><origin xyz="{numbers(at)}" rpy="{numbers(turned)}"/>'
        f'<axis xyz="{numbers(axis / np.linalg.norm(axis))}"/></joint>'
    )


def wrist(random: Random) -> str:
    """Light links that shrink."""
    parts, parent, long = ['<link name="base"/>'], 'base', 0.0
    for n in range(int(random.integers(3, 8))):
        mass, length = 3.0 * 0.5**n, 0.4 * 0.7**n
        across = mass * length**2 / 12.0 + 1e-6
        inertia = np.diag([across / 5.0, across, across])
        parts.append(link(n, mass, np.array([length / 2.0, 0.0, 0.0]), inertia))
        turned = random.uniform(-1.0, 1.0, 3)
        parts.append(hinge(n, parent, np.array([long, 0.0, 0.0]), turned, random))
        parent, long = f'link{n}', length
    return f'<robot name="wrist">{"".join(parts)}</robot>'


def tree(random: Random) -> str:
    """Random links on random links."""
    parts = ['<link name="base"/>']
    for n in range(int(random.integers(3, 8))):
        mass, shape = 10.0 ** random.uniform(-2.0, 1.0), random.normal(size=(3, 3))
        inertia = shape @ shape.T
        inertia *= mass * 10.0 ** random.uniform(-3.0, -1.0) / np.trace(inertia)
        inertia += np.linalg.eigvalsh(inertia)[-1] * np.eye(3)  # that of a real body
        parts.append(link(n, float(mass), random.uniform(-0.3, 0.3, 3), inertia))
        parent = 'base' if n == 0 else f'link{random.integers(0, n)}'
        at, turned = random.uniform(-0.5, 0.5, 3), random.uniform(-2.0, 2.0, 3)
        parts.append(hinge(n, parent, at, turned, random))
    return f'<robot name="tree">{"".join(parts)}</robot>'


def ratio(text: str) -> tuple[int, float, float]:
    """Joints, evaluations here and in joint angles; NaN where the motion is not known."""
    robot = Tree(text, False)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'robot.urdf'
        file.write_text(text, 'utf-8')
        scene = scene_from_text(imported(str(file), scene=True))
    exact = robot.exact(1.0)
    if not np.abs(robot.integrated(1.0, 1e-11)[0] - exact).max() < KNOWN:
        return len(robot.names), math.nan, math.nan
    _, own = cost(Simulated(scene, robot, 1.0).run, TOLERANCES, exact, 1)
    _, angles = cost(lambda each: robot.integrated(1.0, each), TOLERANCES, exact, 1)
    return len(robot.names), own, angles


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--robots', type=int, default=40)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    mujoco.set_mju_user_warning(lambda text: None)
    body: list[tuple[str, int, str, str, str]] = []
    found: dict[str, list[float]] = {'wrist': [], 'tree': []}
    for n in range(options.robots):
        kind = ('wrist', 'tree')[n % 2]
        text = {'wrist': wrist, 'tree': tree}[kind](np.random.default_rng([options.seed, n]))
        joints, own, angles = ratio(text)
        body.append((kind, joints, f'{own:.0f}', f'{angles:.0f}', f'{own / angles:.2f}'))
        if math.isfinite(own / angles):
            found[kind].append(own / angles)
        print(*body[-1], sep=', ', flush=True)
    for kind, ratios in found.items():
        if not ratios:
            continue
        told = f'median {median(ratios):.2f}, worst {max(ratios):.2f}'
        print(f'{len(ratios)} of each {kind}: {told}', file=sys.stderr)
    with open(RESULTS / 'random_robots.csv', 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}, mujoco {mujoco.__version__}\n')
        writer = csv.writer(stream)
        writer.writerow(['kind', 'joints', 'evaluations', 'angle_evaluations', 'ratio'])
        writer.writerows(body)


if __name__ == '__main__':
    main()
