"""Tables of a scene, a sample and a log in a notebook: the numbers, and names that stay text."""

from __future__ import annotations

import copy
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from alf_ros import Simulation, load_scene
from alf_ros.errors import StepError
from alf_ros.html_table import MOST_ROWS
from alf_ros.logs import load, log
from support.log_files import make

HOSTILE = '<script>alert(1)</script><img src=x onerror="alert(2)">&amp;\x1b[2J'
TAGS = {'p', 'b', 'table', 'thead', 'tbody', 'tr', 'th', 'td'}


class Reader(HTMLParser):
    """The texts of cells by row, and the texts of paragraphs; only tags of tables are accepted."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.texts: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        assert self._open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        assert tag in TAGS and {name for name, _ in attributes} <= {'style'}, (tag, attributes)
        self._open.append(tag)
        if tag == 'tr':
            self.rows.append([])
        elif tag in ('td', 'th'):
            self.rows[-1].append('')

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, text: str) -> None:
        if self._open[-1] in ('td', 'th'):
            self.rows[-1][-1] += text
        else:
            self.texts.append(text)

    def row(self, first: str) -> list[str]:
        """The first row that begins so; a joint is in two tables of a sample."""
        return next(row[1:] for row in self.rows if row[0] == first)


def test_a_scene() -> None:
    shown = Reader(load_scene('slider_crank')._repr_html_())
    assert shown.texts == ['Scene slider_crank']
    assert shown.row('mechanism') == ['slider_crank, planar']
    assert shown.row('bodies') == ['2: crank, coupler'] and shown.row('drives') == ['none']
    assert shown.row('effects') == ['gravity'] and shown.row('initial velocities of') == ['B']
    assert shown.row('solver') == ['integrator rk4, step 0.001 s']
    assert shown.row('knee') == ['revolute', 'crank, coupler']


def test_a_sample() -> None:
    simulation = Simulation(load_scene('slider_crank'))
    simulation.step(250)
    sample = simulation.sample()
    shown = Reader(sample._repr_html_())
    assert shown.texts == ['Sample at t = 0.25 s']
    assert shown.row('energy') == [f'{sample.energy:.6g} J'] and shown.row('singular') == ['no']
    guide = sample.joints['guide']
    assert shown.row('guide') == [
        f'{guide.position:.6g} m',
        f'{guide.velocity:.6g} m/s',
        f'{guide.effort:.6g} N',
        '',
    ]
    x, y = sample.reactions['crank_pin'].force
    _, reaction = (row for row in shown.rows if row[0] == 'crank_pin')
    assert reaction[1:] == [f'{x:.6g}, {y:.6g}', '0', '']


def test_a_share_of_many_is_said() -> None:
    sample = Simulation(load_scene('bricard')).sample()
    unknown = [name for name, each in sample.reactions.items() if each.indeterminate]
    shown = Reader(sample._repr_html_())
    assert unknown
    assert {row[0] for row in shown.rows if row[-1] == 'one of many'} == set(unknown)


def test_a_sample_that_cannot_be_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def jammed(sample: Any) -> None:
        raise StepError('the mechanism is <jammed>', 'loosen it', 1.5)

    sample = Simulation(load_scene('pendulum')).sample()
    monkeypatch.setattr(type(sample), 'joint_efforts', property(jammed))
    shown = Reader(sample._repr_html_())
    assert shown.texts[1:] == ['t = 1.5 s: the mechanism is <jammed>; loosen it']


def test_a_mechanism_of_many_joints_is_cut_short() -> None:
    scene = load_scene('n_four_bar')
    assert len(scene.mechanism.joints) > MOST_ROWS
    shown = Reader(scene._repr_html_())
    assert len(shown.rows) < MOST_ROWS + 10
    assert shown.texts[-1] == f'and {len(scene.mechanism.joints) - MOST_ROWS} more'


@pytest.fixture(scope='module')
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made, _ = make(tmp_path_factory.mktemp('logs'), 'slider_crank')
    return made


def test_a_log(path: Path) -> None:
    found = load(path)
    shown = Reader(found._repr_html_())
    assert shown.texts == ['Log of the scene slider_crank']
    assert shown.row('log')[0].endswith(path.name)
    assert shown.row('time') == [f'0 to {found.end:.9g} s']
    assert shown.row('inputs') == [str(len(found.inputs))]
    for topic, count in found.survey.counts.items():
        assert shown.row(topic) == [found.survey.types[topic], str(count)]


def test_a_large_log_is_not_read_through(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log, '_READ_TO_SHOW', 1000)
    found = load(path)
    assert Reader(found._repr_html_()).texts[-1] == 'not read yet: `survey` reads it'
    assert 'survey' not in vars(found)
    count = len(found.inputs)  # which reads it through
    assert Reader(found._repr_html_()).row('inputs') == [str(count)]


def test_hostile_names_stay_text(path: Path) -> None:
    """The loader checks the names of a scene; the names in a log may be any text."""
    scene = copy.copy(load_scene('pendulum'))
    object.__setattr__(scene, 'name', HOSTILE)
    object.__setattr__(scene, 'file', HOSTILE)
    told = load(path)
    told.info = {**told.info, 'scene': HOSTILE, 'solver': {HOSTILE: HOSTILE}}
    told.survey.counts[HOSTILE], told.survey.types[HOSTILE] = 1, HOSTILE
    told.survey.damage = HOSTILE
    for page in (scene._repr_html_(), told._repr_html_()):
        shown = Reader(page)
        assert '<script>alert(1)</script>' in shown.texts[0]
        assert '\x1b' not in page
