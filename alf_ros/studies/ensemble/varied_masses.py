"""Members that differ in the masses of bodies alone: these bodies, without a scene of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from alf_ros.errors import InputError
from alf_ros.mechanism import Body
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.studies.ensemble.distributions import Value
from alf_ros.studies.ensemble.sampling import Varied


class VariedMasses:
    """The bodies of a scene whose masses vary, `of` each varied name."""

    def __init__(self, scene: Scene, of: Mapping[str, str]) -> None:
        self._scene, self._of = scene, of

    def bodies(self, values: Sequence[Mapping[str, Value]]) -> list[dict[str, Body] | None]:
        """Of each member with these values its bodies, by name; None where it needs a scene of its
        own."""
        columns = {
            body: overrides.with_masses(self._scene, body, [each[name] for each in values])
            for name, body in self._of.items()
        }
        members = []
        for row in zip(*columns.values(), strict=True):
            own = {name: body for name, body in zip(columns, row, strict=True) if body is not None}
            members.append(own if len(own) == len(columns) else None)
        return members


def varied_masses(scene: Scene, vary: Sequence[tuple[str, Varied]]) -> VariedMasses | None:
    """The masses that vary in a study; None if anything else does.

    Sections other than the mechanism may have values of the study that all members share.
    """
    of: dict[str, str] = {}
    try:
        for name, varied in vary:
            body = overrides.body_of_mass(scene, name)
            if body is not None and body not in of.values():
                of[name] = body
            elif not isinstance(varied, tuple) or len(set(varied)) > 1:
                return None
            elif overrides.section(scene, name) == 'mechanism':
                return None
    except InputError:
        return None
    return VariedMasses(scene, of) if of else None
