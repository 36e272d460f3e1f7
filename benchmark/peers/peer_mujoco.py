"""MuJoCo: minimal coordinates of a tree, loops closed by `connect`, stepped by mujoco.rollout.

Settings: RK4 (Euler and implicitfast err a thousand times more in the slider-crank), Newton solver
to 1e-15; constraints as stiff as they can be: timeconst of 0.7 steps (refsafe off), critically
damped, impedance 0.9999.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import mujoco
import numpy as np
from common import branches, perform, timed, tips
from mujoco import rollout

INTEGRATOR = 'RK4'
# steps; of 0.5 to 4 the one that errs least in slider-crank and two four-bars; in ten, 0.6 to 1
# are alike
TIMECONST = 0.7
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
    return _runner(*slider_crank_model(case))


def slider_crank_model(case: dict[str, Any]) -> tuple[Any, list[float], list[float], Any]:
    """Its model, positions and speeds at the start, and the points A and B of positions."""
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

    return model, start, speeds, points


def four_bars(n: int, case: dict[str, Any]) -> Any:
    """Every crank is hinged on the ground, a coupler on its tip, and tied to the tip of the next.

    One chain of ten fails at steps above 1.2 ms.
    """
    coupler = f'<body pos="1 0 0">{HINGE}{ROD}<site name="end{{k}}" pos="1 0 0"/></body>'
    crank = f'<body pos="{{k}} 0 0">{HINGE}{ROD}<site name="tip{{k}}" pos="1 0 0"/>'
    bodies = [(crank + (coupler if k < n else '') + '</body>').format(k=k) for k in range(n + 1)]
    loops = [(f'end{k}', f'tip{k + 1}') for k in range(n)]
    model = _model(''.join(bodies), loops, '')
    return _runner(model, *branches(n, case['theta'], case['rate']), tips)


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
        if any(warning.number for warning in data.warning):
            raise RuntimeError('unstable')  # rollout repeats its last state from there on
        q = np.concatenate([state[None], states[0, n - 1 :: n]])[:, 1 : 1 + model.nq]
        return points(q), spent

    data.qpos[:], data.qvel[:] = start, speeds
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return run, float(data.energy.sum())


if __name__ == '__main__':
    mujoco.set_mju_user_warning(lambda text: None)  # no MUJOCO_LOG.TXT: runs tell
    perform(
        'mujoco',
        f'mujoco {mujoco.__version__}, {INTEGRATOR}, Newton, connect with timeconst {TIMECONST}h',
        {
            'slider_crank': slider_crank,
            'double_four_bar': partial(four_bars, 2),
            'n_four_bar': partial(four_bars, 10),
        },
    )
