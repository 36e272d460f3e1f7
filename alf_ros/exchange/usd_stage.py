"""A USD stage as the package usd-core composes it: prims, poses and attributes as numbers.

Lengths become m and masses kg here, by `metersPerUnit` and `kilogramsPerUnit`. What the library
would print, it keeps: errors become one line, and content that is not found is listed.
"""

from __future__ import annotations

import re
import resource
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from alf_ros import paths
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import usd_probe
from alf_ros.exchange.robot import FramePose
from alf_ros.scene.text.yaml_document import LARGEST, LARGEST_FILE

SUFFIXES = ('.usd', '.usda', '.usdc', '.usdz')
MOST_BYTES = 1 << 30  # of a binary file, which is mapped; a text is read as a whole
MOST_PRIMS = 1_000_000
MOST_MEMORY = 1 << 33  # bytes: a damaged file of some bytes may claim arrays of any length
ENDLESS = 1e15  # a number from there on is a limit that does not limit: many files have 3.4e38
_HEADS = (b'#usda', b'#sdf', b'PXR-USDC', b'PK\x03\x04')  # texts, binary files, archives
_TEXTS = 2  # the first of them
_SKEWED = 1e-5  # cosine between axes: the rotations of most files have single precision


class UsdStage:
    """The prims of a file and of all that it refers to.

    metre, kilogram: units of the file in m and kg. up: number of its axis that points up.
    missing: one line for each reference that leads nowhere.
    """

    def __init__(self, path: Path) -> None:
        """Open a file. Raises InputError."""
        is_text = _check(path)
        try:
            from pxr import Tf, Usd, UsdGeom, UsdPhysics
        except ImportError:
            message = 'a USD file: `pip install usd-core` reads it'
            raise InputError(message, file=str(path)) from None
        self.file = str(path)
        usd_probe.check(path, is_text, MOST_MEMORY)
        try:
            self._stage = Usd.Stage.Open(str(path.absolute()))
        except (Tf.ErrorException, UnicodeError) as error:
            raise InputError(_refused(error), file=self.file) from None
        self._cache = UsdGeom.XformCache(Usd.TimeCode.Default())
        self.metre = self._unit('metersPerUnit', UsdGeom.GetStageMetersPerUnit(self._stage))
        kilogram = UsdPhysics.GetStageKilogramsPerUnit(self._stage)
        self.kilogram = self._unit('kilogramsPerUnit', kilogram)
        up = str(UsdGeom.GetStageUpAxis(self._stage))
        if up not in ('X', 'Y', 'Z'):
            raise self.error('upAxis', 'not an axis', value=up, expected='X, Y or Z')
        self.up = 'XYZ'.index(up)
        self.missing = [_unresolved(each) for each in self._stage.GetCompositionErrors()]
        default = self._stage.GetDefaultPrim()
        self.name = default.GetName() if default else path.stem

    def _unit(self, key: str, value: float) -> float:
        if not 0.0 < value <= LARGEST:
            raise self.error(key, 'not a unit', value=value)
        return float(value)

    def error(self, key: str, message: str, **details: Any) -> InputError:
        """Return an InputError with file and key; `details` are its other fields."""
        return InputError(message, file=self.file, key=key, **details)

    def prims(self) -> Iterator[Any]:
        """All active prims, in instances too, each after its parent. Raises InputError."""
        from pxr import Usd

        every = Usd.PrimRange.Stage(self._stage, Usd.TraverseInstanceProxies())
        for n, prim in enumerate(every):
            if n >= MOST_PRIMS:
                raise self.error('stage', f'more than {MOST_PRIMS} prims')
            yield prim

    def prim(self, path: str) -> Any:
        """The prim of a path, which may be no valid one."""
        return self._stage.GetPrimAtPath(path)

    def affine(self, prim: Any) -> tuple[Floats, Floats]:
        """Matrix (3, 3) and origin (3,) in the world, both in m, of coordinates of a prim in its
        own unit. Raises InputError."""
        found = np.array(self._cache.GetLocalToWorldTransform(prim), dtype=float).T
        if not np.all(np.abs(found) <= LARGEST) or np.abs(found[3] - (0, 0, 0, 1)).max() > 0.0:
            raise self.error(str(prim.GetPath()), 'not a usable transformation')
        return self.metre * found[:3, :3], self.metre * found[:3, 3]

    def parent(self, prim: Any) -> Floats:
        """Matrix (3, 3) in the world, in m, of the space in which a prim is placed."""
        parent, resets = prim.GetParent(), self._cache.GetLocalTransformation(prim)[1]
        return self.metre * np.eye(3) if resets else self.affine(parent)[0]

    def frame(self, prim: Any) -> FramePose:
        """The frame of a prim in the world, without its scales. Raises InputError for axes that
        are skewed, mirrored or flat."""
        matrix, origin = self.affine(prim)
        return FramePose(origin, self.rotation(matrix, str(prim.GetPath())))

    def rotation(self, matrix: Floats, key: str) -> Floats:
        """(3, 3) the rotation in a matrix of axes with any lengths. Raises InputError."""
        sizes = np.linalg.norm(matrix, axis=0)
        if not sizes.min() > 0.0:
            raise self.error(key, 'a scale of zero')
        axes = matrix / sizes
        if np.abs(axes.T @ axes - np.eye(3)).max() > _SKEWED:
            expected = 'scales of its parents that are equal, or none'
            raise self.error(key, 'its axes are skewed', expected=expected)
        if np.linalg.det(axes) < 0.0:
            raise self.error(key, 'it is mirrored', expected='positive scales')
        return np.asarray(Rotation.from_matrix(axes).as_matrix())

    def numbers(
        self, prim: Any, name: str, default: Sequence[float], endless: bool = False
    ) -> Floats:
        """The values of an attribute, `default` where neither the file nor its schema has one.

        endless: infinite values count as what they are. Raises InputError.
        """
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        if value is None:
            return np.array(default, dtype=float)
        try:
            found: Floats = np.array(_components(value), dtype=float).ravel()
        except (TypeError, ValueError):
            found = np.empty(0)
        if _is_single(str(attribute.GetTypeName())):  # as written: 0.1 is not 0.10000000149
            found = np.array([float(str(np.float32(x))) for x in found])
        usable = ~np.isnan(found) & ((np.abs(found) <= LARGEST) | endless)
        if found.size != len(default) or not usable.all():
            count = 'a number' if len(default) == 1 else f'{len(default)} numbers'
            key = f'{prim.GetPath()} {name}'
            raise self.error(key, 'not usable numbers', expected=count)
        if endless:
            found[np.abs(found) >= ENDLESS] *= np.inf
        return found

    def schemas(self, prim: Any) -> list[str]:
        """The schemas applied to a prim, as written: usd-core keeps back those that it does not
        know, such as all of PhysX."""
        written = prim.GetMetadata('apiSchemas')
        return [] if written is None else [str(each) for each in written.GetAppliedItems()]

    def array(self, prim: Any, name: str, kind: type) -> NDArray[Any]:
        """An attribute with any count of numbers of a kind; empty where it has none."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        try:
            return np.array([] if value is None else value, dtype=kind)
        except (TypeError, ValueError, OverflowError):
            return np.array([], dtype=kind)

    def number(self, prim: Any, name: str, default: float = 0.0, endless: bool = False) -> float:
        """The value of an attribute. Raises InputError."""
        return float(self.numbers(prim, name, (default,), endless)[0])

    def is_authored(self, prim: Any, name: str) -> bool:
        """Whether the file itself has a value of an attribute."""
        attribute = prim.GetAttribute(name)
        return bool(attribute) and bool(attribute.HasAuthoredValue())

    def targets(self, prim: Any, name: str) -> list[str]:
        """The paths of a relationship; none where it is absent."""
        relation = prim.GetRelationship(name)
        return [str(each) for each in relation.GetForwardedTargets()] if relation else []

    def quaternion(self, prim: Any, name: str) -> Floats:
        """(3, 3) the rotation of an attribute; none where it is absent or zero."""
        w, x, y, z = self.numbers(prim, name, (1.0, 0.0, 0.0, 0.0))
        if not any((w, x, y, z)):
            return np.eye(3)
        return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())

    def word(self, prim: Any, name: str, default: str = '') -> str:
        """The token or string of an attribute; `default` where it has none."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        return value if isinstance(value, str) else default

    def choice(self, prim: Any, name: str, default: str, among: Sequence[str]) -> str:
        """The token of an attribute, which is one of several; `default` where it has none. Raises
        InputError."""
        found = self.word(prim, name, default)
        if found not in among:
            raise self.error(f'{prim.GetPath()} {name}', 'not known', value=found, choices=among)
        return found

    def holds(self, prim: Any, name: str, default: bool) -> bool:
        """Whether an attribute is true; `default` where it is absent."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        return default if value is None else bool(value)


@contextmanager
def guarded(path: Path) -> Iterator[None]:
    """Read a file with a limit of memory, and keep what the library would print on stderr, from
    all of its threads. Raises InputError where it refuses a value or a text."""
    try:
        from pxr import Tf, UsdUtils
    except ImportError:  # which `UsdStage` reports
        yield
        return
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = _memory() + MOST_MEMORY
    if soft == resource.RLIM_INFINITY or most < soft:
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    try:
        yield
    except Tf.ErrorException:
        raise InputError('usd-core refuses it', file=str(path)) from None
    except UnicodeDecodeError:
        raise InputError('a text in it is not UTF-8', file=str(path)) from None
    except MemoryError:
        raise InputError(f'needs more than {MOST_MEMORY >> 20} MB', file=str(path)) from None
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        delegate.TakeUncoalescedDiagnostics()


def _memory() -> int:
    """Bytes of address space that this process has."""
    pages = Path('/proc/self/statm').read_text(encoding='ascii').split()[0]
    return int(pages) * resource.getpagesize()


def _check(path: Path) -> bool:
    """Refuse what cannot be a USD file, before the library maps it. Returns whether it is a text.
    Raises InputError."""
    head = paths.head(path, 16)
    kinds = [n for n, each in enumerate(_HEADS) if head.startswith(each)]
    if not kinds:
        raise InputError('not a USD file', file=str(path))
    most = LARGEST_FILE if kinds[0] < _TEXTS else MOST_BYTES
    if path.stat().st_size > most:
        raise InputError(f'larger than {most >> 20} MB', file=str(path))
    return kinds[0] < _TEXTS


def _refused(error: Exception) -> str:
    """Why a file cannot be opened, without words of the file."""
    try:
        text = str(error)
    except UnicodeDecodeError:  # it quotes the file
        text = ''
    line = re.search(r':(\d+):\d+: ', text)
    return 'not a USD file' + (f': an error in line {line[1]}' if line else ': damaged')


def _unresolved(error: Any) -> str:
    """A reference that leads nowhere, and the prim that has it."""
    first = re.split(' introduced by | -- |\n', str(error), maxsplit=1)[0].rstrip(':. ')
    return f'{first} ({error.rootSite.path})'


def _components(value: Any) -> Any:
    """The numbers of a value; of a quaternion the real one first."""
    if hasattr(value, 'GetReal'):
        return [value.GetReal(), *value.GetImaginary()]
    return value


def _is_single(kind: str) -> bool:
    return kind.startswith('float') or kind.endswith(('3f', 'quatf'))
