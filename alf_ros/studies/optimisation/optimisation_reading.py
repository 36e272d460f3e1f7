"""An optimisation from a YAML file, with the keys of `optimise`:

scene: linkage.yaml
vary: {a: [0.05, 0.2], b: [0.2, 0.4]}
minimise: {path: P, through: [[0.1, 0.2], [0.1, 0.3]]}
subject_to: {"min(transmission(A, B))": [radians(40), ~]}
starts: 8
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.text import yaml_document
from alf_ros.studies.ensemble.study_reading import plain, scene_beside, within
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


def optimise_file(source: str | Path, report: Report | None = None, **changes: Any) -> Optimum:
    """The optimum of the study in a YAML file; `changes` replace keys of it.

    Raises InputError and AlfError as `optimise`, errors of the file with their line.
    """
    path = paths.named(source)
    fields = yaml_document.read(path).mapping(KEYS, ('scene', 'vary', 'minimise'))
    given: dict[str, Any] = {}
    for key, entry in fields.items():
        given[key] = within(entry, lambda entry=entry: plain(entry))  # type: ignore[misc]
    given['scene'] = within(fields['scene'], lambda: scene_beside(given['scene'], path.parent))
    given.update({key: value for key, value in changes.items() if value is not None})
    try:
        return optimise(**given, report=report)
    except InputError as error:
        said = fields.get((error.key or '').partition('.')[0])
        if error.file is None and said is not None:
            raise InputError(str(error), file=str(path), line=said.line) from None
        raise
