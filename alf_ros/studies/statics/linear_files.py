"""A linear model as a file: .npz of numpy, .mat of MATLAB, .json."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.studies.statics.linear_model import LinearModel

_MATRICES = ('A', 'B', 'C', 'D', 'stiffness', 'damping', 'drift', 'directions', 'frequencies')
_RATIOS = 'damping_ratios'
_NAMES = ('states', 'inputs', 'outputs', 'input_units', 'output_units', 'notes')


def write(model: LinearModel, path: str | Path) -> Path:
    """Write a model; the end of the name says how. Returns the path.

    Every file has the matrices by their names in `LinearModel`, the eigenvalues, and the names of
    states, inputs and outputs. In .json a complex number is a pair, its real part first. Raises
    InputError for another end of the name, OSError if the file cannot be written.
    """
    path = paths.named(path, 'path')
    if path.suffix not in _WRITERS:
        raise InputError(
            'not a kind of file', value=path.name, expected=' or '.join(sorted(_WRITERS))
        )
    with paths.replacing(path) as target:
        _WRITERS[path.suffix](model, target)
    return path


def _arrays(model: LinearModel) -> dict[str, Any]:
    found = {name: getattr(model, name) for name in (*_MATRICES, _RATIOS, 'eigenvalues')}
    return found | {'t': model.t}


def _npz(model: LinearModel, path: Path) -> None:
    whole = _arrays(model)
    for name in _NAMES:
        whole[name] = np.array(getattr(model, name), dtype=str)
    np.savez(path, **whole)


def _mat(model: LinearModel, path: Path) -> None:
    from scipy.io import savemat

    names = {name: np.array(getattr(model, name), dtype=object) for name in _NAMES}
    with open(
        path, 'wb'
    ) as stream:  # the error of scipy does not say why a file cannot be written
        savemat(stream, {**_arrays(model), **names}, oned_as='column')


def _json(model: LinearModel, path: Path) -> None:
    whole: dict[str, Any] = {name: list(getattr(model, name)) for name in _NAMES}
    for name, value in _arrays(model).items():
        array = np.asarray(value)
        if np.iscomplexobj(array):
            array = np.stack([array.real, array.imag], axis=-1)
        listed = array.astype(object)
        listed[~np.isfinite(array.astype(float))] = None  # JSON has no NaN
        whole[name] = listed.tolist()
    path.write_text(json.dumps(whole, indent=1, allow_nan=False), 'utf-8')


_WRITERS: dict[str, Callable[[LinearModel, Path], None]] = {
    '.npz': _npz,
    '.mat': _mat,
    '.json': _json,
}
