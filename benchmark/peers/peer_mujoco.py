"""MuJoCo: minimal coordinates of a tree, loops closed by `connect`, stepped by mujoco.rollout.

Settings: RK4 (Euler and implicitfast err a thousand times more in the slider-crank), Newton solver
to 1e-15; constraints as stiff as they can be: timeconst of 0.7 steps (refsafe off), critically
damped, impedance 0.9999.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from common import perform, timed
from mujoco import rollout

INTEGRATOR = 'RK4'
TIMECONST = 0.7  # steps; of 0.5 to 4 the one that errs least in both mechanisms
ROD = f'<inertial pos="0.5 0 0" mass="1" diaginertia="1e-6 {1.0 / 12.0} {1.0 / 12.0}"/>'
HINGE = '<joint type="hinge" axis="0 0 1"/>'


def _model(bodies: str, loops: list[tuple[str, str]], anchors: str) -> mujoco.MjModel:
    connects = ''.join(
        f'<connect site1="{a}" site2="{b}" solimp="0.9999 0.9999 0.001 0.5 2"/>' for a, b in loops
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="0 -9.81 0" integrator="{INTEGRATOR}" solver="Newton" '
        'tolerance="1e-15" iterations="100" ls_tolerance="1e-6">'
        '<flag contact="disable" refsafe="disable"/></option>'
        f'<worldbody>{anchors}{bodies}</worldbody><equality>{connects}</equality></mujoco>'
    )


def slider_crank(case: dict[str, Any]) -> Any:
    """Coupler on a slide and a hinge at B; the crank hangs on it and is tied to the origin."""
    model = _model(
        f'<body><joint type="slide" axis="1 0 0"/>{HINGE}{ROD}<body pos="1 0 0">{HINGE}{ROD}'
        '<site name="o" pos="1 0 0"/></body></body>',
        [('o', 'O')],
        '<site name="O"/>',
    )
    theta, rate = case['theta'], case['rate']
    start = [2 * math.cos(theta), math.pi - theta, 2 * theta]
    speeds = [-2 * math.sin(theta) * rate, -rate, 2 * rate]

    def points(q: Any) -> Any:
        x, c = q[:, 0], q[:, 1]
        return np.stack([x + np.cos(c), np.sin(c), x, 0 * x], axis=1)

    return _runner(model, start, speeds, points)


def double_four_bar(case: dict[str, Any]) -> Any:
    """A chain crank, coupler, crank, coupler, crank; the feet of the last two cranks are tied."""
    model = _model(
        f'<body>{HINGE}{ROD}<body pos="1 0 0">{HINGE}{ROD}<body pos="1 0 0">{HINGE}{ROD}'
        f'<site name="a" pos="1 0 0"/><body>{HINGE}{ROD}<body pos="1 0 0">{HINGE}{ROD}'
        '<site name="b" pos="1 0 0"/></body></body></body></body></body>',
        [('a', 'A1'), ('b', 'A2')],
        '<site name="A1" pos="1 0 0"/><site name="A2" pos="2 0 0"/>',
    )
    theta, rate = case['theta'], case['rate']
    start = [theta, -theta, theta + math.pi, -theta - math.pi, theta + math.pi]
    speeds = [rate, -rate, rate, -rate, rate]

    def points(q: Any) -> Any:
        first, second, fourth = q[:, 0], q[:, 0] + q[:, 1], q[:, :4].sum(axis=1)
        b0 = np.stack([np.cos(first), np.sin(first)], axis=1)
        b1 = b0 + np.stack([np.cos(second), np.sin(second)], axis=1)
        b2 = b1 + np.stack([np.cos(fourth), np.sin(fourth)], axis=1)
        return np.concatenate([b0, b1, b2], axis=1)

    return _runner(model, start, speeds, points)


def _runner(model: Any, start: list[float], speeds: list[float], points: Any) -> Any:
    data = mujoco.MjData(model)

    def run(n: int, h: float, instants: int = 100) -> tuple[Any, float]:
        model.opt.timestep = h
        model.eq_solref[:] = [TIMECONST * h, 1.0]
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = start, speeds
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state = np.zeros(size)
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        (states, _), spent = timed(lambda: rollout.rollout(model, data, state, nstep=n * instants))
        q = np.concatenate([state[None], states[0, n - 1 :: n]])[:, 1 : 1 + model.nq]
        return points(q), spent

    data.qpos[:], data.qvel[:] = start, speeds
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return run, float(data.energy.sum())


if __name__ == '__main__':
    perform(
        'mujoco',
        f'mujoco {mujoco.__version__}, {INTEGRATOR}, Newton, connect with timeconst {TIMECONST}h',
        {'slider_crank': slider_crank, 'double_four_bar': double_four_bar},
    )
