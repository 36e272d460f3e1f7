"""Where machine code is kept between processes, so that it is compiled once.

numba's own cache looks only at the file of the function that is called, and two processes that
fill it at once can take each other's code. Here a folder holds the code of one state of the
sources: its name has the digest of all that goes into the code. Nothing in it is ever changed, so
nothing in it can be old.

- The digest is of alf_ros/kernel, of the folder of this package that the function lies in, of the
  versions of Python, numba, llvmlite and numpy, of the processor, and of numba's settings. For a
  function of somebody else's file: of that file, of the modules that it imports, unless they are
  installed elsewhere, of alf_ros/kernel and of alf_ros/effects/contract. It is taken when the
  file is imported; if the sources are no longer the same when the code is saved, it is not saved
  (`cache_sources`).
- A file holds one overload. Its name has the digest of the module and of the types of the
  arguments. It is written under another name, then renamed: a reader thus reads all of it. Its
  content has a digest too: a damaged file is compiled again, never run.
- One process compiles an overload: on a miss it locks the name of the file, looks again, compiles
  and saves. Other processes compile other overloads at the same time. A hit takes no lock. Locks
  are taken along calls: first of a function, then of the functions that it calls. Calls have no
  circle, so no two processes wait for each other. If no process has saved anything for `PATIENCE`
  seconds, because the owner of the lock is stopped or hangs, the waiting process compiles and
  saves too: both save the same (`cache_folder`).
- The folder lies below NUMBA_CACHE_DIR if that is set; else in `__pycache__` of the package; else,
  where that cannot be written, in the cache folder of the user. A folder that cannot be written is
  read nevertheless. If no folder can be written, each process compiles for itself.
- A process that creates a folder removes older ones of the same name. It keeps folders in use and
  the last `KEPT`, which other versions of Python, other processors or another branch may use: each
  process holds a shared lock on the folders that it reads.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import warnings
from collections.abc import Callable
from typing import Any

from numba.core.caching import _Cache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from alf_ros.gc_pause import paused
from alf_ros.kernel.numba_ext.cache_folder import Folder
from alf_ros.kernel.numba_ext.cache_sources import Sources
from alf_ros.kernel.numba_ext.held_signals import held
from alf_ros.kernel.numba_ext.inner_code import rebuilt
from alf_ros.kernel.numba_ext.repeated_work import spared

_misses: list[str] = []


def misses() -> int:
    """How many functions this process had to compile so far."""
    return len(_misses)


class Cache(_Cache):
    """The overloads of one function."""

    def __init__(self, function: Callable[..., Any], variant: str = '') -> None:
        code = function.__code__
        self._function = function
        self._enabled = True
        self._sources = Sources.of(function)
        stem, _ = os.path.splitext(os.path.basename(code.co_filename))
        name = f'{stem}.{function.__qualname__}{variant}-{code.co_firstlineno}'
        self._name = name.replace('<', '').replace('>', '')
        self._folder: Folder | None = None
        self._turns: list[contextlib.ExitStack] = []

    def guarded(self, compile: Callable[..., Any]) -> Callable[..., Any]:
        """`compile`, in which a miss locks the overload until it ends, however it ends."""

        @functools.wraps(compile)
        def wrapper(*args: Any) -> Any:
            with (
                held(),
                global_compiler_lock,
                paused(),
                spared(),
                contextlib.ExitStack() as turn,
            ):
                self._turns.append(turn)
                try:
                    return compile(*args)
                finally:
                    self._turns.pop()

        return wrapper

    @property
    def cache_path(self) -> str | None:
        """Where the code was read or saved last."""
        return None if self._folder is None else str(self._folder._places[0])

    def _key(self, signature: Any) -> tuple[str, str]:
        """Name of the file of an overload, and what must stand in it."""
        cells = [cell.cell_contents for cell in self._function.__closure__ or ()]
        # what is saved names the module: a file of an effect can be another one in a package
        module = self._function.__module__
        text = f'{self._name}\n{module}\n{signature}\n'.encode() + (dumps(cells) if cells else b'')
        key = hashlib.sha256(text).hexdigest()
        return f'{self._name}-{key[:16]}', key

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature, or None: then the overload is locked, and nobody has it."""
        # Not all that numba refreshes here: a compilation brings the rest, a tenth of a start.
        rtsys.initialize(target_context)
        data = self._read(sig, target_context)
        if data is None:
            _misses.append(self._name)
            return None
        return rebuilt(target_context, data)

    def _read(self, sig: Any, target_context: Any) -> Any:
        if not self._enabled or self._sources is None:
            return None
        if self._folder is None:
            magic = target_context.codegen().magic_tuple()
            self._folder = Folder.of(self._sources, magic)
        name = self._key(sig)
        data = self._folder.read(*name)
        if data is None and self._turns:
            self._turns[-1].enter_context(self._folder.locked(name[0]))
            data = self._folder.read(*name)
        return data

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save code, unless it holds addresses or the sources have changed since."""
        if not self._enabled or self._folder is None or self._sources is None:
            return
        if data.library.has_dynamic_globals or any(not one.can_cache for one in data.lifted):
            warnings.warn(f'{self._name} holds addresses and is not cached', stacklevel=2)
        elif not self._sources.changed():
            # without the annotated source, a text that nobody reads
            saved = data._replace(type_annotation='')._reduce()
            self._folder.write(*self._key(sig), dumps(saved))

    def enable(self) -> None:
        """Begin to look for code, and to save it."""
        self._enabled = True

    def disable(self) -> None:
        """Compile always."""
        self._enabled = False

    def flush(self) -> None:
        """Nothing: what the folder holds is right."""
