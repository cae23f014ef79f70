"""Claims of Section 6: experiments, here with the simulated arm behind the fake robot."""

import numpy as np

from redres_ros.paper.claims.claim import Finding, claim
from redres_ros.paper.experiment import (
    FINER,
    WINDOW,
    MeasuredMotion,
    VelocityDifference,
    differentiate,
)
from redres_ros.paper.runs import Runs
from redres_ros.simulation.recording import Recording

# fraction of the largest velocity up to which two experiments count as practically the same
_PRACTICAL = 0.02
_ALIKE = 0.05  # fraction of the joints' path up to which two motions count as very similar


@claim('6.1', 'With law (2) the robot is stopped for its acceleration, which peaks after 7 s')
def _stopped(runs: Runs) -> Finding:
    tried = runs['measured_2']
    ended = tried.recording['t'][-1]
    (peak, at) = tried.recording.peak('joint_acceleration_norm')
    return Finding(
        bool(tried.stop_reason) and 7.0 < ended < 9.0 and at > 7.0,
        f'stopped at {ended:.2f} s, {tried.stop_reason}; '
        f'largest commanded |ddq| {peak:.0f} rad/s^2 at {at:.2f} s',
    )


@claim('6.1', 'The peaks are seen in the measured acceleration after 7 s (Fig. 10)')
def _seen(runs: Runs) -> Finding:
    tried = runs['measured_2']
    before, after = (_largest(tried.motion, span) for span in ((0.0, 7.0), (7.0, np.inf)))
    fine = _largest(tried.motion_through(FINER))
    ideal = runs['ideal_2']
    peak, _ = ideal.peak('joint_acceleration_norm')
    return Finding(
        after > before,
        f'largest measured |ddq| {after:.1f} rad/s^2 after 7 s, {before:.1f} rad/s^2 before; '
        f'through a window of {FINER * ideal.T:g} s it is {fine:.1f} rad/s^2 after 7 s',
        f"the paper's window of {WINDOW * ideal.T:g} s shows a peak of {peak:.0f} rad/s^2 of an "
        f'ideal arm as {_filtered(ideal):.1f} rad/s^2; the rest is missing because the stop ends '
        'the motion before its peak',
    )


@claim('6.1', 'With law (23) the robot reaches the end (Fig. 11)')
def _finishes(runs: Runs) -> Finding:
    tried = runs['measured_23']
    end, _ = runs.experiment_model.tip(tried.q[-1])
    error = float(np.linalg.norm(end - runs.task.waypoints[-1]))
    return Finding(
        tried.recording.finished and error < 0.001,
        f'{tried.recording.ending}, {1e3 * error:.3f} mm from it',
    )


@claim('6.1', 'In the first part the two motions are very similar')
def _alike(runs: Runs) -> Finding:
    one = _until(runs['measured_2'].recording, runs.task.segment_time)
    two = _until(runs['measured_23'].recording, runs.task.segment_time)
    largest = float(np.abs(one - two).max())
    path = float(np.ptp(one, axis=0).max())
    return Finding(
        largest < _ALIKE * path,
        f'over the first segment at most {largest:.4f} rad apart, on a path of {path:.2f} rad',
    )


@claim('6.1', 'The commanded acceleration stays below that of law (2)')
def _lower_peak(runs: Runs) -> Finding:
    one, _ = runs['measured_2'].recording.peak('joint_acceleration_norm')
    two, _ = runs['measured_23'].recording.peak('joint_acceleration_norm')
    return Finding(
        two < one,
        f'largest commanded |ddq| {two:.1f} rad/s^2 with (23), '
        f'{one:.1f} rad/s^2 with (2) until it was stopped',
    )


@claim('6.1', 'So does the measured one (Figs. 10, 12)')
def _lower_measured_peak(runs: Runs) -> Finding:
    tried = runs['measured_2'], runs['measured_23']
    one, two = (_largest(each.motion) for each in tried)
    fine_one, fine_two = (_largest(each.motion_through(FINER)) for each in tried)
    recording = tried[0].recording
    span = (0.0, tried[0].motion.t[-1])
    longer = _largest(runs['measured_2_without_stop'].motion, span)
    ideal_one, ideal_two = (_filtered(runs[name]) for name in ('ideal_2', 'ideal_23'))
    return Finding(
        two < one,
        f'largest measured |ddq| {two:.1f} rad/s^2 with (23), {one:.1f} rad/s^2 with (2) until it '
        f'was stopped; {longer:.1f} rad/s^2 with (2) over the same time where nothing stops it; '
        f'through a window of {FINER * recording.T:g} s {fine_two:.1f} and {fine_one:.1f} rad/s^2',
        f"the stop at {recording['t'][-1]:.2f} s reverses it, not the paper's window of "
        f'{WINDOW * recording.T:g} s: of ideal arms the window shows {ideal_two:.1f} and '
        f'{ideal_one:.1f} rad/s^2',
    )


@claim('6.1', 'Law (23) and scheme (22) move the robot practically alike')
def _practically_23(runs: Runs) -> Finding:
    return _practically(runs.difference('measured_23_at_once', 'measured_22'))


@claim('6.1', 'What (23) commands and what is measured with (22) differ negligibly (Fig. 13)')
def _plotted_23(runs: Runs) -> Finding:
    return _plotted(runs.difference('measured_23_at_once', 'measured_22'))


@claim('6.2', 'Law (35) needs the points in reverse order to stay within the joint ranges')
def _reverse_order(runs: Runs) -> Finding:
    there = runs['measured_35_forward']
    back = runs['measured_35']
    return Finding(
        'position limit' in there.stop_reason and back.recording.finished,
        f'as in the other runs: {there.recording.ending}; '
        f'in reverse order: {back.recording.ending}',
        'the paper does not give the start of the reversed task; ours is where law (23) ends',
    )


@claim('6.2', 'Law (35) and scheme (29) with (34) move the robot practically alike')
def _practically_35(runs: Runs) -> Finding:
    return _practically(runs.difference('measured_35_at_once', 'measured_29'))


@claim('6.2', 'What (35) commands and what is measured with (29) differ negligibly (Fig. 16)')
def _plotted_35(runs: Runs) -> Finding:
    return _plotted(runs.difference('measured_35_at_once', 'measured_29'))


def _practically(difference: VelocityDifference) -> Finding:
    largest = float(difference.measured.max())
    speed = float(difference.dq.max())
    return Finding(
        largest < _PRACTICAL * speed,
        f'measured velocities at most {largest:.1e} rad/s apart, the largest being '
        f'{speed:.2f} rad/s; commanded ones at most {float(difference.commanded.max()):.1e} rad/s',
        'two experiments that begin between samples, with noise of 1e-5 rad and positions of which '
        'some are recorded late, all of it assumed',
    )


def _plotted(difference: VelocityDifference) -> Finding:
    at = int(np.argmax(difference.total))
    largest = float(difference.total[at])
    speed = float(difference.dq.max())
    return Finding(
        largest < _PRACTICAL * speed,
        f'at most {largest:.2f} rad/s at {difference.t[at]:.2f} s, {largest / speed:.0%} of the '
        f'largest velocity, half of the time below {np.median(difference.total):.3f} rad/s; at '
        f'that moment the filter alone makes {difference.filtered[at]:.2f} rad/s, servo, speed '
        f'limit and encoders {difference.servo[at]:.2f} rad/s, and the commands are '
        f'{difference.commanded[at]:.0e} rad/s apart',
        'compares a command with a filtered measurement, and so shows filter and servo rather than '
        'the difference of law and scheme',
    )


def _largest(motion: MeasuredMotion, span: tuple[float, float] = (0.0, np.inf)) -> float:
    """Largest |ddq| [rad/s^2] in a span of time [s]."""
    within = (motion.t >= span[0]) & (motion.t < span[1])
    return float(np.linalg.norm(motion.ddq[within], axis=1).max())


def _filtered(recording: Recording) -> float:
    """Largest |ddq| [rad/s^2] of an ideal arm, as the paper's filter shows it."""
    return _largest(differentiate(recording.vectors('q1'), recording.T))


def _until(recording: Recording, t: float) -> np.ndarray:
    return recording.vectors('q1')[: round(t / recording.T)]
