"""Forces and motions at a known time: without one a recording cannot tell a delay.

The windows of a fit begin at any place of a motion. If nothing depends on time, a motion that is
late is as good a motion, and only the errors of reading between two steps would tell them apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from alf_ros import effects
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene
from alf_ros.studies.identification.recording import Recording


def check_delay(scene: Scene, recordings: Sequence[Recording]) -> None:
    """Raise InputError if neither the scene nor a recorded input changes at a known time."""
    if scene.mechanism.drives or any(map(_is_over_time, scene.effects)):
        return
    if not any(map(_changes, recordings)):
        raise InputError(
            'no input, drive or table acts at a known time: nothing tells a delay',
            key='delay',
            expected='recorded inputs that change during the measurements',
        )


def _changes(recording: Recording) -> bool:
    """Whether an input begins or changes during the measurements."""
    held = dict[tuple[str, str], object]()
    for each in recording.inputs:
        if any(isinstance(value, Curve) for value in each.said.values()):
            return True
        place = each.kind, each.name
        if recording.begin < each.t < recording.end and held.get(place) != each.entry:
            return True
        held[place] = each.entry
    return False


def _is_over_time(effect: Effect) -> bool:
    """Whether an effect has a table over time; one from a file may do anything with the time."""
    if effect.kind not in effects.own():
        return True
    for each in fields(effect.parameters):
        value, kind = getattr(effect.parameters, each.name), each.metadata.get('kind')
        if kind == 'signal' and value is not None and not isinstance(value, float | int):
            return True
        if kind == 'table' and value is not None and each.metadata['unit'].startswith('s,'):
            return True
    return False
