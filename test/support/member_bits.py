"""All bits of members: `python -m support.member_bits`, in the folder of the tests, builds each of
`MEMBERS` in a process that has built nothing before, and prints a digest of each."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from alf_ros import Scene, Simulation, load_scene
from alf_ros.errors import AlfError
from alf_ros.scene.overrides import with_changes
from support.thorough import LONG

# a wheel-less arm: `com` and the second point change which numbers of its rows and masses are zero
ARM = {
    'mechanism': {
        'alf': 1,
        'parameters': {'N': 2, 'side': 0.1, 'x': 1.0, 'y': 0.0},
        'points': {
            'O': {'at': [0, 0], 'fixed': True},
            'P': {'at': [1, 0]},
            'Q': {'at': [0.5, 'side']},
            'E<k>': {'for': {'k': [1, 'N']}, 'at': ['1 + k', 'side']},
            'F': {'at': [1, 1]},
        },
        'bodies': {
            'arm': {'points': ['O', 'P', 'Q'], 'mass': 1, 'inertia': 'rod', 'com': ['x/2', 'y']},
            'first': {'points': ['P', 'E1'], 'mass': 1, 'inertia': 'rod'},
            'next<k>': {
                'for': {'k': [2, 'N']},
                'points': ['E<k-1>', 'E<k>'],
                'mass': 1,
                'inertia': 'rod',
            },
            'slide': {'points': ['Q', 'F'], 'mass': 0.2, 'inertia': 'rod'},
        },
        'joints': {
            'root': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'},
            'tip': {'type': 'revolute', 'between': ['arm', 'first'], 'at': 'P'},
            'knee<k>': {
                'for': {'k': [2, 'N']},
                'type': 'revolute',
                'between': ['first', 'next<k>'],
                'at': 'E1',
            },
            'pin': {'type': 'revolute', 'between': ['arm', 'slide'], 'at': 'Q'},
            'guide': {
                'type': 'slider',
                'point': 'F',
                'on': {'through': [1, 1], 'direction': ['x', 'y']},
            },
        },
    },
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
}

# what changes: names of each kind, twice with other numbers; and members of another structure
CRANK, FOUR, DOWN = 'slider_crank', 'four_bar', 'gravity.acceleration.1'
_EVERY: list[tuple[str, dict[str, str]]] = [
    (CRANK, {'coupler.mass': '1.07'}),
    (CRANK, {'coupler.mass': '0.93', 'm': '1.2'}),
    (CRANK, {'coupler.mass': '0'}),  # fewer pairs of masses
    (CRANK, {'L': '1.1', DOWN: '-9.7'}),
    (CRANK, {'L': '0.95', 'initial.velocities.B.0': '-3.9'}),
    (CRANK, {'initial.velocities.B.0': '-4.2', 'solver.penalty': '1e7'}),
    (CRANK, {'mechanism.points.A.at.1': '0.9'}),
    (CRANK, {'mechanism.joints.guide.on.direction': '[1, 0.1]', 'initial.velocities': '{}'}),
    (CRANK, {'mechanism.joints.guide.on.direction': '[1, -0.0]'}),
    (CRANK, {'mechanism.points.A.at': '[0, 0]'}),  # a length of 0: refused
    (FOUR, {'a': '0.101'}),
    (FOUR, {'a': '0.3', 'b': '0.3', 'c': '0.3'}),  # parallel: through a change point
    (FOUR, {'coupler.mass': '0.6'}),
    ('double_four_bar', {'m': '1.1'}),
    ('double_four_bar', {'mechanism.points.A1.at.0': 'L + 1e-10'}),  # contradicts a little
    ('double_four_bar', {'mechanism.points.B1.at.0': '1.1*L'}),
    ('scissor_lift', {'N': '2'}),
    ('scissor_lift', {'N': '3', 'load': '6'}),
    ('wiper', {'reach': '0.046', DOWN: '-9.7'}),
    ('delta_robot', {'l': '0.46', 'platform': '0.6'}),
    ('stewart_platform', {'plate': '21.0'}),
    ('stewart_platform', {'rp': '0.61'}),
    ('planetary_gear', {'rs': '0.031'}),
    ('arm', {'side': '0.1'}),
    ('arm', {'side': '0'}),  # Q on the line of the arm
    ('arm', {'y': '-0.0'}),
    ('arm', {'y': '0.05'}),  # M gets a skew part, the guide a slope
    ('arm', {'N': '1'}),
    ('arm', {'N': '2', 'mechanism.bodies.first.mass': '1.5'}),
]
MEMBERS = _EVERY if LONG else [*_EVERY[:10], *_EVERY[11::3]]


@cache
def base(name: str) -> Scene:
    """The scene whose numbers are changed."""
    return load_scene(ARM if name == 'arm' else name)


def bits(name: str, changes: dict[str, str]) -> str:
    """A digest of the arrays of the model, the start, some steps and a sample; or the error."""
    try:
        simulation = Simulation(with_changes(base(name), changes), integrator='dop853', step=1e-3)
        found = hashlib.sha256(repr(simulation.model.row_names).encode())
        for array in _arrays(simulation):
            found.update(array.tobytes())
        for _ in range(2):
            sample = simulation.sample()
            for array in (sample.q, sample.qd, sample.lam, sample.reaction_forces):
                found.update(array.tobytes())
            simulation.step(3)
    except AlfError as error:
        return f'{type(error).__name__}: {error}'
    return found.hexdigest()


def _arrays(simulation: Simulation) -> Iterator[np.ndarray[Any, Any]]:
    system, start = simulation.model.system, simulation._start
    structs = (system.mass, system.rows, system.pattern, system.arms, system.angles)
    numbers = [system.size, system.mean, system.penalty, system.ordinary, system.rank]
    yield np.array([*numbers, system.close, system.patience])
    for struct in (*structs, simulation.model.lengths):
        yield from (each for name, each in sorted(vars(struct).items()) if name in _named(struct))
    yield from (simulation.model.q, start.q, start.qd, start.ordinary)


def _named(struct: Any) -> list[str]:
    """The fields that are arrays."""
    names = (field.name for field in fields(struct))
    return [name for name in names if isinstance(getattr(struct, name), np.ndarray)]


def main() -> None:
    """Print the digest of each member, built alone."""
    for name, changes in MEMBERS:
        sys.stdout.flush()
        child = os.fork()
        if not child:
            print(bits(name, changes), flush=True)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0


if __name__ == '__main__':
    main()
