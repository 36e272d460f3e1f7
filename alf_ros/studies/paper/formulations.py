"""The two examples of the paper run with a formulation, beside their exact motion.

Bayo & Avello, Nonlinear Dynamics 5 (1994): slider-crank (6.2) and two four-bars (6.3), 10 s. q̈
and λ belong to the reached state, as in `Sample`, in every formulation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import StepError
from alf_ros.scene.scene import load_scene
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.exact import one_freedom
from alf_ros.studies.exact.one_freedom import OneFreedom
from alf_ros.studies.paper.published import PublishedRun, PublishedSetting

DURATION, SPACING = 10.0, 0.02  # s
OFF, CHANGED = 0.1, 0.01  # m off the branch, part of the energy: beyond these a run has failed


@dataclass(frozen=True)
class Example:
    """A mechanism with an exact motion, and its displayed quantities.

    shown: place in q of the coordinate; rows: constraints whose λ are shown, times `weight`(θ),
    which vanishes at the singular positions. figures: where the paper shows this example.
    """

    mechanism: str
    section: str
    figures: str
    alone: Callable[[], OneFreedom]
    theta: float
    rate: float
    coordinate: str
    shown: int
    rows: tuple[str, str]
    weight: Callable[[Floats], Floats]
    weight_text: str


EXAMPLES = (
    Example(
        'slider_crank',
        'Slider-crank (6.2)',
        '3-8',
        one_freedom.slider_crank,
        math.pi / 4,
        2 * math.sqrt(2),
        'x of B',
        2,
        ('crank_length', 'coupler_length'),
        np.cos,
        '',
    ),
    Example(
        'double_four_bar',
        'Two four-bars (6.3)',
        '10-13',
        lambda: one_freedom.four_bars(2),
        math.pi / 2,
        -1.0,
        'x of B0',
        0,
        ('crank0_length', 'crank1_length'),
        np.sin,
        'sin θ · ',
    ),
)


@dataclass(frozen=True)
class ComparedMotion:
    """A motion at its times; SI. `stopped`: why it ended early, if it did; `lost`: the time (s)
    from which on it is none of this mechanism, if there is one."""

    name: str
    t: Floats  # (times,) s
    position: Floats  # (times,)
    velocity: Floats  # (times,)
    acceleration: Floats  # (times,)
    energy: Floats  # (times,)
    lam: Floats  # (times, 2)
    position_error: Floats  # (times,)
    gap: Floats  # (times,) largest opening of a constraint
    lost: float | None
    stopped: str
    evaluations: int
    nearest: float | None = None  # least `weight`(θ) of an evaluation before it was lost

    @property
    def energy_error(self) -> Floats:
        """(times,) J, the distance of the energy from its first value."""
        return np.abs(self.energy - self.energy[0])

    def columns(self) -> list[Floats]:
        """All numbers over time."""
        shown = [self.t, self.position, self.velocity, self.acceleration, self.energy, *self.lam.T]
        return [*shown, self.position_error, self.energy_error, self.gap]

    def verdict(self) -> str:
        """In words."""
        if self.lost is not None:
            return f'fails at {self.lost:.2f} s'
        return 'gets through'


class FormulationComparison:
    """An example, its exact motion, and runs of it at the same times."""

    def __init__(self, example: Example, duration: float = DURATION) -> None:
        self.example = example
        self.times: Floats = SPACING * np.arange(round(duration / SPACING) + 1, dtype=float)
        self._alone = example.alone()
        self.theta, self._rate = self._alone.course(example.theta, example.rate, self.times)
        self._q = np.array([self._alone.position(angle) for angle in self.theta])

    @cached_property
    def _observer(self) -> Simulation:
        """A simulation that gives q̈, λ and the energy of a state."""
        return Simulation(load_scene(self.example.mechanism))

    @cached_property
    def truth(self) -> ComparedMotion:
        """λ and q̈ from the equations of the mechanism at the exact q and q̇."""
        model, state = self._observer.model, self._observer.state
        D = model.layout.dimension
        blocks = model.point_block[: model.layout.movable]
        samples = []
        for q, theta, rate in zip(self._q, self.theta, self._rate, strict=True):
            state.q.reshape(-1, D)[blocks] = q.reshape(-1, D)
            state.qd.reshape(-1, D)[blocks] = (self._alone.tangent(theta) * rate).reshape(-1, D)
            samples.append(self._observed(state.q, state.qd))
        return self._curve('exact', samples, '', 0)

    @property
    def passages(self) -> Floats:
        """Times (s) of the singular positions."""
        weight = self.example.weight(self.theta)
        passed = np.flatnonzero(np.diff(np.sign(weight)))
        share = weight[passed] / (weight[passed] - weight[passed + 1])
        found: Floats = self.times[passed] + share * SPACING
        return found

    def published(self, formulation: str, setting: PublishedSetting) -> ComparedMotion:
        """A run in the setting of the paper; it ends where a step fails."""
        run = PublishedRun(load_scene(self.example.mechanism), formulation, setting)
        samples, stopped = _until_it_fails(
            self._observed(q, qd) for q, qd in run.states(self.times)
        )
        curve = self._curve(formulation, samples, stopped, len(run.evaluated))
        last = math.inf if curve.lost is None else curve.lost
        angles = np.array([_angle(q) for t, q in run.evaluated if t <= last])
        return replace(curve, nearest=float(np.abs(self.example.weight(angles)).min()))

    def lost_at(self, formulation: str, setting: PublishedSetting) -> float | None:
        """The time (s) at which such a run fails, where it stops; None if it does not fail."""
        run = PublishedRun(load_scene(self.example.mechanism), formulation, setting)
        first, reached = None, 0.0
        try:
            for t, (q, qd) in zip(self.times, run.states(self.times), strict=True):
                sample = self._observed(q, qd)
                first, reached = first or sample, float(t)
                if self._is_lost(sample, first):
                    return reached
        except StepError:
            return reached
        return None

    def simulated(self, formulation: str, solver: Mapping[str, Any]) -> ComparedMotion:
        """A run of `Simulation`."""
        scene = load_scene(self.example.mechanism)
        sim = Simulation(scene, formulation=formulation, **solver)
        samples, stopped = _until_it_fails(sim.run(self.times[-1], at=self.times.tolist()))
        if sim.h > SPACING:  # looking between its steps has cost more than the run
            sim = Simulation(scene, formulation=formulation, **solver)
            sim.step(round(self.times[-1] / sim.h))
        return self._curve(formulation, samples, stopped, sim.evaluations)

    def _observed(self, q: Floats, qd: Floats) -> Sample:
        """A sample at q and q̇, all blocks D."""
        self._observer.restore(replace(self._observer.state, q=q, qd=qd))
        return self._observer.sample()

    def _curve(
        self, name: str, samples: list[Sample], stopped: str, evaluations: int
    ) -> ComparedMotion:
        place, rows = self.example.shown, self.example.rows
        reached = self.times[: len(samples)]
        away = (t for t, s in zip(reached, samples, strict=True) if self._is_lost(s, samples[0]))
        lost = next(away, reached[-1] if stopped else None)
        return ComparedMotion(
            name=name,
            t=reached,
            position=np.array([s.q[place] for s in samples]),
            velocity=np.array([s.qd[place] for s in samples]),
            acceleration=np.array([s.qdd[place] for s in samples]),
            energy=np.array([s.energy for s in samples]),
            lam=np.array([[s.multipliers[row] for row in rows] for s in samples]),
            position_error=np.array(
                [np.abs(s.q - q).max() for s, q in zip(samples, self._q, strict=False)]
            ),
            gap=np.array([s.diagnostics.position_violation for s in samples]),
            lost=None if lost is None else float(lost),
            stopped=stopped,
            evaluations=evaluations,
        )

    def _is_lost(self, sample: Sample, first: Sample) -> bool:
        """Whether the points differ from the mechanism with the same first bar, or the energy
        differs from the energy at the start. A run that is only late does not count."""
        off = np.abs(sample.q - self._alone.position(_angle(sample.q))).max()
        kept = abs(sample.energy - first.energy) <= CHANGED * first.energy
        return not (off <= OFF and kept)


def _angle(q: Floats) -> float:
    """θ (rad) of the bar from the origin to the first point of q (n,)."""
    return math.atan2(q[1], q[0])


def _until_it_fails(samples: Iterator[Sample]) -> tuple[list[Sample], str]:
    """The samples of a run, and why it ended early."""
    found: list[Sample] = []
    try:
        found.extend(samples)  # those before a failure stay
    except StepError as error:
        return found, str(error)
    return found, ''
