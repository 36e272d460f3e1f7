"""The page of the view reads units and drives from a published scene, and nothing from other
texts."""

from __future__ import annotations

from pathlib import Path

import pytest

from alf_ros import load_scene
from alf_ros.ros.view.shown_scene import ShownScene
from alf_ros.scene.scene import scene_from_text
from support.ball_scene import BALLS, NAMES

DRIVEN = {
    'mechanism': 'slider_crank',
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
    'drives': {
        'motor': {'joint': 'crank_pin', 'angle': 'pi/4 + t'},
    },
}


def test_units_and_drives() -> None:
    shown = ShownScene(load_scene(DRIVEN).text)
    assert shown.name == 'scene' and not shown.spatial
    assert shown.units == {'crank_pin': 'rad', 'knee': 'rad', 'guide': 'm'}
    assert shown.driven == ('crank_pin',)
    assert shown.drive_units == {'motor': 'N m'}
    pushed = load_scene(
        {
            'mechanism': 'slider_crank',
            'drives': {'piston': {'point': 'B', 'at': ['sqrt(2)', None]}},
        }
    )
    assert ShownScene(pushed.text).drive_units == {'piston_x': 'N'}
    assert ShownScene(load_scene('delta_robot').text).spatial
    balls = ShownScene(scene_from_text(BALLS).text)
    assert balls.balls == NAMES[1:] and set(balls.units) == set(NAMES)


def test_other_numbers_of_effects_are_the_same_run() -> None:
    first = load_scene(DRIVEN)
    other = load_scene({**DRIVEN, 'effects': {'gravity': {'acceleration': [0, -1.6]}}})
    before, same, after = (ShownScene(x.text) for x in (first, first, other))
    assert after.continues(before)
    assert not same.continues(before)  # the same scene anew: a reset
    assert not ShownScene(load_scene('delta_robot').text).continues(before)


@pytest.mark.parametrize(
    'text', ['', '3', '[1]', 'mechanism: 3', '{', 'mechanism: {bodies: {a: {}}}', '&a [*a]']
)
def test_a_text_that_is_no_scene_says_nothing(text: str) -> None:
    shown = ShownScene(text)
    assert (shown.units, shown.driven, shown.balls, shown.drive_units) == ({}, (), (), {})


def test_no_code_of_a_stranger_runs(tmp_path: Path) -> None:
    effect = tmp_path / 'notes.py'
    effect.write_text(f'open({str(tmp_path / "ran")!r}, "w")\n')
    text = load_scene(DRIVEN).text.replace('gravity:', f'{effect}:')
    assert ShownScene(text).units  # the mechanism is read, the effects are not
    assert not (tmp_path / 'ran').exists()
