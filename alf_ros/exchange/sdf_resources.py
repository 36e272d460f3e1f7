"""Files that an SDF names by URIs such as `model://hand/meshes/palm.dae`.

They are beside the SDF, in a folder above it, or where GZ_SIM_RESOURCE_PATH and SDF_PATH say.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

_MODELS = ('.sdf', '.world', '.xml')


def model_file(uri: str, folder: Path) -> Path | None:
    """The file that a URI of an <include> means; None if there is none."""
    for at in _candidates(uri, folder):
        if at.is_dir():
            at = next(iter(sorted(at.glob('*.sdf'))), at)
        if at.is_file() and at.suffix in _MODELS:
            return at
    return None


def mesh_uri(uri: str, folder: Path) -> str:
    """The URI of a mesh, with its path if it says `model://` and is found."""
    if uri.startswith('model://'):
        return next((str(at) for at in _candidates(uri, folder) if at.is_file()), uri)
    return uri


def _candidates(uri: str, folder: Path) -> Iterator[Path]:
    name = uri.partition('://')[2] if '://' in uri else uri
    places = [folder, *folder.resolve().parents]
    for variable in ('GZ_SIM_RESOURCE_PATH', 'SDF_PATH'):
        places += [Path(each) for each in os.environ.get(variable, '').split(':') if each]
    if name and '\0' not in name:
        yield from (place / name for place in places)
