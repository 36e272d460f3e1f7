"""A store: the chunks of an ensemble in a zarr folder that keeps every finished chunk.

A chunk is one file for each array. Each is written beside and renamed into its place, and the
last one written is the seal of the chunk, with the SHA-256 of the others. A chunk counts if its
seal exists and every digest fits: so a process may be killed, or a machine lose its power, at any
instant. A chunk that is half written is computed again, to the same bytes.

`.alf_ros/manifest.json` says study and versions, `.alf_ros/chunks` holds the seals, and
`.alf_ros/lock` is locked while a process writes. Readers of zarr do not see these files.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import threading
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import IO, Any

import numpy as np

from alf_ros import paths
from alf_ros.digest import digest
from alf_ros.errors import InputError
from alf_ros.resources import version
from alf_ros.studies.ensemble import zarr_format
from alf_ros.studies.ensemble.chunk import Arrays, Chunk, variables_of
from alf_ros.studies.ensemble.kept_outputs import LabelledArray
from alf_ros.studies.ensemble.study import Study

HIDDEN, MANIFEST = '.alf_ros', 'manifest.json'
_LIBRARIES = ('numpy', 'scipy', 'numba', 'llvmlite')
_one_thread = threading.Lock()


def versions() -> dict[str, str]:
    """Of all that may change a bit of a member. `sources`: a digest of the whole package, as a
    list of its folders would miss others that a member comes to need."""
    with _one_thread:  # all threads of a worker ask at once: 64 together read for seconds
        return {'alf_ros': version(), 'sources': digest('.'), **_libraries()}


@cache  # 10 ms, and a worker of a cluster asks for each chunk
def _libraries() -> dict[str, str]:
    return {name: metadata.version(name) for name in _LIBRARIES}


class EnsembleStore:
    """The store of a study in a folder, for one process at a time; use it in a `with` block.

    An earlier store that cannot be written, as on a disk for reading only, can be read; `begin`
    and `put` refuse it.

    Raises InputError for a folder that holds something else, the store of another study or of
    other versions, one that another process uses, and if a new one cannot be written.
    """

    def __init__(self, folder: str | Path, study: Study) -> None:
        self.folder = paths.named(folder, 'store')
        self.study = study
        self._hidden = self.folder / HIDDEN
        self._variables = {variable.name: variable for variable in variables_of(study)}
        self._held = contextlib.ExitStack()  # the lock
        self._refusal: OSError | None = None
        self._was_there = False  # as a folder of a store, under this name

    @property
    def is_writable(self) -> bool:
        """Whether chunks can be put."""
        return self._refusal is None

    def __enter__(self) -> EnsembleStore:
        try:
            with self._writing():
                self._open(self._hidden / MANIFEST)
        except BaseException:
            self._held.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def _open(self, manifest: Path) -> None:
        if self.folder.exists() and not manifest.exists():
            self._refuse_foreign()
        try:
            (self._hidden / 'chunks').mkdir(parents=True, exist_ok=True)
            self._take(self._held.enter_context(open(self._hidden / 'lock', 'w')))
            if manifest.exists():
                self._compare(manifest)
            self._was_there = True
            self._prepare(manifest)
        except OSError as error:
            if not manifest.is_file():
                raise
            self._compare(manifest)
            self._refusal = error

    def begin(self) -> None:
        """Chunks will be put. Raises InputError if the store cannot be written."""
        with self._writing():
            if self._refusal is not None:
                raise self._refusal

    def _refuse_foreign(self) -> None:
        """A folder may be empty, or what a process left that was killed before its manifest."""
        if not self.folder.is_dir() or {path.name for path in self.folder.iterdir()} - {HIDDEN}:
            raise InputError(
                'not a store of an ensemble, and left as it is',
                key='store',
                value=str(self.folder),
                expected='a new folder',
            )

    def _take(self, lock: IO[str]) -> None:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                'another process writes into this store', key='store', value=str(self.folder)
            ) from None

    @property
    def _manifest(self) -> dict[str, Any]:
        return {'study': self.study.data, 'digest': self.study.digest, 'versions': versions()}

    def _compare(self, manifest: Path) -> None:
        """Raises InputError if the manifest is of something else."""
        text = zarr_format.text(self._manifest)
        try:
            found = manifest.read_bytes()
            if found == text:
                return
            before, now = json.loads(found), json.loads(text)
            now['study'] = {key: now['study'][key] for key in self.study.data}  # as one reads it
            for part in ('versions', 'study'):
                for key in now[part]:
                    if before[part].get(key) != now[part][key]:
                        name, value, old = _apart(key, now[part][key], before[part].get(key))
                        what = 'other versions' if part == 'versions' else 'another study'
                        raise InputError(
                            f'the store of {what}',
                            key=f'store.{name}',
                            value=value,
                            expected=f'{_brief(old)}, or a new folder',
                        )
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            pass
        raise InputError('its manifest cannot be read', key='store', value=str(self.folder))

    def _prepare(self, manifest: Path) -> None:
        """The manifest first; then what describes the arrays, again and again the same."""
        for left in self._hidden.glob('*.tmp'):
            left.unlink()
        self._put(manifest, zarr_format.text(self._manifest))
        arrays, study = {}, self.study
        rows, length = study.members, study.chunk
        for name, variable in self._variables.items():
            arrays[name] = zarr_format.array(
                (rows, *variable.shape),
                (length, *variable.shape),
                variable.dtype,
                ('member', *variable.dims),
                variable.attributes,
            )
        fixed = {'member': np.arange(rows, dtype='<i8'), **_along(study.variables)}
        for name, values in fixed.items():
            units = {'units': 's'} if name == 't' or name.startswith('t_') else {}
            arrays[name] = zarr_format.array(
                values.shape, values.shape, values.dtype.str, (name,), units
            )
        coordinates = ' '.join(parameter.name for parameter in study.parameters)
        about = {'coordinates': coordinates, 'title': study.name, 'study': study.digest}
        for path, content in zarr_format.metadata(arrays, about).items():
            self._put(self.folder / path, content)
        for name, values in fixed.items():
            self._put(self.folder / name / '0', zarr_format.encoded(values, len(values)))

    # -------------------------------------------------------------------------------- chunks

    def put(self, chunk: Chunk) -> None:
        """Keep a chunk: it counts when this returns. Raises InputError if it cannot be written."""
        self.begin()
        for folder in (self._hidden, *(self.folder / name for name in self._variables)):
            if not folder.is_dir():  # otherwise it would be made again, without earlier chunks
                raise self._removed()
        with self._writing():
            digests = {}
            for name, variable in self._variables.items():
                data = zarr_format.encoded(chunk.arrays[name], self.study.chunk)
                self._put(self._place(chunk.number, variable), data)
                digests[name] = hashlib.sha256(data).hexdigest()
            self._put(self._seal(chunk.number), zarr_format.text(digests))

    def finished(self) -> Iterator[Chunk]:
        """The chunks that are whole."""
        for number in range(self.study.chunks):
            found = self.chunk(number)
            if found is not None:
                yield found

    def chunk(self, number: int) -> Chunk | None:
        """A chunk; None if it has not been finished, or is damaged."""
        try:
            digests = json.loads(self._seal(number).read_bytes())
            rows = len(self.study.indices(number))
            arrays: dict[str, Any] = {}
            for name, variable in self._variables.items():
                data = self._place(number, variable).read_bytes()
                if hashlib.sha256(data).hexdigest() != digests[name]:
                    return None
                whole = zarr_format.decoded(data, variable.dtype, self.study.chunk, variable.shape)
                arrays[name] = whole[:rows]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        return Chunk(number, arrays)

    def _seal(self, number: int) -> Path:
        return self._hidden / 'chunks' / f'{number}.json'

    def _place(self, number: int, variable: LabelledArray) -> Path:
        name = zarr_format.chunk_name(number, 1 + len(variable.shape))
        return self.folder / variable.name / name

    def _put(self, path: Path, content: bytes) -> None:
        path.parent.mkdir(exist_ok=True)
        paths.put(path, content, self._hidden / f'{os.getpid()}.tmp')

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            gone = self._was_there and not self._hidden.exists()
            if gone and isinstance(error, FileNotFoundError):
                raise self._removed() from None
            kept = '; what is finished is kept' if self._was_there else ''
            raise InputError(
                f'cannot be written: {error.strerror or error}{kept}',
                key='store',
                value=str(self.folder),
            ) from None

    def _removed(self) -> InputError:
        what = 'a part of it' if self._hidden.is_dir() else 'it'
        message = f'{what} has been removed or renamed while the study ran'
        return InputError(message, key='store', value=str(self.folder))


class Memory:
    """Chunks that are kept in this process only."""

    def __init__(self) -> None:
        self._chunks: dict[int, Chunk] = {}

    def begin(self) -> None:
        """Chunks will be put."""

    def put(self, chunk: Chunk) -> None:
        """Keep a chunk."""
        self._chunks[chunk.number] = chunk

    def finished(self) -> Iterator[Chunk]:
        """All chunks, in their order."""
        for number in sorted(self._chunks):
            yield self._chunks[number]


def kept_size(folder: str | Path) -> int | None:
    """How many members a chunk of an earlier store has; None if there is no store, or none that
    can be read: then `EnsembleStore` refuses it."""
    try:
        manifest = json.loads((paths.named(folder, 'store') / HIDDEN / MANIFEST).read_bytes())
        size = manifest['study']['chunk']
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return size if type(size) is int and size > 0 else None


def joined(study: Study, chunks: Iterator[Chunk]) -> Arrays:
    """The arrays of all members, of chunks in their order."""
    found: dict[str, list[Any]] = {variable.name: [] for variable in variables_of(study)}
    for chunk in chunks:
        for name, values in found.items():
            values.append(chunk.arrays[name])
    return {name: np.concatenate(values) for name, values in found.items()}


def _along(variables: tuple[LabelledArray, ...]) -> dict[str, Any]:
    """The coordinates of all dimensions that have some."""
    found: dict[str, Any] = {}
    for variable in variables:
        for name, values in variable.along.items():
            texts = [value for value in values if isinstance(value, str)]
            dtype = f'<U{max(map(len, texts))}' if texts else '<f8'
            found[name] = np.array(list(values), dtype=dtype)
    return found


def _apart(key: str, now: Any, before: Any) -> tuple[str, Any, Any]:
    """Where two values of a key differ: at one of their names, if they have the same ones."""
    if isinstance(now, dict) and isinstance(before, dict) and now.keys() == before.keys():
        name = next(name for name in now if now[name] != before[name])
        return f'{key}.{name}', now[name], before[name]
    return key, now, before


def _brief(data: object) -> str:
    text = json.dumps(data)
    return text if len(text) <= 60 else f'{text[:57]}...'
