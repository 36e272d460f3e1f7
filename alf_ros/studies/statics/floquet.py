"""`alf_ros.floquet`: whether a periodic motion is stable, by the multipliers of one period.

States beside the motion are η = Yᵀ M δq and ν = Zᵀ M δq̇, as in `linearisation`. Each of their
g + f directions begins a tangent, δq = Y η, δq̇ = Z ν + U η, which follows the motion over one
period (`Simulation(tangents=['state.0', …])`). Read in the same coordinates at the end, where the
position is the first one again, the tangents are the columns of the monodromy matrix.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as linalg
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.carried_positions import blocks_of
from alf_ros.model.constraints.rotors import without_rotors
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import number
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import Instant, Loads
from alf_ros.studies.statics.linearisation import refuse_singular
from alf_ros.studies.statics.positions_of_rest import in_order

STABLE, NEUTRAL, UNSTABLE = 'stable', 'neutral', 'unstable'
_FEWEST, _MOST = 100, 2000  # steps of a period
_TOLERANCE = 1e-11  # of a step
_MISSES = 1e-6  # of the size and of the largest velocity, by which a motion may miss its start
_ONE = 1e-4  # distance from 1 of a multiplier that counts as 1 at most: of a double one the root
# of errors
_KNOWN = 1e-7  # of its norm: how well the matrix is known, beside the error of the period
_WHOLE = 1e-9  # of a step


@dataclass(frozen=True, eq=False)
class FloquetModel:
    """How small deviations from a periodic motion change over one period.

    period: s. monodromy (g + f, g + f): of (η, ν) at the start, η (g,) the displacement along
    `directions`, ν (f,) the change of velocity, for a unit of mass. directions (g, n): each in the
    order of `Sample.q`, kg^-½. flow (g + f,): η̇ and ν̇ of the motion at the start. miss: the
    distance (m, m/s) of its end from its start. autonomous: whether the motion may begin at any
    time; then a deviation along it returns, and its multiplier, 1, does not count in the verdict.
    doubt: how well the matrix is known, as a part of its norm.
    """

    period: float
    monodromy: Floats
    directions: Floats
    flow: Floats
    miss: tuple[float, float]
    autonomous: bool
    doubt: float

    def __repr__(self) -> str:
        states = len(self.monodromy)
        return f'<FloquetModel {self.verdict}, period {self.period:g} s, {states} states>'

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """(g + f,) eigenvalues of the monodromy matrix, the largest first, of a pair the one with
        positive imaginary part."""
        values = np.linalg.eigvals(self.monodromy).astype(complex)
        order = sorted(values, key=lambda z: (-round(abs(z), 9), -z.imag))
        return np.array(order, dtype=complex)

    @property
    def exponents(self) -> NDArray[np.complex128]:
        """(g + f,) log(multiplier) / period, 1/s, with the least imaginary part: it is known up to
        multiples of 2π / period."""
        with np.errstate(divide='ignore'):
            return np.asarray(np.log(self.multipliers) / self.period)

    @property
    def verdict(self) -> str:
        """'stable' if all deviations decay (to a shift in time, if nothing depends on time),
        'unstable' if one grows, 'neutral' if the largest neither grows nor decays."""
        beside = self.monodromy
        if self.autonomous:
            # across the motion: beside the multiplier along it, another 1 would be doubled, and
            # the last digits of the period would move both by their root
            across = np.linalg.svd(self.flow[None])[2][1:]
            beside = across @ beside @ across.T
        if not beside.size:
            return STABLE
        values, left, right = linalg.eig(beside, left=True)
        cosines = np.abs((left.conj() * right).sum(axis=0))
        known = self.doubt * np.linalg.norm(self.monodromy, 2)
        doubt = known / np.maximum(cosines, known / _ONE)
        grown = np.abs(values) - 1.0
        if (grown > doubt).any():
            return UNSTABLE
        return STABLE if (grown < -doubt).all() else NEUTRAL


def floquet(about: SceneSource | Simulation, *, period: float) -> FloquetModel:
    """The monodromy matrix and the Floquet multipliers of the periodic motion that begins at the
    present of a simulation, or where a scene starts.

    period (s): after it, positions and velocities must be the first ones again. The motion is
    computed with `dop853_adaptive` at a tolerance of 1e-11. Held inputs stay.

    Raises InputError if the motion is not periodic, with the distance that it misses; where
    nothing is free; in a singular position; for a motion that stays in a kink of a force; where
    tangents are refused (see `Simulation(tangents=…)`); and for more than 1200 coordinates.
    """
    period = number(period, 'period')
    if not period > 0.0:
        raise InputError('not usable', key='period', value=period, expected='more than 0 s')
    base = about if isinstance(about, Simulation) else Simulation(about)
    loads, state = Loads(base), base.state
    instant = Instant(loads, base.t, state.q, state.qd, state.turns)
    refuse_singular(instant)
    Y, Z = instant.position_directions, instant.velocity_directions
    if not Z.shape[1]:
        raise InputError('nothing is free: drives and rows hold every motion', key='floquet')
    run, steps = _begun(base, instant, period)
    flow = _flow(instant, run.sample())
    if instant.is_kinked:  # a motion through the kink leaves it at once, and has tangents
        run.step(1)
        later = run.state
        if Instant(loads, run.t, later.q, later.qd, later.turns).is_kinked:
            text = 'the motion stays in a kink of a force: deviations to its sides differ'
            raise InputError(text, key='effects')
        steps -= 1
    run.step(steps)
    end = run.state
    miss, part = _checked_miss(instant, end.q, end.qd, period)
    monodromy = _reduced(instant, end.tangents)
    # free of time the flow is a tangent, and ends as one; over a short period all nearly return
    off = float(np.linalg.norm(monodromy @ flow - _flow(instant, run.sample())))
    size = float(np.linalg.norm(flow))
    return FloquetModel(
        period=period,
        monodromy=monodromy,
        directions=in_order(instant.model, Y.T),
        flow=flow,
        miss=miss,
        autonomous=off <= _KNOWN * float(np.linalg.norm(monodromy, 2)) * size and size > 0.0,
        doubt=_KNOWN + part,
    )


def _begun(base: Simulation, instant: Instant, period: float) -> tuple[Simulation, int]:
    """A simulation with a tangent for each direction of the state, and the steps of the period."""
    count = min(max(math.ceil(period / base.h - _WHOLE), _FEWEST), _MOST)
    step, before = period / count, base.t / (period / count)
    if abs(before - round(before)) > _WHOLE * max(1.0, before):
        raise InputError(
            f'the motion begins at t = {base.t:g} s, which is no whole number of steps of '
            f'{step:g} s',
            key='period',
            value=period,
            expected='a start at t = 0, or after whole periods',
        )
    Y, Z = instant.position_directions, instant.velocity_directions
    names = [f'state.{k}' for k in range(Y.shape[1] + Z.shape[1])]
    solver = base.solver
    found = Simulation(
        base.scene,
        step=step,
        integrator='dop853_adaptive',
        tolerance=_TOLERANCE,
        formulation=solver.formulation,
        penalty=solver.penalty,
        iterations=solver.iterations,
        tangents=names,
    )
    n = instant.model.n
    tangents = np.zeros((len(names), 2, instant.q.size))
    solve = ConstrainedSolve(instant.model, ())
    solve.factorise(instant.M, instant.J_of_movable, instant.q)
    for k, y in enumerate(Y.T):
        tangents[k, 0, :n] = y
        tangents[k, 1, :n] = solve.solve(np.zeros(n), -(instant.turning @ y))[0]
    for k, z in enumerate(Z.T, Y.shape[1]):
        tangents[k, 1, :n] = z
    state = base.state
    found.restore(
        replace(
            found.state,
            step=round(before),
            q=state.q,
            qd=state.qd,
            turns=state.turns,
            sums=state.sums,
            inputs=state.inputs,
            tangents=tangents.ravel(),
        )
    )
    return found, count


def _reduced(instant: Instant, tangents: Floats) -> Floats:
    """(g + f, g + f): a column for each tangent, in η and ν."""
    n = instant.model.n
    Y, Z = instant.position_directions, instant.velocity_directions
    columns = tangents.reshape(Y.shape[1] + Z.shape[1], 2, -1)[..., :n]
    momenta = np.array([instant.M @ each.T for each in columns])  # (tangents, n, 2)
    return np.vstack([Y.T @ momenta[..., 0].T, Z.T @ momenta[..., 1].T])


def _flow(instant: Instant, sample: Sample) -> Floats:
    """(g + f,) of η̇ and ν̇ of a sample, in the coordinates of the start."""
    model, n = instant.model, instant.model.n
    acceleration = blocks_of(model, sample.qdd)[:n]
    rates = instant.position_directions.T @ (instant.M @ sample.state.qd[:n])
    return np.concatenate([rates, instant.velocity_directions.T @ (instant.M @ acceleration)])


def _checked_miss(
    instant: Instant, q: Floats, qd: Floats, period: float
) -> tuple[tuple[float, float], float]:
    """How far (m, m/s) the motion ends from its start; and as a part of its size, or of its
    largest velocity. Raises InputError if it is too far."""
    apart = without_rotors(instant.model.layout, q - instant.q)
    far = float(np.abs(apart).max(initial=0.0))
    off = float(np.abs(qd - instant.qd).max(initial=0.0))
    size = instant.model.size
    fastest = max(float(np.abs(instant.qd).max(initial=0.0)), size / period)
    part = max(far / size, off / fastest)
    if part > _MISSES:
        raise InputError(
            f'the motion is not periodic: after {period:.9g} s it misses its start by '
            f'{far:.3g} m and {off:.3g} m/s',
            key='period',
        )
    return (far, off), part
