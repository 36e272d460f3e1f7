"""Meshes for the page of the view, each read once, in a thread: a large file takes seconds.

The page asks for them by a name made of their triangles, so that no request contains a path.
"""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue

from alf_ros.errors import InputError, printable, shortened
from alf_ros.inspection.mesh_triangles import MeshTriangles, read_mesh
from alf_ros.logs.report.solid_bodies import mesh_data

MOST_FILES = 500


class MeshLibrary:
    """Triangles of files, and their text for the page. `say` hears why a file is not drawn: each
    reason once, with the first file; the page counts the others."""

    def __init__(self, say: Callable[[str], None] = lambda text: None) -> None:
        self._say, self._reasons = say, set[str]()
        self._read: dict[str, tuple[str, MeshTriangles] | None] = {}
        self._texts: dict[str, bytes] = {}
        self._wanted: SimpleQueue[str] = SimpleQueue()
        threading.Thread(target=self._work, name='meshes', daemon=True).start()

    def find(self, file: str) -> tuple[str, MeshTriangles] | None:
        """Name and triangles of a file; None until it has been read, and if that fails."""
        if file not in self._read and len(self._read) < MOST_FILES:
            self._read[file] = None
            self._wanted.put(file)
        return self._read.get(file)

    def text(self, name: str) -> bytes | None:
        """The JSON of a mesh that has been read; None if none has this name."""
        return self._texts.get(name)

    def _work(self) -> None:
        while True:
            file = self._wanted.get()
            try:
                mesh = read_mesh(file)
            except InputError as error:
                self._tell(file, error.message)
                continue
            text = json.dumps(mesh_data(mesh)).encode()
            name = hashlib.sha256(text).hexdigest()[:24]
            self._texts[name] = text
            self._read[file] = name, mesh

    def _tell(self, file: str, reason: str) -> None:
        if reason not in self._reasons:
            self._reasons.add(reason)
            name = shortened(Path(file).name)  # of a scene that anybody may publish
            self._say(printable(f'a mesh is not drawn: {name}: {reason}'))
