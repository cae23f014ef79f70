"""Rate, jitter and clock, from the stamps of the states."""

from collections.abc import Iterator

import numpy as np

from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.preflight.graph_snapshot import STATES, StateSeen
from redres_ros.preflight.verdict import Level, Verdict

_FEWEST = 10  # states for an estimate of the rate
_RATE_ERROR = 0.02  # fraction by which the rate may differ
_HALF = 0.5  # of a period: stamps that jitter by more are ambiguous
_FEW = 0.01  # fraction of stamps that may jitter by more
_CLOCKS = 1.0  # [s] by which two clocks may differ without a note


def judge_stamps(states: tuple[StateSeen, ...], rate: float) -> Iterator[Verdict]:
    """Verdicts on the stamps of the states.

    Args:
        states: In the order in which they came.
        rate: Cycles a second that are expected [Hz].
    """
    if not states:
        return
    stamps = np.array([state.stamp for state in states]) / 1e9  # [s]
    if not stamps.all():
        yield Verdict(Level.FAULT, 'stamps', f'{STATES} without a stamp')
        return
    stamps = np.unique(stamps)  # a robot that waits for its answer sends a state again
    if len(stamps) < _FEWEST:
        text = f'only {len(stamps)} states came; too few to estimate the rate'
        yield Verdict(Level.FAULT, 'rate', text)
        return
    period = float(np.median(np.diff(stamps)))  # [s]
    if abs(period * rate - 1.0) > _RATE_ERROR:
        text = f'{1.0 / period:.4g} states a second; expected {rate:g}: change the parameter rate'
        yield Verdict(Level.FAULT, 'rate', text)
    else:
        yield Verdict(Level.OK, 'rate', f'{1.0 / period:.4g} states a second')
        yield _judge_jitter(states, rate)
    apart = states[-1].arrived / NANOSECONDS - stamps[-1]
    if abs(apart) > _CLOCKS:
        text = f"the robot's clock is {apart:.3g} s from this computer's; stamp task velocities 0"
        yield Verdict(Level.NOTE, 'clock', text)


def _judge_jitter(states: tuple[StateSeen, ...], rate: float) -> Verdict:
    """Whether the controller, which counts cycles in the same way, can number every state."""
    cycles = CycleCounter(round(NANOSECONDS / rate))
    stamps: list[int] = []  # [ns]
    numbers: list[int] = []
    refused = 0
    for state in states:
        if state.stamp == cycles.newest:
            continue
        try:
            cycles.enter(state.stamp, state.arrived / NANOSECONDS)
        except ClockError:
            refused += 1
            continue
        stamps.append(state.stamp - states[0].stamp)
        numbers.append(cycles.number)
    expected = np.polynomial.Polynomial.fit(numbers, stamps, 1)
    errors = np.abs(np.array(stamps) - expected(np.array(numbers))) / cycles.period
    lost = numbers[-1] - numbers[0] + 1 - len(numbers)
    gaps = f'; {lost} states did not come' if lost else ''
    text = f'stamps jitter by {100.0 * errors.max():.1f} % of a period at most{gaps}'
    unclear = refused + int(np.sum(errors > _HALF))
    if unclear > _FEW * len(states):
        text += f'; the cycle of {unclear} states is not clear, as they jitter by half a period'
        return Verdict(Level.FAULT, 'jitter', text)
    return Verdict(Level.OK, 'jitter', text)
