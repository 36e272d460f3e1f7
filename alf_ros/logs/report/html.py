"""One HTML file that shows logs: data, drawing and look are inside, and nothing is fetched."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.logs.report import panels
from alf_ros.logs.report.decimation import Trace
from alf_ros.logs.report.drawn_motion import DrawnMotion
from alf_ros.logs.report.gather import Label
from alf_ros.logs.report.solid_bodies import HINT, mesh_data, packed_script
from alf_ros.logs.report.summary import Account
from alf_ros.mechanism import VisualShape

PAGE = Path(__file__).with_name('page')
# Kinds of commands with values, and the panels of these
ORDERED = {'wrench': 'wrench', 'effort': 'ordered_effort', 'target': 'ordered_position'}

_EQUAL = 1e-14  # of the largest number, from which down a spread is rounding
_LATE, _LARGEST = 1e-2, 1e38  # likewise, where float32 would lose digits; what float32 holds

Json = dict[str, Any]


def page(accounts: Sequence[Account]) -> str:
    """The text of the file."""
    logs = [_log(account) for account in accounts]
    used = {curve['panel'] for log in logs for trace in log['traces'] for curve in trace['curves']}
    solid = shows_shapes(accounts)
    data = {
        'three': packed_script() if solid else '',
        'flat': f'outlines only: {HINT}' if solid and not packed_script() else '',
        'title': ' and '.join(dict.fromkeys(account.scene for account in accounts)),
        'panels': [{'key': key, **panels.panel(key)._asdict()} for key in panels.ordered(used)],
        'logs': logs,
    }
    names = ('stage.js', 'solids.js', 'plot.js', 'analysis.js')
    return assembled(PAGE / 'analysis.html', [PAGE / name for name in names], data)


def shows_shapes(accounts: Sequence[Account]) -> bool:
    """Whether a body of the logs has a shape to draw."""
    return any(account.motion is not None and account.motion.shapes for account in accounts)


def assembled(template: Path, scripts: Sequence[Path], data: Json) -> str:
    """The text of a page: a template with the look of all pages, scripts and data inside."""
    parts = {
        '/*LOOK*/': (PAGE / 'look.css').read_text('utf-8'),
        '/*SCRIPT*/': '\n'.join(
            path.read_text('utf-8').replace("'use strict';\n", '', 1 if n else 0)
            for n, path in enumerate(scripts)
        ),
        # '</script>' in a name must not end the data
        '/*DATA*/': json.dumps(data).replace('<', '\\u003c'),
    }
    text = template.read_text('utf-8')
    for mark, part in parts.items():
        before, after = text.split(mark)
        text = before + part + after
    return text


def packed(values: Floats) -> float | Json:
    """Numbers for the page: one if all are equal, else float32 as text. Numbers that differ in
    late digits only, such as an energy, stand as differences from a `base`: float32 has 7."""
    found = values.ravel()
    numbers = found[np.isfinite(found)]
    if not numbers.size:
        return array(found)
    largest = float(np.abs(numbers).max())
    spread = float(numbers.max()) - float(numbers.min())  # of Python: it may be infinite
    if numbers.size == found.size and spread <= _EQUAL * largest:
        return float(np.median(numbers))
    if spread < _LATE * largest < _LARGEST:
        base = float(numbers[0])
        return {**array(found - base), 'base': base}
    return array(found)


def _single(values: Floats) -> NDArray[np.float32]:
    """As float32: values that are too large become infinite."""
    with np.errstate(over='ignore'):
        return np.ascontiguousarray(values, dtype='<f4')


def array(values: Floats) -> Json:
    """The same where an array is needed."""
    flat = _single(values)
    return {'f32': base64.b64encode(flat.tobytes()).decode()}


def _log(account: Account) -> Json:
    found, first = account.found, account.first
    traces = [_trace(each.labels, each.trace, account) for each in found.signals.values()]
    for (panel, name), trace in found.reports.numbers.items():
        if panel == 'distance' and account.is_exact:
            continue  # better known from the states
        traces.append(_trace([Label(panel, name)], trace, account))
    for (kind, name), trace in found.orders.traces.items():
        if kind in ORDERED:
            traces.append(_trace([Label(ORDERED[kind], name)], trace, account))
    motion = account.motion
    if motion is not None and account.is_exact:
        traces.append(_trace([Label('distance', 'of the states')], motion.distance, account))
    return {
        'name': account.name,
        'about': account.about,
        'notes': account.notes,
        'faults': account.faults,
        'texts': account.texts,
        'first': first,
        'last': account.last,
        'traces': [trace for trace in traces if trace['curves']],
        'levels': [
            {'task': task, 't': array(trace.t - first), 'high': packed(trace.high)}
            for task, trace in found.reports.levels.items()
        ],
        'orders': [
            {'label': ' '.join(key).strip(), 't': array(trace.t - first)}
            for key, trace in found.orders.traces.items()
        ],
        'passes': account.passes,
        'motion': None if motion is None else _motion(motion, first),
    }


def _trace(labels: Sequence[Label], trace: Trace, account: Account) -> Json:
    curves = [
        _curve(label, trace.low[:, n], trace.high[:, n], account)
        for n, label in enumerate(labels)
        if _is_worth(label, trace, n)
    ]
    return {'t': array(trace.t - account.first), 'group': trace.group, 'curves': curves}


def _is_worth(label: Label, trace: Trace, n: int) -> bool:
    """Numbers there are; and of vectors only the components that are not always zero: in the plane
    half of them are."""
    low, high = trace.low[:, n], trace.high[:, n]
    if not np.isfinite(high).any():
        return False
    return not label.part or bool(low.any() or high.any())


def _curve(label: Label, low: Floats, high: Floats, account: Account) -> Json:
    angles = None if account.motion is None else account.motion.angles
    if label.panel in panels.PEAKS:
        low = high
    sizes = np.abs(np.concatenate([low, high]))
    lowest = packed(low)
    return {
        'panel': panels.place(label.panel, label.name, angles),
        'name': label.name,
        'part': label.part,
        'low': lowest,
        'high': lowest if np.array_equal(low, high, equal_nan=True) else packed(high),
        'largest': float(np.max(sizes, initial=0.0, where=np.isfinite(sizes))),
    }


def _shape(shape: VisualShape, files: Sequence[str]) -> Json:
    mesh = files.index(shape.file) if shape.kind == 'mesh' else None
    return {'kind': shape.kind, 'color': shape.color, 'mesh': mesh}


def _motion(motion: DrawnMotion, first: float) -> Json:
    D = 3 if motion.spatial else 2
    moving = np.flatnonzero(np.ptp(motion.places, axis=0).any(axis=1)).tolist()
    still = motion.places[0].astype(object)
    still[moving, :D] = None  # in the plane depths of shapes stay
    frames = {
        't': array(motion.t - first),
        'values': array(motion.places[:, moving, :D]),
        'width': len(moving) * D,
    }
    forces = [
        {
            't': array(t - first),
            'values': array(forces[..., :D]),
            'width': len(points) * D,
            'at': points,
        }
        for t, points, forces in motion.forces
    ]
    held = motion.applied
    return {
        'spatial': motion.spatial,
        'links': motion.links,
        'pins': motion.pins,
        'wheels': motion.wheels,
        'symbols': motion.symbols,
        'missing': len(motion.missing),
        'meshes': [mesh_data(each) for each in motion.meshes.values()],
        'shapePoints': motion.shape_points,
        'shapes': [_shape(each, list(motion.meshes)) for each in motion.shapes],
        'scale': motion.scale,
        'moving': moving,
        'still': still.ravel().tolist(),
        'frames': frames,
        'forces': forces,
        'held': {'values': array(held), 'width': 6 * held.shape[1]} if held.size else None,
    }
