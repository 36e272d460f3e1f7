"""Candidates of an experiment design: motions that the machine could do next.

A candidate is a scene, a recording whose inputs act, or the scene with other numbers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene, load_scene
from alf_ros.studies.identification.recorded_names import Topics
from alf_ros.studies.identification.recording import Recording
from alf_ros.studies.identification.recording_reader import read_recording

Candidate: TypeAlias = str | Path | Scene | Recording | Mapping[str, Any]
_COMMA = re.compile(r',(?![^\[{]*[\]}])')  # outside of brackets
_KEY = 'design'


@dataclass(frozen=True, eq=False)
class CandidateMotion:
    """A scene that runs; `plan`: inputs that act, and measured joints where it starts, if any."""

    name: str
    scene: Scene
    plan: Recording | None = None

    @property
    def positions(self) -> bool:
        """Whether the plan says where the motion starts."""
        return self.plan is not None and any(c.kind == 'position' for c in self.plan.channels)


def candidates(
    given: Any, scene: Scene, fitted: Sequence[str], topics: Topics | None
) -> list[CandidateMotion]:
    """The candidates of `Identification.design`; `scene`: the one that was fitted.

    Raises InputError for unreadable ones, two with one name, and changes of fitted numbers.
    """
    if isinstance(given, (str, Path, Scene, Recording)):
        given = [given]
    if isinstance(given, Mapping):
        each = [(str(name), what) for name, what in given.items()]
    elif isinstance(given, Sequence):
        each = [(_name(what), what) for what in given]
    else:
        each = []
    if not each:
        raise InputError(
            'no candidates', key=_KEY, value=given, expected='scenes, recordings or NAME=VALUE'
        )
    names = [name for name, _ in each]
    for n, name in enumerate(names):
        if name in names[:n]:
            raise InputError('named twice', key=_KEY, value=name)
    return [_candidate(name, what, scene, fitted, topics or Topics()) for name, what in each]


def _name(what: Any) -> str:
    if isinstance(what, (Scene, Recording)):
        return what.name
    if isinstance(what, (str, Path)):
        return str(what)
    raise InputError('no candidate', key=_KEY, value=what, expected='a scene or a recording')


def _candidate(
    name: str, what: Any, scene: Scene, fitted: Sequence[str], topics: Topics
) -> CandidateMotion:
    if isinstance(what, Recording):
        return CandidateMotion(name, scene, what)
    if isinstance(what, Scene):
        return CandidateMotion(name, what)
    if isinstance(what, Mapping):
        return CandidateMotion(name, load_scene(what))
    if not isinstance(what, (str, Path)):
        raise InputError('no candidate', key=_KEY, value=what, expected='a scene or a recording')
    first, *rest = _COMMA.split(str(what))
    changes, plan = overrides.read(rest, _KEY), None
    if '=' in first:
        changes = overrides.read([first, *rest], _KEY)
    elif _is_recording(first):
        plan = read_recording(first, scene, topics, plan=True)
    else:
        scene = load_scene(first)
    for number in changes:
        if number in fitted:
            raise InputError(
                'is fitted: a further motion has the same value', key=_KEY, value=number
            )
    return CandidateMotion(name, overrides.with_changes(scene, changes, f'{_KEY} '), plan)


def _is_recording(text: str) -> bool:
    path = paths.named(text, _KEY)
    return path.is_dir() or path.suffix in ('.mcap', '.db3')
