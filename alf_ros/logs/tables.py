"""A log as tables: pandas, CSV, Parquet. One table for each topic of numbers, SI, `t` in s.

pandas and pyarrow are imported where they are asked for; CSV needs neither.
"""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.logs import progress
from alf_ros.logs.log import Log
from alf_ros.logs.series import NUMERIC, Series
from alf_ros.paths import put, replacing

if TYPE_CHECKING:
    import pandas


def table(log: Log, series: Series) -> dict[str, Floats | Integers]:
    """The columns of a series by label, stamp (ns) and t (s) before them."""
    return {'stamp': series.stamp, 't': log.time(series.stamp), **series.labelled()}


def frame(log: Log, topic: str) -> pandas.DataFrame:
    """A topic as a pandas DataFrame with the index t (s). Raises InputError without pandas."""
    try:
        import pandas
    except ImportError:
        raise InputError('DataFrames need pandas: pip install pandas') from None
    return pandas.DataFrame(table(log, log.read(topic))).set_index('t')


def to_csv(log: Log, folder: Path, report: progress.Report = progress.silent) -> list[Path]:
    """`<topic>.csv` of every topic of numbers, and inputs.jsonl; numbers read back exactly.

    Raises InputError if the folder cannot be written.
    """
    writers: dict[str, Any] = {}
    paths = [_inputs(log, folder)]
    try:
        with ExitStack() as files:  # closed within: the rest of a file is written then
            for series, path in _numeric(log, folder, '.csv', report):
                columns = table(log, series)
                if series.topic not in writers:
                    target = files.enter_context(replacing(path))
                    stream = files.enter_context(open(target, 'w', newline='', encoding='utf-8'))
                    writers[series.topic] = csv.writer(stream)
                    writers[series.topic].writerow(columns)
                    paths.append(path)
                lists = (column.tolist() for column in columns.values())
                writers[series.topic].writerows(zip(*lists, strict=True))
    except OSError as error:
        raise InputError(f'cannot be written: {error.strerror}', file=str(folder)) from None
    return paths


def to_parquet(log: Log, folder: Path, report: progress.Report = progress.silent) -> list[Path]:
    """`<topic>.parquet` of every topic of numbers, and inputs.jsonl.

    Raises InputError without pyarrow, or if the folder cannot be written.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError('Parquet needs pyarrow: pip install pyarrow') from None
    writers: dict[str, Any] = {}
    paths = [_inputs(log, folder)]
    try:
        with ExitStack() as files:  # closed within: the end of a file is written then
            for series, path in _numeric(log, folder, '.parquet', report):
                columns = {key: np.ascontiguousarray(c) for key, c in table(log, series).items()}
                made = pyarrow.table(columns)
                if series.topic not in writers:
                    target = files.enter_context(replacing(path))
                    writer = pyarrow.parquet.ParquetWriter(target, made.schema)
                    writers[series.topic] = files.enter_context(writer)
                    paths.append(path)
                writers[series.topic].write_table(made)
    except OSError as error:
        raise InputError(f'cannot be written: {error}', file=str(folder)) from None
    return paths


def _inputs(log: Log, folder: Path) -> Path:
    path = folder / 'inputs.jsonl'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        put(path, ''.join(f'{json.dumps(entry)}\n' for entry in log.inputs))
    except OSError as error:
        raise InputError(f'cannot be written: {error.strerror}', file=str(folder)) from None
    return path


def _numeric(
    log: Log, folder: Path, suffix: str, report: progress.Report
) -> Iterator[tuple[Series, Path]]:
    """Series of numbers and the file of each; a topic whose names change gets another file."""
    seen: dict[str, list[tuple[str, ...]]] = {}
    stems = _stems(log.survey.counts)
    for piece in log.pieces(report=report):
        for series in piece:
            if series.type not in NUMERIC:
                continue
            known = seen.setdefault(series.topic, [])
            if series.names not in known:
                known.append(series.names)
            number = known.index(series.names)
            stem = stems[series.topic] + (f'-{number}' if number else '')
            topic = f'{series.topic}#{number}' if number else series.topic
            yield _renamed(series, topic), folder / f'{stem}{suffix}'


def _stems(topics: Collection[str]) -> dict[str, str]:
    """The name of a file for each topic. `/a/b_c` and `/a_b/c` differ in two underscores in a
    row, which no name in ROS has."""
    found = {topic: topic.strip('/').replace('/', '_') for topic in topics}
    often = Counter(found.values())
    twice = [topic for topic, stem in found.items() if often[stem] > 1]
    return found | {topic: topic.strip('/').replace('/', '__') for topic in twice}


def _renamed(series: Series, topic: str) -> Series:
    return series if series.topic == topic else Series(**{**vars(series), 'topic': topic})
