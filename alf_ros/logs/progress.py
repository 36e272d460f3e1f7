"""How the library tells that it gets on: through a callback, so that it prints nothing itself."""

from __future__ import annotations

from collections.abc import Callable

Report = Callable[[float], None]  # takes the part that is done, 0 to 1
Announce = Callable[[str], None]  # receives the next action, in words


def silent(_: object) -> None:
    """A report, or an announcement, that nobody sees."""
