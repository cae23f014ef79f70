"""Figures that others published for Saturation in the Null Space, beside ours."""

from redres_ros.paper.claims.claim import PUBLISHED, Finding, claim
from redres_ros.paper.runs import Runs
from redres_ros.paper.saturation import (
    LWR,
    LWR_DAMPED,
    PLANAR,
    PLANAR_CHOICES,
    Benchmark,
    SaturatedMotion,
)

_AS_LONG = 0.01  # of the time
_AS_STRAIGHT = 0.1  # of the angle


@claim('SNS', f'The LWR goes there and back as fast as theirs, {LWR.seconds} s', PUBLISHED)
def lwr(runs: Runs) -> Finding:
    """The LWR without damping."""
    return _compared(
        LWR,
        runs['published_lwr'],
        'their program gives 4.639 s and 0.0012 rad here too, and accelerates joint 6 by 664 '
        'deg/s^2 where 300 are allowed, for 0.18 s after the corner (as their own plot shows): it '
        'does not check its last resort, when no scaling is found',
    )


@claim('SNS', f'The same with damping, {LWR_DAMPED.seconds} s', PUBLISHED)
def lwr_damped(runs: Runs) -> Finding:
    """The LWR with its self-motion damped."""
    return _compared(LWR_DAMPED, runs['published_lwr_damped'])


@claim('SNS', f'The planar arm twice around a hexagon, {PLANAR.seconds} s', PUBLISHED)
def planar(runs: Runs) -> Finding:
    """The planar arm, and how much the outcome depends on our own choices."""
    others = ', '.join(
        f'{_longer(PLANAR, runs[f"published_{name}"]):+.1f} % with {_choices(choice)}'
        for name, choice in PLANAR_CHOICES.items()
    )
    remark = f'braking before a corner and damping are our choices, {_choices(PLANAR)}: {others}'
    return _compared(PLANAR, runs['published_planar'], remark)


def _choices(benchmark: Benchmark) -> str:
    """What we choose ourselves in a motion that others published."""
    return f'{benchmark.braking:g} m/s^2 and k_d = {benchmark.damping:g} 1/s'


def _compared(theirs: Benchmark, ours: SaturatedMotion, remark: str = '') -> Finding:
    longer = _longer(theirs, ours)
    straighter = ours.heading_error / theirs.heading_error
    held = (
        abs(longer) < 100.0 * _AS_LONG
        and straighter < _AS_STRAIGHT
        and ours.limit_usage < 1.0 + 1e-9
    )
    measured = (
        f'{ours.seconds:.3f} s, {longer:+.1f} %; heading error {ours.heading_error:.1e} rad, '
        f'theirs {theirs.heading_error:g} rad; '
        f'at most {100.0 * ours.limit_usage:.0f} % of a limit'
    )
    return Finding(held, measured, remark)


def _longer(theirs: Benchmark, ours: SaturatedMotion) -> float:
    """By how much our motion takes longer [%]."""
    return 100.0 * (ours.seconds / theirs.seconds - 1.0)
