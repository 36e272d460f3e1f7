"""The task of every engine: the points of a mechanism, at instants, computed with steps of h.

    python peer_<name>.py plan.json results.jsonl

Runs in the environment of the engine, so it knows nothing of alf_ros: the exact motions, and the
steps to take, come in plan.json. Each run is a line of JSON.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

# A run of n steps of h (s) between two instants returns positions (instants, n) and the processor
# seconds of its steps. It may raise, or stop early: then it did not end.
Run = Callable[..., tuple[Any, float]]
CLOSE = 1e-4  # m: what is above, at a tiny step for a short time, is another model


def perform(
    peer: str, about: str, makers: dict[str, Callable[[dict[str, Any]], tuple[Run, float]]]
) -> None:
    """Check the model of each mechanism, then run it with every step of the plan.

    A maker makes the model of a mechanism, and returns what runs it and its energy (J).
    """
    with open(sys.argv[1], encoding='utf-8') as stream:
        plan = json.load(stream)
    with open(sys.argv[2], 'a', encoding='utf-8') as out:
        for mechanism, case in plan['cases'].items():
            run, energy = makers[mechanism](case)
            exact, spacing = np.array(case['exact']), case['spacing']
            _check(peer, run, energy - case['energy'], exact, spacing)
            for k in plan['numbers'].get(peer, plan['numbers']['all']):
                n = round(k * spacing / 0.01)
                said = {'peer': peer, 'about': about, 'mechanism': mechanism, 'k': k}
                result = measured(partial(run, n, spacing / n), exact, spacing, plan['longest'])
                if result is None:
                    break  # smaller steps take longer still
                print(json.dumps(said | result), file=out, flush=True)


def measured(run: Run, exact: Any, spacing: float, longest: float) -> dict[str, Any] | None:
    """Error and cost of a run, and why it did not end; None if it would take too long."""
    instants = len(exact) - 1
    try:
        _, spent = run(instants=1)
        if spent * instants > longest:
            return None
        found, first = run()
        times = [first]
        while len(times) < 3 and sum(times) < 0.02 * longest:
            times.append(run()[1])
    except Exception as reason:
        return {'error': None, 'cpu': None, 'failure': str(reason).strip().splitlines()[-1][:80]}
    cpu = 1e3 * statistics.median(times) / (spacing * instants)
    error = math.nan
    if len(found) == len(exact):
        error = float(np.abs(found - exact).max())
    if not math.isfinite(error):
        return {'error': None, 'cpu': cpu, 'failure': 'not finite, or ended early'}
    return {'error': error, 'cpu': cpu, 'failure': ''}


def _check(peer: str, run: Run, energy: float, exact: Any, spacing: float) -> None:
    """The same physics have the same energy (its difference, J), and at tiny steps, over a short
    time, are on the exact motion."""
    found, _ = run(1000, spacing / 1000, instants=3)
    wrong = float(np.abs(found - exact[:4]).max())
    if not (wrong < CLOSE and abs(energy) < CLOSE):
        raise SystemExit(f'{peer}: another mechanism: {wrong:.1e} m, {energy:.1e} J from it')


def branches(n: int, theta: float, rate: float) -> tuple[list[float], list[float]]:
    """Angles (rad) and rates (rad/s) of the hinges of `n` four-bars as branches: crank, coupler on
    its tip, crank ..., coupler, crank, with all cranks at theta (rad), rate (rad/s)."""
    return [*[theta, -theta] * n, theta], [*[rate, -rate] * n, rate]


def tips(q: Any) -> Any:
    """Tips of these cranks, m: x, y of each, from angles (instants, hinges), rad."""
    cranks = q[:, ::2]
    x = np.cos(cranks) + np.arange(cranks.shape[1])
    return np.stack([x, np.sin(cranks)], axis=2).reshape(len(q), -1)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """The result of `work`, and its processor time, s."""
    started = time.process_time()
    result = work()
    return result, time.process_time() - started
