"""Pinocchio: minimal coordinates of a tree, loops closed by proximal constraint dynamics.

It has no integrator of its own: RK4 is written here, in Python. The cost of a step excludes this
Python code: it is four times the cost of a call of `constraintDynamics`, measured alone, at states
of the motion.
Settings: 3-D contacts, μ = 1e-10, to 1e-14; Baumgarte correction of 50 1/s. The best found.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from common import branches, perform, timed, tips

MU, GAIN = 1e-10, 50.0  # the best of 1e-6 to 1e-10, and 1/s, of 1 to 50  # 1/s
CALLS = 2000


class Tree:
    """Rods of 1 m and 1 kg along x of their joint."""

    def __init__(self) -> None:
        self.model = pin.Model()
        self.model.gravity.linear = np.array([0.0, -9.81, 0.0])
        self.ties = pin.StdVec_RigidConstraintModel()

    def rod(self, parent: int, place: float, joint: Any = None) -> int:
        """Hinged at `place` (m) along x of its parent."""
        at = pin.SE3(np.eye(3), np.array([place, 0.0, 0.0]))
        name = f'joint{self.model.njoints}'
        new = self.model.addJoint(parent, joint or pin.JointModelRZ(), at, name)
        if joint is None:
            inertia = np.diag([1e-6, 1.0 / 12.0, 1.0 / 12.0])
            body = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), inertia)
            self.model.appendBodyToJoint(new, body, pin.SE3.Identity())
        return new

    def tie(self, body: int, other: int, x: float) -> None:
        """The far end of a rod stays at (x, 0) of another body; 0 is the ground."""
        far = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
        fixed = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        tie = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            self.model,
            body,
            far,
            other,
            fixed,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        tie.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(GAIN**2, 2.0 * GAIN))
        self.ties.append(tie)

    def runner(self, start: list[float], speeds: list[float], points: Any) -> Any:
        """The function that runs the mechanism; `points` makes places of q (instants, nq)."""
        data, ties = self.model.createData(), self.ties
        datas = pin.StdVec_RigidConstraintData()
        datas.extend([tie.createData() for tie in ties])
        settings = pin.ProximalSettings(1e-14, 1e-14, MU, 50)
        pin.initConstraintDynamics(self.model, data, ties, datas)
        nothing = np.zeros(self.model.nv)

        def rates(q: Any, v: Any) -> Any:
            return pin.constraintDynamics(
                self.model, data, q, v, nothing, ties, datas, settings
            ).copy()

        def run(n: int, h: float, instants: int = 100) -> tuple[Any, float]:
            q, v = np.array(start), np.array(speeds)
            found, states = [q], []
            for _ in range(instants):
                for _ in range(n):
                    a1 = rates(q, v)
                    v2 = v + 0.5 * h * a1
                    a2 = rates(q + 0.5 * h * v, v2)
                    v3 = v + 0.5 * h * a2
                    a3 = rates(q + 0.5 * h * v2, v3)
                    v4 = v + h * a3
                    a4 = rates(q + h * v3, v4)
                    q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
                    v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
                if not np.isfinite(v).all():
                    raise RuntimeError('not finite')
                found.append(q)
                states.append((q, v))

            def again() -> None:
                for k in range(CALLS):
                    pin.constraintDynamics(
                        self.model, data, *states[k % instants], nothing, ties, datas, settings
                    )

            _, spent = timed(again)
            return points(np.array(found)), spent / CALLS * 4 * n * instants

        q, v = np.array(start), np.array(speeds)
        return run, pin.computeMechanicalEnergy(self.model, data, q, v)


def slider_crank(case: dict[str, Any]) -> Any:
    """As for MuJoCo: from B backwards."""
    tree = Tree()
    slide = tree.rod(0, 0.0, pin.JointModelPX())
    crank = tree.rod(tree.rod(slide, 0.0), 1.0)
    tree.tie(crank, 0, 0.0)
    theta, rate = case['theta'], case['rate']
    start = [2 * math.cos(theta), math.pi - theta, 2 * theta]
    speeds = [-2 * math.sin(theta) * rate, -rate, 2 * rate]

    def points(q: Any) -> Any:
        x, c = q[:, 0], q[:, 1]
        return np.stack([x + np.cos(c), np.sin(c), x, 0 * x], axis=1)

    return tree.runner(start, speeds, points)


def four_bars(n: int, case: dict[str, Any]) -> Any:
    """As for MuJoCo: cranks on the ground, couplers on them."""
    tree = Tree()
    cranks = [tree.rod(0, 0.0)]
    for k in range(1, n + 1):
        coupler = tree.rod(cranks[-1], 1.0)
        cranks.append(tree.rod(0, float(k)))
        tree.tie(coupler, cranks[-1], 1.0)
    return tree.runner(*branches(n, case['theta'], case['rate']), tips)


if __name__ == '__main__':
    perform(
        'pinocchio',
        f'pinocchio {pin.__version__}, proximal constraint dynamics, RK4',
        {
            'slider_crank': slider_crank,
            'double_four_bar': partial(four_bars, 2),
            'n_four_bar': partial(four_bars, 10),
        },
    )
