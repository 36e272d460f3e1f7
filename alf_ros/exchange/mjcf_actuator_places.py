"""Where the numbers of an actuator of MuJoCo stand.

From MuJoCo 3.11 on an actuator may have several controls and push with several numbers. Arrays of
controls and of gears then have places of their own; before, they have one for each actuator.
"""

from __future__ import annotations

from typing import Any


def count(model: Any) -> int:
    """The number of actuators of a model."""
    return int(getattr(model, 'nactuator', model.nu))


def is_single(model: Any, n: int) -> bool:
    """Whether actuator n has one control and pushes with one number."""
    several = ('actuator_ctrlnum', 'actuator_outnum')
    return all(int(getattr(model, name)[n]) == 1 for name in several if hasattr(model, name))


def control(model: Any, n: int) -> int:
    """The place of the first control of actuator n."""
    return _place(model, 'actuator_ctrladr', n)


def output(model: Any, n: int) -> int:
    """The place of its first gear, and of its moments."""
    return _place(model, 'actuator_outadr', n)


def _place(model: Any, name: str, n: int) -> int:
    places = getattr(model, name, None)
    return n if places is None else int(places[n])
