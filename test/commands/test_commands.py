"""`python -m alf_ros`: what it lists, and how every command ends."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from alf_ros import __main__ as program
from alf_ros.commands import COMMANDS
from alf_ros.commands import fork as fork_command
from alf_ros.commands.parser import Parser, numbers, writing_into
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError, StepError
from support.thorough import thinned

BLOCK = """
import sys
from types import ModuleType

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {blocked}:
            raise ModuleNotFoundError('No module named ' + repr(name), name=name)

sys.meta_path.insert(0, Block())
from alf_ros.__main__ import main
sys.exit(main({argv}))
"""


def run_without(blocked, *argv):
    code = BLOCK.format(blocked=set(blocked), argv=list(argv))
    return subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)


def one_line(text):
    assert text.endswith('\n') and text.count('\n') == 1
    return text


@pytest.fixture
def command(monkeypatch):
    """Make a function the command `try`; returns what main() returns for it."""

    module = ModuleType('alf_ros.try')

    def run(function, *argv):
        monkeypatch.setattr(module, 'main', function, raising=False)
        monkeypatch.setattr(program, 'COMMANDS', {'try': 'alf_ros.try'})
        monkeypatch.setitem(sys.modules, 'alf_ros.try', module)
        monkeypatch.setattr(sys, 'argv', ['before'])
        return program.main(['try', *argv])

    return run


def raiser(error):
    def function(argv):
        raise error

    return function


def test_help_lists_every_command_without_a_heavy_import():
    heavy = ['numpy', 'numba', 'scipy', 'yaml', 'rclpy', 'mcap']
    done = run_without(heavy, '--help')
    assert (done.returncode, done.stderr) == (0, '')
    for name in COMMANDS:
        (line,) = [line for line in done.stdout.splitlines() if line.startswith(f'  {name} ')]
        assert len(line.split()) > 3, 'every command has a line of help'


@pytest.mark.parametrize('name', COMMANDS)
def test_help_names_the_command_as_its_errors_do(name, capsys, request):
    try:
        assert program.main([name, '--help']) == 2
        said = capsys.readouterr().err
        assert 'make setup' in said, said
        assert request.config.getoption('--without-ros'), 'all libraries are there otherwise'
        pytest.skip(said)  # a library is missing
    except SystemExit as end:
        assert end.code == 0
    assert capsys.readouterr().out.startswith(f'usage: alf_ros {name} [-h]')


def test_no_command_is_a_usage_error(capsys):
    assert program.main([]) == 2
    assert 'usage:' in capsys.readouterr().err


def test_unknown_command_names_the_nearest(capsys):
    assert program.main(['simulatr']) == 2
    assert "did you mean 'simulator'?" in one_line(capsys.readouterr().err)


def test_missing_library_is_one_line():
    done = run_without(['rclpy'], 'simulator')
    assert (done.returncode, done.stdout) == (2, '')
    assert "No module named 'rclpy'" in one_line(done.stderr)


@pytest.mark.parametrize(
    ('library', 'name', 'text'),
    thinned(
        [
            ('urdf_parser_py', 'r.urdf', '<robot name="r"><link name="a"/></robot>'),
            ('mujoco', 'r.xml', '<mujoco><worldbody/></mujoco>'),
        ],
        keep=lambda library, name, text: library == 'mujoco',
    ),
)
def test_a_missing_parser_of_robots_is_one_line_with_its_extra(library, name, text, tmp_path):
    (tmp_path / name).write_text(text)
    done = run_without([library], 'import', str(tmp_path / name))
    assert (done.returncode, done.stdout) == (2, '')
    assert f"No module named '{library}'" in one_line(done.stderr)
    assert "pip install 'alf_ros[import]'" in done.stderr and 'ROS 2' not in done.stderr


def test_an_import_error_of_our_own_is_a_bug_and_shows(command):
    with pytest.raises(ImportError):
        command(raiser(ImportError('cannot import', name='alf_ros.model')))


@pytest.mark.parametrize(
    'error, code',
    [(InputError('bad', key='mass', value=-1), 2), (StepError('no', 'yes', 0.5), 1)],
)
def test_errors_of_the_package_are_one_line(command, capsys, error, code):
    assert command(raiser(error)) == code
    assert str(error) in one_line(capsys.readouterr().err)


def test_ctrl_c_is_quiet(command, capsys):
    assert command(raiser(KeyboardInterrupt())) == 130
    assert capsys.readouterr() == ('', '')


@pytest.mark.parametrize('command', ['', "main(['--version'])"])
def test_what_ctrl_c_leaves_half_made_says_nothing(command):
    """Ctrl-C may come while llvmlite makes an object, whose end then misses the handle."""
    code = f"""
from alf_ros.__main__ import main
from llvmlite.binding.ffi import ObjectRef
{command}
ObjectRef.__new__(ObjectRef)
"""
    said = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True).stderr
    assert ('_as_parameter_' in said) == (not command)


def test_a_command_gets_its_arguments_and_gives_its_exit_code(command):
    seen = []

    def function(argv):
        seen.append((argv, sys.argv))
        return 7

    assert command(function, '--step', '1') == 7
    assert seen == [(['--step', '1'], ['alf_ros try', '--step', '1'])]


@pytest.mark.parametrize('given, used', [(None, '1'), ('3', '3')])
def test_matrices_of_a_command_are_for_one_thread(command, monkeypatch, given, used):
    """Unless the user says otherwise."""
    monkeypatch.delenv('OPENBLAS_NUM_THREADS', raising=False)
    if given is not None:
        monkeypatch.setenv('OPENBLAS_NUM_THREADS', given)
    seen = []
    command(lambda _: seen.append(os.environ['OPENBLAS_NUM_THREADS']))
    assert seen == [used]


def test_a_reader_that_leaves_early_is_no_error():
    many = 'import sys; from alf_ros import __main__ as p; p.usage = lambda: "x" * 10**6;'
    code = many + 'sys.exit(p.main(["--help"]))'
    writer = subprocess.Popen(
        [sys.executable, '-c', code], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    writer.stdout.close()
    assert writer.stderr.read() == b''
    writer.stderr.close()
    writer.wait()


# ------------------------------------------------------------------- what commands have in common


@pytest.mark.parametrize(
    'given',
    [
        ['gradient', 'log', '--of', 'final(energy)', '--by', 'm', '--json', ''],
        ['check', 'four_bar', '--folder', ''],
        ['modes', 'four_bar', '--html='],
        ['ensemble', 'study.yaml', '--store', ''],
        ['optimise', 'study.yaml', '--output', ''],
    ],
)
def test_an_empty_text_is_no_file_and_no_folder(given, capsys):
    """It counted as none given, so that nothing was written, or as the present folder."""
    assert program.main(given) == 2
    option = given[-2] if not given[-1] else given[-1].rstrip('=')
    said = f"alf_ros {given[0]}: {option}: no name, got ''; expected a path\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize('given', ['nan', 'inf', '-inf'])
def test_numbers_of_options_are_finite(given: str) -> None:
    with pytest.raises(InputError, match=f"--at: not a finite number: '{given}'"):
        fork_command.main(['no_log', f'--at={given}'])


def test_all_commands_have_one_parser():
    """So that every mistake is answered alike."""
    folder = Path(program.__file__).parent
    made = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob('*.py')
        if 'ArgumentParser' in path.read_text(encoding='utf-8')
    }
    assert made == {'commands/parser.py'}
    with pytest.raises(InputError, match=r'--no.*\(see --help\)'):
        Parser('try').parse_args(['--no'])


def test_numbers_are_expressions_by_name():
    assert numbers(['a=1.5', 'b=2*3']) == {'a': 1.5, 'b': 6.0}
    for text in ('a', 'a=', 'a=x'):
        with pytest.raises(InputError, match='NAME=NUMBER'):
            numbers([text])


@pytest.mark.parametrize('text', ['-1e-12', '-1.5E3', '-.5', '-2'])
def test_negative_numbers_are_no_options(text: str) -> None:
    """One with an exponent was refused as if it were absent."""
    parser = Parser('try')
    parser.add_argument('--at', type=float)
    assert parser.parse_args(['--at', text]).at == float(text)
    with pytest.raises(InputError, match="argument --at: not a finite number: '-1e400'"):
        parser.parse_args(['--at', '-1e400'])


@pytest.mark.parametrize('text', ['1_0', '\u0663', '1_0.5', 'infinity'])
def test_options_take_decimal_numbers(text: str) -> None:
    """`1_0` was 10, as in Python, and digits of other scripts were digits."""
    parser = Parser('try')
    parser.add_argument('--at', type=float)
    parser.add_argument('--count', type=int)
    for option, kind in (('--at', 'float'), ('--count', 'int')):
        with pytest.raises(InputError, match=f"argument {option}: invalid {kind} value: '{text}'"):
            parser.parse_args([option, text])
    assert parser.parse_args(['--at', '+1e1', '--count', '+07']).at == 10.0


def test_options_of_several_values_add_up() -> None:
    parser = Parser('try')
    parser.add_argument('--by', nargs='+', default=[1], type=int)
    assert parser.parse_args([]).by == [1]
    assert parser.parse_args(['--by', '2', '3', '--by', '4']).by == [2, 3, 4]
    assert parser.parse_args(['--by', '5']).by == [5]


@pytest.mark.parametrize(
    ('line', 'said'),
    [
        ('check four_bar --set a=1 --set a=2', "--set: given twice, got 'a'; expected it once"),
        ('check four_bar --folder no/a --folder no/b', '--folder: given twice; expected it once'),
        ('export four_bar -o a --output b', '--output: given twice; expected it once'),
        ('loads wiper --duration 1 --limits x=1 --limits x=2', "--limits: given twice, got 'x'"),
        ('atlas four_bar --bar A B --bar B A', '--bar: given twice'),
        ('import x.xacro --argument a=1 --argument a:=2', "--argument: given twice, got 'a'"),
        ('fork no_log --at 0 --set a=1 --set a=2', "--set: given twice, got 'a'"),
        (
            'identify four_bar no_log --fit m --bounds m=1:2 m=1:3',
            "--bounds: given twice, got 'm'",
        ),
        ('view --port 1 --port 2', '--port: given twice'),
        ('view --ros-args -p a:=1 -p a:=2', "-p: given twice, got 'a'; expected it once"),
        (
            'simulator --duration 1 --ros-args -p duration:=2',
            '--duration: given twice, also by -p duration; expected one of them',
        ),
        (
            'close --active a --ros-args -p close:active:=[b]',
            '--active: given twice, also by -p close:active; expected one of them',
        ),
    ],
)
def test_a_value_given_twice_is_refused(line: str, said: str, capsys) -> None:
    assert program.main(line.split()) == 2
    assert said in one_line(capsys.readouterr().err)


@pytest.mark.parametrize(
    ('line', 'said'),
    [
        ('modes pendulum --count 0', '--count: not usable, got 0'),
        ('equilibrium pendulum --at=-1', '--at: not usable, got -1.0'),
        ('equilibrium pendulum --over gravity.acceleration.1 --to=-9.81', '--to: a path has two'),
        ('linearise pendulum --period=-1', '--period: not usable'),
        ('loads wiper --duration 1 --weights foo=1', '--weights: no such actuator'),
        ('atlas four_bar --over crank_pin --hold crank_pin=x', '--hold: not a number by name'),
        ('loads wiper --duration 1 --limits foo=1', '--limits: no such quantity'),
        ('loads wiper --duration 1 --rate 0', '--rate: no instant behind the first'),
        ('equilibrium pendulum --to 0', '--to: has no meaning without --over'),
        ('equilibrium pendulum --from 0', '--from: has no meaning without --over'),
        ('equilibrium pendulum --csv path.csv', '--csv: has no meaning without --over'),
        ('equilibrium pendulum --branches', '--branches: has no meaning without --over'),
        ('equilibrium pendulum --over t --to 1 --starts 9', '--starts: has no meaning with'),
        ('equilibrium pendulum --starts 9 --nearest', '--nearest: has no meaning with --starts'),
        ('equilibrium pendulum --seed 0', '--seed: has no meaning without --starts'),
        ('loads wiper --duration 1 --pieces 9', '--pieces: has no meaning without --limits'),
        ('loads wiper --duration 1 --limits a=1 --rate 9', '--rate: has no meaning with --limits'),
        ('linearise pendulum -o no/folder/x.mat', '--output: No such file'),
    ],
)
def test_errors_name_options_as_typed(line: str, said: str, capsys) -> None:
    assert program.main(line.split()) == 2
    assert said in one_line(capsys.readouterr().err)


@pytest.mark.parametrize('line', ['modes', 'linearise --inputs crank_pin.effort'])
def test_where_nothing_is_free_there_are_no_modes(line: str, tmp_path: Path, capsys) -> None:
    scene = tmp_path / 'held.yaml'
    scene.write_text('{mechanism: four_bar, drives: {d: {joint: crank_pin, angle: 1 + t}}}')
    name, *others = line.split()
    assert program.main([name, str(scene), *others]) == 0
    assert 'drives are frozen at t = 0 s' in capsys.readouterr().out


@pytest.mark.parametrize('name', ['check', 'ensemble', 'optimise', 'verify', 'import'])
def test_a_folder_in_place_of_a_file_is_called_so(name: str, tmp_path, capsys) -> None:
    assert program.main([name, str(tmp_path)]) == 2
    assert 'folder' in one_line(capsys.readouterr().err).replace(str(tmp_path), '')


def test_a_file_that_is_read_is_not_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    robot = '<robot name="r"><link name="base"/></robot>'
    files = {'r.urdf': robot, 'm.yaml': 'mechanism: slider_crank\n', 'side.yaml': '{}\n'}
    for name, text in files.items():
        Path(name).write_text(text)
    for line, said in (
        (
            'import r.urdf -o ./r.urdf',
            "-o: the file that is read, and left as it is, got './r.urdf'",
        ),
        ('import r.urdf --loops side.yaml -o side.yaml', '-o: the file that is read'),
        ('export m.yaml -o m.yaml', '-o: the file that is read'),
        ('export m.yaml -o new.urdf --loops m.yaml', '--loops: the file that is read'),
    ):
        assert program.main(line.split()) == 2
        assert said in capsys.readouterr().err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == files


def test_a_file_that_cannot_be_written_is_told_by_its_option(tmp_path):
    with writing_into(str(tmp_path / 'new' / 'folder')) as folder:
        assert folder.is_dir()
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='--folder: Not a directory'):
        with writing_into(str(tmp_path / 'file' / 'below')):
            pass
    with pytest.raises(InputError, match='--folder: No such file'):
        with writing_into(str(tmp_path)) as folder:
            (folder / 'absent' / 'file').write_text('')
    with pytest.raises(BrokenPipeError):  # of what is printed, not of a file
        with writing_into(str(tmp_path)):
            raise BrokenPipeError


class Terminal(io.StringIO):
    """A stderr on a terminal of 60 columns."""

    def isatty(self):
        return True

    def seen(self):
        return re.split(r'\r\x1b\[K', self.getvalue())[1:]


@pytest.fixture
def terminal(monkeypatch):
    stderr = Terminal()
    monkeypatch.setattr('alf_ros.commands.progress.sys', SimpleNamespace(stderr=stderr))
    monkeypatch.setattr(os, 'get_terminal_size', lambda _: os.terminal_size((60, 24)))
    return stderr


def test_a_bar_counts_runs(terminal):
    with ProgressBar(total=2) as bar:
        bar.show('a')
        bar.show('b' * 99)
        bar.clear()
        bar.clear()
    first, second, *removed = terminal.seen()
    assert first == f'[{"." * 30}] 0/2  a'
    assert second.startswith(f'[{"#" * 15}{"." * 15}] 1/2') and len(second) < 60
    assert removed == ['']  # once


def test_a_bar_shows_the_part_of_what_takes_long(terminal, monkeypatch):
    now = [0.0]
    monkeypatch.setattr('alf_ros.commands.progress.time.monotonic', lambda: now[0])
    monkeypatch.setattr(os, 'get_terminal_size', lambda _: os.terminal_size((0, 0)))
    with ProgressBar('verify') as bar:
        for now[0], part in ((0.2, 0.1), (1.0, 0.25), (1.05, 0.3), (3.0, 1.0)):
            bar(part)
    assert terminal.seen() == [
        f'verify [{"#" * 8}{"." * 22}]  25%, 3 s left',
        f'verify [{"#" * 30}] 100%, 0 s left',
        '',
    ]


def test_a_pipe_gets_a_line_every_ten_seconds(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr('alf_ros.commands.progress.time.monotonic', lambda: now[0])
    with ProgressBar('verify', total=2) as bar:
        bar.show('quick')
        for now[0], part in ((1.0, 0.1), (10.0, 0.25), (19.9, 0.5), (30.0, 0.75)):
            bar(part)
        bar.show('early')
        now[0] = 40.0
        bar.show('a')
    out, errors = capsys.readouterr()
    assert out == ''
    assert errors == 'verify  25%, 30 s left\nverify  75%, 10 s left\n2/2  a\n'
