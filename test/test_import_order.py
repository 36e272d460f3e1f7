"""Imports go one way, and only the last rooms know ROS: the order that doc/design.md states."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'alf_ros'

# Every module of the package, room by room: each imports from its own room and from earlier ones.
ROOMS = {
    'errors': ['errors', 'arrays', 'collector', 'commands', 'resources', 'stamps', 'structs'],
    'kernel': [
        'kernel',
        'kernel.adaptive',
        'kernel.aside',
        'kernel.bearings',
        'kernel.block',
        'kernel.chart',
        'kernel.constraints',
        'kernel.data',
        'kernel.each',
        'kernel.factor',
        'kernel.forces',
        'kernel.implicit',
        'kernel.iteration',
        'kernel.jit',
        'kernel.ledger',
        'kernel.limits',
        'kernel.manifold',
        'kernel.mass',
        'kernel.prescribed',
        'kernel.rank',
        'kernel.residuals',
        'kernel.soft',
        'kernel.softest',
        'kernel.stage',
        'kernel.step',
        'kernel.step_error',
        'kernel.substitution',
        'kernel.tally',
        'kernel.trace',
        'kernel.turns',
        'kernel.twofold',
        'kernel.vectors',
        'kernel.watch',
    ],
    'mechanism': ['mechanism', 'layout', 'form', 'signal'],
    'model': [
        'model',
        'arms',
        'assembly',
        'auxiliary',
        'branching',
        'consistency',
        'coordinates',
        'disk',
        'driving',
        'linearised',
        'mass',
        'modes',
        'orientation',
        'pattern',
        'penalty',
        'prescribed',
        'rank',
        'reactions',
        'rolling',
        'rotor',
        'row',
        'rows',
        'row_arrays',
        'signal_machine',
        'soft',
        'teeth',
    ],
    'effects': [
        'effects',
        'affine',
        'curve',
        'effect_file',
        'measure',
        'table',
        'effects.contract',
        'effects.gravity',
        'effects.constant_wrench',
        'effects.joint_effort',
        'effects.damper',
        'effects.drag',
        'effects.ground_contact',
        'effects.joint_friction',
        'effects.joint_stop',
        'effects.motor',
        'effects.spring',
        'effects.torsion_spring',
        'effects.user_table',
    ],
    'scene': [
        'scene',
        'effect_values',
        'document',
        'expression',
        'mechanism_bodies',
        'mechanism_check',
        'mechanism_drives',
        'mechanism_file',
        'mechanism_gears',
        'mechanism_joints',
        'mechanism_orient',
        'number_file',
        'repetition',
        'scene_changes',
        'scene_effects',
        'schema',
        'schema_command',
        'assignment',
        'import_command',
        'loop_file',
        'mjcf_import',
        'robot',
        'robot_file',
        'urdf_import',
        'urdf_loops',
        'serialise',
    ],
    'simulation': [
        'simulation',
        'state',
        'failures',
        'accuracy',
        'applied',
        'bearings',
        'call_cost',
        'ledger',
        'input_checks',
        'efforts',
        'integrator',
        'passes',
        'placement',
        'resolution',
        'formulations',
        'formulations.adams',
        'formulations.alf1',
        'formulations.alf2',
        'formulations.baumgarte',
        'formulations.dense',
        'formulations.independent',
        'formulations.lagrange_canonical',
        'formulations.runge_kutta',
        'formulations.saddle',
        'formulations.storage',
        'limits',
        'sample',
        'stiffness',
        'exact',
        'reference_motion',
        'trial',
        'check',
        'error_plot',
        'hard_cases',
        'campaign',
        'landing',
        'display',
        'progress_bar',
        'work_precision',
        'work_plot',
        'work_reference',
        'work_report',
        'work_trial',
        'reduced',
        'readings',
        'saved_states',
        'settings',
        'state_vector',
        'starting_states',
        'comparison',
        'published',
        'table_one',
        'figures',
        'figure_plot',
        'figure_scan',
        'price',
        'provenance',
        'price_plot',
        'effects_command',
        'mechanism_plot',
        'outline',
        'plot_canvas',
        'soundness',
        'sweep',
    ],
    'logs': [
        'logs',
        'analysis',
        'analysis.account',
        'analysis.analyze',
        'analysis.gathered',
        'analysis.motion',
        'analysis.nearness',
        'analysis.orders',
        'analysis.page',
        'analysis.panels',
        'analysis.reports',
        'analysis.trace',
        'logs.arguments',
        'logs.cdr',
        'logs.comparison',
        'logs.container',
        'logs.export',
        'logs.journal',
        'logs.log',
        'logs.progress',
        'logs.rerun',
        'logs.resume',
        'logs.series',
        'logs.verify',
    ],
    'messages': [
        'messages',
        'markers',
        'topics',
        'transforms',
        'urdf',
        'export_command',
    ],
    'recorder': ['recorder', 'bag', 'log_file', 'log_run', 'recover', 'fork'],
    'node': [
        'node',
        'command_messages',
        'control',
        'diagnostics',
        'entities',
        'inputs',
        'outputs',
        'pacing',
        'parameters',
        'playback',
        'replay',
        'reporting',
        'run',
        'services',
        'simulation_services',
        'simulator',
        'spinning',
        'startup',
        'status',
        'trajectories',
        'view',
        'view_commands',
        'view_node',
        'view_server',
        'foxglove_bridge',
    ],
    'entry': ['__init__', '__main__'],
}
ROOM = {module: room for room, modules in ROOMS.items() for module in modules}
RANK = {room: rank for rank, room in enumerate(ROOMS)}

ROS_ROOMS = {'messages', 'recorder', 'node'}
# Command modules outside these rooms that may import ROS packages or mcap: none so far.
ROS_MODULES: set[str] = set()
ROS = re.compile(
    r'(rclpy|rosidl\w*|rosbag2\w*|tf2\w*|launch\w*|ament\w*|\w+_(msgs|srvs|interfaces)|mcap\w*)'
)


def modules():
    """Yield (name below alf_ros, path) of every module."""
    for path in sorted(PACKAGE.rglob('*.py')):
        parts = path.relative_to(PACKAGE).with_suffix('').parts
        yield '.'.join(parts[:-1] if parts[1:] and parts[-1] == '__init__' else parts), path


MODULES = dict(modules())
PLACED = sorted(MODULES.keys() & ROOM.keys())


def imports(path, at_import=False):
    """Return the dotted names a file imports; with `at_import` only what importing it needs."""
    found = set()

    def visit(node):
        if at_import and isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            return
        if at_import and isinstance(node, ast.If) and 'TYPE_CHECKING' in ast.unparse(node.test):
            return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path.name}:{node.lineno}: relative import'
            found.update(f'{node.module}.{alias.name}' for alias in node.names)
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(ast.parse(path.read_text(encoding='utf-8')))
    return found


def ours(path, at_import=False):
    """Return the modules of the package that a file imports."""
    found = set()
    for name in imports(path, at_import):
        if name.partition('.')[0] != 'alf_ros':
            continue
        below = name.partition('.')[2]
        # `from alf_ros.scene import Scene` names an attribute of the module.
        while below and below not in MODULES:
            below = below.rpartition('.')[0]
        found.add(below or '__init__')
    return found


def test_rooms_stand_as_the_design_says():
    line = re.search(r'^errors <- .*$', (ROOT / 'doc/design.md').read_text(encoding='utf-8'), re.M)
    stated = line.group().split(' <- ')
    assert stated == [room for room in ROOMS if room in stated]
    assert set(ROOMS) - set(stated) == {'entry'}


def test_every_module_has_its_place():
    assert set(MODULES) == set(ROOM), 'ROOMS above and the files of alf_ros differ'


@pytest.mark.parametrize('module', PLACED)
def test_a_module_imports_only_from_its_room_and_earlier_ones(module):
    others = ours(MODULES[module]) & ROOM.keys()
    late = {other for other in others if RANK[ROOM[other]] > RANK[ROOM[module]]}
    assert not late, f'{module} ({ROOM[module]}) imports {late}'


def test_no_circle():
    graph = {module: ours(path, at_import=True) - {module} for module, path in MODULES.items()}
    while free := [module for module, needs in graph.items() if not needs & graph.keys()]:
        for module in free:
            del graph[module]
    assert not graph, f'these import each other: {sorted(graph)}'


@pytest.mark.parametrize('module', PLACED)
def test_only_the_last_rooms_know_ros(module):
    known = {name for name in imports(MODULES[module]) if ROS.fullmatch(name.partition('.')[0])}
    if ROOM[module] not in ROS_ROOMS and module not in ROS_MODULES:
        assert not known


WITHOUT_ROS = """
import re, sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if re.fullmatch(sys.argv[1], name.partition('.')[0]):
            raise ImportError('blocked: ' + name, name=name)

sys.meta_path.insert(0, Block())
try:
    import alf_ros.node
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
