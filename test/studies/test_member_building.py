"""A member has the bits that it has alone, whatever the process has built before."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from alf_ros import Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.kernel import Mass
from alf_ros.mechanism.memory import ResultMemory, exactly, remembered
from alf_ros.model.compile import allocate
from alf_ros.model.struct_memory import StructMemory, changed, frozen, made
from alf_ros.scene.overrides import with_changes
from support.member_bits import MEMBERS, base, bits

TESTS = Path(__file__).parents[1]


@pytest.fixture(scope='module')
def alone() -> list[str]:
    """The digest of each member that is built in a process of its own."""
    command = [sys.executable, '-m', 'support.member_bits']
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_members_differ(alone: list[str]) -> None:
    assert len(alone) == len(MEMBERS)
    # 0.0 and -0.0 in `com` and in a direction give the same numbers; all others differ
    assert len(set(alone)) >= len(MEMBERS) - 2
    assert sum('Error' in each for each in alone) == 1


def test_one_after_another(alone: list[str]) -> None:
    order = [*range(len(MEMBERS)), *reversed(range(len(MEMBERS)))]
    assert [bits(*MEMBERS[n]) for n in order] == [alone[n] for n in order]


def test_in_threads(alone: list[str]) -> None:
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda member: bits(*member), MEMBERS[:9] * 4))
    assert found == alone[:9] * 4


def test_text_of_a_changed_scene_loads_to_it() -> None:
    for name, changes in MEMBERS[:4]:
        scene = with_changes(base(name), changes)
        again = pickle.loads(pickle.dumps(scene))
        assert again == scene and again.text == scene.text
        loaded = with_changes(load_scene(name), changes)
        assert loaded.text == scene.text and loaded.mechanism == scene.mechanism


# ---------------------------------------------------------------------------------------- memories


def test_zeros_of_either_sign_are_different_arguments() -> None:
    calls: list[object] = []

    @remembered(8)
    def seen(value: object) -> int:
        calls.append(value)
        return len(calls)

    nothing = np.zeros(2)
    assert [seen(0.0), seen(-0.0), seen((0.0,)), seen((-0.0,))] == [1, 2, 3, 4]
    assert [seen(nothing), seen(-nothing), seen(nothing.astype(np.float32))] == [5, 6, 7]
    assert [seen(0.0), seen((-0.0,)), seen(np.zeros(2)), seen(np.zeros((1, 2)))] == [1, 4, 5, 8]
    assert seen(1.0) == 9 and seen(0.0) == 1  # the last ones used are kept
    assert seen(-0.0) == 10


def test_a_memory_is_bounded_and_keeps_nothing_large() -> None:
    memory, made_by = ResultMemory(2), []

    def make() -> Floats:
        made_by.append(1)
        return np.zeros(3)

    for n in (1, 2, 3, 3, 2, 1):
        found = memory.found((exactly(n),), make)
        assert not found.flags.writeable
    assert len(made_by) == 4
    large = exactly(tuple(range(100_000)))
    memory.found((large,), make)
    memory.found((large,), make)
    assert len(made_by) == 6


# ----------------------------------------------------------------------------------------- structs


def test_structs_made_quickly_are_those_made_slowly() -> None:
    parts = {
        'diagonal': np.array([1.0, 2.0]),
        'i': np.array([1], dtype=np.uint32),
        'j': np.array([0], dtype=np.uint32),
        'k': np.array([0.5]),
        'skew': np.zeros(0, dtype=np.uint32),
        'w': np.zeros(0),
    }
    slow, quick = Mass(**parts), made(Mass, **parts)
    assert (slow._table == quick._table).all()
    other = np.array([3.0, 4.0])
    again = changed(slow, diagonal=other)
    assert (again._table == Mass(**{**parts, 'diagonal': other})._table).all()
    assert again.diagonal is other and slow.diagonal is parts['diagonal']
    assert not frozen(again).diagonal.flags.writeable
    assert (changed(slow, diagonal=other)._table == again._table).all()  # read-only arrays too
    for wrong in (np.zeros(2, dtype=int), np.zeros((2, 2))[:, 0]):
        with pytest.raises(TypeError, match='Mass.diagonal is no array of float64'):
            changed(slow, diagonal=wrong)


def test_memory_of_a_workspace_is_its_own_and_zero() -> None:
    model = Simulation(load_scene('four_bar')).model
    one, two = (allocate(model, model.system, 4) for _ in range(2))
    one.q[:], one.chart.t[:] = 7.0, 8.0
    assert not two.q.any() and not one.qd.any() and not one.chart.n.any()
    assert one.evaluations.dtype == np.int64 and one.caller.dtype == np.uint64
    for struct in (one, one.chart, one.ended):
        words = {name: word for name, word, _ in vars(struct)['_numba_type_'].parts}
        for name in (field.name for field in fields(struct)):
            if name in ('chart', 'ended', 'trail', 'watch'):
                continue
            array, word = getattr(struct, name), words[name]
            assert struct._table[word + 1] == array.size
            assert not array.size or struct._table[word] == array.ctypes.data
    with pytest.raises(TypeError, match='Mass.i: numbers of uint32'):
        StructMemory(Mass, {'i': 3})
