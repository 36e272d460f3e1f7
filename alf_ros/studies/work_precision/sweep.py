"""A sweep of settings, and the CSV file that keeps the measurements.

Existing measurements are not repeated, as long as version, machine, scene and duration are the
same.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from alf_ros import paths
from alf_ros.digest import digest
from alf_ros.logs.progress import Announce, silent
from alf_ros.logs.provenance import about
from alf_ros.resources import version
from alf_ros.scene.scene import FORMULATIONS, INTEGRATORS, Scene
from alf_ros.studies.work_precision.measurement import Measurement, Setting, measure, settings
from alf_ros.studies.work_precision.reference import Reference
from alf_ros.studies.work_precision.report import Summary

COLUMNS = (
    'scene,scene_sha256,version,duration_s,formulation,integrator,iterations,step_s,tolerance,cpu_ms_per_s,'
    'repetitions,preparation_s,evaluations_per_s,position_error_m,energy_error_J,'
    'constraint_error_m,constraint_force_error_N,failure,reference,reference_error_m,'
    'reference_force_error_N'
).split(',')
NUMBERS = (COLUMNS[9], *COLUMNS[11:17])  # of a point
KEYS = COLUMNS[:9]  # measured settings; the other columns are results
ONLY_FORMULATIONS = 20  # bodies above which the dense formulations are left out

Row = dict[str, str]


class Store:
    """The CSV file: its rows of this machine, and where new ones go.

    Rows of other machines and versions are dropped, and so is a last line that was cut off.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._about = path, about()
        self.rows: dict[tuple[str, ...], Row] = {}
        try:
            lines = path.read_text(encoding='utf-8').splitlines()
        except FileNotFoundError:
            lines = []
        if lines and _undated(lines[0]) == _undated(self._about):
            for row in csv.DictReader(lines[1:]):
                whole = list(row) == COLUMNS and None not in row.values()
                if whole and row['version'] == identity():
                    self.rows[_key(row)] = row
        with (
            paths.replacing(path) as target,
            open(target, 'w', newline='', encoding='utf-8') as stream,
        ):
            print(self._about, file=stream)
            writer = csv.DictWriter(stream, COLUMNS, lineterminator='\n')
            writer.writeheader()
            writer.writerows(self.rows.values())

    def add(self, row: Row) -> None:
        """Keep a row, in the file at once."""
        self.rows[_key(row)] = row
        with open(self._path, 'a', newline='', encoding='utf-8') as stream:
            csv.DictWriter(stream, COLUMNS, lineterminator='\n').writerow(row)


def identity() -> str:
    """The version of the package, and a digest of the code that computes the motion."""
    code = digest('kernel', 'mechanism', 'model', 'effects', 'scene', 'simulation')
    return f'{version()}+{code[:8]}'


def plan(
    scene: Scene,
    formulations: Sequence[str] | None,
    integrators: Sequence[str] | None,
    iterations: Sequence[int],
    steps: Sequence[float] | None,
    tolerances: Sequence[float],
) -> list[Setting]:
    """The settings to sweep for a scene; None stands for all, `steps` in s.

    The dense formulations are left out of all where the scene has more than ONLY_FORMULATIONS
    bodies.
    """
    small = len(scene.mechanism.bodies) <= ONLY_FORMULATIONS
    formulations = formulations or (FORMULATIONS if small else FORMULATIONS[:1])
    integrators = integrators or INTEGRATORS
    return list(settings(formulations, integrators, sorted(iterations), steps, tolerances))


def sweep(
    scene: Scene,
    plan: Sequence[Setting],
    against: Reference,
    store: Store,
    announce: Announce = silent,
) -> Summary:
    """Measure the settings that are not in the store yet; returns all points of the plan.

    `announce` is called with each setting before. Raises OSError if the store cannot be written.
    """
    points = []
    for setting in plan:
        announce(f'{scene.name}: {setting.formulation}, {setting}')
        wanted = _keys(scene, setting, against)
        row = store.rows.get(tuple(wanted.values()))
        if row is None:
            row = wanted | _measured(measure(scene, setting, against), against)
            store.add(row)
        points.append(measurement_of(row))
    stated = against.times[-1], against.kind, against.error, against.force_error
    return Summary(scene.name, *stated, points)


def _keys(scene: Scene, setting: Setting, against: Reference) -> Row:
    tolerance = '' if setting.tolerance is None else f'{setting.tolerance:.6g}'
    numbers = [f'{setting.iterations}', f'{setting.step:.9g}', tolerance]
    head = [scene.name, scene.hash[:16], identity(), f'{against.times[-1]:g}']
    values = [*head, setting.formulation, setting.integrator, *numbers]
    return dict(zip(KEYS, values, strict=True))


def _measured(point: Measurement, against: Reference) -> Row:
    errors = (point.position, point.energy, point.gap, point.force)
    values = [f'{point.cpu:.5g}', f'{point.repetitions}', f'{point.preparation:.3g}']
    values += [f'{point.evaluations:.5g}', *(f'{error:.4g}' for error in errors), point.failure]
    values += [against.kind, f'{against.error:.2g}', f'{against.force_error:.2g}']
    return dict(zip(COLUMNS[len(KEYS) :], values, strict=True))


def measurement_of(row: Row) -> Measurement:
    """The point that a row of the CSV file holds."""
    tolerance = float(row['tolerance']) if row['tolerance'] else None
    setting = Setting(
        row['formulation'],
        row['integrator'],
        int(row['iterations']),
        float(row['step_s']),
        tolerance,
    )
    cpu, preparation, evaluations, *errors = (float(row[name]) for name in NUMBERS)
    position, energy, gap, force = errors
    return Measurement(
        setting,
        cpu,
        int(row['repetitions']),
        preparation,
        evaluations,
        position,
        energy,
        gap,
        force,
        row['failure'],
    )


def _key(row: Row) -> tuple[str, ...]:
    return tuple(row[name] for name in KEYS)


def _undated(text: str) -> str:
    return text.rpartition(',')[0]
