"""Ticks against a steady clock that the test winds."""

import pytest

from alf_ros.ros.simulator.pacing import BACKLOG, Pacer


def run(pacer, times):
    """Ticks made at each of the times."""
    made = []
    for now in times:
        due = pacer.due(now)
        for _ in range(due):
            pacer.done()
        made.append(due)
    return made


def test_one_tick_a_beat_whatever_the_jitter():
    pacer = Pacer(0.002, 1.0)
    jitter = [0.0, 3e-4, -3e-4, 4.5e-4, -4.5e-4, 1e-4] * 50
    assert run(pacer, [100.0 + 0.002 * k + jitter[k] for k in range(1, 300)]) == [1] * 299
    assert pacer.overruns == 0 and pacer.lost == 0.0


def test_nothing_is_owed_for_the_time_before_the_first_call():
    pacer = Pacer(0.002, 1.0)
    assert run(pacer, [1e6]) == [1]
    pacer.start()
    assert run(pacer, [2e6]) == [1]
    assert pacer.lost == 0.0


def test_a_short_delay_is_caught_up():
    pacer = Pacer(0.002, 1.0)
    made = run(pacer, [0.0, 0.002, 0.0241, 0.026])
    assert made == [1, 1, 11, 1] and pacer.overruns == 1 and pacer.lost == 0.0


def test_a_long_delay_is_lost_beyond_the_bound():
    pacer = Pacer(0.002, 1.0)
    made = run(pacer, [0.0, 0.002, 5.004])
    assert made[2] <= 1 + BACKLOG / 0.002 and made[2] >= BACKLOG / 0.002
    assert pacer.lost == pytest.approx(5.0 - BACKLOG)
    assert run(pacer, [5.006]) == [1]


@pytest.mark.parametrize('factor', [0.25, 2.0])
def test_the_factor_scales_ticks_to_real_time(factor):
    pacer = Pacer(0.004, factor)
    assert pacer.beat == pytest.approx(0.004 / factor)
    run(pacer, [k * 0.001 for k in range(3001)])
    assert pacer.ticks * 0.004 == pytest.approx(3.0 * factor, abs=0.01)
    assert pacer.achieved == pytest.approx(factor, rel=0.02)


def test_many_ticks_share_a_beat_when_they_are_short():
    pacer = Pacer(0.0001, 1.0)
    assert pacer.beat == 0.001
    assert sum(run(pacer, [k * 0.001 for k in range(1001)])) == pytest.approx(10_000, abs=2)
    assert pacer.overruns == 0


def test_factor_zero_does_not_pace():
    pacer = Pacer(0.002, 0.0)
    assert pacer.due(0.0) > 1_000_000 and pacer.due(0.0) > 1_000_000


def test_lateness_is_told_by_median_and_percentile():
    pacer = Pacer(0.01, 1.0)
    run(pacer, [k * 0.01 + (0.003 if k % 10 == 5 else 0.001 * (k > 0)) for k in range(102)])
    assert pacer.lateness == pytest.approx((0.001, 0.003))
