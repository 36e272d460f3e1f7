"""A chunk: members that are one piece of work, and one row of files in a store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alf_ros.studies.ensemble.kept_outputs import LabelledArray
from alf_ros.studies.ensemble.member import LONGEST_REASON
from alf_ros.studies.ensemble.members_together import run_members
from alf_ros.studies.ensemble.study import Study

REASON = LabelledArray('reason', text=LONGEST_REASON)
Arrays = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class Chunk:
    """`arrays`: (members, ...) of each varied name and each variable, and `reason`, empty where a
    member ran."""

    number: int
    arrays: Arrays

    @property
    def failed(self) -> int:
        """How many of its members failed."""
        return int((self.arrays[REASON.name] != '').sum())


def run_chunk(study: Study, number: int) -> Chunk:
    """Run the members of a chunk, in their order. Raises AlfError if this process has other code
    than the study: that is no failure of a member."""
    _ = study.scene
    members = run_members(study, study.indices(number))
    found: dict[str, NDArray[np.generic]] = {
        variable.name: np.array([member.arrays[n] for member in members], dtype=np.float64)
        for n, variable in enumerate(study.variables)
    }
    values = [study.values(k) for k in study.indices(number)]
    for parameter in study.parameters:
        texts = [value[parameter.name] for value in values]
        given = texts if parameter.text else [float(text) for text in texts]
        found[parameter.name] = np.array(given, dtype=parameter.dtype)
    reasons = [member.reason for member in members]
    found[REASON.name] = np.array(reasons, dtype=REASON.dtype)
    return Chunk(number, found)


def variables_of(study: Study) -> tuple[LabelledArray, ...]:
    """Of all arrays of a chunk."""
    return (*study.parameters, *study.variables, REASON)
