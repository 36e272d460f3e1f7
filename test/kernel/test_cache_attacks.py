"""The cache of machine code: killed and stopped processes, a full disk, sources that change.

Whatever happens, what runs is the code of the sources that were imported.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba.core import config

from alf_ros.kernel.numba_ext import cache_folder, jit
from support.paths import ROOT

# A process that has imported the compiler, and forks one for each run: `run` gives what it
# computed and compiled, or the signal that ended or stopped it.
PROCESSES = """
import json, os, resource, signal, sys
from pathlib import Path
from numba.core import event
from alf_ros.kernel.numba_ext import cache_folder

cache_folder.PATIENCE = 0.2
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
ROOT = cache_folder.roots()[0]

def write(factor):  # as many bytes, at the same time
    Path('law.py').write_text(LAW.replace('FACTOR', str(factor)))
    os.utime('law.py', (1, 1))

def compute(answer, function):
    import law
    with event.install_recorder('numba:compile') as recorder:
        value = getattr(law, function)(4)
    compiled = sum(one.is_start for _, one in recorder.buffer)
    os.write(answer, json.dumps([value, compiled]).encode())

def start(before=None, function='total'):
    answer, given = os.pipe()
    child = os.fork()
    if not child:
        os.close(answer)
        if before:
            before()
        compute(given, function)
        os._exit(0)
    os.close(given)
    return child, answer

def end(child, answer, options=0):
    _, status = os.waitpid(child, options)
    if os.WIFSTOPPED(status):
        return signal.Signals(os.WSTOPSIG(status)).name
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return json.loads(os.read(answer, 999))

def run(before=None, function='total'):
    return end(*start(before, function))

def at(name, do, nth=1):
    'Calls a function before the nth file of code is opened, or gets its name.'
    left = list(range(nth))
    def hook(event, arguments):
        if event == name and left and str(arguments[0]).endswith('.new'):
            left.pop()
            if not left:
                do()
    return lambda: sys.addaudithook(hook)

def kill():
    os.kill(os.getpid(), signal.SIGKILL)

def stop():
    os.kill(os.getpid(), signal.SIGSTOP)

def room(size, action):
    'No file may be longer: the kernel kills who writes on, or refuses it as a full disk does.'
    def before():
        signal.signal(signal.SIGXFSZ, action)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    return before

LAW = '''
from alf_ros.kernel.numba_ext.jit import compiled, inner

@inner
def twice(x):
    return FACTOR * x

@compiled
def total(n):
    s = 0
    for i in range(n):
        s += twice(i)
    return s

@compiled
def other(x):
    return x - FACTOR
'''
"""
OVERLOADS = 2  # of total and of twice


def processes(folder: Path, script: str) -> Any:
    """The output of a script with the functions above, run in a folder with its own cache."""
    (folder / 'main.py').write_text(PROCESSES + script)
    env = {**os.environ, 'PYTHONPATH': f'{ROOT}:{folder}', 'PYTHONDONTWRITEBYTECODE': '1'}
    env['NUMBA_CACHE_DIR'] = str(folder / 'cache')
    done = subprocess.run(
        [sys.executable, 'main.py'], cwd=folder, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


KILLED = """
instants = [
    at('open', kill), room(1, signal.SIG_DFL), room(200, signal.SIG_DFL),
    room(4096, signal.SIG_DFL), at('os.rename', kill), at('open', kill, 2),
]
def unfinished():
    return set(ROOT.glob('*/*.new'))
found = []
for n, instant in enumerate(instants):
    write(n + 2)
    before = unfinished()
    how = run(instant)
    left = unfinished() - before
    if n % 2:  # the sources change
        write(n + 102)
    found.append([how, len(left), run(), run(), len(left & unfinished())])
print(json.dumps(found))
"""


def test_killed_at_any_instant_of_a_save(tmp_path: Path) -> None:
    """Before and while a file is written, before it gets its name, and between two of them."""
    found = processes(tmp_path, KILLED)
    hows = ['SIGKILL', 'SIGXFSZ', 'SIGXFSZ', 'SIGXFSZ', 'SIGKILL', 'SIGKILL']
    assert [one[0] for one in found] == hows
    assert [one[1] for one in found] == [0, 1, 1, 1, 1, 0]
    for n, (_, _, (value, compiled), again, left) in enumerate(found):
        changed = n % 2
        assert value == (n + 102 if changed else n + 2) * 6
        assert compiled <= OVERLOADS and again == [value, 0]
        assert changed or left == 0  # who compiles there removes what was not finished


FULL = """
write(3)
first = run(room(0, signal.SIG_IGN))
second = run(room(1000, signal.SIG_IGN))
files = sorted(path.name for path in ROOT.glob('*/*'))
print(json.dumps([first, second, files, run(), run()]))
"""


def test_a_full_disk_costs_time_only(tmp_path: Path) -> None:
    first, second, files, third, fourth = processes(tmp_path, FULL)
    assert first == second == third == [18, OVERLOADS] and fourth == [18, 0]
    assert files == ['lock']


EDITED = """
write(5)
def edit():
    write(7)
first = run(at('open', edit))  # while the first file is opened: what comes after is not saved
files = sum(path.name != 'lock' for path in ROOT.glob('*/*'))
print(json.dumps([first, files, run(), run()]))
"""


@pytest.mark.thorough
def test_sources_that_change_while_code_is_saved(tmp_path: Path) -> None:
    assert processes(tmp_path, EDITED) == [[30, OVERLOADS], 1, [42, OVERLOADS], [42, 0]]


STOPPED = """
write(2)
holder = start(at('open', stop))
found = [end(*holder, os.WUNTRACED)]
found += [run(), run()]  # waits for its patience; finds all
os.kill(holder[0], signal.SIGCONT)
found += [end(*holder), run()]
print(json.dumps(found))
"""


def test_nobody_waits_for_ever_for_a_stopped_process(tmp_path: Path) -> None:
    stopped, waiter, reader, holder, last = processes(tmp_path, STOPPED)
    assert stopped == 'SIGSTOP'
    assert waiter == [12, OVERLOADS] and reader == [12, 0]
    assert holder == [12, OVERLOADS] and last == [12, 0]


BESIDE = """
write(2)
holder = start(at('open', stop))
found = [end(*holder, os.WUNTRACED)]
cache_folder.PATIENCE = 1e9
found.append(run(lambda: signal.alarm(60), 'other'))  # ends it if it waits
os.kill(holder[0], signal.SIGCONT)
print(json.dumps([*found, end(*holder), run(), run(function='other')]))
"""


@pytest.mark.thorough
def test_functions_are_compiled_side_by_side(tmp_path: Path) -> None:
    """A process stops while it compiles `total`; another one compiles `other`."""
    found = processes(tmp_path, BESIDE)
    assert found == ['SIGSTOP', [2, 1], [12, OVERLOADS], [12, 0], [2, 0]]


DAMAGED = """
write(2)
found = [run()]
for path in ROOT.glob('*/law.*'):
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 4
    path.write_bytes(whole)
print(json.dumps([*found, run(), run()]))
"""


def test_damaged_files_are_compiled_again(tmp_path: Path) -> None:
    assert processes(tmp_path, DAMAGED) == [[12, OVERLOADS], [12, OVERLOADS], [12, 0]]


@jit.inner
def one_more(x: Any) -> Any:
    return x + 1


def one_more_at_least(x: Any) -> Any:
    return one_more(x)


def test_one_bit_wherever_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every bit of the head, bits all over the code, and every length that lacks something."""
    monkeypatch.setattr(config, 'CACHE_DIR', str(tmp_path))
    monkeypatch.setattr(cache_folder.Folder, '_known', {})
    monkeypatch.setattr(one_more._cache, '_folder', None)
    assert jit.compiled(one_more_at_least)(1) == 2
    (folder,) = cache_folder.Folder._known.values()
    (code,) = tmp_path.glob('alf_ros/*/*one_more_at_least*')
    whole = code.read_bytes()
    key = whole[:64].decode()
    assert folder.read(code.name, key) is not None
    bits = [*range(8 * 130), *range(8 * 130, 8 * len(whole), 997)]
    assert len(bits) > 1000
    for bit in bits:
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        code.write_bytes(damaged)
        assert folder.read(code.name, key) is None, bit
    for length in [*range(140), *range(140, len(whole), 401)]:
        code.write_bytes(whole[:length])
        assert folder.read(code.name, key) is None, length
    code.write_bytes(whole)
    assert folder.read(code.name, key) is not None


# a process that runs a scene, during which its sources are edited, and loads others
RUNNING = """
import json
from pathlib import Path
import alf_ros
from alf_ros import AlfError, Simulation, load_scene

assert Path(alf_ros.__file__).is_relative_to(Path.cwd())

def fall(effects):
    scene = {'mechanism': 'pendulum', 'effects': effects}
    simulation = Simulation(load_scene(scene), step=1e-3, integrator='rk4')
    simulation.step(20)
    return simulation.sample().q.tobytes().hex()

LAWS = [{'gravity': {'acceleration': [0, -9.81]}}, {'drag': {'on': 'A', 'linear': 0.5}},
        {'damper': {'between': ['A', 'O'], 'damping': 3}}]
"""
EDITS = """
def edit(path):
    with open(path, 'a') as file:
        file.write('# edited\\n')

found = [fall(LAWS[0])]
edit('alf_ros/kernel/stage.py')
found += [fall(LAWS[0]), fall(LAWS[1])]
edit('alf_ros/effects/damper.py')
try:
    fall(LAWS[2])
except AlfError as error:
    found.append(str(error))
print(json.dumps(found))
"""
# where code of the sources as they are now would be kept
PLACES = """
from numba.core.registry import cpu_target
from alf_ros.kernel.numba_ext.cache_folder import Folder
from alf_ros.kernel.numba_ext.cache_sources import Sources

magic = cpu_target.target_context.codegen().magic_tuple()
sources = Sources('kernel', ('kernel',), {}), Sources('effects', ('kernel', 'effects'), {})
print(json.dumps([str(place) for one in sources for place in Folder.of(one, magic)._places]))
"""


@pytest.mark.thorough
def test_sources_of_the_package_that_change_while_it_runs(tmp_path: Path) -> None:
    """Imported code still runs, and saves nothing; a law whose source has changed is refused."""
    shutil.copytree(
        ROOT / 'alf_ros', tmp_path / 'alf_ros', ignore=shutil.ignore_patterns('__pycache__')
    )
    for name in ('config', 'package.xml'):
        (tmp_path / name).symlink_to(ROOT / name)
    # what is compiled is the same here: it need not be compiled again
    (tmp_path / 'cache').mkdir()
    there = cache_folder.roots()[0]
    there.mkdir(parents=True, exist_ok=True)
    (tmp_path / 'cache/alf_ros').symlink_to(there)
    env = {**os.environ, 'PYTHONPATH': str(tmp_path), 'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}

    def told(script: str) -> Any:
        done = subprocess.run(
            [sys.executable, '-c', script], cwd=tmp_path, env=env, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    expected = told(RUNNING + 'print(json.dumps([fall(law) for law in LAWS[:2]]))')
    assert all(Path(place).exists() for place in told(RUNNING + PLACES))
    *found, refused = told(RUNNING + EDITS)
    assert found == [expected[0], *expected] and expected[0] != expected[1]
    assert refused.startswith(f'{tmp_path}/alf_ros/effects/damper.py: edited since')
    assert not any(Path(place).exists() for place in told(RUNNING + PLACES))
