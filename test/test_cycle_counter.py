"""Stamps of a robot's states, counted as cycles: perfect, jittering, drifting, set, reordered."""

from collections.abc import Iterable
from contextlib import nullcontext, suppress

import numpy as np
import pytest

from redres_ros.loop.cycle_counter import ClockError, CycleCounter

T = 2_000_000  # [ns]
EPOCH = 1_700_000_000 * 10**9  # [ns] as of a computer's clock


def counted(stamps: Iterable[int], late: float = 3e-4) -> list[int]:
    """What each state after the first one counts; the last but one comes late by so much [s]."""
    cycles = CycleCounter(T)
    *most, last_but_one, last = stamps
    arrivals = [stamp * 1e-9 + 3e-4 for stamp in most]
    arrivals += last_but_one * 1e-9 + late, last * 1e-9 + 3e-4
    counts = [cycles.enter(stamp, arrived) for stamp, arrived in zip(stamps, arrivals, strict=True)]
    assert counts[0] == 0
    return counts[1:]


@pytest.mark.parametrize('late', [3e-4, 0.1999])  # while the process is held up
def test_perfect_stamps_are_one_cycle_each_and_a_gap_is_as_many_as_it_holds(late: float) -> None:
    stamps = [EPOCH + k * T for k in (0, 1, 2, 3, 7, 8, 108)]
    assert counted(stamps, late) == [1, 1, 1, 4, 1, 100]


@pytest.mark.parametrize('share', [0.2, 0.4, 0.49])
@pytest.mark.parametrize('off', [-0.005, 0.0, 0.005])
def test_jitter_within_half_a_period_and_a_rate_half_a_percent_off_do_not_matter(share, off):
    jitter = np.random.default_rng(1).uniform(-share, share, 20_000)
    stamps = [EPOCH + round(T * (k * (1.0 + off) + jitter[k])) for k in range(20_000)]
    counts = counted(sorted(stamps))
    assert counts.count(1) >= 0.99 * len(counts)
    assert abs(sum(counts) - len(counts)) <= 0.01 * len(counts)


@pytest.mark.parametrize('step', [-3600, -0.9, -0.3, -0.005, -0.004, 0.05, 0.3, 0.9, 3600])
@pytest.mark.parametrize('lost', [0, 7])  # states
def test_a_clock_that_is_set_costs_one_state_at_most_and_no_cycle(step: float, lost: int) -> None:
    if -0.01 < step < 0.0 and lost:
        pytest.skip('looks like a state that is late')
    cycles = CycleCounter(T)
    counts = []
    for k in (*range(500), *range(500 + lost, 1000)):
        stamp = EPOCH + k * T + (round(step * 1e9) if k >= 500 else 0)
        with suppress(ClockError):
            counts.append(cycles.enter(stamp, k * 0.002))
    assert sum(counts) == 999
    assert len(counts) == 1000 - lost - (not 0.0 < step <= 1.0)


@pytest.mark.parametrize(
    'strays', [(5e9,), (-5e9,), (3e8,), (T / 2,), (-T,), (-2 * T, -T), (-T, -5 * T, -3 * T, -3 * T)]
)
@pytest.mark.parametrize('late', [0, 2, 11])
@pytest.mark.parametrize('came', [0.1985, 0.2012])
@pytest.mark.parametrize('jitter', [0.0, 0.2])
def test_strays_cost_no_cycle_however_late_the_next_state_comes(strays, late, came, jitter) -> None:
    cycles = CycleCounter(T)
    jitters = np.random.default_rng(5).uniform(-jitter, jitter, 102)
    stamps = [EPOCH + round(T * (k + jitters[k])) for k in range(102)]
    for k in range(100):
        cycles.enter(stamps[k], k * 0.002)
    for stray in strays:
        with nullcontext() if 0 < stray < 1e9 else pytest.raises(ClockError, match='a second'):
            cycles.enter(stamps[99] + round(stray), came)
    for k in (100, 101):
        cycles.enter(stamps[k], max(came, (k + late) * 0.002))
        assert cycles.number == k + 1


@pytest.mark.parametrize('back', [0.3, 0.5, 1.0, 1.5, 2.0, 3.0])  # periods
@pytest.mark.parametrize('jitter', [0.0, 0.1, 0.2])
@pytest.mark.parametrize('late', [0, 3])
def test_a_clock_that_is_set_back_by_a_few_periods_costs_no_cycle(back, jitter, late) -> None:
    cycles = CycleCounter(T)
    jitters = np.random.default_rng(3).uniform(-jitter, jitter, 120)
    for k in range(120):
        stamp = EPOCH + round(T * (k + jitters[k] - (back if k >= 100 else 0.0)))
        with suppress(ClockError):
            cycles.enter(stamp, max(k, 100 + late if k >= 100 else 0) * 0.002 + k * 1e-6)
            assert cycles.number == k + 1


def test_a_stamp_of_zero_is_refused() -> None:
    with pytest.raises(ClockError, match='no stamp'):
        CycleCounter(T).enter(0, 0.0)


def test_a_robot_that_starts_again_has_a_new_clock() -> None:
    cycles = CycleCounter(T)
    cycles.enter(EPOCH, 0.0)
    assert cycles.enter(EPOCH + 10 * 10**9, 10.0) == 0
    assert cycles.enter(10**9, 20.0) == 0
    assert cycles.enter(10**9 + T, 20.002) == 1


def test_states_at_twice_the_rate_are_refused_with_both_figures() -> None:
    cycles = CycleCounter(T)
    refused = []
    for k in range(100):
        try:
            cycles.enter(EPOCH + k * T // 2, k * 0.001)
        except ClockError as error:
            refused.append(str(error))
    assert 40 < len(refused) < 50
    assert '1 ms' in refused[0] and '2 ms' in refused[0] and '500 Hz' in refused[0]
    assert cycles.number <= 60  # nor does the arm move twice as fast


@pytest.mark.parametrize('apart', [25_000, 400_000, 1_800_000, 3_000_000_000])
def test_states_that_two_nodes_publish_are_reported_as_such(apart: int) -> None:
    cycles = CycleCounter(T)
    for k in range(300):
        for stamp in (EPOCH + k * T, EPOCH + k * T + apart):
            with suppress(ClockError):
                cycles.enter(stamp, stamp * 1e-9)
        assert k < 120 or 'two nodes publish the joints of this arm' in cycles.rate_error


def test_states_that_get_lost_do_not_look_like_another_rate() -> None:
    cycles = CycleCounter(T)
    random = np.random.default_rng(4)
    for k in np.flatnonzero(random.random(2000) > 0.3).tolist():
        cycles.enter(EPOCH + k * T, k * 0.002)
        assert cycles.rate_error == ''


def test_a_stamp_is_of_the_cycle_whose_state_has_it_or_of_the_nearest() -> None:
    cycles = CycleCounter(T)
    random = np.random.default_rng(2)
    stamps = [EPOCH + round(T * (k + random.uniform(-0.4, 0.4))) for k in range(100)]
    numbers = {}
    for stamp in stamps:
        cycles.enter(stamp, stamp * 1e-9)
        numbers[stamp] = cycles.number
    assert [cycles.cycle(stamp) for stamp in stamps] == [numbers[stamp] for stamp in stamps]
    assert cycles.cycle(stamps[-1] + 7 * T + T // 3) == cycles.number + 7
