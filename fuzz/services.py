"""A running node: calls of its services, messages on its topics and parameters, in any order.

A case is a list of acts. `Graph` (in `node_graph`) carries them out and judges them.
"""

from __future__ import annotations

import json
import os
from random import Random
from typing import Any

from spoiling import INTEGERS, TEXTS, number, scratch, value

TRIGGERS = ('step', 'reset', 'reset_state', 'save_state', 'restore_state')
ABOUT = ('get_parameters', 'get_parameter_types', 'describe_parameters')
SET = ('set_parameters', 'set_parameters_atomically')
SCENES = (
    'slider_crank',
    'four_bar',
    'rolling_disk',
    'missing',
    'scene.yaml',
    '.',
    'circle',
    'pipe',
)
WRENCHED = ('crank', 'coupler', 'A', 'B')
JOINTS = ('crank_pin', 'coupler_pin', 'slide', 'crank', '')
TOPICS = ('joints', 'path', *WRENCHED)
VERIFIED = 40  # of so many cases, the log of one is run again


class Harness:
    SUFFIX = '.json'
    SECONDS = 120.0  # also of compiling and of steps while it plays

    def __init__(self) -> None:
        self._folder = scratch('services')
        self._graph: Any = None

    # ------------------------------------------------------------------------- what is made

    def make(self, random: Random) -> bytes:
        """The acts, as JSON."""
        acts = [self._act(random) for _ in range(random.choice((1, 2, 3, 5, 8)))]
        return json.dumps(acts).encode()

    def _act(self, random: Random) -> list[Any]:
        kind = random.randrange(40)
        if kind < 8:
            return ['trigger', random.choice(TRIGGERS)]
        if kind < 12:
            return ['pause', bool(random.randrange(2))]
        if kind < 21:
            many = random.choice((1, 1, 2))
            return ['set', random.choice(SET), [self._parameter(random) for _ in range(many)]]
        if kind < 23:
            names = [random.choice((*TEXTS, 'rate', 'solver.step')) for _ in range(2)]
            return ['about', random.choice(ABOUT), names]
        if kind == 23:
            return ['list', [random.choice(TEXTS), 'solver'], random.choice(INTEGERS)]
        if kind < 28:
            numbers = [self._float(random) for _ in range(6)]
            frame = random.choice(('', '', 'world', 'crank', *TEXTS))
            return ['wrench', random.choice(WRENCHED), frame, numbers]
        if kind < 33:
            names = [self._joint(random) for _ in range(random.choice((0, 1, 1, 2, 5)))]
            return ['joints', names, *(self._floats(random) for _ in range(3))]
        if kind < 37:
            names = [self._joint(random) for _ in range(random.choice((0, 1, 1, 2)))]
            points = [self._point(random) for _ in range(random.choice((0, 1, 1, 2, 3)))]
            start = random.choice((0, 0, 0, 1, -1, 2**31 - 1, -(2**31)))
            return ['path', names, start, points]
        if kind == 37:
            scene = self._scene(random) if random.randrange(3) == 0 else random.choice(SCENES)
            return ['scene', scene]
        return ['bytes', random.choice(TOPICS), random.randrange(2**32)]

    def _joint(self, random: Random) -> str:
        return random.choice(JOINTS) if random.randrange(4) else random.choice(TEXTS)

    def _float(self, random: Random) -> float:
        if random.randrange(3):
            return random.choice((0.0, 0.0, random.gauss(0.0, 1.0)))
        return float(number(random))

    def _floats(self, random: Random) -> list[float]:
        return [self._float(random) for _ in range(random.choice((0, 0, 1, 1, 2, 9)))]

    def _point(self, random: Random) -> list[Any]:
        """Positions, velocities, accelerations, efforts, s, ns."""
        seconds = random.choice((0, 1, 2, -1, 2**31 - 1, -(2**31)))
        nanoseconds = random.choice((0, 5 * 10**8, 2**32 - 1))
        return [*(self._floats(random) for _ in range(4)), seconds, nanoseconds]

    def _parameter(self, random: Random) -> list[Any]:
        """Name, or a number for one that the node has; its type as the message says, -1 for the
        right one; value."""
        if random.randrange(8) == 0:
            return [random.choice(TEXTS), random.randrange(12), value(random, 0)]
        kind = random.choice((-1, -1, -1, random.randrange(10), random.choice((10, 99, 255))))
        given = random.choice((number(random), random.gauss(0, 1), random.choice(TEXTS), True))
        return [random.randrange(1000), kind, given]

    def _scene(self, random: Random) -> str:
        import scenes

        return scenes.Harness().make(random).decode('utf-8', 'replace')

    # ------------------------------------------------------------------------- what is asked

    def check(self, case: bytes) -> str:
        """Every call is answered with one line, every message is taken or refused; a refusal
        changes nothing, all numbers stay finite, and the log verifies."""
        here = os.getcwd()
        os.chdir(self._folder)
        try:
            if self._graph is None:
                import node_graph

                self._graph = node_graph.Graph(self._folder)
            self._graph.begin()
            ends = {self._graph.do(*act) for act in json.loads(case)}
            if sum(case) % VERIFIED == 0:
                self._graph.verify()
        except BaseException:
            self.close()
            raise
        finally:
            os.chdir(here)
        return 'refused' if ends == {'refused'} else 'ran'

    def close(self) -> None:
        """End the nodes."""
        graph, self._graph = self._graph, None
        if graph is not None:
            graph.close()
