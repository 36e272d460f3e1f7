"""An optimisation from a YAML file, with the keys of `optimise`:

scene: linkage.yaml
vary: {a: [0.05, 0.2], b: [0.2, 0.4]}
minimise: {path: P, through: [[0.1, 0.2], [0.1, 0.3]]}
subject_to: {"min(transmission(A, B))": [radians(40), ~]}
starts: 8
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene, load_scene
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.studies.ensemble.study_reading import (
    line_of,
    lines_of,
    plain,
    scene_of,
    within,
)
from alf_ros.studies.optimisation.optimisation import Report, optimise
from alf_ros.studies.optimisation.optimum import Optimum

KEYS = (
    'scene',
    'vary',
    'minimise',
    'subject_to',
    'starts',
    'seed',
    'sampling',
    'duration',
    'period',
    'designs',
)


@dataclass(frozen=True, eq=False)
class StudyFile:
    """A study in a file: its scene, and all arguments of `optimise` by name."""

    path: Path
    fields: Mapping[str, Entry]
    scene: Scene
    given: Mapping[str, Any]

    def optimum(self, report: Report | None = None) -> Optimum:
        """Its optimum. Raises InputError and AlfError as `optimise`, errors of the file with their
        line."""
        try:
            return optimise(self.scene, **self.given, report=report)
        except InputError as error:
            raise _of_file(error, self.path, self.fields) from None


def read_study(source: str | Path, **changes: Any) -> StudyFile:
    """The study in a YAML file; `changes` replace keys of it. Raises InputError."""
    path = paths.named(source)
    fields = yaml_document.read(path).mapping(KEYS, ('scene', 'vary', 'minimise'))
    given: dict[str, Any] = {}
    for key, entry in fields.items():
        if key != 'scene':
            given[key] = within(entry, lambda entry=entry: plain(entry))  # type: ignore[misc]
    scene = scene_of(fields['scene'], path.parent)
    given.update({key: value for key, value in changes.items() if value is not None})
    try:
        loaded = load_scene(scene)
        return StudyFile(path, fields, loaded, given)
    except InputError as error:
        raise _of_file(error, path, fields) from None


def _of_file(error: InputError, path: Path, fields: Mapping[str, Entry]) -> InputError:
    """An error with the line of its key, if it does not belong to another file."""
    line = line_of(error.key or '', lines_of(fields))
    if error.file is None and line is not None:
        return InputError(str(error), file=str(path), line=line)
    return error
