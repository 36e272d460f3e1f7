"""Signals while code is compiled or loaded: heard afterwards, by all handlers, as they were."""

from __future__ import annotations

import faulthandler
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from alf_ros.kernel.numba_ext.held_signals import held
from support.paths import ROOT

ONE, TWO = signal.SIGUSR1, signal.SIGUSR2


class Heard(Exception):
    """An error that a handler of these tests raises."""


@pytest.fixture
def heard() -> Iterator[list[int]]:
    """The signals that a handler heard; it raises `Heard` at each second one, `TWO`."""
    numbers: list[int] = []

    def hear(number: int, frame: Any) -> None:
        numbers.append(number)
        if number == TWO:
            raise Heard

    before = {number: signal.signal(number, hear) for number in (ONE, TWO)}
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_handler_runs_when_the_block_ends(heard: list[int]) -> None:
    hears = signal.getsignal(ONE)
    with held():
        signal.raise_signal(ONE)
        assert heard == []
    assert heard == [ONE]
    assert signal.getsignal(ONE) == hears
    signal.raise_signal(ONE)
    assert heard == [ONE, ONE]


def test_what_a_handler_raises_is_raised_when_the_block_ends(heard: list[int]) -> None:
    ended = False
    with pytest.raises(Heard):
        with held():
            signal.raise_signal(TWO)
            signal.raise_signal(ONE)
            ended = True
    assert ended and set(heard) == {ONE, TWO}
    with held():
        signal.raise_signal(ONE)
    assert heard[-1] == ONE and len(heard) == 3


def test_an_error_of_the_block_stays(heard: list[int]) -> None:
    with pytest.raises(KeyError):
        with held():
            signal.raise_signal(ONE)
            raise KeyError
    assert heard == [ONE]


def test_a_handler_runs_where_an_inner_block_begins(heard: list[int]) -> None:
    with held():
        with held():
            signal.raise_signal(ONE)
        assert heard == []
        with held():
            assert heard == [ONE]
            signal.raise_signal(ONE)
            assert heard == [ONE]
    assert heard == [ONE, ONE]


def test_what_is_raised_where_an_inner_block_begins_ends_the_outer_one(heard: list[int]) -> None:
    with pytest.raises(Heard):
        with held():
            signal.raise_signal(TWO)
            with held():
                heard.clear()
    assert heard == [TWO]
    with held():
        signal.raise_signal(ONE)
        assert heard == [TWO]
    assert heard == [TWO, ONE]


def test_a_handler_of_c_behind_that_of_python_waits_too(heard: list[int], tmp_path: Path) -> None:
    with open(tmp_path / 'traces', 'w+') as traces:
        faulthandler.register(ONE, traces, chain=True)
        try:
            with held():
                signal.raise_signal(ONE)
                assert traces.read() == '' and heard == []
            traces.seek(0)
            assert 'most recent call first' in traces.read() and heard == [ONE]
            traces.truncate(0)
            signal.raise_signal(ONE)
            traces.seek(0)
            assert 'most recent call first' in traces.read() and heard == [ONE, ONE]
        finally:
            faulthandler.unregister(ONE)


def test_a_loop_that_waits_for_signals_is_woken_once(heard: list[int]) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        for each in (ours, theirs):
            each.setblocking(False)
        before = signal.set_wakeup_fd(theirs.fileno())
        try:
            with held():
                signal.raise_signal(ONE)
            assert signal.set_wakeup_fd(before) == theirs.fileno()
        finally:
            signal.set_wakeup_fd(before)
        assert ours.recv(9) == bytes([ONE])


def test_another_thread_holds_nothing_back(heard: list[int]) -> None:
    inside, done = threading.Event(), threading.Event()

    def work() -> None:
        with held():
            inside.set()
            done.wait()

    thread = threading.Thread(target=work)
    thread.start()
    inside.wait()
    signal.raise_signal(ONE)
    assert heard == [ONE]
    done.set()
    thread.join()


LOADING = """
import signal
from numba.core.codegen import JITCPUCodegen

library = JITCPUCodegen._library_class
asked, signals = library._object_getbuffer_hook, iter(range(25))

def hook(cls, name):  # LLVM asks for code: here an exception has no caller
    if next(signals, None) is not None:
        signal.raise_signal(signal.SIGINT)
    return asked(name)

library._object_getbuffer_hook = classmethod(hook)
from alf_ros import Simulation, load_scene

ended = 0
while True:
    try:
        sim = Simulation(load_scene('slider_crank'), integrator='rk4')
        sim.step(20)
        break
    except KeyboardInterrupt:
        ended += 1
print(ended > 5, sim.state.q.tobytes().hex())
"""


def test_ctrl_c_while_code_is_loaded_ends_the_call_and_not_python() -> None:
    from alf_ros import Simulation, load_scene

    sim = Simulation(load_scene('slider_crank'), integrator='rk4')
    sim.step(20)
    command = [sys.executable, '-c', LOADING]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.split() == ['True', sim.state.q.tobytes().hex()]
