"""The cost of robots without loops, beside MuJoCo at equal error.

    .venv/bin/pip install example-robot-data
    .venv/bin/python benchmark/trees.py [FILE.urdf ... [--floating]] [--seconds 1]

Each robot begins at rest where it is drawn, an arm on the ground, a robot with legs in free fall.
A constant effort on each joint holds the weight there, and would turn the joint alone by 1 rad in
a second. There are neither friction nor limits. `dop853_adaptive` runs with tolerances and a grid
of 0.1 s, MuJoCo's RK4 with steps. The error is the largest one of a joint (rad) at the end, of
each against its own limit: here a tolerance of 1e-12, there M and the bias forces integrated by
scipy to 1e-12. How far these limits are apart is printed. The cost is the time of the processor
for a second at an error of 1e-6 rad, by interpolation, and so is the number of evaluations.
`angle_evaluations` count the same method in joint angles: M and the bias forces of MuJoCo,
integrated by scipy with its DOP853 and tolerances.

`least_us` is what an evaluation cannot do without: A assembled and factorised once, and solved
five times, one for the position and two each for velocities and accelerations. Writes trees.csv.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation  # noqa: E402
from alf_ros.arrays import Floats, Unit  # noqa: E402
from alf_ros.exchange.import_file import imported  # noqa: E402
from alf_ros.kernel import linearise, solve  # noqa: E402
from alf_ros.kernel.data import System, Work  # noqa: E402
from alf_ros.kernel.numba_ext.jit import compiled  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.model.compile import allocate  # noqa: E402
from alf_ros.scene.scene import scene_from_text  # noqa: E402

SHIPPED = {  # below the folder of example-robot-data; whether its base moves
    'ur_description/urdf/ur5_robot.urdf': False,
    'panda_description/urdf/panda.urdf': False,
    'anymal_b_simple_description/robots/anymal.urdf': True,
    'solo_description/robots/solo12.urdf': True,
    'talos_data/robots/talos_left_arm.urdf': False,
    'talos_data/robots/talos_reduced.urdf': True,
}
TOLERANCES = [10.0**-k for k in range(2, 12)]
STEPS = [4e-2 / 2**k for k in range(11)]
WANTED, ROUNDS = 1e-6, 15
NOTHING = 1e-5  # kg: stands for no mass in some files
SOLVES = 5  # of an evaluation
REPEATED = 2000
Run = tuple[Floats, float, int]  # (joints,) rad at the end, s of the processor, evaluations


def bare(file: Path, floating: bool) -> str:
    """The URDF without shapes, limits and friction, the same for both."""
    robot = ET.parse(file).getroot()
    for link in robot.iter('link'):
        for part in [*link.findall('visual'), *link.findall('collision')]:
            link.remove(part)
        for part in link.findall('inertial'):
            mass = part.find('mass')
            if mass is None or float(mass.get('value', '0')) <= NOTHING:
                link.remove(part)
    if floating:
        _give_root_mass(robot)
    for joint in robot.iter('joint'):
        for part in [*joint.findall('dynamics'), *joint.findall('mimic')]:
            joint.remove(part)
        if joint.get('type') == 'revolute':
            joint.set('type', 'continuous')
            for limit in joint.findall('limit'):
                joint.remove(limit)
    for other in [*robot.findall('transmission'), *robot.findall('gazebo')]:
        robot.remove(other)
    return ET.tostring(robot, encoding='unicode')


def _give_root_mass(robot: ET.Element) -> None:
    """A root without mass takes the mass of the link fixed to it, at the same place."""
    links = {link.get('name', ''): link for link in robot.findall('link')}
    joints = {_end(joint, 'child'): joint for joint in robot.findall('joint')}
    root = next(name for name in links if name not in joints)
    if links[root].find('inertial') is None:
        fixed = (x for x in joints.values() if x.get('type') == 'fixed')
        child = links[next(_end(x, 'child') for x in fixed if _end(x, 'parent') == root)]
        inertial = child.findall('inertial')[0]
        links[root].append(inertial)
        child.remove(inertial)


def _end(joint: ET.Element, which: str) -> str:
    found = joint.find(which)
    return '' if found is None else found.get('link', '')


class Tree:
    """A robot without loops, in MuJoCo's coordinates; `efforts` (N m) by joint."""

    def __init__(self, text: str, floating: bool) -> None:
        spec = mujoco.MjSpec.from_string(text)
        spec.compiler.fusestatic = False  # with it MuJoCo 3.8 misplaces the mass of Panda's hand
        if floating:
            spec.worldbody.first_body().add_freejoint()
        self.model = model = spec.compile()
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        off = mujoco.mjtDisableBit
        model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT
        self.data = mujoco.MjData(model)
        self.own = np.flatnonzero(model.jnt_type != mujoco.mjtJoint.mjJNT_FREE)
        self.names = [model.joint(n).name for n in self.own]
        self.at, self.of = model.jnt_qposadr[self.own], model.jnt_dofadr[self.own]
        mujoco.mj_forward(model, self.data)
        signs = np.random.default_rng(1).choice([-1.0, 1.0], len(self.own))
        efforts = 2.0 * signs * self.mass()[self.of, self.of]
        if not floating:
            efforts += self.data.qfrc_bias[self.of]
        self.efforts = dict(zip(self.names, efforts.tolist(), strict=True))
        self.start = self.data.qpos.copy()
        self.force = np.zeros(model.nv)
        self.force[self.of] = efforts

    def mass(self) -> Floats:
        """M (nv, nv)."""
        M = np.zeros((self.model.nv, self.model.nv))
        for column, unit in zip(M, np.eye(self.model.nv), strict=True):
            mujoco.mj_mulM(self.model, self.data, column, unit)
        return M

    def exact(self, seconds: float) -> Floats:
        """(joints,) rad at the end, to about 1e-11."""
        return self.integrated(seconds, 1e-12)[0]

    def integrated(self, seconds: float, tolerance: float) -> Run:
        """In joint angles with scipy's DOP853."""
        model, data = self.model, self.data

        def rate(_: float, y: Floats) -> Floats:
            data.qpos[:], data.qvel[:] = y[: model.nq], y[model.nq :]
            norm = np.linalg.norm(data.qpos[3:7]) if model.nq > model.nv else 1.0
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            bent = np.linalg.solve(self.mass(), self.force - data.qfrc_bias)
            moved = np.zeros(model.nq)
            mujoco.mj_integratePos(model, moved, data.qvel, 0.0)
            if model.nq > model.nv:  # q̇ = q ω / 2 of the quaternion of the base
                moved[:3] = data.qvel[:3]
                w, v = y[3], y[4:7]
                spin = data.qvel[3:6]
                moved[3] = -0.5 * v @ spin
                moved[4:7] = 0.5 * (w * spin + np.cross(v, spin))
                moved[3:7] += (1.0 - norm) * y[3:7]
                moved[7:] = data.qvel[6:]
            else:
                moved[:] = data.qvel
            return np.concatenate([moved, bent])

        y = np.concatenate([self.start, np.zeros(model.nv)])
        begin = time.process_time()
        found = solve_ivp(rate, (0.0, seconds), y, 'DOP853', rtol=tolerance, atol=0.1 * tolerance)
        spent = time.process_time() - begin
        return np.asarray(found.y[self.at, -1]), spent, int(found.nfev)

    def run(self, seconds: float, step: float) -> Run:
        """With RK4, which evaluates four times a step."""
        model, data = self.model, self.data
        steps = round(seconds / step)
        model.opt.timestep = seconds / steps
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qfrc_applied[:] = self.start, self.force
        signature = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.zeros(mujoco.mj_stateSize(model, signature))
        mujoco.mj_getState(model, data, state, signature)
        forces = np.tile(self.force, (steps, 1))
        begin = time.process_time()
        states, _ = rollout.rollout(
            model, data, state, forces, control_spec=mujoco.mjtState.mjSTATE_QFRC_APPLIED
        )
        spent = time.process_time() - begin
        return np.asarray(states[0, -1, 1 : 1 + model.nq][self.at]), spent, 4 * steps


class Simulated:
    """The same robot with `dop853_adaptive`."""

    def __init__(self, scene: Any, tree: Tree, seconds: float) -> None:
        self.scene, self.tree, self.seconds = scene, tree, seconds

    def prepared(self, tolerance: float) -> Simulation:
        """With the efforts of the tree, on a grid of 0.1 s."""
        simulation = Simulation(
            self.scene,
            integrator='dop853_adaptive',
            tolerance=tolerance,
            step=self.seconds / round(10.0 * self.seconds),
        )
        for name, effort in self.tree.efforts.items():
            simulation.apply_effort(name, effort)
        return simulation

    def run(self, tolerance: float) -> Run:
        """With a tolerance."""
        simulation, steps = self.prepared(tolerance), round(10.0 * self.seconds)
        start = simulation.state
        simulation.step()  # makes what a first step needs
        simulation.restore(start)
        before, begin = simulation.evaluations, time.process_time()
        simulation.step(steps)
        spent, count = time.process_time() - begin, simulation.evaluations - before
        joints = simulation.sample().joints
        return np.array([joints[name].position for name in self.tree.names]), spent, count

    def least(self) -> float:
        """Seconds of what an evaluation cannot do without."""
        model = self.prepared(WANTED).model
        work = allocate(model, model.system, 0)
        fastest = math.inf
        for _ in range(ROUNDS):
            begin = time.process_time()
            _solve_often(model.unit, model.system, work, model.q, REPEATED)
            fastest = min(fastest, time.process_time() - begin)
        return fastest / REPEATED


@compiled
def _solve_often(unit: Unit, system: System, work: Work, q: Floats, count: int) -> None:
    for _ in range(count):
        linearise(unit, system, work, q)
        for _ in range(SOLVES):
            solve(unit, system.pattern, work.diagonal, work.off, work.delta)


def cost(
    run: Callable[[float], Run], settings: list[float], exact: Floats, rounds: int = ROUNDS
) -> tuple[float, float]:
    """Milliseconds and evaluations at an error of WANTED: between two settings by straight lines
    of logarithms."""
    before: tuple[float, float, int] | None = None
    for setting in settings:
        found, spent, count = min((run(setting) for _ in range(rounds)), key=lambda each: each[1])
        error = float(np.abs(found - exact).max())
        print(f'    {setting:.1e}: {error:.1e} rad, {1e3 * spent:.3g} ms', file=sys.stderr)
        if error <= WANTED:
            if before is None:
                return 1e3 * spent, count
            part = math.log(before[0] / WANTED) / math.log(before[0] / max(error, 1e-15))
            return (
                1e3 * before[1] * (spent / before[1]) ** part,
                before[2] * (count / before[2]) ** part,
            )
        before = error, spent, count
    return math.nan, math.nan


def measured(file: Path, floating: bool, seconds: float) -> dict[str, str]:
    """The row of a robot."""
    print(f'{file.name}', file=sys.stderr)
    text = bare(file, floating)
    tree = Tree(text, floating)
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / file.name
        plain.write_text(text, 'utf-8')
        scene = scene_from_text(imported(str(plain), floating=floating, scene=True))
    exact = tree.exact(seconds)
    own = Simulated(scene, tree, seconds)
    limit = own.run(1e-12)[0]
    ours, evaluations = cost(own.run, TOLERANCES, limit)
    theirs, others = cost(lambda step: tree.run(seconds, step), STEPS, exact)
    _, angles = cost(lambda each: tree.integrated(seconds, each), TOLERANCES, exact, 1)
    return {
        'robot': file.stem,
        'base': 'free' if floating else 'fixed',
        'joints': str(len(tree.names)),
        'alf_ros_ms_per_s': f'{ours / seconds:.3g}',
        'mujoco_ms_per_s': f'{theirs / seconds:.3g}',
        'ratio': f'{ours / theirs:.2f}',
        'evaluations': f'{evaluations / seconds:.0f}',
        'angle_evaluations': f'{angles / seconds:.0f}',
        'mujoco_evaluations': f'{others / seconds:.0f}',
        'us': f'{1e3 * ours / evaluations:.3g}',
        'least_us': f'{1e6 * own.least():.3g}',
        'mujoco_us': f'{1e3 * theirs / others:.3g}',
        'limits_apart_rad': f'{np.abs(limit - exact).max():.1e}',
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('files', nargs='*', type=Path, metavar='FILE.urdf')
    parser.add_argument('--floating', action='store_true', help='of the files: the base is free')
    parser.add_argument('--seconds', type=float, default=1.0)
    parser.add_argument('--folder', type=Path, default=ROOT / 'benchmark' / 'results')
    options = parser.parse_args()
    mujoco.set_mju_user_warning(lambda text: None)
    cases = dict.fromkeys(options.files, options.floating)
    if not cases:
        cases = {shipped() / name: floating for name, floating in SHIPPED.items()}
    rows = [measured(file, floating, options.seconds) for file, floating in cases.items()]
    for row in rows:
        print(', '.join(f'{key} {value}' for key, value in row.items()))
    with open(options.folder / 'trees.csv', 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}, mujoco {mujoco.__version__}\n')
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def shipped() -> Path:
    """The robots of example-robot-data."""
    for folder in map(Path, sys.path):
        found = folder / 'cmeel.prefix' / 'share' / 'example-robot-data' / 'robots'
        if found.is_dir():
            return found
    sys.exit('pip install example-robot-data, or name URDF files')


if __name__ == '__main__':
    main()
