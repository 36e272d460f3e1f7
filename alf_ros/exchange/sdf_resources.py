"""Files that an SDF names by URIs such as `model://hand/meshes/palm.dae`.

They are beside the file that names them, in a folder above it, or where GZ_SIM_RESOURCE_PATH and
SDF_PATH say. Models may also be around the SDF that includes this file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from alf_ros.exchange import sdf_versions, xml_file

_MODELS = ('.sdf', '.world', '.xml')


def model_file(uri: str, *folders: Path) -> Path | None:
    """The file that a URI of an <include> means, around the first of these folders that has it;
    None if there is none."""
    for at in _candidates(uri, *folders):
        if at.is_dir():
            at = _of_folder(at)
        if at.is_file() and at.suffix in _MODELS:
            return at
    return None


def _of_folder(folder: Path) -> Path:
    """The file of the newest version that is read, of those that `model.config` names; without it
    `model.sdf`, or any other. The folder itself if there is none."""
    others = sorted(folder.glob('*.sdf'))
    if (config := folder / 'model.config').is_file():
        versions = {}
        for each in xml_file.root_of(config).findall('sdf'):
            minor = sdf_versions.minor_of(each.get('version', ''))
            if minor is not None and minor <= sdf_versions.NEWEST:
                versions[minor] = folder / (each.text or '').strip()
        others = [versions[max(versions)]] if versions else others
    return next((each for each in others if each.name == 'model.sdf'), next(iter(others), folder))


def mesh_uri(uri: str, folder: Path) -> str:
    """The URI of a mesh, with its path if it says `model://` and is found."""
    if uri.startswith('model://'):
        return next((str(at) for at in _candidates(uri, folder) if at.is_file()), uri)
    return uri


def _candidates(uri: str, *folders: Path) -> Iterator[Path]:
    name = uri.partition('://')[2] if '://' in uri else uri
    places = [place for each in folders for place in (each, *each.resolve().parents)]
    for variable in ('GZ_SIM_RESOURCE_PATH', 'SDF_PATH'):
        places += [Path(each) for each in os.environ.get(variable, '').split(':') if each]
    if name and '\0' not in name:
        yield from (place / name for place in places)
