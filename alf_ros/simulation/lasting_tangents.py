"""The tangents of a run that still exist: some end where it passes a singular position."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from alf_ros.simulation.displaced_scenes import Middle
from alf_ros.simulation.quantity_tangents import QuantityTangents
from alf_ros.simulation.singular_passes import Pass
from alf_ros.simulation.tangent_following import Followed, TangentFollowing


class LastingTangents:
    """Knows which tangents of a run exist, and gives them to its samples.

    A parameter that unfolds a passed singular position has no tangent behind it.
    """

    def __init__(self, following: TangentFollowing, middle: Middle) -> None:
        self.following = following
        self._of_quantities = QuantityTangents(following, middle)
        self._unfolded: dict[str, float] = {}  # t (s) from which a tangent does not exist

    def followed(self, passes: Iterable[Pass], whole: bool) -> Followed:
        """Of a sample behind these passes; `whole`: it is one of a whole step, up to which
        singular positions are found."""
        following = self.following
        if following.placing:
            for passed in passes:
                for name in following.unfolded_by(passed):
                    self._unfolded.setdefault(name, passed.t)
        told = 'it unfolds the singular position passed at t = {:.6g} s'
        refused = {name: told.format(t) for name, t in self._unfolded.items()}
        if not whole:
            told = 'of a length or a drive it is known at whole steps, where passes are found'
            refused = {**dict.fromkeys(following.placing, told), **refused}
        return Followed(following, refused, self._of_quantities.of)

    def restart(self, t: float) -> None:
        """The run continues from t (s): what ended later exists again."""
        self._unfolded = {name: end for name, end in self._unfolded.items() if end <= t}

    @property
    def memory(self) -> dict[str, float]:
        """Data of a copy."""
        return dict(self._unfolded)

    def recall(self, memory: Mapping[str, float]) -> None:
        """Continue from the memory of another."""
        self._unfolded = dict(memory)
