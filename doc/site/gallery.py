"""The gallery: every scene of the library with its picture, its motion, its files and numbers.

`python -m alf_ros check` draws the pictures, `analyze --animation` the moving ones. They are kept
from build to build, by a key of their sources.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from docstrings import markdown, table
from sources import ROOT

from alf_ros import Scene, load_scene, resources
from alf_ros.inspection import mechanism_plot
from alf_ros.inspection.soundness import Soundness, examine
from alf_ros.logs import load
from alf_ros.logs.report import animation
from alf_ros.logs.report.summary import account
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.simulation import setup

_ON_CARDS = ('bodies', 'joints', 'freedoms')
_DURATION, _RATE = 4.0, 50.0  # s that a moving picture shows, Hz
# s, s per second, and Hz, where _DURATION would show too little, or a pause at the end: a platform
# and a rack soon leave their place, an excavator takes longer for a cycle
_SHOWN = {
    'actuator_leg': (2.2, 0.5, 50.0),
    'excavator': (9.0, 2.0, 25.0),
    'four_axis_delta': (1.8, 0.5, 50.0),
    'rack_and_pinion': (0.5, 0.125, 200.0),
    'spring_leg': (2.5, 0.5, 50.0),
    'stewart_platform': (0.6, 0.2, 100.0),
}


@dataclass(frozen=True)
class Exhibit:
    """A scene, its file, the file of its mechanism, and the findings of `check`."""

    scene: Scene
    file: Path
    mechanism: Path
    found: Soundness

    @property
    def title(self) -> str:
        """Its name in words."""
        words = self.file.stem.replace('_', ' ')
        return words[0].upper() + words[1:]

    @property
    def numbers(self) -> list[tuple[str, int]]:
        """Sizes of the mechanism, and how freely it moves at ordinary positions."""
        model, mechanism = self.found.model, self.scene.mechanism
        rows, rank = len(model.row_names), model.n - self.found.freedoms
        return [
            ('bodies', len(mechanism.bodies)),
            ('joints', len(mechanism.joints)),
            ('coordinates', model.n),
            ('constraint rows', rows),
            ('redundant rows', rows - rank),
            ('freedoms', self.found.freedoms),
        ]


def exhibits(names: list[str] | None = None) -> list[Exhibit]:
    """All scenes of the library, or the scenes with these names."""
    mechanisms = resources.library('mechanisms')
    made = []
    for name, file in sorted(resources.library('scenes').items()):
        if names is None or name in names:
            scene = load_scene(name)
            made.append(Exhibit(scene, file, mechanisms[scene.mechanism.name], examine(scene)))
    return made


def comment(file: Path) -> tuple[str, str]:
    """The comment at the head of a file: its first paragraph, and the others as Markdown."""
    lines = []
    for line in file.read_text('utf-8').splitlines():
        if not line.startswith('#'):
            break
        lines.append(line.removeprefix('#').removeprefix(' '))
    first, *parts = '\n'.join(lines).strip('\n').split('\n\n')
    found = [_paragraph(part) for part in parts if part.strip()]
    return ' '.join(first.split()), '\n\n'.join(found)


def _paragraph(part: str) -> str:
    """Text flows; a drawing stays as it is."""
    lines = part.strip('\n').splitlines()
    if any(line.startswith('   ') for line in lines):
        return '\n'.join(['```text', *lines, '```'])
    return markdown(' '.join(part.split()))


def write(target: Path, kept: Path, films: bool, names: list[str] | None = None) -> None:
    """Write the pages into `target`, pictures among them; `kept`: of earlier builds."""
    target.mkdir(parents=True)
    kept.mkdir(parents=True, exist_ok=True)
    shown = exhibits(names)
    for each in shown:
        _picture(each, kept, target)
        film = _film(each, kept, target) if films else None
        (target / f'{each.file.stem}.md').write_text(_page(each, film), 'utf-8')
    (target / 'index.md').write_text(_index(shown), 'utf-8')


def _key(each: Exhibit, *sources: str) -> str:
    """The digest of what a picture is drawn from: the scene, and the code that draws."""
    digest = hashlib.sha256(each.scene.text.encode())
    for source in sources:
        digest.update((ROOT / source).read_bytes())
    return digest.hexdigest()[:16]


def _picture(each: Exhibit, kept: Path, target: Path) -> None:
    parts = ('mechanism_plot', 'joint_pen', 'plot_axes', 'shape_edges', 'mesh_lines')
    key = _key(each, *(f'alf_ros/inspection/{part}.py' for part in parts))
    path = kept / f'{each.file.stem}_{key}.png'
    if not path.exists():
        part = kept / 'part.png'  # a build that is interrupted leaves no half of a picture
        mechanism_plot.draw(part, each.found)
        part.rename(path)
    shutil.copy(path, target / f'{each.file.stem}.png')


def _film(each: Exhibit, kept: Path, target: Path) -> str | None:
    """The name of the moving picture; None if nothing would be seen to move."""
    parts = [f'logs/report/{part}' for part in ('animation', 'drawn_motion', 'shape_outlines')]
    parts += [f'inspection/{part}' for part in ('shape_places', 'symbol_places', 'wheel_places')]
    sources = [f'alf_ros/{part}.py' for part in parts]
    key = _key(each, *sources, 'doc/site/gallery.py')
    path = kept / f'{each.file.stem}_{key}.webp'
    if not path.exists():
        _write_film(each, path)
    if path.stat().st_size == 0:
        return None
    name = f'{each.file.stem}_film.webp'
    shutil.copy(path, target / name)
    return name


def _write_film(each: Exhibit, path: Path) -> None:
    """Record a log, and draw it as `analyze --animation` does; an empty file if nothing moves."""
    duration, speed, rate = _SHOWN.get(each.file.stem, (_DURATION, 1.0, _RATE))
    with tempfile.TemporaryDirectory() as folder:
        made = setup.made(each.scene, {}, rate)
        run = LogRun(Path(folder), made)
        run.send()
        for _ in range(round(duration * rate)):
            made.simulation.step(made.steps)
            run.send()
        run.close()
        film = animation.film(account(load(run.recorder.path)), each.scene.name)
    moved = float(np.nanmax(np.ptp(film.places, axis=0)))
    if (film.motion.links or film.motion.wheels) and moved > 0.01 * each.found.model.size:
        part = path.with_name('part.webp')
        animation.write(part, [film], speed)
        part.rename(path)
    else:
        path.touch()


def _page(each: Exhibit, film: str | None) -> str:
    name = each.file.stem
    first, rest = comment(each.file)
    of_mechanism, drawing = comment(each.mechanism)
    parts = [f'# {each.title}', markdown(first), rest, f'![{each.title}]({name}.png)']
    if film:
        parts.append(f'```{{image}} {film}\n:alt: {each.title}, in motion\n:loading: lazy\n```')
    parts += [
        table(('what', 'number'), [(what, str(number)) for what, number in each.numbers]),
        f'Run it with `python -m alf_ros simulator --scene {name}`, judge it with '
        f'`python -m alf_ros check {name}`.',
        '## The mechanism',
        markdown(of_mechanism),
        drawing,
        f'## The files\n\n`config/scenes/{each.file.name}`:',
        f'```yaml\n{each.file.read_text("utf-8")}```',
        f'`config/mechanisms/{each.mechanism.name}`:',
        f'```yaml\n{each.mechanism.read_text("utf-8")}```',
    ]
    return '\n\n'.join(part for part in parts if part) + '\n'


def _counted(n: int, what: str) -> str:
    one = {'bodies': 'body', 'joints': 'joint', 'freedoms': 'freedom'}
    return f'{n} {one[what] if n == 1 else what}'


def _index(shown: list[Exhibit]) -> str:
    cards = []
    for each in shown:
        name = each.file.stem
        said = ', '.join(_counted(n, what) for what, n in each.numbers if what in _ON_CARDS)
        cards.append(
            f'::::{{container}}\n[![{each.title}]({name}.png)]({name}.md)\n\n[{each.title}]({name}.md)\n\n'
            f'{markdown(comment(each.file)[0])}\n\n{said}\n::::'
        )
    names = '\n'.join(each.file.stem for each in shown)
    return (
        '# Gallery\n\nEvery scene of the library. `make run SCENE=<name>` runs one.\n\n'
        ':::::{container} gallery\n' + '\n\n'.join(cards) + '\n:::::\n\n'
        f'```{{toctree}}\n:hidden:\n\n{names}\n```\n'
    )
