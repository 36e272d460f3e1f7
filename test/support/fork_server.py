"""Starts processes of this package by `fork`, after a second of imports that all of them share.

`support.forked` starts this program and sends it requests. Each process has its own arguments,
folder, environment, streams and session, and Python ends it as any other. It begins where
`python -m alf_ros ...`, or `python program.py`, would have imported the package.

This process must have no other threads, because a fork has only the thread that forks. So each
process imports rclpy, which starts threads, itself. It also imports matplotlib itself, which reads
its environment.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib
import json
import os
import pkgutil
import random
import runpy
import selectors
import signal
import socket
import struct
import sys
from pathlib import Path
from typing import Any

LATER = ('rclpy', 'matplotlib')
LARGEST = 1 << 20  # bytes of a request
NUMBER = struct.Struct('i')


class _Later:
    """Refuses to import `LATER`."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name in LATER:
            raise ImportError(f'{name} is imported by each process')


def prepare() -> None:
    """Import the modules of the package that do without `LATER`, and load the usual code."""
    import alf_ros

    hook: Any = _Later()
    sys.meta_path.insert(0, hook)
    for module in pkgutil.walk_packages(alf_ros.__path__, 'alf_ros.', onerror=lambda _: None):
        if not module.name.endswith('__main__'):
            try:
                importlib.import_module(module.name)
            except ImportError:
                pass  # it needs what comes later
    sys.meta_path.remove(hook)
    simulation = alf_ros.Simulation(alf_ros.load_scene('slider_crank'))
    simulation.step(3)
    _ = simulation.sample().reactions
    gc.collect()
    gc.freeze()  # or the first collection of each process would copy all memory
    assert len(os.listdir('/proc/self/task')) == 1, 'a process with threads cannot be forked'


def serve(control: socket.socket) -> dict[str, Any]:
    """Fork at each request; returns in the child, with the request. The parent never returns.

    A request comes with three streams and a socket, which hears the process number, and later the
    status with which the process ended.
    """
    running = selectors.DefaultSelector()
    running.register(control, selectors.EVENT_READ)
    while True:
        for key, _ in running.select():
            if key.fileobj is not control:
                number, told = key.data
                _, status = os.waitpid(number, 0)
                running.unregister(key.fileobj)
                os.close(key.fd)
                _tell(told, status)
                told.close()
                continue
            text, streams, _, _ = socket.recv_fds(control, LARGEST, 4)
            if not text:
                sys.exit(0)  # the process that asked has ended
            number = os.fork()
            if number == 0:
                signal.set_wakeup_fd(-1)
                running.close()
                control.close()
                request: dict[str, Any] = json.loads(text)
                request['streams'] = streams[:3]
                os.close(streams[3])
                return request
            for stream in streams[:3]:
                os.close(stream)
            told = socket.socket(fileno=streams[3])
            _tell(told, number)
            running.register(os.pidfd_open(number), selectors.EVENT_READ, (number, told))


def _tell(to: socket.socket, number: int) -> None:
    try:
        to.send(NUMBER.pack(number))
    except OSError:
        pass  # nobody waits any more


def become(request: dict[str, Any]) -> None:
    """Be the process that was asked for."""
    os.setsid()
    for number, stream in enumerate(request['streams']):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(request['folder'])
    os.environ.clear()
    os.environ.update(request['environment'])
    if 'PYTHONFAULTHANDLER' in os.environ:
        faulthandler.enable()
    random.seed()
    importlib.import_module('numpy').random.seed()
    named = os.environ.get('PYTHONPATH', '')
    first, *rest = request['arguments']
    as_module = first == '-m'
    folder = os.getcwd() if as_module else os.path.dirname(os.path.abspath(first))
    sys.path[:] = [folder, *filter(None, named.split(os.pathsep)), *request['path']]
    if as_module:
        sys.argv = rest
        runpy.run_module(rest[0], run_name='__main__', alter_sys=True)
    else:
        sys.argv = [first, *rest]
        runpy.run_path(first, run_name='__main__')


if __name__ == '__main__':
    # as Python begins: without the folder of this file, and without what PYTHONPATH names
    named = [os.path.realpath(p) for p in os.environ.get('PYTHONPATH', '').split(os.pathsep) if p]
    given = [path for path in sys.path[1:] if os.path.realpath(path) not in named]
    sys.path[:] = [str(Path(__file__).parents[2]), *sys.path[1:]]
    prepare()
    asked = serve(socket.socket(fileno=int(sys.argv[1])))
    asked['path'] = given
    become(asked)
