"""The recordings given to `identify`: paths, arrays, or several of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene
from alf_ros.studies.identification.counted_once import check_recordings
from alf_ros.studies.identification.recorded_names import Topics
from alf_ros.studies.identification.recording import Recording
from alf_ros.studies.identification.recording_reader import read_recording


def read_all(given: Any, scene: Scene, topics: Topics | None) -> list[Recording]:
    """The recordings, of which paths are read. Raises InputError for other things, and for
    recordings that begin before the scene or count twice."""
    one = isinstance(given, (str, Path, Recording))
    each = [given] if one else list(given) if isinstance(given, (list, tuple)) else []
    if not each or not all(isinstance(x, (str, Path, Recording)) for x in each):
        raise InputError(
            'no recording', key='recordings', value=given, expected='paths or recordings'
        )
    if not isinstance(topics, (Topics, type(None))):
        raise InputError('not topics', key='topics', value=topics, expected='Topics(…)')
    found = [
        x if isinstance(x, Recording) else read_recording(x, scene, topics or Topics())
        for x in each
    ]
    for read in found:
        if read.begin < 0.0:
            raise InputError(
                'begins before the scene does',
                file=read.name,
                key='recordings',
                value=f't = {read.begin:g} s',
                expected='0 s or later',
            )
    check_recordings(found)
    return found
