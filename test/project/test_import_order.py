"""Imports follow the order in doc/design.md, and only the last packages of it import ROS."""

import ast
import functools
import re
import subprocess
import sys

from support.paths import ROOT
from support.syntax import BLOCKS, parsed, statements

PACKAGE = ROOT / 'alf_ros'

# Each imports from itself and from earlier ones; the four from `inspection` to `studies` know
# nothing of each other but in this order.
ROOMS = (
    'errors',
    'arrays',
    'columns',
    'splines',
    'resources',
    'digest',
    'moved',
    'paths',
    'html_table',
    'gc_pause',
    'kernel',
    'mechanism',
    'model',
    'effects',
    'scene',
    'simulation',
    'inspection',
    'exchange',
    'logs',
    'studies',
    'ros',
    'commands',
    '__init__',
    '__main__',
)
ROS_ROOMS = {'ros', 'commands'}
ROS = re.compile(
    r'(rclpy|rosidl\w*|rosbag2\w*|tf2\w*|launch\w*|ament\w*|\w+_(msgs|srvs|interfaces)|mcap\w*)'
)


def modules():
    """Yield (name below alf_ros, path) of every module."""
    for path in sorted(PACKAGE.rglob('*.py')):
        parts = path.relative_to(PACKAGE).with_suffix('').parts
        yield '.'.join(parts[:-1] if parts[1:] and parts[-1] == '__init__' else parts), path


MODULES = dict(modules())


def room(module):
    """The place of a module in the order, by its folder."""
    return ROOMS.index(module.partition('.')[0])


@functools.cache
def imports(path, at_import=False):
    """Return the dotted names a file imports; with `at_import` only what importing it needs."""
    found: set[str] = set()

    def visit(node):
        if at_import and isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            return
        if at_import and isinstance(node, ast.If) and 'TYPE_CHECKING' in ast.unparse(node.test):
            return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path.name}:{node.lineno}: relative import'
            found.update(f'{node.module}.{alias.name}' for alias in node.names)
        for block in BLOCKS:
            for child in getattr(node, block, ()):
                visit(child)

    visit(parsed(path))
    return found


def ours(path, at_import=False):
    """Return the modules of the package that a file imports."""
    found: set[str] = set()
    for name in imports(path, at_import):
        if name.partition('.')[0] != 'alf_ros':
            continue
        below = name.partition('.')[2]
        # `from alf_ros.scene.scene import Scene` names an attribute of the module.
        while below and below not in MODULES:
            below = below.rpartition('.')[0]
        found.add(below or '__init__')
    return found


def test_the_rooms_are_those_of_the_package():
    there = {path.stem for path in PACKAGE.iterdir() if path.suffix == '.py' or path.is_dir()}
    assert there - {'__pycache__'} == set(ROOMS)
    line = re.search(r'^kernel <- .*$', (ROOT / 'doc/design.md').read_text(encoding='utf-8'), re.M)
    packages = [name for name in ROOMS if (PACKAGE / name).is_dir()]
    assert line.group().split(' <- ') == packages and len(packages) == 12


def test_modules_import_only_from_their_rooms_and_earlier_ones():
    late = [
        f'{module} imports {other}'
        for module, path in MODULES.items()
        for other in sorted(ours(path))
        if room(other) > room(module)
    ]
    assert not late, '\n'.join(late)


def test_nothing_of_ours_is_hidden_from_the_interpreter():
    hidden = [
        f'{module}:{node.lineno}: {ast.unparse(node)}'
        for module, path in MODULES.items()
        if module != '__init__'  # it imports when asked
        for node in statements(parsed(path))
        if isinstance(node, ast.If)
        and 'TYPE_CHECKING' in ast.unparse(node.test)
        and 'alf_ros' in ast.unparse(node)
    ]
    assert not hidden, '\n'.join(hidden)


def test_no_circle():
    graph = {module: ours(path, at_import=True) - {module} for module, path in MODULES.items()}
    while free := [module for module, needs in graph.items() if not needs & graph.keys()]:
        for module in free:
            del graph[module]
    assert not graph, f'these import each other: {sorted(graph)}'


def test_only_the_last_rooms_know_ros():
    known = [
        f'{module} imports {name}'
        for module, path in MODULES.items()
        if module.partition('.')[0] not in ROS_ROOMS
        for name in sorted(imports(path))
        if ROS.fullmatch(name.partition('.')[0])
    ]
    assert not known, '\n'.join(known)


WITHOUT_ROS = """
import re, sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if re.fullmatch(sys.argv[1], name.partition('.')[0]):
            raise ImportError('blocked: ' + name, name=name)

sys.meta_path.insert(0, Block())
try:
    import alf_ros.commands.simulator
except ImportError as error:
    assert 'blocked' in str(error)
else:
    sys.exit('nothing was blocked')

from alf_ros import Simulation, load_scene
simulation = Simulation(load_scene('slider_crank'))
before = simulation.sample()
simulation.step(10)
after = simulation.sample()
assert simulation.step_index == 10
assert abs(after.energy - before.energy) < 1e-6 * abs(before.energy)
assert abs(after.q - before.q).max() > 1e-3
"""


def test_the_library_simulates_without_ros_recording_or_plotting():
    blocked = f'{ROS.pattern}|zstandard|lz4|matplotlib'
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, blocked], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
