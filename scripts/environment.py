"""Create or refresh .venv, the interpreter behind `make run` and `make test`.

Run by `make setup`; needs only Python with its venv module. With a ROS 2 installation sourced,
.venv sees it and uses its rclpy; otherwise rclpy comes as wheels. A stamp, written last, says what
.venv was made from: when it still agrees nothing is done, and without it .venv is made again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / '.venv'
PYTHON = VENV / 'bin' / 'python'
STAMP = VENV / 'alf_ros-setup.json'
REQUIREMENTS = ROOT / 'requirements'
SUPPORTED = ((3, 10), (3, 13))
ESSENTIAL = 'import numba, scipy, yaml, mcap, rclpy, sensor_msgs.msg, trajectory_msgs.msg'


def base_python() -> str:
    """Return the interpreter outside any venv, so that .venv is never rebuilt by its own."""
    base = Path(sys.base_prefix) / 'bin' / f'python{sys.version_info[0]}.{sys.version_info[1]}'
    return str(base) if base.exists() else sys.executable


def sourced_ros(python: str) -> dict[str, str] | None:
    """Return where the rclpy of a sourced ROS 2 lies and its major numpy, or None without one."""
    if not (os.environ.get('AMENT_PREFIX_PATH') or os.environ.get('ROS_DISTRO')):
        return None
    find = "import importlib.util as u; s = u.find_spec('rclpy'); print(s.origin if s else '')"
    origin = subprocess.run([python, '-c', find], stdout=subprocess.PIPE, text=True).stdout.strip()
    if not origin or VENV in Path(origin).parents:
        return None
    # The path is found by a Python of another version too; only an import shows that it fits.
    load = 'import rclpy, sensor_msgs.msg, numpy; print(numpy.__version__.split(".")[0])'
    found = subprocess.run([python, '-c', load], capture_output=True, text=True)
    if found.returncode:
        reason = (found.stderr.strip() or 'no reason given').splitlines()[-1]
        sys.exit(
            f'setup: the sourced ROS 2 ({origin}) does not import in {python}: {reason}; give its '
            'own Python (make setup PYTHON=/usr/bin/python3), or use a shell without that ROS 2'
        )
    return {'rclpy': origin, 'numpy': found.stdout.strip()}


def wanted(python: str, ros: dict[str, str] | None) -> dict[str, object]:
    """Return what the stamp must say for .venv to be up to date."""
    digest = hashlib.sha256()
    for path in [*sorted(REQUIREMENTS.glob('*.txt')), Path(__file__)]:
        digest.update(path.read_bytes())
    version = '.'.join(map(str, sys.version_info[:2]))
    base = {'folder': str(VENV), 'python': python, 'version': version, 'ros': ros}
    return {'base': base, 'requirements': digest.hexdigest()}


def present() -> dict[str, Any]:
    """Return what the stamp says; empty when .venv is missing or unfinished."""
    try:
        stamp = json.loads(STAMP.read_text())
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) and PYTHON.exists() else {}


def step(title: str, *command: str) -> None:
    """Say what happens now and run it; a failure ends the setup."""
    print(f'setup: {title}', flush=True)
    try:
        code = subprocess.call(command, cwd=ROOT)
    except KeyboardInterrupt:
        sys.exit(130)
    if code:
        sys.exit(f'setup: failed ({title}): see above; `make setup` starts again')


def install(title: str, *names: str) -> None:
    """Install requirement files into .venv, pip telling of every package."""
    files = [f'--requirement={REQUIREMENTS / name}.txt' for name in names]
    pip = [str(PYTHON), '-m', 'pip', 'install', '--disable-pip-version-check', '--use-pep517']
    step(title, *pip, f'--constraint={REQUIREMENTS / "constraints.txt"}', *files)


def create(python: str, ros: dict[str, str] | None) -> None:
    """Make .venv from nothing."""
    shown = f'Python {platform.python_version()} ({python})'
    if not SUPPORTED[0] <= sys.version_info[:2] <= SUPPORTED[1]:
        sys.exit(f'setup: Python 3.10 to 3.13 is needed, got {shown}; try PYTHON=python3.12')
    if ros is None and (platform.system(), platform.machine()) != ('Linux', 'x86_64'):
        sys.exit('setup: ROS 2 wheels exist for Linux on x86_64 only; source a ROS 2 first')
    if subprocess.run([python, '-c', 'import venv, ensurepip'], capture_output=True).returncode:
        sys.exit(f'setup: {shown} has no venv module; Debian, Ubuntu: apt install python3-venv')
    flags = ['--clear'] + (['--system-site-packages'] if ros else [])
    step(f'.venv with {shown}', python, '-m', 'venv', *flags, str(VENV))


def fill(ros: dict[str, str] | None) -> None:
    """Install everything into .venv and see that it imports."""
    install('1/4 solver', 'core', f'numpy{ros["numpy"]}' if ros else 'numpy2')
    if ros:
        print(f'setup: 2/4 ROS 2 is sourced: using {ros["rclpy"]}', flush=True)
    else:
        install('2/4 ROS 2 as wheels', 'ros')
    install('3/4 recording and plotting', 'record')
    optional = ('import', 'ensemble', 'view', 'test', 'docs')
    install('4/4 import, ensembles, viewers, tests, documentation', *optional)
    # Importable from any folder; without isolation, so that nothing is downloaded for it.
    editable = ['--no-deps', '--no-build-isolation', '--quiet', '--editable', str(ROOT)]
    step('alf_ros itself', str(PYTHON), '-m', 'pip', 'install', *editable)
    step('checking', str(PYTHON), '-c', ESSENTIAL)


def main() -> None:
    """Bring .venv up to date; it keeps its Python unless the user named one (`--python-given`)."""
    # Left by a python with ROS wheels: with it that of .venv would not look for its own libraries.
    os.environ.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    have = present()
    python = base_python()
    kept = have.get('base', {}).get('python', python)
    if '--python-given' not in sys.argv[1:] and kept != python and os.access(kept, os.X_OK):
        os.execv(kept, [kept, __file__, '--python-given'])
    with open(__file__) as lock:  # two at once would spoil each other's .venv
        fcntl.flock(lock, fcntl.LOCK_EX)
        have = present()
        ros = sourced_ros(python)
        want = wanted(python, ros)
        if have == want:
            return
        if have.get('base') != want['base']:
            create(python, ros)
        STAMP.unlink(missing_ok=True)
        fill(ros)
        STAMP.write_text(json.dumps(want, indent=1) + '\n')
    print('setup: done, .venv/bin/python is the interpreter', flush=True)


if __name__ == '__main__':
    main()
