"""Two mechanisms, and in test/data/effect_examples.yaml examples of each effect on them."""

from __future__ import annotations

from typing import Any

import pytest
from numba.core.registry import CPUDispatcher

from alf_ros import Simulation, load_scene
from alf_ros.effects.contract import OnDemand
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.scene.text import yaml_document
from support.paths import DATA

PLANAR = """
mechanism:
  alf: 1
  space: planar
  points:
    O: {at: [0, 0], fixed: true}
    W: {at: [2, 1.5], fixed: true}
    A: {at: [1, 0.2]}
    B: {at: [1.4, -0.8]}
    S: {at: [1.4, -0.8]}
    C: {at: [2.5, -0.6]}
  bodies:
    arm: {points: [O, A], mass: 2.0, inertia: {about_com: 0.3}, com: [0.4, 0.1]}
    fore: {points: [A, B], mass: 1.0, inertia: rod}
    shoe: {points: [S, C], mass: 0.5, inertia: {about_com: 0.02}}
  joints:
    shoulder: {type: revolute, between: [ground, arm], at: O}
    elbow: {type: revolute, between: [arm, fore], at: A}
    rail: {type: prismatic, between: [fore, shoe], at: B, axis: [0.4, -1]}
initial: {velocities: {A: [~, 1.5], B: [0.5, ~], C: [1.0, ~]}}
"""
SPATIAL = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    W: {at: [2, 1.5, 0.5], fixed: true}
    A: {at: [1, 0.2, 0.1]}
    B: {at: [1.4, -0.8, 0.3]}
    S: {at: [1.4, -0.8, 0.3]}
    C: {at: [2.5, -0.6, 0.2]}
    D: {at: [2.5, -0.6, 0.2]}
    E: {at: [3, 0, 1]}
  bodies:
    arm: {points: [O, A], mass: 2.0, inertia: {about_com: [0.3, 0.2, 0.25]}, com: [0.4, 0.1, 0]}
    fore: {points: [A, B], mass: 1.0, inertia: {about_com: [0.1, 0.2, 0.15]}}
    shoe: {points: [S, C], mass: 0.5, inertia: {about_com: [0.02, 0.03, 0.04]}}
    hand: {points: [D, E], mass: 0.5, inertia: {about_com: [0.02, 0.03, 0.04]}}
  joints:
    shoulder: {type: revolute, between: [ground, arm], at: O, axis: [0.2, 0, 1]}
    elbow: {type: universal, between: [arm, fore], at: A, axes: [[0, 0, 1], [1, 0, 0]]}
    rail: {type: cylindrical, between: [fore, shoe], at: B, axis: [0.4, -1, 0]}
    wrist: {type: prismatic, between: [shoe, hand], at: D, axis: [1, 0, 1]}
initial: {velocities: {A: [~, 1.5, ~], B: [~, ~, 0.2], C: [~, ~, 2], E: [~, ~, 0.7]}}
"""
# by kind: `planar` and `spatial` do everything that it can do, `without` has no strength
EXAMPLES = yaml_document.read(DATA / 'effect_examples.yaml').mapping()
LOADED = [('joint_friction', f'{which}_loaded') for which in ('planar', 'spatial')]
DRIVEN = [('tendon', f'{which}_driven') for which in ('planar', 'spatial')]
CASES = [(kind, which) for kind in EXAMPLES for which in ('planar', 'spatial')] + LOADED + DRIVEN
_SPATIAL = list(EXAMPLES)[::2]  # in `make test`


def in_plane_or_space(kind: str, which: str) -> bool:
    """Whether a case stays in `make test`, of tests that compile each effect: half of the effects
    are tried in space, the others in the plane."""
    return which.startswith('spatial') == (kind in _SPATIAL)


def simulation(kind: str, which: str, **options: Any) -> Simulation:
    fields = yaml_document.parse(
        SPATIAL if which.startswith('spatial') else PLANAR, None
    ).mapping()
    chosen = {kind: EXAMPLES[kind].mapping()[which]}
    return Simulation(load_scene({**fields, 'effects': chosen}), **{'step': 1e-3, **options})


def as_python(monkeypatch: pytest.MonkeyPatch, *modules: object) -> None:
    """Replace compiled functions by their Python source, and loops for LLVM by ranges.

    Functions that are compiled on demand call the replaced ones: they are compiled before."""
    for module in modules:
        for value in vars(module).values():
            if isinstance(value, OnDemand):
                assert value.address
    for module in modules:
        for name, value in list(vars(module).items()):
            if isinstance(value, CPUDispatcher):
                monkeypatch.setattr(module, name, value.py_func)
            elif value is each:
                monkeypatch.setattr(module, name, range)
