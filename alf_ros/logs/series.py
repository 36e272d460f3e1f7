"""Messages of one topic as columns: one array for each field, in place of ten million messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.logs.cdr import BEGIN, FIRST_STAMP, Decoder
from alf_ros.logs.mcap_chunks import Block, Bytes, Channel

_JOINT_STATE = 'sensor_msgs/msg/JointState'
_WRENCHES = 'sensor_msgs/msg/MultiDOFJointState'
COMPONENTS = tuple(f'{what}.{axis}' for what in ('force', 'torque') for axis in 'xyz')
_NUMBER = 'std_msgs/msg/Float64'
TEXT = 'std_msgs/msg/String'
NUMERIC = (_JOINT_STATE, _WRENCHES, _NUMBER)


def type_with(fields: tuple[str, ...]) -> str:
    """The type whose messages hold their numbers in these fields."""
    types = {'wrench': _WRENCHES, 'data': _NUMBER}
    return types.get(fields[0], _JOINT_STATE)


@dataclass(frozen=True)
class Series:
    """N messages of `topic` in the order of the log.

    stamp (N,) ns, `told` (N,) ns in its header if it has one; `names` (k,) of the numbers;
    `columns`: 'position', 'velocity', 'effort' (N, k), 'wrench' (N, k, 6: force N, torque N m),
    'data' (N, 1), depending on the type; `messages` are dictionaries, for types that do not
    consist of numbers; `place` (N,) orders the messages of all topics of one piece; `form` is what
    all messages have in common, besides numbers and stamps: size, header, lengths, names. Of texts
    and other types it is every header that is not CDR's plain one, and all bytes behind a message.
    """

    topic: str
    type: str
    stamp: Integers
    sequence: Integers
    place: Integers
    told: Integers
    names: tuple[str, ...] = ()
    columns: dict[str, Floats] = field(default_factory=dict)
    messages: tuple[dict[str, Any], ...] = ()
    form: bytes = b''

    def __len__(self) -> int:
        return len(self.stamp)

    def labelled(self) -> dict[str, Floats]:
        """The columns one by one (N,), named as a table names them: 'position.knee',
        'wrench.knee.force.x', 'data'."""
        found = {}
        for key, values in self.columns.items():
            for k, name in enumerate(self.names or ('',)):
                label = f'{key}.{name}' if self.names else key
                if values.ndim == 3:
                    for c, component in enumerate(COMPONENTS):
                        found[f'{label}.{component}'] = values[:, k, c]
                else:
                    found[label] = values[:, k]
        return found


def joined(pieces: Sequence[Series]) -> Series:
    """Pieces of one topic as one. Raises InputError if their types or names differ."""
    first = pieces[0]
    for piece in pieces:
        if (piece.type, piece.names) != (first.type, first.names):
            text = f'its content changes at {piece.stamp[0]} ns: read its pieces one by one'
            raise InputError(text, key=first.topic)
    return Series(
        first.topic,
        first.type,
        np.concatenate([piece.stamp for piece in pieces]),
        np.concatenate([piece.sequence for piece in pieces]),
        np.concatenate([piece.place for piece in pieces]),
        np.concatenate([piece.told for piece in pieces]),
        first.names,
        {key: np.concatenate([p.columns[key] for p in pieces]) for key in first.columns},
        tuple(message for piece in pieces for message in piece.messages),
        first.form,
    )


class _Layout:
    """Where the numbers lie in messages like this one, and what else is in all of them."""

    def __init__(self, kind: str, decoder: Decoder, data: bytes) -> None:
        message, places, parts, _ = decoder.read_with_places(data)
        self.size = len(data)
        try:
            self.names, self.shapes = _shapes(kind, message)
            count = sum(int(np.prod(shape)) for shape in self.shapes.values())
            fits = count == len(places) and (kind == _NUMBER or 'stamp' in message['header'])
            uneven = _uneven(self.names, self.shapes)
        except (KeyError, TypeError):
            fits, uneven = False, ''
        if not fits or uneven:
            raise InputError(f'a message that is not of its type{uneven}', value=kind)
        self.numbers = (np.array(places, np.int64)[:, None] + np.arange(8)).ravel()
        fixed = np.zeros(self.size, bool)
        for begin, end in parts:
            fixed[begin:end] = True
        fixed[self.numbers] = False
        self._has_header = kind != _NUMBER
        if self._has_header:
            fixed[FIRST_STAMP] = False
        self._fixed = np.flatnonzero(fixed)
        self._wanted = np.frombuffer(data, np.uint8)[self._fixed]
        self.form = self.size.to_bytes(8, 'little') + self._wanted.tobytes()

    def fits(self, rows: Bytes) -> NDArray[np.bool_]:
        """Which of these messages (N, size) differ in numbers and stamp only."""
        return np.asarray((rows[:, self._fixed] == self._wanted).all(axis=1))

    def told(self, rows: Bytes) -> Integers | None:
        """The stamps (ns) in the headers of messages (N, size); None if they have none."""
        if not self._has_header:
            return None
        parts = np.ascontiguousarray(rows[:, FIRST_STAMP])
        seconds, rest = parts[:, :4].copy().view('<i4'), parts[:, 4:].copy().view('<u4')
        return np.asarray(seconds[:, 0].astype(np.int64) * 1_000_000_000 + rest[:, 0])

    def columns(self, rows: Bytes) -> dict[str, Floats]:
        """The numbers of messages (N, size)."""
        numbers = np.ascontiguousarray(rows[:, self.numbers]).view('<f8')
        found, at = {}, 0
        for key, shape in self.shapes.items():
            count = int(np.prod(shape))
            found[key] = numbers[:, at : at + count].reshape(-1, *shape)
            at += count
        return found


def _shapes(
    kind: str, message: dict[str, Any]
) -> tuple[tuple[str, ...], dict[str, tuple[int, ...]]]:
    """Names, and the shape of each field that holds numbers, in their order."""
    if kind == _NUMBER:
        return (), {'data': (1,)}
    if kind == _JOINT_STATE:
        fields = ('position', 'velocity', 'effort')
        return tuple(message['name']), {
            key: (len(message[key]),) for key in fields if message[key]
        }
    if message['transforms'] or message['twist']:
        raise InputError('transforms and twists are not read', value=kind)
    return tuple(message['joint_names']), {'wrench': (len(message['wrench']), 6)}


def _uneven(names: tuple[str, ...], shapes: dict[str, tuple[int, ...]]) -> str:
    """Which field has another number of values than there are names; '' if none has."""
    for key, shape in shapes.items():
        if shape[0] != (len(names) or 1):
            return f': {len(names)} names and {shape[0]} of {key}'
    return ''


class ChannelReader:
    """Messages of one channel to series."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._decoder = Decoder(channel.type, channel.definition)
        self._layout: _Layout | None = None

    def series(self, block: Block, rows: Integers) -> Iterator[Series]:
        """These messages of a chunk, in series of equal names: nearly always one."""
        if self._channel.type not in NUMERIC:
            read = [self._decoder.read_with_places(block.message(k)) for k in rows]
            form = b''.join(sorted({each.around for each in read} - {BEGIN}))
            yield self._made(block, rows, messages=tuple(each.message for each in read), form=form)
            return
        while rows.size:
            layout = self._layout
            if layout is not None:
                sizes = block.end[rows] - block.start[rows]
                count = _leading(sizes == layout.size)
                if count:
                    window = sliding_window_view(block.data, layout.size)
                    bytes_ = window[block.start[rows[:count]]]
                    count = _leading(layout.fits(bytes_))
                if count:
                    some = bytes_[:count]
                    columns, told = layout.columns(some), layout.told(some)
                    names, form = layout.names, layout.form
                    yield self._made(block, rows[:count], names, columns, told=told, form=form)
                    rows = rows[count:]
                    continue
            self._layout = _Layout(self._channel.type, self._decoder, block.message(rows[0]))

    def _made(
        self,
        block: Block,
        rows: Integers,
        names: tuple[str, ...] = (),
        columns: dict[str, Floats] | None = None,
        messages: tuple[dict[str, Any], ...] = (),
        told: Integers | None = None,
        form: bytes = b'',
    ) -> Series:
        return Series(
            self._channel.topic,
            self._channel.type,
            block.stamp[rows],
            block.sequence[rows],
            block.start[rows],
            block.stamp[rows] if told is None else told,
            names,
            columns or {},
            messages,
            form,
        )


def _leading(true: NDArray[np.bool_]) -> int:
    """How many are true before the first that is not."""
    return int(true.size if true.all() else true.argmin())
