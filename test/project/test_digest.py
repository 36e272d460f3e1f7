"""Digests find what they are of, and old names of modules say the new one."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from alf_ros import digest as module
from alf_ros import moved
from alf_ros.digest import digest


def test_a_name_that_is_not_there_is_an_error() -> None:
    with pytest.raises(FileNotFoundError, match='kernels'):
        digest('kernel', 'kernels')
    with pytest.raises(FileNotFoundError, match='logs/report/page'):
        digest('logs/report/page')  # no Python in it


def test_text_and_place_of_every_file_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, '_PACKAGE', tmp_path)
    found = []
    deep = tmp_path / 'room' / 'deeper'
    deep.mkdir(parents=True)
    for name, text in (('a.py', '1'), ('deeper/b.py', '2'), ('a.py', '3'), ('deeper/c.py', '')):
        (tmp_path / 'room' / name).write_text(text)
        digest.cache_clear()
        found.append(digest('room'))
    (deep / 'c.py').rename(deep / 'd.py')
    digest.cache_clear()
    found.append(digest('room'))
    assert len(set(found)) == len(found)
    digest.cache_clear()


@pytest.mark.parametrize('old', moved._NOW)
def test_an_old_name_says_the_new_one(old: str) -> None:
    new = moved._NOW[old]
    with pytest.raises(ModuleNotFoundError, match=f'it is {new} now'):
        importlib.import_module(old)
    importlib.import_module(new)
