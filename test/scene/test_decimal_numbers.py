"""Numbers of URDF, SDF and tables: what their C++ readers take, and not all that Python does."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from alf_ros import InputError
from alf_ros.exchange.import_file import imported
from alf_ros.scene.text import number_table
from alf_ros.scene.text.decimal_numbers import decimal
from support.imported_motions import saved

URDF = (
    '<robot name="r"><link name="base"/><link name="bar"><inertial><mass value="{}"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="pin" type="continuous"><parent link="base"/><child link="bar"/></joint></robot>'
)
SDF = (
    '<sdf version="1.9"><model name="m"><link name="bar"><inertial><mass>{}</mass></inertial>'
    '</link><joint name="pin" type="revolute"><parent>world</parent><child>bar</child><axis>'
    '<xyz>0 1 0</xyz><limit><upper>{}</upper></limit></axis></joint></model></sdf>'
)
FOREIGN = ('1_0', 'infinity', '1e3j', '0x10', '\u0663', '1e', '.', '+-1', '')


@pytest.mark.parametrize('word', ['10', '1.', '.5', '-0.5E+3', '+1e-3'])
def test_numbers(word: str) -> None:
    assert decimal(word) == float(word)


def test_numbers_without_a_finite_value() -> None:
    assert decimal('-INF') == -math.inf and math.isnan(decimal('nan'))


@pytest.mark.parametrize('word', FOREIGN)
def test_words_that_are_no_numbers(word: str) -> None:
    with pytest.raises(ValueError):
        decimal(word)


def test_files_with_numbers_of_python_are_refused(tmp_path: Path) -> None:
    def read(name: str, text: str) -> str:
        return imported(saved(tmp_path, name, text))

    with pytest.raises(InputError, match='link bar: mass value: not a number, got .1_0'):
        read('it.urdf', URDF.format('1_0'))
    with pytest.raises(InputError, match='bar: not usable numbers, got .1_0'):
        read('it.sdf', SDF.format('1_0', '1'))
    with pytest.raises(InputError, match='pin: not a number, got .1_0'):
        read('it.sdf', SDF.format('1', '1_0'))
    assert 'limits' not in read('it.sdf', SDF.format('1', 'inf'))


def test_a_table_with_numbers_of_python_is_refused(tmp_path: Path) -> None:
    """`1_0` was 10 without a word, although 1.0 may have been meant."""
    assert number_table.read(Path(saved(tmp_path, 'it.csv', 't,x\n0, 1\n1,+2e0 \n'))) == (
        (0, 1),
        (1, 2),
    )
    for word in ('1_0', '\u0663'):
        with pytest.raises(InputError, match='it.csv:2: not a row of numbers: column 2 of 2'):
            number_table.read(Path(saved(tmp_path, 'it.csv', f'0,1\n1,{word}\n')))
