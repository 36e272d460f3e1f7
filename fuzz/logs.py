"""Logs: records, chunks, schemas, CDR payloads, journal and metadata of a small one, changed.

What reads logs must end in one line; and `verify` may call equal only what no change is in.
"""

from __future__ import annotations

import json
import shutil
import struct
from random import Random

from mcap_records import (
    CHANNEL,
    CHUNK,
    MESSAGE,
    METADATA,
    SCHEMA,
    Record,
    behind,
    mapping,
    read_mapping,
    read_text,
    records,
    text,
    together,
)
from plain_logs import JOURNAL, outputs, plain, without_origin
from spoiling import INTEGERS, TEXTS, altered, damaged, damaged_text, number, scratch, spoil

SUFFIX = '.mcap'
MOST_STEPS = 100_000


class Harness:
    SUFFIX = SUFFIX
    every = False  # use of a log, not one of them

    def __init__(self) -> None:
        from small_logs import small_logs

        from alf_ros.logs import journal, load
        from alf_ros.logs.comparison import compare

        self._journal = journal
        self.folder = scratch('logs')
        self._path = self.folder / 'case_0.mcap'
        self._logs = small_logs(self.folder)
        self._whole = [outputs(data) for data in self._logs]
        for which, data in enumerate(self._logs):  # else nothing that is changed could be seen
            self._path.write_bytes(data)
            result = compare(load(self._path))
            assert result.equal, result.faults
            self._same(bytes([which]) + data, result)

    def make(self, random: Random) -> bytes:
        """A changed log; the first byte says of which."""
        which = random.randrange(len(self._logs))
        parts = records(self._logs[which])
        kind = 0
        for _ in range(random.choice((1, 1, 1, 2, 3))):
            kind = random.randrange(100)
            if kind < 30:
                self._message(parts, random)
            elif kind < 50:
                self._entry(parts, random)
            elif kind < 62:
                self._metadata(parts, random)
            elif kind < 72:
                self._schema(parts, random)
            elif kind < 80:
                self._channel(parts, random)
            elif kind < 90:
                self._order(parts, random)
            elif kind < 96:
                self._chunk(parts, random)
            elif kind < 99:
                record = random.choice(parts)
                record.head['length'] = random.choice(INTEGERS) % 2**64
        end = behind(self._logs[which])
        data = together(parts, damaged(end, random) if kind == 99 else end)
        if random.randrange(12) == 0:
            data = damaged(data, random)
        return bytes([which]) + data

    # ------------------------------------------------------------- what is changed

    def _some(self, parts: list[Record], code: int, random: Random) -> Record | None:
        found = [r for part in parts for r in (part.inner or [part]) if r.code == code]
        return random.choice(found) if found else None

    def _message(self, parts: list[Record], random: Random) -> None:
        record = self._some(parts, MESSAGE, random)
        if record is None or len(record.content) < 22:
            return
        head, data = bytearray(record.content[:22]), bytearray(record.content[22:])
        kind = random.randrange(8)
        if kind == 0:
            head[:2] = (random.choice(INTEGERS) % 2**16).to_bytes(2, 'little')
        elif kind == 1:
            head[2:6] = (random.choice(INTEGERS) % 2**32).to_bytes(4, 'little')
        elif kind == 2:
            at = random.choice((6, 14))
            old = int.from_bytes(head[at : at + 8], 'little')
            new = random.choice((old + 1, old - 1, old + 10**6, *INTEGERS)) % 2**64
            head[at : at + 8] = new.to_bytes(8, 'little')
        elif kind <= 5 and len(data) >= 12:  # a number of the payload
            at = 4 + 8 * random.randrange((len(data) - 4) // 8)
            (old,) = struct.unpack_from('<d', data, at) if at + 8 <= len(data) else (0.0,)
            new = altered(old, random) if random.randrange(2) else float(number(random))
            if at + 8 <= len(data):
                struct.pack_into('<d', data, at, new)
        else:
            data = bytearray(damaged(bytes(data), random))
        record.content = bytes(head) + bytes(data)

    def _entry(self, parts: list[Record], random: Random) -> None:
        """Change an entry of the journal; sometimes seal it again."""
        found = [
            r
            for part in parts
            for r in (part.inner or [part])
            if r.code == MESSAGE and b'{"step"' in r.content
        ]
        if not found:
            return
        record = random.choice(found)
        try:
            entry = json.loads(_string(record))
        except (ValueError, struct.error):
            return
        if random.randrange(10) == 0:
            said = damaged_text(json.dumps(entry), random)
        else:
            for _ in range(random.choice((1, 1, 2))):
                spoil(entry, random)
            try:
                if random.randrange(2):
                    entry.pop('seal', None)
                    seal = '' if record is found[0] else json.loads(_string(found[0]))['seal']
                    said, _ = self._journal.chained(entry, seal)
                else:
                    said = json.dumps(entry)
            except (ValueError, RecursionError, KeyError, TypeError):
                return
        raw = said.encode('utf-8', 'surrogatepass') + b'\0'
        payload = b'\0\1\0\0' + struct.pack('<I', len(raw)) + raw
        record.content = record.content[:22] + payload

    def _metadata(self, parts: list[Record], random: Random) -> None:
        found = [part for part in parts if part.code == METADATA]
        record = random.choice(found)
        try:
            name, at = read_text(record.content, 0)
            pairs = read_mapping(record.content, at)
        except (struct.error, ValueError):
            return
        if not pairs:
            return
        key = random.choice(sorted(pairs))
        kind = random.randrange(8)
        if kind == 0:
            del pairs[key]
        elif kind == 1:
            pairs[key] = random.choice(TEXTS).encode('utf-8', 'replace').decode()
        elif kind == 2:
            pairs[key] = damaged_text(pairs[key], random)
        elif kind == 3:
            name = random.choice((b'', b'alf_ros', b'rosbag2', b'\xff'))
        elif kind == 4:
            pairs[key] = '[' * 5000 + ']' * 5000
        else:
            try:
                told = {'': json.loads(pairs[key])}
                spoil(told, random)
                pairs[key] = json.dumps(told.get('', 0))
            except (ValueError, RecursionError):
                pairs[key] = damaged_text(pairs[key], random)
        pairs = {k: v.encode('utf-8', 'replace').decode() for k, v in pairs.items()}
        record.content = text(name) + mapping(pairs)
        if random.randrange(6) == 0:
            record.content = damaged(record.content, random)

    def _schema(self, parts: list[Record], random: Random) -> None:
        record = self._some(parts, SCHEMA, random)
        if record is None:
            return
        try:
            name, at = read_text(record.content, 2)
            encoding, at = read_text(record.content, at)
            definition = read_text(record.content, at)[0].decode()
        except (struct.error, ValueError):
            return
        lines = definition.splitlines()
        at = random.randrange(len(lines) or 1)
        kind = random.randrange(8)
        if kind == 0:
            name = random.choice((b'', b'a', b'a/b', b'a/msg/B', b'std_msgs/msg/Float64', b'\xff'))
        elif kind == 1 and lines:
            lines[at] = random.choice((lines[at] * 2, '', *lines))
        elif kind == 2:
            own = name.decode('utf-8', 'replace').replace('/msg/', '/')
            lines.insert(at, random.choice((f'{own} inner', f'{own}[2] inner', f'{own}[] inner')))
        elif kind == 3:
            sizes = random.choice(('[4294967295]', '[1000000000]', '[-1]', '[]', '[<=3]', '[0]'))
            lines.insert(at, f'float64{sizes} more')
        elif kind == 4:
            lines.insert(
                at, random.choice(('string[] a', 'wstring b', 'bool[100000000] c', 'X y'))
            )
        elif kind == 5 and lines:
            del lines[at]
        elif kind == 6:  # many, each of many of the next
            kinds = ''.join(f'\n===\nMSG: a/T{k}\nT{k + 1}[100] x' for k in range(9))
            lines += [*kinds.splitlines(), '===', 'MSG: a/T9', '']
            lines.insert(0, 'a/T0 deep')
        else:
            lines = damaged_text(definition, random).splitlines()
        raw = '\n'.join(lines).encode('utf-8', 'replace')
        record.content = record.content[:2] + text(name) + text(encoding) + text(raw)

    def _channel(self, parts: list[Record], random: Random) -> None:
        record = self._some(parts, CHANNEL, random)
        if record is None:
            return
        other = self._some(parts, CHANNEL, random)
        try:
            topic, at = read_text(record.content, 4)
            rest = record.content[at:]
            another = read_text(other.content, 4)[0] if other else b''
        except struct.error:
            return
        kind = random.randrange(5)
        head = bytearray(record.content[:4])
        if kind == 0:
            some = random.choice(TEXTS).encode('utf-8', 'replace')
            topic = random.choice((another, some, topic + b'x', b'\xff'))
        elif kind == 1:
            head[2:4] = random.randrange(8).to_bytes(2, 'little')
        elif kind == 2:
            head[:2] = random.randrange(12).to_bytes(2, 'little')
        else:
            rest = damaged(rest, random)
        record.content = bytes(head) + text(topic) + rest

    def _order(self, parts: list[Record], random: Random) -> None:
        chunks = [part for part in parts if part.code == CHUNK]
        some = random.choice(chunks).inner if chunks and random.randrange(3) else parts
        if not some:
            return
        at, other = random.randrange(len(some)), random.randrange(len(some))
        kind = random.randrange(4)
        if kind == 0:
            del some[at]
        elif kind == 1:
            some[at], some[other] = some[other], some[at]
        elif kind == 2:
            some.insert(other, some[at])
        else:
            some.insert(at, Record(random.randrange(256), damaged(some[at].content, random)))

    def _chunk(self, parts: list[Record], random: Random) -> None:
        chunks = [part for part in parts if part.code == CHUNK]
        if not chunks:
            return
        head = random.choice(chunks).head
        kind = random.randrange(5)
        if kind == 0:
            head['compression'] = random.choice((b'zstd', b'lz4', b'zst', b'\xff\xfe', b'\0'))
        elif kind == 1:
            head['crc'] = random.choice((0, 1, 2**32 - 1))
        elif kind == 2:
            head['size'] = random.choice((0, 100, 6 * 10**9, 2**63, 2**64 - 1))
        elif kind == 3:
            head['packed'] = random.choice((0, 100, 6 * 10**9, 2**63, 2**64 - 1))
        else:
            head['compression'] = b'zstd'
            head['size'] = random.choice((0, 100, 6 * 10**9, 2**32))

    # ------------------------------------------------------------- what is asked

    def check(self, case: bytes) -> str:
        """`verify`, and one of all else that reads logs; raises what it should not, and
        AssertionError for a change that `verify` did not see."""
        from alf_ros.errors import AlfError
        from alf_ros.logs import load, tables
        from alf_ros.logs.comparison import compare, told
        from alf_ros.logs.report.html import page
        from alf_ros.logs.report.summary import account
        from alf_ros.ros.recording.fork import fork
        from alf_ros.ros.recording.recover import recover
        from alf_ros.ros.replay.sources import Recorded, Redriven

        path = self._path
        path.write_bytes(case[1:])
        said = []

        def one(act) -> object:
            try:
                return act()
            except AlfError as error:
                line = str(error)
                assert line.isprintable() and 10 < len(line) < 900, f'not one clear line: {line!r}'
                said.append(line)
                return None

        def replayed(source) -> None:
            for _ in source.items(source.first):
                pass

        out = self.folder / 'out'
        uses = [
            lambda: page([account(load(path))]),
            lambda: tables.to_csv(load(path), self.folder / 'tables'),
            lambda: recover(load(path), out / 'recovered'),
            lambda: replayed(Recorded(load(path))),
        ]
        if not one(lambda: is_long(load(path))):
            result = one(lambda: compare(load(path)))
            if result is not None:
                assert all(line.isprintable() for line in told(load(path), result).splitlines())
                if result.equal:
                    self._same(case, result)
            uses += [
                lambda: fork(load(path), 0.01, {}, out, 'fork'),
                lambda: replayed(Redriven(load(path))),
            ]
        for use in uses if self.every else [uses[sum(case) % len(uses)]]:
            one(use)
        shutil.rmtree(out, ignore_errors=True)
        shutil.rmtree(self.folder / 'tables', ignore_errors=True)
        return 'refused' if said else 'ran'

    def _same(self, case: bytes, result) -> None:
        """The result of another, plain reader is the beginning of the recorded messages.

        A case of the corpus may come from another machine or release, which its journal says.
        """
        now, before = outputs(case[1:]), self._whole[case[0]]
        now, before = without_origin(now, before), without_origin(before, now)
        for topic, messages in now.items():
            known = before.get(topic, [])
            same = len(messages) <= len(known) and all(
                a == b or plain(topic, a) == plain(topic, b)
                for a, b in zip(messages, known, strict=False)
            )
            assert same, f'silent: {topic} was changed, and verify calls it equal'
        # What ends earlier as a whole is a shorter log; where it was cut off, that is told.
        missing = {topic: len(m) - len(now.get(topic, [])) for topic, m in before.items()}
        missing.pop(JOURNAL, None)
        even = result.damage or len({n for t, n in missing.items() if t in now}) <= 1
        assert even, f'silent: {missing} are missing, and verify calls it equal'


def _string(record: Record) -> bytes:
    """The text of a message std_msgs/String."""
    (length,) = struct.unpack_from('<I', record.content, 26)
    return record.content[30 : 30 + length - 1]


def is_long(log) -> bool:
    """Whether to run it again would be right, and take minutes."""
    solvers = [log.info['solver'], *(e['solver'] for e in log.inputs if e['kind'] == 'settings')]
    steps = [solver.get('step') for solver in solvers]
    least = min((h for h in steps if isinstance(h, float) and h > 0.0), default=1.0)
    return (log.survey.last - log.survey.first) * 1e-9 / least > MOST_STEPS
