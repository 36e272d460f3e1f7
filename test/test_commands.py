"""`python -m alf_ros`: what it lists, and how every command ends."""

import subprocess
import sys

import pytest

from alf_ros import __main__ as program
from alf_ros.commands import COMMANDS
from alf_ros.errors import InputError, StepError

BLOCK = """
import sys

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

    class Module:
        pass

    def run(function, *argv):
        Module.main = staticmethod(function)
        monkeypatch.setattr(program, 'COMMANDS', {'try': 'alf_ros.try'})
        monkeypatch.setitem(sys.modules, 'alf_ros.try', Module)
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


def test_a_command_gets_its_arguments_and_gives_its_exit_code(command):
    seen = []

    def function(argv):
        seen.append((argv, sys.argv))
        return 7

    assert command(function, '--step', '1') == 7
    assert seen == [(['--step', '1'], ['alf_ros try', '--step', '1'])]


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
