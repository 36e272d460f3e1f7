"""Which files a scene may name besides its own text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class References:
    """`folder`: where relative paths of mechanisms, tables and effects begin; None: the scene is
    whole, and names no file. `code`: whether an effect in a file may run that has not run in this
    process before."""

    folder: Path | None = Path()
    code: bool = True


WHOLE = References(None, code=False)
