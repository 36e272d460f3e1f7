"""Effects packed for the kernel: kind after kind, on one layout of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.effects.contract import Effect, Packed
from alf_ros.errors import InputError
from alf_ros.kernel import Effects
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.mechanism.natural_coordinates import Layout


@dataclass(frozen=True)
class PackedKind:
    """An effect's file, its functions (addresses; 0: none, or nobody asks), its instances packed,
    and the instances with a load: none, or all. `undated`: whether it may jump at instants that it
    does not tell."""

    name: str
    force: int
    potential: int
    friction: int
    tangent: int
    side: int
    undated: bool
    interval: int
    packed: Packed
    rubbing: Sequence[Effect]


@dataclass(frozen=True)
class AskedFunctions:
    """The functions and numbers of effects that a method asks for, besides those that all of them
    need: `tangents` of an implicit one, `sides` of an adaptive explicit one, `branches` of one
    with derivatives, and `intervals` of every method of alf2. `ends`: whether steps end at
    kinks that they would cross."""

    tangents: bool = False
    sides: bool = False
    branches: bool = False
    intervals: bool = False
    ends: bool = False


NOTHING = AskedFunctions()


def listed(kinds: Sequence[PackedKind]) -> Effects:
    """As the kernel wants them."""
    slots = [kind.packed.slots for kind in kinds]
    params = [kind.packed.params for kind in kinds]
    sides, undated = ([getattr(kind, name) for kind in kinds] for name in ('side', 'undated'))
    loads = np.cumsum([0, *(len(kind.rubbing) for kind in kinds)], dtype=np.uint64)
    return Effects(
        force=np.array([kind.force for kind in kinds], dtype=np.uint64),
        potential=np.array([kind.potential for kind in kinds], dtype=np.uint64),
        friction=np.array([kind.friction for kind in kinds], dtype=np.uint64),
        tangent=np.array([kind.tangent for kind in kinds], dtype=np.uint64),
        side=np.array(sides if any(sides) else [], dtype=np.uint64),
        undated=np.array(undated if any(sides) else [], dtype=np.int64),
        slots=np.concatenate([np.zeros(0, dtype=np.int64), *slots]),
        params=np.concatenate([np.zeros(0), *params]),
        slots_at=_starts(slots),
        params_at=_starts(params),
        loads_at=loads[:-1].copy(),
    )


def once(
    packed: list[tuple[Layout, list[PackedKind]]],
    effects: Sequence[Effect],
    layout: Layout,
    asked: AskedFunctions = NOTHING,
) -> list[PackedKind]:
    """The kinds of effects on a layout, kept in `packed`: two layouts, or three, ever ask."""
    for known, kinds in packed:
        if known is layout:
            return kinds
    packed.append((layout, kinds_of(effects, layout, asked)))
    return packed[-1][1]


def kinds_of(
    effects: Sequence[Effect], layout: Layout, asked: AskedFunctions = NOTHING
) -> list[PackedKind]:
    """Effects, kind after kind. Raises InputError if one does not fit the mechanism."""
    kinds = []
    for kind, instances in _by_kind(effects).items():
        module = registry.load(kind)
        try:
            with form_of(layout.asked):
                packed = module.pack(instances, layout)
        except ValueError as error:
            names = ', '.join(effect.name for effect in instances)
            raise InputError(str(error), key=f'{kind} ({names})') from None
        potential = module.potential.address if hasattr(module, 'potential') else 0
        rubs = any(loaded(effect) is not None for effect in instances)
        friction = module.friction.address if rubs else 0
        rubbing = instances if rubs else ()
        tangent = module.tangent.address if asked.tangents and hasattr(module, 'tangent') else 0
        undated = not (hasattr(module, 'side') or packed.instants.size)
        side = 0 if packed.smooth else _side(kind, module, asked, undated)
        within = asked.intervals and packed.intervals > 0
        interval = module.interval.address if within else 0
        addresses = module.force.address, potential, friction, tangent, side
        kinds.append(PackedKind(kind, *addresses, undated, interval, packed, rubbing))
    return kinds


def _side(kind: str, module: ModuleType, asked: AskedFunctions, undated: bool) -> int:
    """The function that tells the sides of kinks. Derivatives find branches also of an effect that
    has none, over time if it does not give instants; ours that have none have no kinks."""
    if hasattr(module, 'side'):
        asks = asked.sides or asked.branches
        return int(module.side.address) if asks else 0
    if not asked.branches or kind in registry.own() or getattr(module, 'CONSTANT', False):
        return 0
    from alf_ros.effects.contract.force_branches import force_branches

    return force_branches(module.force._pyfunc, undated)


def _by_kind(effects: Sequence[Effect]) -> dict[str, list[Effect]]:
    by_kind: dict[str, list[Effect]] = {}
    for effect in effects:
        by_kind.setdefault(effect.kind, []).append(effect)
    return by_kind


def loaded(effect: Effect) -> str | None:
    """The joint coordinate whose reaction an effect depends on."""
    module = registry.load(effect.kind)
    name: str | None = module.loaded(effect.parameters) if hasattr(module, 'loaded') else None
    return name


def _starts(parts: Sequence[Floats] | Sequence[Integers]) -> Addresses:
    sizes = [part.size for part in parts]
    return np.cumsum([0, *sizes], dtype=np.uint64)[:-1]
