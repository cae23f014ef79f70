"""Figures that others published for Saturation in the Null Space, beside ours."""

from redres_ros.paper.claims.claim import Claim, Finding
from redres_ros.paper.figures.runs import Runs
from redres_ros.paper.saturation import LWR, LWR_DAMPED, PLANAR, Benchmark, Saturated

_AS_LONG = 0.01  # of the time
_AS_STRAIGHT = 0.1  # of the angle


def lwr(runs: Runs) -> Finding:
    """The LWR without damping."""
    return _beside(
        LWR,
        runs.saturated_lwr,
        'their program gives 4.639 s and 0.0012 rad here too, and accelerates joint 6 by 664 '
        'deg/s^2 where 300 are allowed, for 0.18 s after the corner (as their own plot shows): it '
        'does not check its last resort, when no scaling is found',
    )


def lwr_damped(runs: Runs) -> Finding:
    """The LWR with its self-motion damped."""
    return _beside(LWR_DAMPED, runs.saturated_lwr_damped)


def planar(runs: Runs) -> Finding:
    """The planar arm."""
    return _beside(PLANAR, runs.saturated_planar)


def _beside(theirs: Benchmark, ours: Saturated, remark: str = '') -> Finding:
    longer = ours.seconds / theirs.seconds - 1.0
    straighter = ours.astray / theirs.astray
    held = abs(longer) < _AS_LONG and straighter < _AS_STRAIGHT and ours.used < 1.0 + 1e-9
    measured = (
        f'{ours.seconds:.3f} s, {100.0 * longer:+.1f} %; '
        f'{ours.astray:.1e} rad astray, where theirs goes {theirs.astray:g}; '
        f'{100.0 * ours.used:.0f} % of a limit at most'
    )
    return Finding(held, measured, '' if held else remark)


SATURATION = (
    Claim('SNS', f'The LWR goes there and back as fast as theirs, {LWR.seconds} s', lwr),
    Claim('SNS', f'The same with damping, {LWR_DAMPED.seconds} s', lwr_damped),
    Claim('SNS', f'The planar arm twice around a hexagon, {PLANAR.seconds} s', planar),
)
