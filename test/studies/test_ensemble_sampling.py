"""Which numbers a member has: against numpy and scipy, and whoever asks in whatever order."""

from __future__ import annotations

import hashlib
import itertools
import math
import pickle
import re
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from alf_ros import ensemble
from alf_ros.errors import InputError
from alf_ros.studies.ensemble import distributions as law
from alf_ros.studies.ensemble.distributions import distribution
from alf_ros.studies.ensemble.sampling import Sampling
from alf_ros.studies.ensemble.study_reading import load_study, study_of

TWO = {'a': law.uniform(0.0, 1.0), 'b': law.normal(2.0, 0.5)}


@pytest.mark.parametrize(
    ('given', 'exact'),
    [
        (law.uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
        (law.normal(2.0, 0.5), stats.norm(2.0, 0.5)),
        (law.lognormal(3.0, 0.2), stats.lognorm(0.2, scale=3.0)),
        (law.triangular(1.0, 1.5, 4.0), stats.triang(1 / 6, 1.0, 3.0)),
        (distribution({'weibull_min': {'c': 2.0, 'scale': 3.0}}, 'x'), stats.weibull_min(2, 0, 3)),
        (distribution(stats.beta(2, 3, scale=2.0), 'x'), stats.beta(2, 3, 0, 2)),
    ],
)
def test_a_distribution_is_that_of_scipy(given, exact):
    u = np.linspace(1e-6, 1.0 - 1e-6, 41)
    found = [pickle.loads(pickle.dumps(given)).at(each) for each in u]
    assert found == pytest.approx(exact.ppf(u), rel=1e-9, abs=1e-12)
    assert distribution(given.data, 'x') == given


def test_sides_may_be_open_and_numbers_of_numpy():
    """Of the law of scipy; a law of one's own that has the name of another is no such law."""
    told = distribution(stats.truncnorm(-2.0, np.inf, loc=1.0, scale=0.3), 'x')
    assert distribution(told.data, 'x') == told
    assert told.at(0.01) == float(stats.truncnorm(-2.0, np.inf, 1.0, 0.3).ppf(0.01))
    given = distribution({'uniform': [np.int64(2), np.float32(4.0)]}, 'x')
    assert given == law.uniform(2, 4.0) and pickle.loads(pickle.dumps(given)) == given
    short = type(stats.norm)(a=-1.0, b=1.0, name='norm')()
    with pytest.raises(InputError, match="x: not a distribution of scipy.stats, got 'norm'"):
        distribution(short, 'x')
    with pytest.raises(InputError, match=r'x: norm\.loc: not a number, got \[1, 2\]'):
        distribution(stats.norm(loc=[1, 2]), 'x')


def test_an_open_side_in_a_file(tmp_path):
    """As YAML writes it, for laws that may have one."""
    exact = stats.truncnorm(-2, math.inf, 1, 0.3)
    for given, u in (('a: -2, b: .inf', 0.9), ('a: -.INF, b: 2', 0.1)):
        file = tmp_path / 'study.yaml'
        vary = f'{{gravity.acceleration.1: {{truncnorm: {{{given}}}}}}}'
        file.write_text(f'scene: pendulum\nvary: {vary}\n')
        study = load_study(file, members=2, duration=0.01)
        ((_, found),) = study.vary
        assert isinstance(found, law.Distribution)
        assert found.at(u) == pytest.approx(math.copysign((exact.ppf(0.9) - 1) / 0.3, u - 0.5))
    file.write_text('scene: pendulum\nvary: {bar.mass: {uniform: [0.5, .inf]}}\n')
    with pytest.raises(InputError, match=r'study.yaml:2: vary\.bar\.mass: .*high: not finite'):
        load_study(file, members=2)


def test_a_quantile_beyond_the_range_of_numbers_is_of_no_member():
    """The law has it, a scene has not: the member says it, the others run."""
    found = ensemble(
        'pendulum',
        {'bar.mass': {'lognormal': [1.0, 3000.0]}},
        6,
        outputs=['final(energy)'],
        duration=0.01,
        workers=0,
    )
    masses, reasons = found['bar.mass'].values, found.reason.values
    assert np.isinf(masses).any()
    for mass, reason in zip(masses.tolist(), reasons.tolist(), strict=True):
        if math.isinf(mass):
            assert reason.startswith("vary.bar.mass: not a finite number, got 'inf'")
    assert np.isnan(found.final_energy.values[reasons != '']).all()


def test_a_number_is_a_word_of_philox():
    """The scheme of the page, with numpy alone."""
    key = int.from_bytes(hashlib.sha256(b'a').digest()[:8], 'little')
    words = np.random.Philox(key=[7, key]).random_raw(8)
    # numpy counts before it draws: the block of its first words has the counter 1
    found = [float(Sampling('random', TWO, 9, 7).values(k)['a']) for k in range(8)]
    assert found == [(int(word) >> 12) * 2.0**-52 + 2.0**-53 for word in words]


@pytest.mark.parametrize('kind', ['random', 'lhs', 'sobol', 'saltelli'])
def test_a_member_needs_no_member_before_it(kind):
    in_order = [Sampling(kind, TWO, 32, 3).values(k) for k in range(32)]
    asked = Sampling(kind, TWO, 32, 3)
    order = np.random.default_rng(0).permutation(32).tolist()
    assert {k: asked.values(k) for k in order} == dict(enumerate(in_order))
    assert in_order != [Sampling(kind, TWO, 32, 4).values(k) for k in range(32)]


def test_random_members_do_not_depend_on_what_else_varies_or_how_many_there_are():
    more = {'c': law.uniform(0.0, 1.0), **TWO}
    assert Sampling('random', TWO, 5, 0).values(4) == {
        name: value
        for name, value in Sampling('random', more, 5000, 0).values(4).items()
        if name in TWO
    }


def test_random_numbers_are_spread_as_they_should_be():
    sampling = Sampling('random', TWO, 4000, 1)
    numbers = np.array([sampling.unit(k) for k in range(4000)])
    for column in numbers.T:
        assert stats.kstest(column, 'uniform').pvalue > 0.01
    assert abs(stats.spearmanr(*numbers.T).statistic) < 0.05


def test_a_latin_hypercube_has_one_member_in_each_slice():
    sampling = Sampling('lhs', TWO, 50, 2)
    numbers = np.array([sampling.unit(k) for k in range(50)])
    for column in numbers.T:
        assert sorted(np.floor(column * 50).tolist()) == list(range(50))


def test_sobol_is_the_sequence_of_scipy():
    sampling = Sampling('sobol', TWO, 64, 5)
    exact = qmc.Sobol(2, scramble=True, rng=5).random(64)
    assert np.array_equal([sampling.unit(k) for k in range(64)], exact + 2.0**-31)


def test_saltelli_changes_one_number_at_a_time():
    sampling = Sampling('saltelli', TWO, 32, 5)
    for point in range(8):
        a, b, first, second = (sampling.unit(4 * point + role) for role in range(4))
        assert np.array_equal(first, [b[0], a[1]])
        assert np.array_equal(second, [a[0], b[1]])


def test_grids_and_tables():
    lists = {'a': ('1', '2', '3'), 'b': ('[0, 1]', 'x')}
    grid = Sampling('grid', lists, None, 0)
    found = [tuple(grid.values(k).values()) for k in range(grid.members)]
    assert found == list(itertools.product(*lists.values()))
    table = Sampling('table', {'a': ('1', '2'), 'b': ('x', 'y')}, None, 0)
    assert [table.values(k) for k in range(table.members)] == [
        {'a': '1', 'b': 'x'},
        {'a': '2', 'b': 'y'},
    ]


def test_members_in_a_file(tmp_path):
    """A line of names, then a line for each member: numbers keep their digits, texts stay."""
    (tmp_path / 'parts.csv').write_text(
        '# measured\ncoupler.mass, "solver.integrator"\n1.0625, "rk4"\n\n1.125,dop853\n0.1,rk4\n'
    )
    (tmp_path / 'study.yaml').write_text(
        'scene: four_bar\nvary: parts.csv\nduration: 0.1\noutputs: [final(energy)]\n'
    )
    found = load_study(tmp_path / 'study.yaml')
    assert (found.sampling, found.members) == ('table', 3)
    assert dict(found.vary) == {
        'coupler.mass': ('1.0625', '1.125', '0.1'),
        'solver.integrator': ('rk4', 'dop853', 'rk4'),
    }
    assert found.data['vary']['coupler.mass'] == ['1.0625', '1.125', '0.1']
    kept = ensemble(
        'four_bar', tmp_path / 'parts.csv', duration=0.1, outputs=['final(energy)'], workers=0
    )
    assert kept['coupler.mass'].values.tolist() == [1.0625, 1.125, 0.1]
    assert set(kept['reason'].values) == {''}
    (tmp_path / 'study.yaml').write_text(
        'scene: four_bar\nvary: parts.csv\nsampling: random\nmembers: 9\n'
    )
    assert load_study(tmp_path / 'study.yaml').members == 9


@pytest.mark.parametrize(
    ('vary', 'said'),
    [
        (
            'coupler.mass: [1, oops]',
            "4: vary.coupler.mass[1]: not a number, got 'oops'; expected a finite number",
        ),
        (
            'coupler.mass:\n  - 1\n  - .inf',
            "6: vary.coupler.mass[1]: not a finite number, got '.inf'",
        ),
        ('coupler.mass: [1, nan]', "4: vary.coupler.mass[1]: not a finite number, got 'nan'"),
        ('coupler.mass: [1, 1e60]', "4: vary.coupler.mass[1]: too large, got '1e+60'"),
        ('coupler.mass: [1, 2*q]', "4: vary.coupler.mass[1]: unknown name 'q' in '2*q'"),
        (
            'gravity.acceleration: [[0, -9], [0, nan]]',
            "4: vary.gravity.acceleration[1]: not a finite number, got 'nan'",
        ),
        ('gravity.acceleration: [[0, -9], oops]', '4: vary.gravity.acceleration[1]: not a number'),
        ('solver.tolerance: [1.0e-8, oops]', '4: vary.solver.tolerance[1]: not a number'),
        ('joints.crank_pin.effort: [1, oops]', '4: vary.joints.crank_pin.effort[1]: not a number'),
    ],
)
def test_a_listed_value_that_is_no_number_is_refused(vary, said, tmp_path):
    """Before any member runs, with its line: it is a slip of the pen, and no member that fails."""
    file = tmp_path / 'study.yaml'
    file.write_text(
        f'scene: slider_crank\nsampling: grid\nvary:\n {vary}\n'.replace('\n ', '\n  ')
    )
    with pytest.raises(InputError, match=re.escape(f'study.yaml:{said}')):
        load_study(file)


def test_a_cell_that_is_no_number_is_refused(tmp_path):
    """With its line in the file of members; a word where the scene has a word stays."""
    file = tmp_path / 'parts.csv'
    file.write_text('coupler.mass, solver.integrator\n1, rk4\n\n2, oops\ninf, rk4\n')
    said = re.escape(
        "parts.csv:5: coupler.mass: not a finite number, got 'inf'; expected a finite"
    )
    with pytest.raises(InputError, match=said):
        ensemble('slider_crank', file)


def test_values_of_some_members_only():
    """A quotient of parameters may be a number in other members; a mass below zero is a member
    that fails; a motion is a function of time."""
    vary: dict[str, Any] = {'L': [2.0, '1/(m-1)', 1.0], 'coupler.mass': [1.0, 2.0, -1.0]}
    made = study_of('slider_crank', vary, sampling='table', duration=0.1)
    assert made.members == 3
    with pytest.raises(InputError, match='mass'):
        made.scene_of(2)
    driven = {'drives.turn.angle': ['0.5*t', 1.0]}
    scene = {
        'mechanism': 'slider_crank',
        'drives': {'turn': {'joint': 'crank_pin', 'angle': 'pi/4'}},
    }
    assert study_of(scene, driven, sampling='table', duration=0.1).members == 2


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', 'no members in the file'),
        ('coupler.mass\n', 'no members in the file'),
        ('1.0,2.0\n3.0,4.0\n', "1: no name in column 1, got '1.0'; expected a line of names"),
        ('coupler.mass,\n1,2\n', '1: no name in column 2'),
        ('a,b,a\n1,2,3\n', "1: named twice, got 'a'"),
        ('# x\na,b\n1,2\n1\n', '4: wrong number of columns; expected 2 columns'),
        ('a,b\n1,\n', '2: b: an empty cell'),
        ('a;b\n1;2\n', "1: no commas between the columns, got 'a;b'"),
        ('a\tb\n1\t2\n', '1: no commas between the columns'),
        ('a\n"1\n"\n2\n', '2: not a line of a table: unexpected end of data'),
        ('a\n"1"5\n', "2: not a line of a table: ',' expected after '\"'"),
        pytest.param(
            f'a\n{"1" * 140_000}\n', '2: not a line of a table: field larger than', id='long'
        ),
    ],
)
def test_a_file_of_members_that_cannot_be_is_said(text, said, tmp_path):
    (tmp_path / 'parts.csv').write_text(text)
    samplings: list[Any] = [None, np.zeros(3)]
    for sampling in samplings:
        with pytest.raises(InputError, match=f'parts.csv:? ?{re.escape(said)}'):
            ensemble('four_bar', tmp_path / 'parts.csv', sampling=sampling)
    (tmp_path / 'study.yaml').write_text('scene: four_bar\nvary: none.csv\n')
    with pytest.raises(InputError, match=r"yaml:2: vary: no such file, got '.*none\.csv'"):
        load_study(tmp_path / 'study.yaml')


def test_each_value_of_a_list_is_equally_likely():
    sampling = Sampling('random', {'a': ('x', 'y', 'z')}, 3000, 0)
    found = [sampling.values(k)['a'] for k in range(3000)]
    assert stats.chisquare([found.count(value) for value in 'xyz']).pvalue > 0.01


@pytest.mark.parametrize(
    ('kind', 'vary', 'members', 'said'),
    [
        ('dice', TWO, 3, "sampling: no such sampling, got 'dice'; known: random, lhs"),
        (None, TWO, 3, 'sampling: nothing given; known: random, lhs'),
        ('random', {}, 3, 'vary: nothing varies; expected {name: distribution or list}'),
        ('random', TWO, None, 'members: how many?; expected a whole number'),
        ('saltelli', TWO, 30, 'members: not usable for Sobol indices, got 30; expected 4 times'),
        ('grid', TWO, None, 'vary.a: a distribution in a grid; expected a list'),
        ('grid', {'a': ('1', '2')}, 3, 'members: a grid has fewer, got 3; expected 2 at most'),
        ('table', {'a': ('1',), 'b': ('1', '2')}, None, 'vary: lists of other lengths'),
    ],
)
def test_what_cannot_be_is_said(kind, vary, members, said):
    with pytest.raises(InputError, match=f'^{re.escape(said)}'):
        Sampling(kind, vary, members, 0)


@pytest.mark.parametrize(
    ('data', 'said'),
    [
        ({'normal': [1.0, -0.1]}, 'x: normal: impossible parameters'),
        (
            {'triangular': [1.0, 1.0, 1.0]},
            "x: triangular: impossible parameters, got {'low': 1.0, 'mode': 1.0, 'high': 1.0}; "
            'expected low <= mode <= high, low < high',
        ),
        ({'normal': [1.0]}, 'x: normal: wrong parameters, got [1.0]'),
        ({'gauss': {'mean': 1.0}}, "x: no such distribution, got 'gauss'; known: uniform, normal"),
        (
            {'weibul_min': {'c': 2.0}},
            "x: no such distribution, got 'weibul_min'; did you mean 'weibull_min'?",
        ),
        ({'unifrm': [1.0, 2.0]}, "x: no such distribution, got 'unifrm'; did you mean 'uniform'?"),
        ({'uniform': {'low': 1.0, 'high': float('inf')}}, 'x: uniform.high: not finite, got inf'),
        ({'beta': {'a': -1.0, 'b': 2.0}}, 'x: beta: impossible parameters'),
        (
            {'weibull_min': {'c': 2.0, 'scal': 0.1}},
            "x: weibull_min: unknown key, got 'scal'; did you mean 'scale'?",
        ),
        ({'weibull_min': {'scale': 0.1}}, "x: weibull_min: missing key 'c'"),
        ('normal', "x: not a distribution, got 'normal'; expected {normal: [mean, deviation]}"),
    ],
)
def test_a_distribution_that_cannot_be_is_said(data, said):
    with pytest.raises(InputError, match=f'^{re.escape(said)}'):
        distribution(data, 'x')
