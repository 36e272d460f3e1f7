"""The zarr format, version 2, as far as a store of an ensemble needs it: written with numpy alone.

A group is a folder of arrays, an array a folder with `.zarray` (shape, chunks, type), `.zattrs`
(the names of its dimensions, for xarray) and one file per chunk. Numbers that are not there are
NaN. Numbers are stored as they are, texts deflated.
https://zarr-specs.readthedocs.io/en/latest/v2/v2.0.html
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.generic]

ATTRIBUTES, ARRAY, GROUP, WHOLE = '.zattrs', '.zarray', '.zgroup', '.zmetadata'
_LEVEL = 1


def text(data: object) -> bytes:
    """JSON that is the same for the same data."""
    return json.dumps(data, indent=1, sort_keys=True).encode() + b'\n'


def array(
    shape: Sequence[int],
    chunks: Sequence[int],
    dtype: str,
    dims: Sequence[str],
    attributes: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """Metadata of an array: the contents of `.zarray` and `.zattrs`, by file name."""
    is_text = dtype.startswith('<U')
    described = {
        'zarr_format': 2,
        'shape': list(shape),
        'chunks': [max(1, n) for n in chunks],
        'dtype': dtype,
        'compressor': {'id': 'zlib', 'level': _LEVEL} if is_text else None,
        'fill_value': 'NaN' if dtype == '<f8' else None,  # xarray masks what has this value
        'order': 'C',
        'filters': None,
        'dimension_separator': '.',
    }
    return {ARRAY: described, ATTRIBUTES: {'_ARRAY_DIMENSIONS': list(dims), **attributes}}


def metadata(
    arrays: Mapping[str, Mapping[str, Any]], about: Mapping[str, Any]
) -> dict[str, bytes]:
    """The files of a group that describe it, by path; `arrays`: the files that `array` returns."""
    files: dict[str, Any] = {GROUP: {'zarr_format': 2}, ATTRIBUTES: dict(about)}
    for name, parts in arrays.items():
        files.update({f'{name}/{part}': content for part, content in parts.items()})
    whole = {'zarr_consolidated_format': 1, 'metadata': files}
    return {path: text(content) for path, content in {**files, WHOLE: whole}.items()}


def chunk_name(number: int, dims: int) -> str:
    """The file of a chunk of an array that is cut along its first dimension only."""
    return '.'.join([str(number)] + ['0'] * (dims - 1))


def encoded(values: Array, length: int) -> bytes:
    """A chunk of `length` rows."""
    is_text = values.dtype.kind == 'U'
    if len(values) < length:
        rest = (length - len(values), *values.shape[1:])
        filled = np.zeros(rest, values.dtype) if is_text else np.full(rest, np.nan)
        values = np.concatenate([values, filled])
    return zlib.compress(values.tobytes(), _LEVEL) if is_text else values.tobytes()


def decoded(data: bytes, dtype: str, length: int, shape: Sequence[int]) -> Array:
    """The rows of a chunk. Raises ValueError for one that is not whole."""
    try:
        raw = zlib.decompress(data) if dtype.startswith('<U') else data
    except zlib.error as error:
        raise ValueError(str(error)) from None
    return np.frombuffer(raw, dtype=dtype).reshape(length, *shape).copy()
