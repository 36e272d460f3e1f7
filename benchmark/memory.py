"""Whether the memory of the node stays flat while it records everything at 1 kHz.

    .venv/bin/python benchmark/memory.py [--minutes 60] [--scene slider_crank] [--readers 0]

Prints the anonymous memory of the node each minute, and the slope over the second half of the run,
in kB a minute. What grows by design is the index of the log: 20 kB a minute.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from real_time import simulator  # sets the path and the domain

# isort: split
from large_node import reader
from recording import RATE


def memory(pid: int) -> int:
    """Anonymous memory of a process, kB (Linux)."""
    lines = Path(f'/proc/{pid}/status').read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('RssAnon'))


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--minutes', type=int, default=60, metavar='N')
    parser.add_argument('--scene', default='slider_crank')
    parser.add_argument('--readers', type=int, default=0, metavar='N', help='of joint_states')
    options = parser.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for n in range(options.readers):
            reader(folder / f'heard{n}.txt', stack)
        arguments = ['--scene', options.scene, '--ros-args', '-p', f'rate:={RATE}']
        process = stack.enter_context(simulator(folder, *arguments))
        found = []
        for minute in range(options.minutes + 1):
            time.sleep(60.0 if minute else 5.0)
            found.append(memory(process.pid))
            print(f'{minute:4d} min {found[-1]:8d} kB', flush=True)
    half = np.array(found[len(found) // 2 :])
    if half.size > 1:
        print(f'slope {np.polyfit(np.arange(half.size), half, 1)[0]:.1f} kB a minute')


if __name__ == '__main__':
    main()
