"""A worker process: chunk numbers come in on stdin, chunks go out on stdout.

A message is its length (8 bytes) and a pickle. The first one in is the pair of a function and a
study; for each number the result of the function goes out. The process ends as soon as stdin
closes, also while it still imports. It closes when the process that began this one has gone,
however that ended.
"""

from __future__ import annotations

import os
import pickle
import queue
import struct
import sys
import threading
from typing import IO, Any

_LENGTH = struct.Struct('<Q')
# Run with -c, so that the worker looks where the client does, and nowhere before. The imports take
# seconds, in which nothing reads stdin: its end is seen behind what waits there. Ctrl-C is the
# client's, which ends the worker.
COMMAND = """
import sys
sys.path[:] = sys.argv[1:]
import os, select, signal, threading

signal.signal(signal.SIGINT, signal.SIG_IGN)

def watch():
    end = select.poll()
    end.register(0, 0)
    end.poll()
    os._exit(0)

threading.Thread(target=watch, daemon=True).start()
from alf_ros.studies.ensemble.worker_process import main
main()
"""


def send(stream: IO[bytes], message: Any) -> None:
    """Write one message. Raises OSError if the other side has gone."""
    data = pickle.dumps(message, protocol=4)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one message. Raises EOFError if the other side has gone."""
    head = stream.read(_LENGTH.size)
    data = stream.read(_LENGTH.unpack(head)[0]) if len(head) == _LENGTH.size else b''
    if len(head) < _LENGTH.size or len(data) < _LENGTH.unpack(head)[0]:
        raise EOFError
    return pickle.loads(data)


def main() -> None:
    """Run chunks until stdin closes."""
    with os.fdopen(os.dup(1), 'wb') as out:
        os.dup2(2, 1)  # what a function of the user prints
        waiting: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=_listen, args=(waiting,), daemon=True).start()
        run, study = waiting.get()
        while True:
            number = waiting.get()
            try:
                send(out, run(study, number))
            except BrokenPipeError:
                os._exit(0)
            except Exception as error:
                send(out, error)


def _listen(waiting: queue.SimpleQueue[Any]) -> None:
    while True:
        try:
            waiting.put(receive(sys.stdin.buffer))
        except (EOFError, OSError):
            os._exit(0)
