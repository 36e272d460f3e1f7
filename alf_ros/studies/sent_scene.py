"""The scene of a study as texts, which another process needs no file for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

from alf_ros.effects import foreign_code
from alf_ros.effects.contract import user_file
from alf_ros.errors import AlfError
from alf_ros.scene.references import WHOLE
from alf_ros.scene.scene import Scene, scene_from_text


@dataclass(frozen=True, eq=False)
class SentScene:
    """Base of studies: `text` is the scene's (`Scene.text`), `files` the texts of its effects that
    are files, by full name, `code` their `effects.foreign_code`, which each process has itself.
    Pickled without the scene itself.
    """

    name: str
    text: str
    files: tuple[tuple[str, str], ...]
    code: tuple[tuple[str, str], ...]

    @staticmethod
    def parts(scene: Scene) -> dict[str, Any]:
        """These fields of a scene, by name."""
        kinds = [effect.kind for effect in scene.effects]
        files, code = user_file.sources(kinds), foreign_code(kinds)
        return {
            'name': scene.name,
            'text': scene.text,
            'files': tuple(files.items()),
            'code': tuple(code.items()),
        }

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)

    @cached_property
    def scene(self) -> Scene:
        """The scene, with the numbers of its file. Raises AlfError if its effects run other code
        in this process than in the one that made the study."""
        for name, text in self.files:
            if not user_file.is_known(name):
                user_file.provide(name, text)
        scene = scene_from_text(self.text, self.name, references=WHOLE)
        here, there = foreign_code(effect.kind for effect in scene.effects), dict(self.code)
        other = sorted(name for name, text in there.items() if here.get(name) != text)
        if other:
            raise AlfError(f'{", ".join(other)}: not as when the study began; begin it again')
        return scene
