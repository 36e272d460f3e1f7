"""The wheels that a commanded velocity of the whole robot turns:

diff_drive: {left: left_hub, right: right_hub, wheel_radius: r, wheel_separation: 2*w}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from alf_ros.mechanism import Mechanism
from alf_ros.scene.parameter_reader import ParameterReader
from alf_ros.scene.references import References
from alf_ros.scene.text.yaml_document import Entry


def _of(kind: str, doc: str, **more: str) -> Any:
    return field(metadata={'kind': kind, 'doc': doc, **more})


@dataclass(frozen=True)
class DiffDrive:
    """Two wheels on one axle, each turned by a motor that follows a velocity.

    Raises ValueError for lengths that are not positive.
    """

    left: str = _of('coordinate', 'joint coordinate of the left wheel, positive forwards')
    right: str = _of('coordinate', 'joint coordinate of the right wheel, positive forwards')
    wheel_radius: float = _of('number', 'radius of the wheels', unit='m')
    wheel_separation: float = _of('number', 'distance between the wheels', unit='m')

    def __post_init__(self) -> None:
        for name in ('wheel_radius', 'wheel_separation'):
            if not getattr(self, name) > 0.0:
                raise ValueError(f'{name} must be positive')
        if self.left == self.right:
            raise ValueError('left and right must be two joints')

    def wheel_speeds(self, forward: float, turn: float) -> tuple[float, float]:
        """Rates (rad/s) of the left and the right wheel for a speed forward (m/s) and a rate of
        turn to the left (rad/s)."""
        half = 0.5 * self.wheel_separation * turn
        return (forward - half) / self.wheel_radius, (forward + half) / self.wheel_radius


def read_diff_drive(
    section: Entry, mechanism: Mechanism, numbers: Mapping[str, float], references: References
) -> DiffDrive:
    """The section of a scene. Raises InputError."""
    reader = ParameterReader(mechanism, numbers, references)
    values: dict[str, Any] = reader.parameters(section, DiffDrive)
    angles = {each.name for each in mechanism.coordinates if each.is_angle}
    for side in ('left', 'right'):
        if values[side] not in angles:
            raise section.mapping()[side].error('not an angle of a wheel', value=values[side])
    try:
        return DiffDrive(**values)
    except ValueError as error:
        raise section.error(str(error)) from None
