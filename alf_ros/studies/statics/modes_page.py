"""One HTML file that shows the modes of a mechanism at rest, each of them moving.

The frames of a mode are positions that the rows allow: the mechanism displaced along the mode and
closed again. Of large mechanisms they are displaced along straight lines. It shares look and
drawing with the page of `analyze`; everything is inside, and nothing is fetched.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.logs.report.html import PAGE, Json, array, assembled
from alf_ros.simulation.display_geometry import in_space, segments
from alf_ros.studies.statics.descent import moved
from alf_ros.studies.statics.instant import DENSE
from alf_ros.studies.statics.mode_words import damping_text, frequency_text, largest_shares
from alf_ros.studies.statics.vibration_modes import VibrationModes

_OWN = Path(__file__).with_name('page')
_FRAMES = 17  # from one end of the motion to the other
_FARTHEST = 0.25  # of the size, that a point moves
_ROOM = 0.05  # of the size, around what moves


def page(found: VibrationModes, title: str, notes: tuple[str, ...]) -> str:
    """The text of the file."""
    model = found.instant.model
    mechanism, names = model.mechanism, model.point_names
    films = [_film(found, k) for k in range(len(found.squares))]
    everything = np.array([_places(found, found.instant.q)] + [p for f in films for p in f])
    low, high = everything.min(axis=(0, 1)), everything.max(axis=(0, 1))
    room = _ROOM * float((high - low).max())
    kinetic, potential = found.kinetic_shares, found.potential_shares
    data: Json = {
        'title': title,
        'notes': list(notes),
        'spatial': model.layout.dimension == 3,
        'links': [names.index(end) for body in mechanism.bodies for end in segments(body)],
        'pins': [names.index(joint.point) for joint in mechanism.joints if joint.point],
        'box': [(low - room).tolist(), (high + room).tolist()],
        'modes': [_mode(found, k, film, kinetic, potential) for k, film in enumerate(films)],
    }
    return assembled(_OWN / 'modes.html', (PAGE / 'stage.js', _OWN / 'modes.js'), data)


def _mode(
    found: VibrationModes,
    k: int,
    film: Floats,
    kinetic: Mapping[str, Floats],
    potential: Mapping[str, Floats],
) -> dict[str, Any]:
    return {
        'frequency': frequency_text(found, k),
        'falls': bool(np.isnan(found.frequencies[k])),
        'damping': damping_text(found, k),
        'kinetic': f'kinetic: {largest_shares(kinetic, k)}',
        'potential': f'potential: {largest_shares(potential, k)}',
        'frames': array(film),
        'count': len(film),
    }


def _places(found: VibrationModes, q: Floats) -> Floats:
    """(points, 3) m of all points at q (blocks D, m)."""
    model = found.instant.model
    return in_space(q.reshape(-1, model.layout.dimension)[model.point_block])


def _film(found: VibrationModes, k: int) -> Floats:
    """(frames, points, 3) m from one end of the motion to the other."""
    instant, model = found.instant, found.instant.model
    rest = _places(found, instant.q)
    along = np.zeros_like(instant.q)
    along[: model.n] = found.motions[k]
    farthest = float(np.abs(_places(found, along)).max(initial=0.0)) or 1.0
    step = _FARTHEST * model.size / farthest * along[: model.n]
    if model.n > DENSE:
        away = _places(found, np.concatenate([step, np.zeros(along.size - model.n)]))
        return np.array([rest - away, rest, rest + away])
    sides = []
    for sense in (-1.0, 1.0):
        here, side = instant, []
        for _ in range(_FRAMES // 2):
            try:
                here = moved(here, sense / (_FRAMES // 2) * step)
            except AssemblyError:
                pass  # it stays at the end of its travel
            side.append(_places(found, here.q))
        sides.append(side)
    return np.array([*reversed(sides[0]), rest, *sides[1]])
