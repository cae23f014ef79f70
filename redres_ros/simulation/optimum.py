"""The best motion along the path of a task, found by who knows all of it."""

from collections.abc import Iterable
from operator import itemgetter

import numpy as np

from redres_ros.kernels.look_ahead import improve_motion
from redres_ros.planning.planner import source_of
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording
from redres_ros.types import JointPositions, Seconds

_STEP = 0.02  # [s] of the motion, about
_STARTS = 2  # motions from which one is sought


def best_motion(
    model: RobotModel, task: WaypointTask, recordings: Iterable[Recording]
) -> tuple[float, JointPositions, Seconds] | None:
    """The least integral of |ddq|^2 [rad^2/s^3] along the nominal path within the joint ranges, the
    positions of that motion, (N, n), and the time from each to the next.

    A local optimum: the better one of two searches, which begin with the recorded motions of least
    acceleration. None without one that finished, or for a task that does not rest at its points.
    """
    if task.switching != 'at_rest':
        return None
    duration = task.segments * task.segment_time
    steps = max(round(duration / _STEP), 1)
    T = duration / steps
    times = T * np.arange(1, steps + 1)
    source = source_of(task, None, None)
    poses = [source.preview(t, 0.0) for t in times]
    X = np.concatenate([pose.positions for pose in poses])
    turned = np.concatenate([pose.rotations for pose in poses]).reshape(-1, 3, 3)
    finished = [each for each in recordings if each.finished]
    finished.sort(key=lambda each: float(np.sum(each['joint_acceleration_norm'] ** 2)))
    found = []
    for recording in finished[:_STARTS]:
        motion = recording.vectors('q1')
        nodes = np.array([np.interp(times, recording['t'], q) for q in motion.T]).T.copy()
        ranges = model.q_min, model.q_max
        improve_motion(motion[0].copy(), (X, turned), T, *ranges, model.kinematics.chain, nodes)
        q = np.vstack((motion[0], nodes))
        dq = np.diff(q, axis=0, prepend=q[:1]) / T
        effort = float((np.diff(dq, axis=0) ** 2).sum() / T)
        found.append((effort, q, T))
    return min(found, key=itemgetter(0), default=None)
