"""Build the documentation site: `make docs`, or `.venv/bin/python doc/site/build.py`.

Pages of the repository and pages made from the package are put side by side, and Sphinx builds
them with warnings as errors. Then every link that stays in the site is followed. Nothing is
fetched.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

# The matrices are small: more threads only wait for each other. numpy asks when it is imported.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import commands_page
import gallery
import links
import notebooks
import python_api
import reference
import sources


def assemble(target: Path, kept: Path, films: bool, scenes: list[str] | None = None) -> None:
    """Write all sources of the site into an empty folder; the gallery shows `scenes`, or all."""
    sources.copy(target)
    notebooks.write(target)
    pages = {
        'python_api': python_api.page(),
        'scene_keys': reference.scene_keys(),
        'joints': reference.joint_types(),
        'effects': reference.effect_kinds(),
        'commands': commands_page.page(),
    }
    (target / 'reference').mkdir()
    for name, text in pages.items():
        (target / 'reference' / f'{name}.md').write_text(text, 'utf-8')
    gallery.write(target / 'gallery', kept, films, scenes)


def main() -> int:
    """Build the site; returns 1 if Sphinx warns or a link leads nowhere."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--folder', default=sources.ROOT / 'build' / 'docs', type=Path)
    parser.add_argument('--no-films', action='store_true', help='leave moving pictures out')
    parser.add_argument('--scenes', nargs='+', help='a gallery of these scenes only')
    options = parser.parse_args()
    folder = options.folder.resolve()
    for part in ('sources', 'html'):
        shutil.rmtree(folder / part, ignore_errors=True)
    (folder / 'sources').mkdir(parents=True)
    assemble(folder / 'sources', folder / 'pictures', not options.no_films, options.scenes)
    flags = ['-W', '--keep-going', '-q', '-c', str(sources.HERE), '-d', str(folder / 'doctrees')]
    command = [
        sys.executable,
        '-m',
        'sphinx',
        *flags,
        str(folder / 'sources'),
        str(folder / 'html'),
    ]
    path = os.pathsep.join([str(sources.HERE), os.environ.get('PYTHONPATH', '')]).rstrip(
        os.pathsep
    )
    if subprocess.call(command, env=os.environ | {'PYTHONPATH': path}):
        return 1
    broken = links.broken(folder / 'html')
    for each in broken:
        print(each, file=sys.stderr)
    if not broken:
        print(f'{folder / "html" / "index.html"}')
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
