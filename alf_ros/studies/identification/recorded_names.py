"""The names of joints and topics in a recording, and what the scene calls them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from alf_ros.errors import InputError
from alf_ros.logs.series import Series


@dataclass(frozen=True)
class Topics:
    """Where a recording has what: topics in full or their last part.

    joints: measured joint states; commands: efforts and targets of joints; wrenches: the topics
    whose last part, or its entry in `renamed`, is a body or a point. renamed: recorded names of
    joints and topics of wrenches -> names of the scene; '' leaves one out.
    """

    joints: str = 'joint_states'
    commands: str = 'joint_commands'
    renamed: Mapping[str, str] = field(default_factory=dict)

    def name(self, recorded: str) -> str:
        """The name in the scene."""
        return self.renamed.get(recorded, recorded)


class RecordedNames:
    """Names joints and topics of one recording, and refuses those that name nothing or two
    things. seen: the recorded names that `renamed` has."""

    def __init__(self, path: Path, topics: Topics) -> None:
        self.path, self.topics = path, topics
        self.seen: set[str] = set()
        self._topic_of: dict[tuple[str, str], str] = {}  # of a joint or input, by kind and name

    def name(self, recorded: str) -> str:
        """The name in the scene, '' to leave it out."""
        if recorded in self.topics.renamed:
            self.seen.add(recorded)
        return self.topics.name(recorded)

    def each_once(self, series: Series) -> None:
        """Refuse a joint that is in one message twice."""
        for k, name in enumerate(series.names):
            if name in series.names[:k]:
                raise InputError(
                    'a joint that is in one message twice',
                    file=str(self.path),
                    key=series.topic,
                    value=name,
                )

    def alone(self, kind: str, name: str, topic: str, key: str) -> None:
        """Refuse a second topic of a joint or input: as of another robot, or of a planner."""
        other = self._topic_of.setdefault((kind, name), topic)
        if other != topic:
            raise InputError(
                f'{name!r} is on two topics',
                file=str(self.path),
                key=key,
                value=f'{other} and {topic}',
                expected='one of them' + ('' if key == 'map' else ', in full'),
            )

    def refuse(self, why: str, recorded: str, name: str, known: Iterable[str]) -> NoReturn:
        """For a name that is not one of those `known`."""
        raise InputError(
            f'{why} ({recorded!r} in the recording)' if name != recorded else why,
            file=str(self.path),
            key='map',
            value=name,
            choices=known,
        )


def is_called(topic: str, name: str) -> bool:
    """Whether a topic has this name, in full or as its last part."""
    return topic == name if name.startswith('/') else topic.rpartition('/')[2] == name
