"""The mechanism of a log drawn from its states: places, forces, and how near it is to singular.

The mechanism is made from the scene in the log without its effects, so that looking at a log runs
no code that came with it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, InputError
from alf_ros.inspection.mesh_triangles import MeshTriangles, read_meshes
from alf_ros.inspection.shape_places import DrawnShapes, shape_places
from alf_ros.inspection.symbol_places import limb_lines, symbol_lines
from alf_ros.inspection.wheel_places import wheel_places
from alf_ros.logs import progress
from alf_ros.logs.log import Log
from alf_ros.logs.report.decimation import Instants, Trace
from alf_ros.logs.report.gather import MOST_ROWS, Gathered
from alf_ros.logs.report.singularity_distance import distances, passes
from alf_ros.mechanism import VisualShape
from alf_ros.mechanism.affine import FormArray
from alf_ros.scene.references import WHOLE
from alf_ros.scene.scene import KEYS, REQUIRED, Solver, scene_from_text
from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_writer import entry, serialise
from alf_ros.simulation import state_vector
from alf_ros.simulation.display_geometry import (
    held_forces,
    in_space,
    poses,
    reaction_places,
    reaction_points,
    segments,
    standard_scale,
)
from alf_ros.simulation.simulation import Simulation

# Of more states than these the page has every second, third … one.
MOST_FRAMES = 40_000


@dataclass
class DrawnMotion:
    """Of k frames.

    t (k,) s; places (k, points, 3) m; `links`, `pins` and `wheels`: numbers of points, two for
    each line, one for each joint, three for each wheel (`wheel_places`), two for each line of
    `symbols` (`symbol_lines`), four for each of `shapes`
    (`DrawnShapes`), whose meshes are in `meshes` by file; `missing`: a line for each file of a
    mesh that cannot be drawn; `scale` m/N of arrows.
    `forces` of the reactions: (t (k,), numbers of points, (k, n, 3) N). `applied` (k, m, 6): place
    and force of each wrench held, NaN where none is. `distance`: σ of all states gathered;
    `passes` (t, σ there, whether through): None if not every state of the log was. `angles`: the
    joint coordinates that are angles.
    """

    spatial: bool
    links: list[int]
    pins: list[int]
    wheels: list[int]
    symbols: list[int]
    shapes: list[VisualShape]
    shape_points: list[int]
    meshes: dict[str, MeshTriangles]
    missing: list[str]
    scale: float
    stride: int
    t: Floats
    places: Floats
    forces: list[tuple[Floats, list[int], Floats]]
    applied: Floats
    distance: Trace
    passes: list[tuple[float, float, bool]] | None
    angles: frozenset[str]


def mechanism(log: Log) -> Simulation:
    """The mechanism of a log, with nothing that acts on it. Raises AlfError if it cannot be made
    by this version."""
    file = str(log.path)
    fields = dict(yaml_document.parse(log.scene_text, file).mapping(KEYS, REQUIRED))
    fields.pop('effects', None)
    scene = scene_from_text(serialise(entry(fields)), file, references=WHOLE)
    try:
        solver = Solver(**log.info['solver'])
    except TypeError as error:
        text = f'its settings do not belong to this version: {error}'
        raise InputError(text, file=file) from None
    return Simulation(scene, step=solver.step, penalty=solver.penalty)


def motion(
    found: Gathered, simulation: Simulation, report: progress.Report = progress.silent
) -> DrawnMotion | None:
    """The gathered frames; None without states of this mechanism."""
    model = simulation.model
    wanted = state_vector.names(model, simulation.state)[: model.n]
    states = {names: each for names, each in found.states.items() if set(wanted) <= set(names)}
    if not states:
        return None
    t = np.concatenate([each.t for each in states.values()])
    columns = [[names.index(name) for name in wanted] for names in states]
    parts = zip(columns, states.values(), strict=True)
    coordinates = np.concatenate([each.values[:, places] for places, each in parts])
    stride = max(each.stride for each in states.values())
    distance = Trace(1, MOST_ROWS)
    near = distances(simulation, t, coordinates, report)
    distance.add(t, near.sigma[:, None])
    film, every = _Film(simulation, found), -(-len(t) // MOST_FRAMES)
    for k in range(0, len(t), every):
        film.take(float(t[k]), coordinates[k])
    drawn = model.mechanism
    points, own = model.point_names, film.numbers
    pins = [points.index(joint.point) for joint in drawn.joints if joint.point]
    acting = {name: points.index(at) for name, at in reaction_points(drawn).items()}
    acting |= dict(zip(film.acting, own['acting'], strict=True))
    return DrawnMotion(
        spatial=drawn.dimension == 3,
        links=[points.index(end) for body in drawn.bodies for end in segments(body)]
        + own['limbs'],
        pins=pins,
        wheels=own['wheels'],
        symbols=own['symbols'],
        shapes=film.shapes,
        shape_points=list(range(len(points) + film.count, len(film.places[0]))),
        meshes=film.meshes,
        missing=film.missing,
        scale=standard_scale(drawn),
        stride=stride * every,
        t=t[::every],
        places=np.array(film.places),
        forces=[_forces(each, names, acting) for names, each in found.reactions.items()],
        applied=film.held(),
        distance=distance,
        passes=passes(near) if stride == 1 else None,
        angles=frozenset(
            (*model.mechanism.ball_angles, *(c.name for c in model.coordinates if c.is_angle))
        ),
    )


def _forces(
    frames: Instants, names: tuple[str, ...], at: dict[str, int]
) -> tuple[Floats, list[int], Floats]:
    known = [n for n, name in enumerate(names) if name in at]
    return frames.t, [at[names[n]] for n in known], frames.values[:, known]


class _Film:
    """The mechanism at one instant after the other."""

    def __init__(self, simulation: Simulation, found: Gathered) -> None:
        self._simulation = simulation
        self._orders = deque(found.orders.held)
        self._start = simulation.state
        model = simulation.model
        drawn, layout = model.mechanism, model.layout
        sliding = reaction_places(drawn, layout)
        self.acting = list(sliding)
        parts = {
            'wheels': wheel_places(drawn, layout, self._start.q),
            'symbols': symbol_lines(drawn, layout, self._start.q),
            'limbs': limb_lines(drawn, layout),
            'acting': list(sliding.values()),
        }
        every = [form for forms in parts.values() for form in forms]
        self._forms = FormArray(every, layout.dimension)
        self.count, self.numbers = len(self._forms), dict[str, list[int]]()
        at = len(model.point_names)
        for name, forms in parts.items():
            self.numbers[name] = list(range(at, at + len(forms)))
            at += len(forms)
        self._shown: DrawnShapes | None = None
        self.meshes, self.missing = dict[str, MeshTriangles](), list[str]()
        placed = shape_places(model.mechanism)
        if placed is not None:
            files = (shape.file for shape in placed.shapes if shape.kind == 'mesh')
            self.meshes, self.missing = read_meshes(files)
            self._shown = DrawnShapes(placed, self.meshes)
        self.shapes = self._shown.shapes if self._shown is not None else []
        self.places: list[Floats] = []
        self._held: list[Floats] = []

    def take(self, t: float, coordinates: Floats) -> None:
        """Go to a time (s) and coordinates in the order of the log."""
        simulation, model = self._simulation, self._simulation.model
        self._hold(t)
        q, D = self._start.q.copy(), model.layout.dimension
        q.reshape(-1, D)[model.coordinate_block] = coordinates.reshape(-1, D)
        step = round(t / simulation.h)
        simulation.restore(replace(simulation.state, step=step, q=q))
        sample = simulation.sample()
        named = sample.points  # made anew each time it is read
        points = np.array([named[name] for name in model.point_names])
        places = in_space(np.vstack([points, self._forms.values(q.reshape(-1, D))]))
        if self._shown is not None:
            places = np.vstack([places, self._shown.places(poses(sample))])
        self.places.append(places)
        held = np.hstack(held_forces(sample)) if sample.inputs.all_wrenches else np.zeros((0, 6))
        self._held.append(held)

    def _hold(self, t: float) -> None:
        while self._orders and self._orders[0].t <= t:
            order = self._orders.popleft()
            try:
                self._simulation.apply_wrench(
                    order.name, order.force, at=order.at, frame=order.frame
                )
            except (AlfError, TypeError, ValueError):
                continue  # a damaged entry, or one of another scene

    def held(self) -> Floats:
        """(k, most at once, 6), NaN where there is none."""
        most = max(map(len, self._held), default=0)
        found = np.full((len(self._held), most, 6), np.nan)
        for row, some in zip(found, self._held, strict=True):
            row[: len(some)] = some
        return found
