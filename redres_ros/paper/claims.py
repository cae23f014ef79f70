"""Every measurable sentence of the paper on motions, and our readings. Its identities are tests."""

from typing import Any

import numpy as np

from redres_ros.paper.claim import ASSUMPTION, Claim, Finding, claim
from redres_ros.paper.experiment import (
    FINER,
    WINDOW,
    MeasuredMotion,
    VelocityDifference,
    differentiate,
    velocity_difference,
)
from redres_ros.paper.runs import SIMULATION_T, TWO_ROUNDS, Runs
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.simulation.recording import Recording

ROUNDING = 1e-9  # [rad/s] what 'zero up to numerical rounding' means here

# fraction of the largest velocity up to which two experiments count as practically the same
_PRACTICAL = 0.02
_ALIKE = 0.05  # fraction of the joints' path up to which two motions count as very similar
_AT_START = 1e-3  # [m] up to which q(0) is at x_0

# --- simulations with an ideal arm ---------------------------------------------------------------


@claim(
    '3.2',
    'Without damping the joints float on the self-motion manifold; null-space damping removes that',
)
def _drift(runs: Runs) -> Finding:
    tick = round(runs.task.segment_time / SIMULATION_T) - 1
    without = runs['simulated_15']['null_velocity_norm'][tick]
    damped = runs['simulated_23']['null_velocity_norm'][tick]
    return Finding(
        bool(without > 10.0 * damped),
        f'with the tip at rest after {runs.task.segment_time:g} s the joints float at '
        f'{without:.3g} rad/s, with damping at {damped:.2g} rad/s',
    )


@claim(
    '4.1',
    'With the norm weighted by M^-2 the motion stays bounded in longer tasks, '
    'unlike with the plain torque norm',
)
def _bounded(runs: Runs) -> Finding:
    speeds = {case: _peak(runs, case, 'velocity')[0] for case in TWO_ROUNDS}
    held = all(
        speed < min(speeds[dynamics, 'minimum_torque', damping], 100.0)
        for (dynamics, law, damping), speed in speeds.items()
        if law == 'minimum_weighted_torque'
    )
    listed = [
        f'{dynamics}, {law}, k_d = {damping:g}: {speed:.3g}'
        for (dynamics, law, damping), speed in speeds.items()
    ]
    return Finding(
        held,
        f'largest |dq| over two rounds of the rectangle [rad/s]: {"; ".join(listed)}',
        'bounded where the model is the identified one; '
        'with the cylinder model and no damping either norm diverges',
    )


@claim('5.1', 'Law (23) and scheme (22) give the same velocities up to rounding (Fig. 5)')
def _equivalence_damped(runs: Runs) -> Finding:
    return _same_motion(runs, 'simulated_23', 'simulated_22')


@claim(
    '5.1',
    'Without damping the arm drifts to a singular configuration, '
    'and the acceleration peaks rise 40 times',
)
def _peaks(runs: Runs) -> Finding:
    """At the sampling times of simulation and experiment."""
    without, at = _peak(runs, 'simulated_15')
    damped, _ = _peak(runs, 'simulated_23')
    ratio = without / damped
    slower = _peak(runs, 'ideal_15')[0] / _peak(runs, 'ideal_23')[0]
    return Finding(
        min(ratio, slower) > 10.0,
        f'{without:.1f} rad/s^2 at {at:.2f} s against {damped:.2f} rad/s^2: '
        f'{ratio:.0f} times at 1 ms; {slower:.0f} times at 2 ms',
        'the paper says 40; held means by more than ten times, since the undamped motion depends '
        'on every detail of the arm, and the paper does not give its link lengths',
    )


@claim('5.1', 'Law and scheme still behave alike without damping')
def _equivalence_undamped(runs: Runs) -> Finding:
    return _same_motion(runs, 'simulated_15', 'simulated_16')


@claim('5.2', 'Law (35) moves the joints faster than law (23) (Figs. 4, 7)')
def _faster(runs: Runs) -> Finding:
    damped, _ = _peak(runs, 'simulated_23', 'velocity')
    law_35, _ = _peak(runs, 'simulated_35', 'velocity')
    return Finding(
        law_35 > damped, f'largest |dq| {law_35:.2f} rad/s with (35), {damped:.2f} rad/s with (23)'
    )


@claim('5.2', 'Law (35) and scheme (29) with (34) give the same velocities up to rounding (Fig. 8)')
def _equivalence_35(runs: Runs) -> Finding:
    return _same_motion(runs, 'simulated_35', 'simulated_29')


# --- experiments, here with the simulated arm behind the fake robot ------------------------------


@claim('6.1', 'With law (2) the robot is stopped for its acceleration, which peaks after 7 s')
def _stopped(runs: Runs) -> Finding:
    tried = runs['measured_2']
    ended = tried['t'][-1]
    peak, at = _peak(runs, 'measured_2')
    return Finding(
        bool(tried.stop_reason) and 7.0 < ended < 9.0 and at > 7.0,
        f'stopped at {ended:.2f} s, {tried.stop_reason}; '
        f'largest commanded |ddq| {peak:.0f} rad/s^2 at {at:.2f} s',
    )


@claim('6.1', 'The peaks are seen in the measured acceleration after 7 s (Fig. 10)')
def _seen(runs: Runs) -> Finding:
    tried = runs['measured_2']
    before, after = (_largest(tried.motion(), span) for span in ((0.0, 7.0), (7.0, np.inf)))
    fine = _largest(tried.motion(FINER))
    ideal = runs['ideal_2']
    peak, _ = _peak(runs, 'ideal_2')
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
        tried.finished and error < 0.001,
        f'{tried.ending}, {1e3 * error:.3f} mm from it',
    )


@claim('6.1', 'In the first part the two motions are very similar')
def _alike(runs: Runs) -> Finding:
    until = round(runs.task.segment_time / runs['measured_2'].T)
    one = runs['measured_2'].vectors('q1')[:until]
    two = runs['measured_23'].vectors('q1')[:until]
    largest = float(np.abs(one - two).max())
    path = float(np.ptp(one, axis=0).max())
    return Finding(
        largest < _ALIKE * path,
        f'over the first segment at most {largest:.4f} rad apart, on a path of {path:.2f} rad',
    )


@claim('6.1', 'The commanded acceleration stays below that of law (2)')
def _lower_peak(runs: Runs) -> Finding:
    one, _ = _peak(runs, 'measured_2')
    two, _ = _peak(runs, 'measured_23')
    return Finding(
        two < one,
        f'largest commanded |ddq| {two:.1f} rad/s^2 with (23), '
        f'{one:.1f} rad/s^2 with (2) until it was stopped',
    )


@claim('6.1', 'So does the measured one (Figs. 10, 12)')
def _lower_measured_peak(runs: Runs) -> Finding:
    first = runs['measured_2']
    second = runs['measured_23']
    one, two = (_largest(each.motion()) for each in (first, second))
    fine_one, fine_two = (_largest(each.motion(FINER)) for each in (first, second))
    span = (0.0, first.motion().t[-1])
    longer = _largest(runs['measured_2_without_stop'].motion(), span)
    ideal_one, ideal_two = (_filtered(runs[name]) for name in ('ideal_2', 'ideal_23'))
    return Finding(
        two < one,
        f'largest measured |ddq| {two:.1f} rad/s^2 with (23), {one:.1f} rad/s^2 with (2) until it '
        f'was stopped; {longer:.1f} rad/s^2 with (2) over the same time where nothing stops it; '
        f'through a window of {FINER * first.T:g} s {fine_two:.1f} and {fine_one:.1f} rad/s^2',
        f"the stop at {first['t'][-1]:.2f} s reverses it, not the paper's window of "
        f'{WINDOW * first.T:g} s: of ideal arms the window shows {ideal_two:.1f} and '
        f'{ideal_one:.1f} rad/s^2',
    )


@claim('6.1', 'Law (23) and scheme (22) move the robot practically alike')
def _practically_23(runs: Runs) -> Finding:
    return _practically(runs, 'measured_23_at_once', 'measured_22')


@claim('6.1', 'What (23) commands and what is measured with (22) differ negligibly (Fig. 13)')
def _plotted_23(runs: Runs) -> Finding:
    return _plotted(runs, 'measured_23_at_once', 'measured_22')


@claim('6.2', 'Law (35) needs the points in reverse order to stay within the joint ranges')
def _reverse_order(runs: Runs) -> Finding:
    there = runs['measured_35_forward']
    back = runs['measured_35']
    return Finding(
        'position limit' in there.stop_reason and back.finished,
        f'as in the other runs: {there.ending}; in reverse order: {back.ending}',
        'the paper does not give the start of the reversed task; ours is where law (23) ends',
    )


@claim('6.2', 'Law (35) and scheme (29) with (34) move the robot practically alike')
def _practically_35(runs: Runs) -> Finding:
    return _practically(runs, 'measured_35_at_once', 'measured_29')


@claim('6.2', 'What (35) commands and what is measured with (29) differ negligibly (Fig. 16)')
def _plotted_35(runs: Runs) -> Finding:
    return _plotted(runs, 'measured_35_at_once', 'measured_29')


# --- our readings of the paper -------------------------------------------------------------------


@claim(
    '5',
    'The arm is an LWR IV with a raised base and a tool, whose lengths the paper does not give',
    ASSUMPTION,
)
def _geometry(runs: Runs) -> Finding:
    arm = find_arm(runs.task.robot)
    bare = RobotModel(find_arm(runs.task.robot, base_offset=0.0, tool_offset=0.0))
    miss, bare_miss = (_miss(runs, model) for model in (runs.model, bare))
    shoulder = runs.model.position(runs.task.start, 'link_2')
    needed = float(np.linalg.norm(runs.task.waypoints - shoulder, axis=1).max())
    reach, bare_reach = (_reach(model) for model in (runs.model, bare))
    return Finding(
        miss < _AT_START and bare_reach < needed < reach,
        f'with the base {1e3 * arm.base_offset:g} mm higher and a tool of '
        f'{1e3 * arm.tool_offset:g} mm, q(0) is {1e3 * miss:.2f} mm from x_0, and the shoulder '
        f'reaches {reach:.3f} m of the {needed:.3f} m to the farthest point; with the bare arm '
        f'{1e3 * bare_miss:.0f} mm and {bare_reach:.3f} m',
        'the two lengths are those that fit q(0) and x_0 of the paper',
    )


@claim(
    '5',
    "The next segment begins once this one's time is over and the error is below 1 mm",
    ASSUMPTION,
)
def _switching(runs: Runs) -> Finding:
    rest = runs['simulated_23']
    early = runs['early_23']
    damped, _ = _peak(runs, 'simulated_23')
    ratio = _peak(runs, 'simulated_15')[0] / damped
    damped_early, _ = _peak(runs, 'early_23')
    ratio_early = _peak(runs, 'early_15')[0] / damped_early
    return Finding(
        ratio > 10.0 > ratio_early,
        f'so the task ends at {rest["t"][-1] + rest.T:.3f} s, largest |ddq| '
        f'{damped:.1f} rad/s^2, {ratio:.0f} times as much without '
        f'damping; with a switch as soon as the error is below 1 mm at '
        f'{early["t"][-1] + early.T:.3f} s, {damped_early:.0f} rad/s^2 and '
        f'{ratio_early:.1f} times',
        'the paper says only that the error is below 1 mm, and that the peaks rise 40 times, which '
        'a switch before the end of the time would hide: it is a step of the task velocity',
    )


CLAIMS: tuple[Claim, ...] = tuple(value for value in globals().values() if isinstance(value, Claim))


def _peak(runs: Runs, name: Any, norm: str = 'acceleration') -> tuple[float, float]:
    """The largest norm of what was commanded in a run, and its time [s]."""
    return runs[name].peak(f'joint_{norm}_norm')


def _same_motion(runs: Runs, law: str, scheme: str) -> Finding:
    """Whether a law and a scheme, each in its own closed loop, differ by rounding only."""
    largest = float(velocity_difference(runs[law], runs[scheme]).max())
    return Finding(
        largest <= ROUNDING, f'largest |dq_I - dq_II| {largest:.1e} rad/s over the whole task'
    )


def _practically(runs: Runs, law: str, scheme: str) -> Finding:
    difference = VelocityDifference.between(runs[law], runs[scheme])
    largest = float(difference.measured.max())
    speed = float(difference.dq.max())
    return Finding(
        largest < _PRACTICAL * speed,
        f'measured velocities at most {largest:.1e} rad/s apart, the largest being '
        f'{speed:.2f} rad/s; commanded ones at most {float(difference.commanded.max()):.1e} rad/s',
        'two experiments that begin between samples, with noise of 1e-5 rad and positions of which '
        'some are recorded late, all of it assumed',
    )


def _plotted(runs: Runs, law: str, scheme: str) -> Finding:
    difference = VelocityDifference.between(runs[law], runs[scheme])
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


def _miss(runs: Runs, model: RobotModel) -> float:
    """Distance of the tip from x_0 at q(0) [m]."""
    return float(np.linalg.norm(model.tip(runs.task.start)[0] - runs.task.waypoints[0]))


def _reach(model: RobotModel) -> float:
    """Distance of the tip from the shoulder with the arm stretched [m]."""
    stretched = np.zeros(model.n)
    return float(np.linalg.norm(model.tip(stretched)[0] - model.position(stretched, 'link_2')))
