"""Which rate of the log would hold, from what topics have cost: arithmetic on made-up costs."""

import io

import pytest
from rclpy.parameter import Parameter

from alf_ros.ros.simulator.node import Simulator, Stop
from alf_ros.ros.simulator.output_costs import Spent, TopicCost, rounded
from alf_ros.ros.terminal import StatusLine

MS = 1e-3


def spent(step=0.2 * MS, period=1.0 * MS, writing=0.0, written=0, **topics):
    return Spent(1000, period, step, topics, writing, written)


def cost(made, sent=0.0, logged=0, published=False):
    """Per tick, of a thousand ticks."""
    return TopicCost(1000 * made, 1000 * sent, 1000 * logged, published)


def test_what_fits_in_a_tick_needs_no_advice():
    found = spent(a=cost(0.3 * MS), b=cost(0.1 * MS, 0.1 * MS, published=True))
    assert found.outputs == pytest.approx(0.5 * MS)
    assert (found.slowest, found.lasting_part, found.advice(1000.0)) == ('a', 1.0, '')
    assert found.lasting_rate(1000.0) == 1000.0


def test_topics_of_the_log_alone_can_be_thinned_out():
    # 0.9 ms of a tick may be used: 0.2 by the step, 0.3 by what is published; 0.4 are left of 0.8
    found = spent(a=cost(0.8 * MS, logged=100), b=cost(0.1 * MS, 0.2 * MS, published=True))
    assert found.lasting_part == pytest.approx(0.5)
    assert found.advice(1000.0) == 'record.rate.all:=500 would hold'


def test_the_writing_thread_follows_so_many_bytes():
    # it takes 2 µs a kB and would have to take 900 kB of each tick of 1 ms
    found = spent(
        a=cost(0.1 * MS, logged=600_000),
        b=cost(0.1 * MS, logged=300_000),
        writing=1.0,
        written=500_000_000,
    )
    assert found.writer_load == pytest.approx(1.8) and found.largest == 'a'
    assert found.lasting_part == pytest.approx(0.5)


def test_what_no_rate_of_the_log_helps():
    slow = spent(step=1.2 * MS, a=cost(0.5 * MS, logged=100))
    assert slow.lasting_rate(1000.0) == 0.0
    assert slow.advice(1000.0) == 'a step takes 1.2 ms of a tick of 1 ms'
    read = spent(b=cost(0.9 * MS, published=True))
    assert read.advice(1000.0) == 'b costs most: turn it off, or lower `rate`'


def test_a_run_as_fast_as_possible_needs_no_advice():
    assert spent(period=0.0, a=cost(5.0)).advice(1000.0) == ''


def test_rates_are_rounded_down():
    assert [rounded(rate) for rate in (123.4, 999.9, 100.0, 0.0372, 0.0)] == [
        120.0,
        990.0,
        100.0,
        pytest.approx(0.037),
        0.0,
    ]


def test_another_scene_does_not_ask_for_topics_that_it_lacks(tmp_path, peer):
    given = {'start_paused': True, 'record.folder': str(tmp_path), 'status_line': False}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = Simulator(StatusLine(stream=io.StringIO()), Stop(), overrides)
    try:
        node.begin()
        node._control.run.send()
        scene = Parameter('scene', value='rolling_disk')  # without joint coordinates
        assert node.set_parameters_atomically([scene]).successful
        assert node._outputs.costs()['joint_states'].made == 0.0
    finally:
        node.close()
        node.destroy_node()
