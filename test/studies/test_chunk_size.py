"""Without a size of its own, a chunk has about two seconds of what really runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import alf_ros
from alf_ros.studies.ensemble.chunk_size import cost_of
from alf_ros.studies.ensemble.crews import ThisProcess
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of
from support.ensemble_kills import seals

MASS = {'coupler.mass': {'normal': [1.0, 0.05]}}
FIXED = {'solver.integrator': ['dop853'], 'solver.step': [0.025]}


def _slider_crank(vary: dict[str, Any], members: int = 10**6, **settings: Any) -> Study:
    given: dict[str, Any] = {'outputs': ['final(energy)'], 'period': 1.0, **settings}
    return study_of('slider_crank', MASS | vary, members=members, **given)


def test_members_in_lanes_are_many() -> None:
    """A chunk of slider-cranks of 10 s, which take 0.6 ms each side by side, had the size for
    those that run alone: 256 of them."""
    together = _slider_crank(FIXED)
    assert together.chunk == 4096
    built = _slider_crank(FIXED, outputs=['final(crank_pin.force)'])
    implicit = _slider_crank(FIXED | {'solver.integrator': ['esdirk43']})
    assert implicit.chunk < built.chunk < together.chunk


def test_a_solver_that_varies_is_counted() -> None:
    """The solver of the scene was, which no member may have."""
    coarse, fine, both = (
        cost_of(
            study_of(
                'slider_crank',
                {'solver.integrator': ['dop853'], 'solver.step': steps},
                sampling='grid',
                outputs=['final(energy)'],
                duration=2.0,
                period=1.0,
            )
        ).seconds
        for steps in ([0.02], [0.0002], [0.02] * 500 + [0.0002] * 500)
    )
    assert 50.0 < fine / coarse < 100.0
    assert both == pytest.approx(0.5 * (coarse + fine), rel=1e-12)


def test_a_study_of_few_members_is_shared_out() -> None:
    """64 pieces, but not of fewer members than two registers hold."""
    assert _slider_crank(FIXED, members=100_000).chunks == 49
    assert _slider_crank(FIXED, members=8192).chunk == 128
    assert _slider_crank(FIXED, members=100).chunk == 16
    assert _slider_crank({'solver.integrator': ['esdirk43']}, members=100).chunk == 2


def test_long_histories_need_smaller_chunks() -> None:
    """The arrays of a chunk have 16 MiB at most."""
    short = {'solver.integrator': ['rk4'], 'solver.step': [0.001]}
    kept = ['energy', 'points.B', 'points.A']  # five numbers
    study = _slider_crank(short, outputs=kept, duration=0.5, period=0.001)
    assert study.chunk == 512 and 8 * 5 * 501 * study.chunk < 2**24


def test_the_size_is_that_of_an_earlier_store(tmp_path: Path) -> None:
    """As another version may have chosen it: nothing is computed again."""
    settings: dict[str, Any] = {'members': 6, 'duration': 0.1, 'outputs': ['final(energy)']}
    store = tmp_path / 'run'
    earlier = study_of('slider_crank', MASS, chunk=4, **settings)
    conduct(earlier, store, ThisProcess())
    before = seals(store)
    default = study_of('slider_crank', MASS, **settings)
    assert default.chunk != 4 and before.keys() == {'0.json', '1.json'}
    found = alf_ros.ensemble('slider_crank', MASS, store=store, workers=0, **settings)
    assert seals(store) == before
    plain = alf_ros.ensemble('slider_crank', MASS, workers=0, **settings)
    assert found['final_energy'].values.tobytes() == plain['final_energy'].values.tobytes()
    with pytest.raises(alf_ros.InputError, match='^store.chunk: the store of another study'):
        alf_ros.ensemble('slider_crank', MASS, store=store, workers=0, chunk=3, **settings)


@pytest.mark.parametrize('said', ['{"study": {"chunk": "4"}}', '{"study": {"chunk": -1}}', '{'])
def test_a_manifest_without_a_size_is_refused_by_the_store(tmp_path: Path, said: str) -> None:
    (tmp_path / 'run' / '.alf_ros').mkdir(parents=True)
    (tmp_path / 'run' / '.alf_ros' / 'manifest.json').write_text(said)
    with pytest.raises(alf_ros.InputError, match='^store'):
        alf_ros.ensemble('slider_crank', MASS, members=2, duration=0.1, store=tmp_path / 'run')
