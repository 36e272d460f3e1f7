"""Numbers of effects by name: found, changed in the scene's text, and refused."""

from typing import Any

import pytest

from alf_ros import InputError, Simulation, load_scene
from alf_ros.scene.effect_values import effect_values, with_effect_values
from alf_ros.scene.scene import scene_from_text

GRAVITY = {'acceleration': [0, -9.81]}
PUSH, TWIST = {'on': 'coupler', 'force': [0, 5.0], 'at': 'A'}, {'on': 'crank', 'torque': 0.1}
MECHANISM = {'mechanism': 'slider_crank', 'initial': {'velocities': {'B': [-4, 0]}}}


def scene(wrenches):
    return load_scene({**MECHANISM, 'effects': {'gravity': GRAVITY, 'constant_wrench': wrenches}})


@pytest.mark.parametrize(
    ('wrenches', 'prefix'),
    [
        ({'push': PUSH, 'twist': TWIST}, 'effects.constant_wrench.push.'),
        ([PUSH, TWIST], 'effects.constant_wrench.constant_wrench_0.'),
        (PUSH, 'effects.constant_wrench.'),
    ],
    ids=['by name', 'a list', 'alone'],
)
def test_a_changed_scene_is_the_scene_written_with_the_other_number(wrenches, prefix):
    before = scene(wrenches)
    assert effect_values(before)[f'{prefix}force'].value == [0.0, 5.0]
    assert effect_values(before)[f'{prefix}torque'].doc.endswith('about +z, N m')
    after = with_effect_values(before, {f'{prefix}force': [1.5, -2.0]})
    assert effect_values(after)[f'{prefix}force'].value == [1.5, -2.0]
    # all else stays, and the text says what runs
    others = [name for name in effect_values(before) if name != f'{prefix}force']
    for name in others:
        assert effect_values(after)[name].value == effect_values(before)[name].value
    assert scene_from_text(after.text) == after and after.hash != before.hash
    assert (after.name, after.mechanism, after.solver) == (
        before.name,
        before.mechanism,
        before.solver,
    )
    written: Any = [{**PUSH, 'force': [1.5, -2.0]}, TWIST]
    if isinstance(wrenches, dict):
        written = dict(zip(('push', 'twist'), written, strict=True))
        written = written if 'push' in wrenches else written['push']
    moved, wanted = Simulation(after), Simulation(scene(written))
    moved.step(100)
    wanted.step(100)
    assert moved.sample().q.tolist() == wanted.sample().q.tolist()


def test_what_an_effect_acts_on_is_no_number():
    names = set(effect_values(scene({'push': PUSH})))
    assert names == {
        'effects.gravity.acceleration',
        'effects.constant_wrench.push.force',
        'effects.constant_wrench.push.torque',
    }


def test_nothing_changed_is_the_same_scene():
    before = scene([PUSH])
    assert with_effect_values(before, {}) is before


@pytest.mark.parametrize(
    ('name', 'value', 'says'),
    [
        ('effects.gravity.accelaration', [0, 0], "did you mean 'effects.gravity.acceleration'"),
        ('effects.gravity.acceleration', [0, 0, 0], 'a list of 3 given'),
        ('effects.constant_wrench.torque', 1e200, 'too large'),
        ('effects.constant_wrench.torque', float('nan'), 'nan'),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(name, value, says):
    with pytest.raises(InputError, match=says.replace("'", '.')) as caught:
        with_effect_values(scene(PUSH), {name: value})
    assert '\n' not in str(caught.value)
