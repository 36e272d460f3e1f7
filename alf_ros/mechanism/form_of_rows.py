"""The form that the equations of scenes beside one another share.

The equations of a mechanism leave out entries that are zero in its drawing. Their unit vectors are
as long as the drawing is large. The points and vectors that carry a body are the first ones that
are well apart in the drawing. A scene with slightly other lengths may then have other entries, or
a kink. Within `form_of` equations have a given form. In a whole form, rows and masses keep entries
that are zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple


class RowForm(NamedTuple):
    """length: of unit vectors, m; None if it is the one of the drawing. whole: whether entries
    that are zero are kept. ends: by body, its points and vectors that carry it."""

    length: float | None = None
    whole: bool = False
    ends: tuple[tuple[str, tuple[int, ...]], ...] = ()


_OF_DRAWING = RowForm()
_FORM: ContextVar[RowForm] = ContextVar('_FORM', default=_OF_DRAWING)


def row_form() -> RowForm:
    """The form that is asked for here."""
    return _FORM.get()


@contextmanager
def form_of(form: RowForm) -> Iterator[None]:
    """Within this, equations have this form.

    The motion does not depend on the length of unit vectors. But the extent of a drawing has a
    kink where two of its sides are equally long, which a scene and the scenes beside it must not
    have.
    """
    before = _FORM.set(form)
    try:
        yield
    finally:
        _FORM.reset(before)


def whole_form() -> RowForm:
    """The form asked for here, with all entries."""
    return row_form()._replace(whole=True)
