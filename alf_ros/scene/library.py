"""A scene by the name of a scene or a mechanism of the library, or by the path of a file."""

from __future__ import annotations

import re
from pathlib import Path

from alf_ros import paths, resources
from alf_ros.errors import InputError
from alf_ros.scene.scene import Scene, load_scene
from alf_ros.scene.text import yaml_document


def load(source: str, parameters: dict[str, float]) -> Scene:
    """The scene of a name or a file; a mechanism alone is put into an empty one.

    Raises InputError.
    """
    is_file = source.endswith(('.yaml', '.yml')) or '/' in source
    if is_file:
        root = yaml_document.read(paths.named(source))
        alone = isinstance(root.value, dict) and 'alf' in root.value
        name = re.sub(r'[^\w.-]', '_', Path(source).stem)[:100]
    else:
        scenes, mechanisms = (
            {path.stem for each in resources.folder(kind) for path in each.glob('*.yaml')}
            for kind in ('scenes', 'mechanisms')
        )
        alone, name = source in mechanisms - scenes, source
        if source not in scenes | mechanisms:
            message = 'neither a scene nor a mechanism of this name'
            choices = sorted(scenes | mechanisms)
            raise InputError(message, key='scene', value=source, choices=choices)
    if alone:
        return load_scene({'name': name, 'mechanism': source}, parameters)
    return load_scene(source, parameters)
