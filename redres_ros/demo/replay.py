"""A motion from the nodes' recordings as the same table that the ideal loop gives."""

from collections.abc import Callable

import numpy as np

from redres_ros.command import Command
from redres_ros.demo.log import Log
from redres_ros.laws import Law
from redres_ros.planning.planner import Reference, orientation_error
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.rotation import from_quaternion
from redres_ros.simulation.recording import MotionRecorder, Recording


def replay(
    log: Log, model: RobotModel, make_law: Callable[[str], Law], T: float, pose: bool = False
) -> Recording:
    """The table of a run, from the stamp at which the task began.

    A state without a command has no row. Norms of accelerations reach back to the last command,
    which is more than T ago where a cycle was missed.

    Args:
        log: of the run.
        model: of the arm.
        make_law: the law of a name, with the gains that it had.
        T: the sampling time [s].
        pose: whether the task has an orientation.
    """
    under_way = log.under_way()
    desired = {}
    if under_way:
        desired = dict(zip(under_way, log.desired_at(under_way), strict=True))
    recorder = MotionRecorder(model.n, T, pose)
    dq_prev = np.zeros(model.n)
    stamp_prev = 0
    for stamp in sorted(log.states.keys() & log.commands.keys()):
        q_ref, dq = log.commands[stamp]
        if stamp in desired:
            state = model.state(log.states[stamp], dq_prev)
            elapsed = (stamp - stamp_prev) / 1e9 if stamp_prev else T
            J = state.J if pose else state.J[:3]
            command = Command(
                dq,
                q_ref,
                state,
                elapsed,
                J,
                make_law(log.law_at(stamp)).weight(state),
                s=log.scaling_at(stamp),
                active_limits='',
                unachieved=np.zeros(len(J)),
            )
            reference = _reference(desired[stamp], state, log.segment_at(stamp), pose)
            recorder.add((stamp - under_way[0]) / 1e9, command, reference)
        dq_prev = dq
        stamp_prev = stamp
    reason = log.reason
    return recorder.recording(reason, finished=log.finished and not reason)


def _reference(wanted: np.ndarray, state: RobotState, segment: int, pose: bool) -> Reference:
    """The planner's reference, without its velocity."""
    x_d = wanted[:3]
    reference = Reference(np.zeros(3), x_d, x_d - state.x, segment, finished=False)
    if not pose:
        return reference
    R_d = from_quaternion(wanted[3:])
    return reference._replace(R_d=R_d, orientation_error=orientation_error(R_d, state.R))
