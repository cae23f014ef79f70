"""Claims of Section 6: experiments, here with the simulated arm behind the fake robot."""

import numpy as np

from redres_ros.paper.claims.claim import Claim, Finding
from redres_ros.paper.experiment import Experiment
from redres_ros.paper.figures.runs import Runs
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording
from redres_ros.waypoints import WaypointTask

# share of the largest velocity up to which two experiments count as practically the same
_PRACTICAL = 0.02
_ALIKE = 0.05  # share of the joints' way up to which two motions count as very similar


def stopped(runs: Runs) -> Finding:
    """The run of Figs. 9 and 10."""
    tried = runs.experiment_minimum_velocity
    ended = tried.recording['t'][-1]
    (peak, at) = tried.recording.peak('joint_acceleration_norm')
    return Finding(
        bool(tried.stop_reason) and 7.0 < ended < 9.0 and at > 7.0,
        f'stopped at {ended:.2f} s, {tried.stop_reason}; '
        f'largest commanded |ddq| {peak:.0f} rad/s^2 at {at:.2f} s',
    )


def finishes(runs: Runs) -> Finding:
    """The run of Figs. 11 and 12."""
    tried = runs.experiment_damped
    error = _end_error(tried, runs.experiment_model, runs.task)
    return Finding(
        tried.recording.finished and error < 0.001,
        f'{tried.recording.ending}, {1e3 * error:.3f} mm from it',
    )


def lower_peak(runs: Runs) -> Finding:
    """Peaks of Figs. 10 and 12."""
    one, _ = runs.experiment_minimum_velocity.recording.peak('joint_acceleration_norm')
    two, _ = runs.experiment_damped.recording.peak('joint_acceleration_norm')
    return Finding(
        two < one,
        f'largest commanded |ddq| {two:.1f} rad/s^2 with (23), '
        f'{one:.1f} rad/s^2 with (2) until it was stopped',
    )


def alike(runs: Runs) -> Finding:
    """Joint paths of the two laws over the first segment."""
    one = _until(runs.experiment_minimum_velocity.recording, runs.task.segment_time)
    two = _until(runs.experiment_damped.recording, runs.task.segment_time)
    apart = float(np.abs(one - two).max())
    way = float(np.ptp(one, axis=0).max())
    return Finding(
        apart < _ALIKE * way,
        f'over the first segment at most {apart:.4f} rad apart, on a way of {way:.2f} rad',
    )


def practically_23(runs: Runs) -> Finding:
    """Fig. 13."""
    return _practically(runs.experiment_damped_unblended, runs.experiment_22)


def practically_35(runs: Runs) -> Finding:
    """Fig. 16."""
    return _practically(runs.experiment_35_unblended, runs.experiment_29)


def reverse_order(runs: Runs) -> Finding:
    """Law (35) with the points in either order."""
    there = runs.experiment_35_forward
    back = runs.experiment_35
    return Finding(
        'position limit' in there.stop_reason and back.recording.finished,
        f'as in the other runs: {there.recording.ending}; '
        f'in reverse order: {back.recording.ending}',
        'the paper does not give the start of the reversed task; ours is where law (23) ends',
    )


def _practically(one: Experiment, two: Experiment) -> Finding:
    ticks = min(len(one.motion.dq), len(two.motion.dq))
    apart = float(np.linalg.norm(one.motion.dq[:ticks] - two.motion.dq[:ticks], axis=1).max())
    speed = float(np.linalg.norm(one.motion.dq, axis=1).max())
    return Finding(
        apart < _PRACTICAL * speed,
        f'measured velocities at most {apart:.1e} rad/s apart, the largest being {speed:.2f} rad/s',
        'closer than in the paper: the fake robot takes every sample in time '
        'and measures without noise',
    )


def _until(recording: Recording, t: float) -> np.ndarray:
    return recording.vectors('q1')[: round(t / recording.T)]


def _end_error(tried: Experiment, model: RobotModel, task: WaypointTask) -> float:
    return float(np.linalg.norm(model.tip(tried.q[-1])[0] - task.waypoints[-1]))


EXPERIMENTAL = (
    Claim(
        '6.1',
        'With law (2) the robot is stopped for its acceleration, which peaks after 7 s (Fig. 10)',
        stopped,
    ),
    Claim('6.1', 'With law (23) the robot reaches the end (Fig. 11)', finishes),
    Claim('6.1', 'In the first part the two motions are very similar', alike),
    Claim('6.1', 'The acceleration stays below that of law (2) (Figs. 10, 12)', lower_peak),
    Claim(
        '6.1', 'Law (23) and scheme (22) move the robot practically alike (Fig. 13)', practically_23
    ),
    Claim(
        '6.2',
        'Law (35) needs the points in reverse order to stay within the joint ranges',
        reverse_order,
    ),
    Claim(
        '6.2',
        'Law (35) and scheme (29) with (34) move the robot practically alike (Fig. 16)',
        practically_35,
    ),
)
