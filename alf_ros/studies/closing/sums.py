"""The sums of angles and lengths that gears, racks, threads and couplings keep constant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data.closing import Integrals
from alf_ros.model.compile import Model
from alf_ros.model.constraints.meshing import integrals
from alf_ros.model.constraints.packing import indices, rows_of, with_more
from alf_ros.model.constraints.row import value
from alf_ros.model.constraints.velocity_integral import IntegralTerm
from alf_ros.model.struct_memory import changed


def with_sums(model: Model, q: Floats) -> tuple[Model, Integrals]:
    """The model, which also counts the angles of its integrals, and these with their values at q
    (blocks D, m), where no angle has turned."""
    found, layout = integrals(model.layout), model.layout
    terms = [term for each in found for term in each.terms]
    angles = [row for term in terms if term.is_angle for row in term.rows]
    lengths = [row for term in terms if not term.is_angle for row in term.rows]
    system, own = model.system, model.system.angles.c.size // 2
    if angles:
        more = with_more(system.angles, rows_of(angles, layout)[0], velocities=False)
        model = replace(model, system=changed(system, angles=more))
    next_angle, next_length, place = own, own + len(angles) // 2, []
    for term in terms:
        place.append(next_angle if term.is_angle else next_length)
        next_angle += term.is_angle
        next_length += not term.is_angle
    row = dict(zip(model.row_names, model.row.tolist(), strict=True))
    places = q.reshape(-1, layout.dimension)
    return model, Integrals(
        row=indices(row[each.name] for each in found),
        first=indices(np.cumsum([0, *(len(each.terms) for each in found)])),
        place=indices(place),
        factor=np.array([term.factor for term in terms], dtype=float),
        value=np.array([sum(_value(t, places) for t in each.terms) for each in found], float),
        lengths=rows_of(lengths, layout)[0],
    )


def _value(term: IntegralTerm, places: Floats) -> float:
    """m, at places (blocks, D)."""
    numbers = [value(row, places) for row in term.rows]
    x = float(np.arctan2(numbers[1], numbers[0])) if term.is_angle else numbers[0]
    return term.factor * x
