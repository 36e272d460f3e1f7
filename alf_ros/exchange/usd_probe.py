"""Whether usd-core survives a file: another process reads all of it first.

A damaged binary file can end the process that opens it. A text that names no other file cannot.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.text.yaml_document import LARGEST_FILE

# Arguments: the file, the most bytes of address space, the path of modules.
_COMMAND = """
import sys
sys.path[:] = sys.argv[3:]
import resource
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
    for attribute in prim.GetAttributes():
        attribute.Get()
"""


def check(path: Path, is_text: bool, most: int) -> None:
    """Read a file in a process with `most` bytes of address space. Raises InputError if a fault
    ends that process, or if usd-core refuses a binary file."""
    if is_text and b'@' not in paths.content(path, LARGEST_FILE):
        return
    given = [str(path.absolute()), str(most), *filter(None, sys.path)]
    done = subprocess.run(
        [sys.executable, '-c', _COMMAND, *given],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    if done.returncode < 0:
        raise InputError('damaged: usd-core cannot survive it', file=str(path))
    if done.returncode and not is_text:  # here it would print what it finds
        raise InputError('not a USD file: damaged', file=str(path))
