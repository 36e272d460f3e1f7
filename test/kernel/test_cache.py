"""The cache of machine code: processes on an empty, a full, a stale and a read-only folder."""

import fcntl
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from numba.core import config
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher

from alf_ros.kernel.numba_ext import cache, cache_folder, jit
from support.paths import ROOT

HELPER = 'FACTOR = 2.0\n'
SOURCE = """
import helper
from alf_ros.kernel.numba_ext.jit import by_address, compiled, inner
from numba import types

@inner
def twice(x):
    return helper.FACTOR * x

@compiled
def total(n):
    s = 0.0
    for i in range(n):
        s += twice(i)
    return s

def note(x):
    return twice(x) + 1.0

@inner
def half(x):
    return 0.5 * x

@compiled
def up(x):
    return twice(half(x))

@compiled
def down(x):
    return half(twice(x))
"""
# A process that has imported the compiler, and forks others. They begin to compile at once, every
# other one at the other end. Prints what each computed and how much it compiled.
SCRIPT = """
import ctypes, json, os, sys
from numba.core import event, types
import alf_ros.kernel.numba_ext.jit

imported, told = os.pipe()
waiting, begin = os.pipe()

def compute(n):
    try:
        import sums
        if 'edit' in sys.argv:
            with open('helper.py', 'w') as file:
                file.write('FACTOR = 7.0\\n')
    finally:
        os.write(told, b'.')
    os.read(waiting, 1)
    if 'read-only' in sys.argv and os.geteuid() == 0:  # from now on permissions bind root too
        ctypes.CDLL(None).capset((ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)())
    calls = [
        lambda: sums.total(4), lambda: sums.total(4.5 > 3), lambda: sums.up(1.0) - sums.down(1.0)
    ]
    with event.install_recorder('numba:compile') as recorder:
        if n % 2:
            values = [call() for call in calls[::-1]][::-1]
        else:
            values = [call() for call in calls]
        noted = sums.by_address(types.float64(types.float64))(sums.note)
    starts = [e for _, e in recorder.buffer if e.is_start]
    return [values, noted.ctypes(3.0), len(starts)]

answers = []
for n in range(int(sys.argv[-1])):
    answer, given = os.pipe()
    child = os.fork()
    if not child:
        os.write(given, json.dumps(compute(n)).encode())
        sys.exit(0)
    answers.append((child, answer))
for _ in answers:
    os.read(imported, 1)
os.write(begin, b'.' * len(answers))
for child, answer in answers:
    assert os.waitpid(child, 0)[1] == 0
    print(os.read(answer, 999).decode())
"""
# total of int64 and of bool, twice of whole numbers and of float64; half, up and down
COMPILED = 7
FILES = COMPILED + 2  # with note, and the lock


@pytest.fixture
def folder():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        (folder / 'helper.py').write_text(HELPER)
        (folder / 'sums.py').write_text(SOURCE)
        (folder / 'main.py').write_text(SCRIPT)
        yield folder


def run(folder, *arguments, processes=4):
    """Return what they compute, and how often all of them together compiled a function."""
    env = {
        **os.environ,
        'PYTHONPATH': f'{ROOT}:{folder}',
        'NUMBA_CACHE_DIR': str(folder / 'cache'),
    }
    env['PYTHONDONTWRITEBYTECODE'] = '1'  # Python's cache knows the time of a file to the second
    command = [sys.executable, 'main.py', *arguments, str(processes)]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(told) == processes
    assert all(one[:2] == told[0][:2] for one in told)
    return told[0][0], told[0][1], sum(one[2] for one in told)


def folders(folder):
    """Return the folders of the cache, each with the names of its files."""
    return {
        p.name: sorted(f.name for f in p.iterdir()) for p in (folder / 'cache/alf_ros').iterdir()
    }


def test_four_processes_compile_each_function_once(folder):
    """On an empty cache folder, then on a full one, then on one that an edit made stale."""
    assert run(folder) == ([12.0, 0.0, 0.0], 7.0, COMPILED)
    ((name, files),) = folders(folder).items()
    assert name.startswith('sums-') and len(files) == FILES and 'lock' in files
    assert run(folder, processes=1) == ([12.0, 0.0, 0.0], 7.0, 0)
    assert folders(folder) == {name: files}

    helper = folder / 'helper.py'
    before = helper.stat()
    helper.write_text('FACTOR = 3.0\n')  # as many bytes, at the same time
    os.utime(helper, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert run(folder, processes=2) == ([18.0, 0.0, 0.0], 10.0, COMPILED)
    assert len(folders(folder)) == 2 and folders(folder)[name] == files


def test_a_folder_that_cannot_be_written_is_read(folder):
    run(folder, processes=1)
    (place,) = (folder / 'cache/alf_ros').iterdir()
    gone = next(place.glob('*note*'))
    gone.unlink()
    files = folders(folder)
    for path in (place, place / 'lock', place.parent, place.parent.parent):
        path.chmod(0o555)
    try:
        # a C function is no event of numba's, but what it calls is there
        assert run(folder, 'read-only', processes=1) == ([12.0, 0.0, 0.0], 7.0, 0)
    finally:
        for path in (place.parent.parent, place.parent, place, place / 'lock'):
            path.chmod(0o755)
    assert folders(folder) == files


@pytest.mark.thorough
def test_without_any_folder_each_process_compiles_for_itself(folder):
    (folder / 'cache').write_text('a file where the folder should be')
    assert run(folder, processes=2) == ([12.0, 0.0, 0.0], 7.0, 2 * COMPILED)


def test_what_is_edited_after_its_import_is_not_saved(folder):
    assert run(folder, 'edit', processes=1) == ([12.0, 0.0, 0.0], 7.0, COMPILED)
    ((_, files),) = folders(folder).items()
    assert files == ['lock']
    assert run(folder, processes=1) == ([42.0, 0.0, 0.0], 22.0, COMPILED)


def free(lock):
    """Whether no process holds any lock in a file. Another one asks: none sees its own."""
    script = (
        'import fcntl, sys; fcntl.lockf(open(sys.argv[1], "r+"), fcntl.LOCK_EX | fcntl.LOCK_NB)'
    )
    asked = subprocess.run([sys.executable, '-c', script, lock], capture_output=True, text=True)
    assert not asked.returncode or 'BlockingIOError' in asked.stderr, asked.stderr
    return not asked.returncode


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setattr(config, 'CACHE_DIR', str(tmp_path))
    monkeypatch.setattr(cache_folder.Folder, '_known', {})
    one_more._cache._folder = None
    return tmp_path / 'alf_ros'


@jit.inner
def one_more(x):
    return x + 1


def two_more(x):
    return one_more(one_more(x))


def wrong(x):
    return one_more(x).nothing_of_this_name


def test_a_compilation_that_fails_frees_the_folder(root):
    with pytest.raises(TypingError):
        jit.compiled(wrong)(1)
    (lock,) = root.glob('*/lock')
    assert free(lock)
    assert jit.compiled(two_more)(1) == 3  # and another one locks it again, with what it calls
    assert free(lock)


def test_a_lock_lasts_until_the_function_is_compiled_that_took_it(root):
    jit.compiled(two_more)(1)
    (folder,) = cache_folder.Folder._known.values()
    (lock,) = root.glob('*/lock')
    with folder.locked('caller'):
        with folder.locked('called'), folder.locked('caller'):
            assert not free(lock)
        assert not free(lock)
    assert free(lock)


def test_old_folders_are_removed_unless_they_are_in_use(root):
    old = [root / f'test_cache-{n:024x}' for n in range(cache_folder.KEPT + 3)]
    other = root / 'kernel-0'
    for n, place in enumerate([*old, other]):
        place.mkdir(parents=True)
        (place / 'code').write_text('')
        os.utime(place, (n, n))  # the first is the oldest
    used = os.open(old[1], os.O_RDONLY)
    fcntl.flock(used, fcntl.LOCK_SH)
    try:
        jit.compiled(two_more)(1)
    finally:
        os.close(used)
    new = set(root.iterdir()) - {*old, other}
    assert len(new) == 1 and other.exists()
    assert [place for place in old if place.exists()] == [old[1], *old[-cache_folder.KEPT + 1 :]]


def test_a_file_that_was_not_written_to_its_end_is_compiled_again(root):
    jit.compiled(two_more)(1)
    (code,) = root.glob('*/*two_more*')
    whole = code.read_bytes()
    (folder,) = cache_folder.Folder._known.values()
    _, key = code.name, whole[:64].decode()
    assert folder.read(code.name, key) is not None
    half = len(whole) // 2
    for damaged in (b'', whole[:10], whole[:-1], whole[:half] + bytes(len(whole) - half)):
        code.write_bytes(damaged)
        assert folder.read(code.name, key) is None
    assert folder.read(code.name, key.swapcase()) is None


def test_what_a_function_calls_is_in_its_digest():
    """Compiled code calls only compiled code of the kernel and of its own folder."""
    for path in (ROOT / 'alf_ros').rglob('*.py'):
        text = path.read_text()
        if 'numba_ext.jit import' in text and 'numba_ext' not in path.parts:
            name = '.'.join(path.relative_to(ROOT).with_suffix('').parts)
            __import__(name.removesuffix('.__init__'))
    seen = 0
    for name, module in list(sys.modules.items()):
        for function in list(vars(module).values()) if name.startswith('alf_ros.') else ():
            kept = getattr(function, '_cache', None)
            if not isinstance(kept, cache.Cache) or not isinstance(function, CPUDispatcher):
                continue
            seen += 1
            for used in function.py_func.__code__.co_names:
                called = function.py_func.__globals__.get(used)
                if isinstance(called, CPUDispatcher):
                    path = called.__module__.replace('.', '/').removeprefix('alf_ros/') + '/'
                    within = kept._sources.package
                    assert any(path.startswith(f'{one}/') for one in within), (name, used)
    assert seen > 100


def test_where_code_is_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(config, 'CACHE_DIR', '')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    ours, users = cache_folder.roots()
    assert ours == ROOT / 'alf_ros/__pycache__/compiled'
    assert sys.platform == 'darwin' or users == tmp_path / 'alf_ros'
    monkeypatch.setattr(config, 'CACHE_DIR', '/given')
    assert cache_folder.roots() == [Path('/given/alf_ros')]
