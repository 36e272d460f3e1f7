"""One Simulation is used by one thread at a time; many of them run side by side."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from alf_ros import BusyError, Simulation, StoppedError
from alf_ros.kernel import advance, advance_adaptively, advance_implicitly
from alf_ros.simulation.sample import Sample
from support.runs import RUNS, bits, made

CALLS: dict[str, Callable[[Simulation], Any]] = {
    'step': lambda sim: sim.step(),
    'sample': lambda sim: sim.sample(),
    'state': lambda sim: sim.state,
    'restore': lambda sim: sim.restore(sim._initial),
    'reset': lambda sim: sim.reset(),
    'place': lambda sim: sim.place('crank', twist=[0.0, 0.0, 1.0]),
    'apply_wrench': lambda sim: sim.apply_wrench('coupler', [0.0, 1.0]),
    'apply_effort': lambda sim: sim.apply_effort('crank_pin', 1.0),
    'apply_target': lambda sim: sim.apply_target('crank_pin', 1.0),
    'clear_inputs': lambda sim: sim.clear_inputs(),
    'run': lambda sim: next(iter(sim.run(1.0))),
    'passes': lambda sim: sim.passes,
    'copy': lambda sim: sim.__copy__(),
}


def test_a_second_thread_is_refused_and_the_first_one_goes_on() -> None:
    sim = Simulation(made('explicit').scene, integrator='rk4', watch=True)
    raised: list[type[BaseException]] = []

    def work() -> None:
        try:
            sim.step(10**12)
        except StoppedError as error:
            raised.append(type(error))

    thread = threading.Thread(target=work)
    thread.start()
    while sim.step_index < 100:
        time.sleep(0.001)
    for name, call in CALLS.items():
        with pytest.raises(BusyError, match='give each thread its own') as refused:
            call(sim)
        assert '\n' not in str(refused.value), name
    assert sim.t > 0.0  # may be read
    sim.stop()
    thread.join()
    assert raised == [StoppedError]
    k = sim.step_index
    alone = Simulation(sim.scene, integrator='rk4', watch=True)
    alone.restore(sim.state)
    sim.step(50)
    alone.step(50)
    assert sim.state.q.tobytes() == alone.state.q.tobytes() and sim.step_index == k + 50


def test_threads_that_fight_for_one_simulation_leave_a_whole_state() -> None:
    sim, refused = made('explicit'), []

    def work() -> None:
        for _ in range(300):
            try:
                sim.step()
            except BusyError:
                refused.append(1)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sim.step_index == 1200 - len(refused)
    alone = made('explicit')
    alone.step(sim.step_index)
    assert bits(sim.state) == bits(alone.state)


@pytest.mark.parametrize('name', RUNS)
def test_many_simulations_run_side_by_side(name: str) -> None:
    """Copies of one simulation share only data that are never written."""
    first = made(name)
    first.step(5)
    others = [first, *(first.__copy__() for _ in range(3))]

    def work(sim: Simulation) -> Any:
        for _ in range(8):
            sim.step(5)
            sample = sim.sample()
            _ = sample.reaction_forces, sample.energy
        return bits(sim.state), sample.reaction_forces.tobytes()

    with ThreadPoolExecutor(4) as pool:
        told = list(pool.map(work, others))
    alone = made(name)
    alone.step(5)
    assert told == 4 * [work(alone)]


def told(sample: Sample) -> tuple[bytes, bytes]:
    return sample.reaction_forces.tobytes(), sample.lam.tobytes()


@pytest.mark.parametrize('name', ['driven', 'rubbing'])
def test_samples_are_read_while_it_steps(name: str) -> None:
    sim, alone = made(name), made(name)
    sim.step(5)
    alone.step(5)
    wanted = told(alone.sample())
    samples = [sim.sample() for _ in range(40)]
    with ThreadPoolExecutor(2) as pool:
        reading = [pool.submit(told, sample) for sample in samples]
        for _ in range(200):
            sim.step(5)
        assert {each.result() for each in reading} == {wanted}
    alone.step(1000)
    assert bits(sim.state) == bits(alone.state)


def test_the_steps_release_the_lock_of_the_interpreter() -> None:
    for function in (advance, advance_adaptively, advance_implicitly):
        assert function.targetoptions['nogil'] is True
    for name in ('alf1', 'alf2_as_printed', 'baumgarte', 'independent', 'lagrange_canonical'):
        module = __import__(f'alf_ros.simulation.formulations.{name}', fromlist=['advance'])
        assert module.advance.targetoptions['nogil'] is True


@pytest.mark.parametrize('name', RUNS)
def test_steps_go_on_while_another_thread_holds_the_interpreter(name: str) -> None:
    """This thread hands the interpreter over only where it sleeps. So steps that it sees between
    two of its own instructions are made by code without the lock, however busy the machine is."""
    sim = made(name)
    sim.step(100)  # from now on compiled code asks the interpreter every 20 ms, not at once
    thread = threading.Thread(target=lambda: _until_stopped(sim))
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e3)
    try:
        thread.start()
        made_meanwhile = 0
        for _ in range(1000):
            before = sim.step_index
            for _ in range(100_000):
                made_meanwhile = sim.step_index - before
                if made_meanwhile:
                    break
            if made_meanwhile:
                break
            time.sleep(1e-3)  # it waits for the interpreter: let it ask, and go on
    finally:
        sys.setswitchinterval(interval)
        sim.stop()
        thread.join()
    assert made_meanwhile > 0


def _until_stopped(sim: Simulation) -> None:
    with pytest.raises(StoppedError):
        sim.step(10**12)
