"""The scene that a simulator published, as far as the page of the view needs it."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import yaml

from alf_ros.errors import AlfError, InputError
from alf_ros.inspection.missing_meshes import shown_parts
from alf_ros.mechanism import Mechanism
from alf_ros.model.constraints.drives import motion_names
from alf_ros.scene.scene import whole_scene
from alf_ros.scene.text import yaml_document

_MOST = 5000  # joints and bodies of a mechanism that is read: a second
_READ = ('name', 'mechanism', 'drives')  # no effects: they may be code of a stranger


class ShownScene:
    """The scene of a text; nothing is known of a text that is no scene, for anybody may publish.

    No file and no effect is read here.
    """

    def __init__(self, text: str) -> None:
        try:
            yaml_document.parse(text, None)  # which bounds how deep it is, and how it grows
            scene = yaml.safe_load(text)
        except (InputError, yaml.YAMLError, ValueError):
            scene = {}
        usable = isinstance(scene, dict) and isinstance(scene.get('mechanism'), dict)
        self._fields: dict[str, Any] = scene if usable else {}

    @property
    def name(self) -> str:
        """The name of the scene; empty if it has none."""
        return str(self._fields.get('name', ''))

    @property
    def spatial(self) -> bool:
        """Whether the mechanism moves in space."""
        return bool(self._fields.get('mechanism', {}).get('space') == 'spatial')

    def continues(self, before: ShownScene) -> bool:
        """Whether only numbers of effects differ, so that the run of `before` continues."""
        if self._fields == before._fields:
            return False
        return self._without_effects == before._without_effects

    @property
    def _without_effects(self) -> dict[str, Any]:
        return {key: value for key, value in self._fields.items() if key != 'effects'}

    @cached_property
    def _mechanism(self) -> Mechanism | None:
        parts = self._fields.get('mechanism', {})
        sizes = [
            len(parts[key]) for key in ('bodies', 'joints') if isinstance(parts.get(key), dict)
        ]
        if not sizes or sum(sizes) > _MOST:
            return None
        try:
            read = {key: self._fields[key] for key in _READ if key in self._fields}
            return whole_scene(read).mechanism
        except AlfError:
            return None

    @cached_property
    def meshes(self) -> dict[str, str]:
        """The files of its meshes, by the URI that markers have."""
        if self._mechanism is None:
            return {}
        shapes = (shape for _, shapes in shown_parts(self._mechanism) for shape in shapes)
        return {shape.uri: shape.file for shape in shapes if shape.kind == 'mesh'}

    @cached_property
    def units(self) -> dict[str, str]:
        """The unit of each joint coordinate and angle of a ball, rad or m; without those that are
        not known."""
        if self._mechanism is None:
            return {}
        known = {c.name: 'rad' if c.is_angle else 'm' for c in self._mechanism.coordinates}
        return known | dict.fromkeys(self._mechanism.ball_angles, 'rad')

    @cached_property
    def driven(self) -> tuple[str, ...]:
        """Joint coordinates that a drive moves: an effort on them changes no motion."""
        if self._mechanism is None:
            return ()
        return tuple(name for drive in self._mechanism.drives for name in drive.of)

    @cached_property
    def balls(self) -> tuple[str, ...]:
        """The angles of balls, on which no effort acts."""
        return () if self._mechanism is None else self._mechanism.ball_angles

    @cached_property
    def drive_units(self) -> dict[str, str]:
        """The unit of the effort of each prescribed motion, N m or N."""
        if self._mechanism is None:
            return {}
        turning = {drive.name for drive in self._mechanism.drives if drive.kind == 'angle'}
        names = motion_names(self._mechanism)
        return {name: 'N m' if name in turning else 'N' for name in names}
