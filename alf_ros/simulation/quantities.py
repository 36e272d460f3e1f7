"""The quantities of a sample by name: names are paths in `Sample`, such as 'reactions.knee.force'.

Quantities of one kind form a group, which is read from a sample as one array.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.model.constraints.drives import motion_names
from alf_ros.simulation.sample import Sample

ONE_OF_MANY = 'one of many that balance: constraints are redundant'
_REACTIONS, _EFFORT = 'reactions.', '.effort'


@dataclass(frozen=True)
class Group:
    """The quantities `names`, read as one array: (names,), or (names, components).

    `units` has one unit for each component, one unit for a quantity without components.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    read: Callable[[Sample], Floats]
    components: tuple[str, ...] = ()


class Quantity(NamedTuple):
    """A quantity by its full name; `units` and `components` as in `Group`."""

    name: str
    units: tuple[str, ...]
    components: tuple[str, ...]


def groups(sample: Sample) -> tuple[Group, ...]:
    """The groups of quantities that samples of this simulation have; SI, world frame.

    'works' are among them if the simulation keeps a ledger.
    """
    found = (*_of_points_and_bodies(sample), *_of_joints(sample), *_of_the_whole(sample))
    return tuple(group for group in found if group.names)


def open_components(sample: Sample, name: str) -> NDArray[np.bool_]:
    """(components,) whether a reaction, or an effort of drives, is one of many at this sample:
    redundant constraints, or a singular position, leave the component open. Empty for other
    quantities."""
    if not may_be_open(name):
        return np.zeros(0, dtype=bool)
    kind, _, path = name.partition('.')
    owner, _, part = path.rpartition('.')
    if kind == 'joints':
        return sample.open_joint_efforts[[sample.model.coordinate_names.index(owner)]]
    if kind == 'drives':
        return sample.open_motion_efforts[[motion_names(sample.model.mechanism).index(owner)]]
    reaction = sample.reactions[owner]
    return reaction.open_force if part == 'force' else reaction.open_torque


def may_be_open(name: str) -> bool:
    """Whether a quantity is the force or the torque of a joint, or an effort."""
    return name.startswith(_REACTIONS) or name.endswith(_EFFORT)


def _paths(pattern: str, names: Iterable[str]) -> tuple[str, ...]:
    return tuple(pattern.replace('*', name) for name in names)


def _of_points_and_bodies(sample: Sample) -> Iterator[Group]:
    model, axes = sample.model, _axes(sample)
    planar, turn = len(axes) == 2, ('qx', 'qy', 'qz', 'qw')

    def positions(sample: Sample) -> Floats:
        return np.array(list(sample.points.values()))

    def velocities(sample: Sample) -> Floats:
        return np.array(list(sample.velocities.values()))

    lengths, speeds = ('m',) * len(axes), ('m/s',) * len(axes)
    yield Group(_paths('points.*', model.point_names), lengths, positions, axes)
    yield Group(_paths('velocities.*', model.point_names), speeds, velocities, axes)
    yield Group(
        _paths('body_poses.*', model.body_names),
        (*lengths, 'rad') if planar else (*lengths, '', '', '', ''),
        lambda sample: sample.body_poses,
        (*axes, 'angle') if planar else (*axes, *turn),
    )


def _of_joints(sample: Sample) -> Iterator[Group]:
    model, axes = sample.model, _axes(sample)
    planar = len(axes) == 2
    places = [n for n, each in enumerate(model.coordinates) if each.is_angle]
    slides = [n for n, each in enumerate(model.coordinates) if not each.is_angle]
    for which, units in ((places, ('rad', 'rad/s', 'N m')), (slides, ('m', 'm/s', 'N'))):
        names = [model.coordinate_names[n] for n in which]
        for what, unit in zip(('position', 'velocity', 'effort'), units, strict=True):
            read = _rows(f'joint_{_plural(what)}', which)
            yield Group(_paths(f'joints.*.{what}', names), (unit,), read)
    yield Group(
        _paths('reactions.*.force', model.joint_names),
        ('N',) * len(axes),
        lambda sample: sample.reaction_forces,
        axes,
    )
    yield Group(
        _paths('reactions.*.torque', model.joint_names),
        ('N m',) * (1 if planar else 3),
        lambda sample: sample.reaction_torques[:, 0] if planar else sample.reaction_torques,
        () if planar else axes,
    )
    motions = motion_names(model.mechanism)
    of_drives = [drive for drive in model.mechanism.drives for f in drive.motion if f is not None]
    for k, what in enumerate(('position', 'velocity', 'effort')):
        for angle, unit in ((True, ('rad', 'rad/s', 'N m')[k]), (False, ('m', 'm/s', 'N')[k])):
            which = [n for n, each in enumerate(of_drives) if (each.kind == 'angle') is angle]
            names = [motions[n] for n in which]
            yield Group(_paths(f'drives.*.{what}', names), (unit,), _motions(k, which))


def _of_the_whole(sample: Sample) -> Iterator[Group]:
    yield Group(
        ('energy', 'kinetic_energy'),
        ('J',),
        lambda sample: np.array([sample.energy, sample.kinetic_energy]),
    )
    yield Group(
        _paths('stored.*', sample.effects),
        ('J',),
        lambda sample: np.array(list(sample.stored.values())),
    )
    yield Group(
        _paths('powers.*', sample.effects),
        ('W',),
        lambda sample: np.array(list(sample.powers.values())),
    )
    if sample.state.works:
        yield Group(
            _paths('works.*', sample.works),
            ('J',),
            lambda sample: np.array(list(sample.works.values())),
        )
    for what, unit in (('position_violation', 'm'), ('velocity_violation', 'm/s')):
        yield Group((f'diagnostics.{what}',), (unit,), _diagnostic(what))
    yield Group(('diagnostics.distance',), ('',), _diagnostic('distance'))


def _axes(sample: Sample) -> tuple[str, ...]:
    return tuple('xyz'[: sample.model.layout.dimension])


def _plural(what: str) -> str:
    return 'velocities' if what == 'velocity' else f'{what}s'


def _rows(attribute: str, which: list[int]) -> Callable[[Sample], Floats]:
    return lambda sample: getattr(sample, attribute)[which]


def _motions(k: int, which: list[int]) -> Callable[[Sample], Floats]:
    return lambda sample: sample.drives[k][which]


def _diagnostic(what: str) -> Callable[[Sample], Floats]:
    return lambda sample: np.array([getattr(sample.diagnostics, what)])
