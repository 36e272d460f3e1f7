"""A note about directions that rows hold to second order only, wherever the mechanism goes."""

from __future__ import annotations

from alf_ros.errors import AssemblyError
from alf_ros.model.singular_branches import position
from alf_ros.model.yielding import yielding, yields
from alf_ros.studies.statics.instant import DENSE, Instant


def held_to_second_order(instant: Instant) -> list[str]:
    """The note, if a mechanism with redundant rows has such directions. To first order they are
    free."""
    model = instant.model
    dependent = len(model.row_names) - round(model.system.rank)
    if not dependent or model.n > DENSE:
        return []
    try:
        here = position(model, instant.q, instant.t)
    except AssemblyError:  # drives cannot move on
        return []
    if not yields(here, dependent):
        return []
    count, names = yielding(here)
    held = f'rows hold {count} of the directions to second order only'
    return [f'{held}: {names} may yield, as if free']
