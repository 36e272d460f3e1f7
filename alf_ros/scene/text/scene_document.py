"""The document of a scene: its text, and the entries of that text, each made when it is asked for.

A study reads one scene and then thousands with a few other numbers. They are derived from the
entries of the first, and the texts of most are never asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from alf_ros.scene.text import yaml_document
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry, serialise

NAME = '<scene>'  # of the text, in errors


class SceneDocument:
    """A text, or the fields whose text it is, or a function that gives them when they are asked
    for. Documents of the same text are equal."""

    def __init__(
        self, content: str | Mapping[str, object] | Callable[[], Mapping[str, object]]
    ) -> None:
        self._content = content
        self.reading: object = None  # of its entries, by `rereading`

    @cached_property
    def text(self) -> str:
        """The whole document."""
        content = self._content() if callable(self._content) else self._content
        return content if isinstance(content, str) else serialise(entry(content))

    @cached_property
    def root(self) -> Entry:
        """The entries of the text, with their lines in it."""
        return yaml_document.parse(self.text, NAME)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneDocument) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __repr__(self) -> str:
        return f'{type(self).__name__}({self.text!r})'

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return SceneDocument, (self.text,)
