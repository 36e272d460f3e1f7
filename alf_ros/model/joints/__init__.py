"""The types of joints, a file each. A mechanism names them; what it does not name is not imported.

A file holds `PLANAR`, `SPATIAL` or both: what the type is in the plane and in space, as a
`JointType` (see `contract`). Its name is the `type` of a mechanism file.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from alf_ros.mechanism import Joint
from alf_ros.model.joints.contract import JointType

_NAMES = {2: 'PLANAR', 3: 'SPATIAL'}


@cache
def kinds() -> tuple[str, ...]:
    """Names of all types. Imports no type."""
    names = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name for name in names if name != 'contract'))


@cache
def find(kind: str, dimension: int) -> JointType | None:
    """The type of a name in the plane (2) or in space (3), if there is one."""
    if kind not in kinds():
        return None
    module = importlib.import_module(f'{__name__}.{kind}')
    return getattr(module, _NAMES[dimension], None)


@cache
def types(dimension: int) -> Mapping[str, JointType]:
    """All types of a dimension by name, in the order in which lists name them."""
    found = {kind: find(kind, dimension) for kind in kinds()}
    there = {kind: each for kind, each in found.items() if each is not None}
    return dict(sorted(there.items(), key=lambda item: (item[1].listed, item[0])))


def type_of(joint: Joint) -> JointType:
    """The type of a joint of a mechanism."""
    found = find(joint.kind, len(joint.frames[0].origin))
    assert found is not None, joint.kind
    return found
