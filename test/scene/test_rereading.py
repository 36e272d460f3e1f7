"""A scene that is read again in parts is the scene that is read as a whole."""

from __future__ import annotations

from typing import Any

import pytest

from alf_ros import AlfError, load_scene, resources
from alf_ros.scene.overrides import with_changes
from alf_ros.scene.rereading import ReadDocument
from alf_ros.scene.scene import Scene

SCENES = sorted(resources.library('scenes'))
OF_BODIES = {'mass': ('0.7', '0', '-1', 'x', '[1]'), 'inertia': ('point', '{about_com: 1}')}
OF_SCENES = {
    'gravity.acceleration': ('[0, 0, -9]', '[0, -9]'),
    'initial.velocities': ('{}', '{nobody: [0, 0]}'),
    'solver.step': ('0.01', '-1', 'a'),
    'solver.accuracy': ('1e-6',),
}


def told(scene: Scene, changes: dict[str, str]) -> Any:
    """All of the changed scene, or its error."""
    try:
        found = with_changes(scene, changes)
    except AlfError as error:
        return str(error)
    return found, repr(found), found.text, found.mechanism.geometry, found.says_solver


@pytest.mark.parametrize('name', SCENES)
def test_in_parts_as_in_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene(name)
    body = scene.mechanism.bodies[-1].name
    each = [{f'{body}.{field}': t} for field, texts in OF_BODIES.items() for t in texts]
    each += [{key: text} for key, texts in OF_SCENES.items() for text in texts]
    each.append({f'{body}.mass': '0.9', 'solver.integrator': 'dop853', 'solver.step': '0.02'})
    told(scene, each[0])  # the first one is read as a whole
    read = [0]
    again = ReadDocument.again

    def counted(self: ReadDocument, *given: Any) -> Scene | None:
        found = again(self, *given)
        read[0] += found is not None
        return found

    monkeypatch.setattr(ReadDocument, 'again', counted)
    parts = [told(scene, changes) for changes in each]
    assert read[0] or '<' in scene.text
    monkeypatch.setattr(ReadDocument, 'again', lambda self, *given: None)
    for changes, found in zip(each, parts, strict=True):
        assert found == told(scene, changes), changes


def test_a_document_decides_and_not_the_scene_that_has_it() -> None:
    scene = load_scene('slider_crank')
    rest = scene.at_rest()
    for _ in range(3):
        assert with_changes(rest, {'coupler.mass': '1.1'}).velocities
    for _ in range(2):
        changed = with_changes(scene, {'coupler.mass': '1.1'})
        assert with_changes(changed, {'crank.mass': '2'}).mechanism.body['coupler'].mass == 1.1
