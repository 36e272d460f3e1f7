"""Simulations of every kind, for tests of what all of them must hold."""

from __future__ import annotations

from typing import Any

from alf_ros import Simulation, State, load_scene
from alf_ros.scene.scene import Scene

# two bodies, an effort held, friction under the true reactions, a ledger's worth of effects
RUBBING: dict[str, Any] = {
    'mechanism': 'four_bar',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'joint_friction': {'joint': 'crank_pin', 'dynamic': 0.3, 'radius': 0.02, 'slip': 1.0},
    },
    'initial': {'velocities': {'A': ['-3*a*sin(theta)', '3*a*cos(theta)']}},
    'solver': {'step': 1e-3, 'integrator': 'rk4'},
}
STIFF: dict[str, Any] = {
    'mechanism': 'double_pendulum',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'torsion_spring': {'joint': 'elbow', 'stiffness': 1e4},
    },
    'initial': {'velocities': {'A': [0, 1], 'B': [-1, 1]}},
}
# its crank swings by 0.14 rad for ever: independent coordinates of the start hold all the time
SWINGING: dict[str, Any] = {
    'mechanism': 'slider_crank',
    'effects': {
        'gravity': {'acceleration': [0, -9.81]},
        'torsion_spring': {'joint': 'crank_pin', 'stiffness': 100.0},
    },
}
# name, scene, settings: explicit, adaptive, implicit, with drives, friction, ledger and watcher,
# in the plane and in space, and a formulation that carries a state of its own; all of them go on
# for ever
RUNS: dict[str, tuple[Any, dict[str, Any]]] = {
    'explicit': ('slider_crank', {'integrator': 'rk4', 'ledger': True}),
    'adaptive': ('double_four_bar', {'integrator': 'dop853_adaptive', 'watch': True}),
    'implicit': (STIFF, {'integrator': 'esdirk43_adaptive', 'step': 1e-3}),
    'driven': ('wiper', {'integrator': 'rk4'}),
    'rubbing': (RUBBING, {'ledger': True}),
    'spatial': ('spatial_slider_crank', {'integrator': 'dop853'}),
    'carried': (SWINGING, {'formulation': 'independent', 'integrator': 'rk4'}),
}


def scene(name: str) -> Scene:
    """The scene of a run."""
    return load_scene(RUNS[name][0])


def made(name: str) -> Simulation:
    """A run at its start."""
    return Simulation(scene(name), **RUNS[name][1])


def bits(state: State) -> tuple[Any, ...]:
    """All of a state, to compare."""
    arrays = (state.q, state.qd, state.turns, state.carried, state.loads)
    works = sorted(state.works.items())
    return state.step, state.pace, works, state.inputs, *(a.tobytes() for a in arrays)
