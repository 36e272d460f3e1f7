"""Recordings of simulated machines: a scene with other numbers runs, sensors add what they add."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros import Recording, Scene, Simulation, load_scene, recorded
from alf_ros.scene import overrides
from alf_ros.studies.identification.recording import HeldInput

SLIDER_CRANK: dict[str, Any] = {
    'name': 'machine',
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_friction': {
            'pin': {'joint': 'crank_pin', 'viscous': 0.3},
            'rail': {'joint': 'guide', 'viscous': 0.2},
        },
    },
    'initial': {'velocities': {'B': [-4, 0]}},
    'solver': {'step': 2e-3, 'integrator': 'rk4'},
}


def scene(**changes: float) -> Scene:
    """The slider-crank with friction; `pin__viscous=0.4` changes a number."""
    return changed(load_scene(SLIDER_CRANK), {k.replace('__', '.'): v for k, v in changes.items()})


def changed(of: Scene, numbers: dict[str, float]) -> Scene:
    """A scene with other numbers."""
    return overrides.with_changes(of, {name: repr(x) for name, x in numbers.items()})


def pushes(joint: str, size: float, duration: float, period: float = 0.1) -> list[HeldInput]:
    """Efforts on a joint that change again and again."""
    count = int(duration / period)
    efforts = size * np.sin(1.7 * np.arange(count)) + 0.4 * size * np.cos(0.6 * np.arange(count))
    return [
        HeldInput(k * period, 'effort', joint, {'effort': float(x)}) for k, x in enumerate(efforts)
    ]


class Machine:
    """The exact motion of a scene, and recordings of it."""

    def __init__(
        self,
        of: Scene,
        joints: Sequence[str],
        duration: float,
        rate: float = 100.0,
        inputs: Sequence[HeldInput] = (),
    ) -> None:
        self.scene, self.joints, self.inputs = of, tuple(joints), tuple(inputs)
        simulation, waiting = Simulation(of), list(inputs)
        self.t = np.arange(int(duration * rate) + 1) / rate
        x, v = [], []
        for t in self.t.tolist():
            step = round(t / simulation.h)
            while waiting and round(waiting[0].t / simulation.h) < step:
                held = waiting.pop(0)
                simulation.step(round(held.t / simulation.h) - simulation.step_index)
                held.apply(simulation)
            simulation.step(step - simulation.step_index)
            sample = simulation.sample()
            x.append([sample.joints[joint].position for joint in joints])
            v.append([sample.joints[joint].velocity for joint in joints])
        self.x, self.v = np.array(x), np.array(v)

    def recording(
        self,
        noise: float = 0.0,
        seed: int = 0,
        quantum: float = 0.0,
        delay: float = 0.0,
        velocities: bool = False,
    ) -> Recording:
        """Positions with white noise (rad, m), rounded to a quantum (rad, m), stamped late by a
        delay (s); velocities with ten times the noise."""
        rng = np.random.default_rng(seed)
        x = self.x + noise * rng.normal(size=self.x.shape)
        v = self.v + 10.0 * noise * rng.normal(size=self.v.shape)
        if quantum > 0.0:
            x = np.round(x / quantum) * quantum
        return recorded(
            self.t + delay,
            dict(zip(self.joints, x.T, strict=True)),
            dict(zip(self.joints, v.T, strict=True)) if velocities else None,
            self.inputs,
        )
