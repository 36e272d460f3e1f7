"""Golden section finds a minimum, at a kink too, and returns an argument that it has tried."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from alf_ros.model.golden_section import lowest


@pytest.mark.parametrize('place', [-1.0, -0.7, 0.1234, 1.0])
@pytest.mark.parametrize('height', [abs, lambda x: x * x])
def test_it_is_found(place: float, height: Callable[[float], float]) -> None:
    tried = []

    def shifted(x: float) -> float:
        tried.append(x)
        return height(x - place)

    found = lowest(shifted, -1.0, 1.0, 1e-7)
    assert abs(found - place) <= 1e-7 and found in tried
    assert shifted(found) == min(map(shifted, list(tried)))
    assert len(set(tried)) < 40
