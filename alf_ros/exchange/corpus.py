"""Every robot file below a folder: imported, checked, simulated, in one table.

Each file is treated in a process of its own with limits of time and memory, so that one that hangs
or grows takes nothing from the others.
"""

from __future__ import annotations

import csv
import multiprocessing
import os
import resource
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from multiprocessing.connection import Connection as Pipe
from pathlib import Path
from typing import Any, TextIO

from alf_ros.errors import AlfError, printable
from alf_ros.exchange import urdf_with_loops, usd_stage
from alf_ros.exchange.import_file import WITHOUT_GROUND, format_of, imported
from alf_ros.inspection.answer import BAD
from alf_ros.inspection.soundness import TooLarge, examine
from alf_ros.scene.scene import Scene, scene_from_text
from alf_ros.simulation.simulation import Simulation

SUFFIXES = ('.urdf', '.xacro', '.sdf', '.world', '.xml', '.mjcf', *usd_stage.SUFFIXES)
_ALONE = ('.urdf', '.sdf')  # nothing includes these
_KINDS = ('robot', 'sdf', 'mujoco', 'usd')
_STEPS = 10  # between two looks at closure and clock
HEADS = ('file', 'result', 'freedoms', 'loops', 'evaluations', 'closure', 'time')
RESULTS = 'ok', 'refused', 'unsound', 'stops', 'limit', 'broken'
OK, REFUSED, UNSOUND, STOPS, LIMIT, BROKEN = RESULTS


_EVERYTHING = """
mechanism:
  alf: 1
  space: spatial
  points: {O: {at: [0, 0, 0], fixed: true}, A: {at: [1, 0, 0]}}
  bodies:
    one: {points: [O, A], mass: 1, inertia: {about_com: [1, 1, 1]}}
    two: {points: [A], mass: 1, inertia: {about_com: [1, 1, 1]}, com: [1, 0, 0]}
  joints:
    first: {type: revolute, between: [ground, one], at: O, axis: [0, 1, 0]}
    second: {type: revolute, between: [one, two], at: A, axis: [0, 1, 0]}
  couplings: {both: {joints: {first: 1, second: -1}}}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  joint_friction: {joint: first, viscous: 1, dynamic: 1, load: 1}
  torsion_spring: {joint: first, stiffness: 1}
  joint_stop: {joint: first, lower: -1, upper: 1, stiffness: 1}
  ground_contact: {on: two, radius: 0.1, through: [0, 0, -9], stiffness: 1, friction: 1}
  tendon: {joints: [[first, 1], [second, 1]], stiffness: 1}
  motor: {joint: first, position: 1, position_gain: 1, armature: 1}
"""


@dataclass(frozen=True)
class ExaminationLimits:
    """Of each file: s of wall time, bytes of address space; and the s that are simulated."""

    seconds: float = 120.0
    memory: int = 16 << 30
    duration: float = 0.5


@dataclass(frozen=True)
class Examined:
    """Result of a file, and why if it is not ok.

    freedoms: degrees of freedom. loops: joints beyond a tree. evaluations: per simulated second.
    closure: m, how far a constraint was open. seconds: of wall time for a simulated one.
    """

    file: str
    result: str
    why: str = ''
    freedoms: int | None = None
    loops: int | None = None
    evaluations: float | None = None
    closure: float | None = None
    seconds: float | None = None


def files_below(folder: Path) -> list[Path]:
    """The robot files below a folder, in order: also those that cannot be read, but no files that
    only other files include."""
    found = [path for path in folder.rglob('*') if path.suffix in SUFFIXES and path.is_file()]
    return sorted(path for path in found if path.suffix in _ALONE or format_of(path) in _KINDS)


def examined(
    folder: Path, wishes: Mapping[str, Any], limits: ExaminationLimits
) -> Iterator[Examined]:
    """Results of all files below a folder, imported with `wishes` (fields of `Wishes`)."""
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload([__name__])
    first = context.Process(target=_compile, daemon=True)  # once, of any duration
    first.start()
    first.join()
    for path in files_below(folder):
        name = str(path.relative_to(folder))
        mine, its = context.Pipe(duplex=False)
        work = its, str(path), name, dict(wishes), limits
        process = context.Process(target=_work, args=work, daemon=True)
        process.start()
        its.close()
        try:
            found = _answer(mine, Examined(name, LIMIT, 'starting'), limits.seconds)
        finally:
            process.kill()
            process.join()
        yield found


def _compile() -> None:
    """Take a step with everything that acts on imported robots, so that its code is kept."""
    Simulation(scene_from_text(_EVERYTHING)).step(1)


def _answer(mine: Pipe, found: Examined, seconds: float) -> Examined:
    """The last that a process says within so many seconds: its result, or what it was doing."""
    end = time.monotonic() + seconds
    try:
        while found.result == LIMIT and mine.poll(max(0.0, end - time.monotonic())):
            found = mine.recv()
    except EOFError:
        return replace(found, why=f'its process ended while {found.why}')
    if found.result == LIMIT:  # a simulated mechanism runs, sound or not
        result = LIMIT if found.seconds is None else OK
        return replace(found, result=result, why=f'{found.why} took longer than {seconds:g} s')
    return found


def _work(
    answer: Pipe, path: str, name: str, wishes: dict[str, Any], limits: ExaminationLimits
) -> None:
    """Treat one file, in a process that may come to grief. It ends with the one that began it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_AS, (limits.memory, limits.memory))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what libraries print
    try:
        for found in _treated(path, name, wishes, limits):
            answer.send(found)
    except MemoryError:
        answer.send(Examined(name, REFUSED, f'it needs more than {limits.memory >> 20} MiB'))
    except Exception as error:  # a fault of this package: the table shows it, and continues
        message = ' '.join(f'{type(error).__name__}: {error}'.split())
        answer.send(Examined(name, BROKEN, message))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _treated(
    path: str, name: str, wishes: dict[str, Any], limits: ExaminationLimits
) -> Iterator[Examined]:
    """The present activity, as a result until the real one exists."""
    yield Examined(name, LIMIT, 'importing')
    kind = format_of(Path(path))
    if kind in WITHOUT_GROUND:
        wishes = wishes | {'ground': None}
    if kind != 'robot':  # which say themselves what floats
        wishes = wishes | {'floating': False}
    elif wishes.get('loops') is None and (side := urdf_with_loops.side_file(Path(path))):
        wishes = wishes | {'loops': str(side)}
    try:
        scene = scene_from_text(imported(path, **wishes))
    except AlfError as error:
        yield Examined(name, REFUSED, str(error).removeprefix(f'{path}: '))
        return
    found = Examined(name, LIMIT, 'simulating', loops=_loops(scene))
    yield found
    found = _simulated(scene, found, limits)
    yield replace(found, result=LIMIT, why='checking')
    try:
        soundness = examine(scene)
        bad = [f'{a.question}: {a.answer}' for a in soundness.answers if a.verdict == BAD]
        found = replace(found, freedoms=soundness.freedoms)
    except TooLarge as error:  # a simulated mechanism runs, sound or not
        found, bad = replace(found, why=found.why or str(error)), []
    except AlfError as error:
        bad = [str(error)]
    if bad and found.result == OK:
        found = replace(found, result=UNSOUND, why=bad[0])
    yield found


def _simulated(scene: Scene, found: Examined, limits: ExaminationLimits) -> Examined:
    """Add the cost of a run over the duration, or over the part that half of the time allows."""
    closure, span = 0.0, 0.0
    try:
        simulation = Simulation(scene)
        simulation.step(1)  # compiled
        start, first = time.perf_counter(), simulation.evaluations
        while span < limits.duration and time.perf_counter() - start < 0.5 * limits.seconds:
            simulation.step(_STEPS)
            span += _STEPS * simulation.h
            closure = max(closure, simulation.sample().diagnostics.position_violation)
    except AlfError as error:
        return replace(found, result=STOPS, why=str(error))
    wall = (time.perf_counter() - start) / span
    evaluations = (simulation.evaluations - first) / span
    return replace(
        found, result=OK, why='', evaluations=evaluations, closure=closure, seconds=wall
    )


def _loops(scene: Scene) -> int:
    """Joints beyond a spanning tree."""
    mechanism = scene.mechanism
    return len(mechanism.joints) - len(mechanism.bodies) + _free(scene)


def _free(scene: Scene) -> int:
    """Groups of bodies that no joint connects with the ground."""
    above = {body.name: body.name for body in scene.mechanism.bodies} | {'ground': 'ground'}

    def root(name: str) -> str:
        while above[name] != name:
            name = above[name]
        return name

    for joint in scene.mechanism.joints:
        above[root(joint.child)] = root(joint.parent)
    return sum(root(name) == name for name in above) - 1


def write(stream: TextIO, found: Sequence[Examined]) -> None:
    """All rows as CSV, a column for each field of `Examined`."""
    columns = [each.name for each in fields(Examined)]
    writer = csv.DictWriter(stream, columns, lineterminator='\n')
    writer.writeheader()
    writer.writerows(map(asdict, found))


def head() -> str:
    """The first two lines of the table."""
    return f'| {" | ".join(HEADS)} |\n|{"---|" * len(HEADS)}'


def total(found: Sequence[Examined]) -> str:
    """How many files there are of each result."""
    counts = Counter(each.result for each in found)
    several = ', '.join(f'{counts[result]} {result}' for result in RESULTS if counts[result])
    return f'{len(found)} files: {several}'


def row(found: Examined) -> str:
    """One line of the table."""
    cells = [
        found.file,
        ': '.join(part for part in (found.result, found.why) if part),
        '' if found.freedoms is None else str(found.freedoms),
        '' if found.loops is None else str(found.loops),
        '' if found.evaluations is None else f'{found.evaluations:.0f} /s',
        '' if found.closure is None else f'{found.closure:.1e} m',
        '' if found.seconds is None else f'{found.seconds:.3g} s/s',
    ]
    # names of files may contain anything: also what ends a cell or a line
    return f'| {" | ".join(printable(cell).replace("|", "/") for cell in cells)} |'
