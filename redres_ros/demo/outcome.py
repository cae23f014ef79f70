"""The outcome of a demo, from its recordings: the motion as a table, and a summary."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from redres_ros.command import Command
from redres_ros.demo.cycles import CycleCounts
from redres_ros.demo.figures import Endurance, GoalCounts, MotionFigures, PressingFigures, Rows
from redres_ros.demo.log import Log
from redres_ros.files.text import write_json
from redres_ros.kernels.tick import rotation_error
from redres_ros.laws import Law
from redres_ros.planning.planner import Reference
from redres_ros.resolution import Solution
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.rotation import from_quaternion
from redres_ros.simulation.recording import MotionRecorder, Recording
from redres_ros.simulation.report import facts

# What a robot does in its session states.
_MEANS = {'MON': ' (only reports)', 'CMD': ' (takes commands)'}


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes:
        endurance: Figures of a repeated task; None if it was not repeated.
        interrupted: Whether Ctrl-C ended it.
        last: Stamp of the last state that counts [ns].
    """

    endurance: Endurance | None
    interrupted: bool
    last: float = math.inf


@dataclass(frozen=True)
class Outcome:
    """The outcome of a demo.

    Attributes:
        recording: Recording of the task.
        motion: Its figures; None if it did not begin.
        cycles: The robot's cycles by outcome; None if the task did not begin.
        stop_reason: Why the robot stopped itself; empty if it did not.
        session: Its states, in order.
        planner_missed: Number of states that the planner did not get.
        switches: (time [s], law before, law after).
        endurance: Figures of a repeated task; None if it was not repeated.
        interrupted: Whether Ctrl-C ended it.
        goals: Goals of an operator; None for a task.
        forces: Times [s], and forces of the environment on the tip in the base frame [N], (N, 4);
            none without a controller that yields.
        desired_force: Desired force; empty: none.
    """

    recording: Recording
    motion: MotionFigures | None
    cycles: CycleCounts | None
    stop_reason: str
    session: tuple[str, ...]
    planner_missed: int = 0
    switches: tuple[tuple[float, str, str], ...] = ()
    endurance: Endurance | None = None
    interrupted: bool = False
    goals: GoalCounts | None = None
    forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    desired_force: Sequence[float] = ()

    @property
    def pressing(self) -> PressingFigures | None:
        """How well the desired force was kept; None without one, or without contact."""
        if not any(self.desired_force):
            return None
        return PressingFigures.of(self.forces, np.array(self.desired_force[:3]))

    @property
    def succeeded(self) -> bool:
        """Whether a robot that was not stopped reached the last point, and no node has grown."""
        steady = self.endurance is None or self.endurance.steady
        return self.recording.finished and not self.stop_reason and not self.interrupted and steady

    @property
    def ending(self) -> str:
        """How it ended, in a word or two."""
        if self.interrupted:
            return 'interrupted'
        if self.stop_reason or not self.recording.finished:
            return 'NOT finished'
        if not self.succeeded:
            return 'finished, but a node has grown'
        return 'finished'

    def table(self, title: str) -> Table:
        """The summary that ends a demo."""
        rows: Rows = [
            ('task', self.ending),
            ('robot', f'stopped: {self.stop_reason}' if self.stop_reason else 'not stopped'),
            ("robot's session", ' > '.join(word + _MEANS.get(word, '') for word in self.session)),
        ]
        if self.motion:
            rows += self.motion.rows(self.goals)
        if self.pressing:
            rows += self.pressing.rows
        if self.cycles:
            rows += [*self.cycles.rows, ('not seen by the planner', str(self.planner_missed))]
        if self.endurance:
            rows += self.endurance.rows
        return facts(rows, title=title)

    def write_json(self, path: Path) -> None:
        """Write the same figures in SI units. Raises FileError."""
        content: dict[str, Any] = {
            'task': self.ending,
            'stop_reason': self.stop_reason,
            'session': self.session,
            'switches': self.switches,
            'planner_missed': self.planner_missed,
        }
        for name in ('motion', 'pressing', 'goals', 'cycles', 'endurance'):
            figures = getattr(self, name)
            content[name] = asdict(figures) if figures else None
        write_json(content, path)


def replay(
    log: Log, model: RobotModel, make_law: Callable[[str], Law], T: float, pose: bool = False
) -> Recording:
    """The table of a run, from the stamp at which the task began.

    A state without a command has no row. Norms of accelerations reach back to the last command,
    which is more than T ago where a cycle was missed.

    Args:
        log: Log of the run.
        model: Model of the arm.
        make_law: The law of a name, with the gains that it had.
        T: Sampling time [s].
        pose: Whether the task has an orientation.
    """
    under_way = log.under_way()
    desired = {}
    if under_way:
        desired = dict(zip(under_way, log.desired_at(under_way), strict=True))
    recorder = MotionRecorder(model, T, pose)
    dq_prev = np.zeros(model.n)
    stamp_prev = 0
    for stamp in sorted(log.states.keys() & log.commands.keys()):
        q_ref, dq = log.commands[stamp]
        if stamp in desired:
            state = model.state(log.states[stamp], dq_prev)
            elapsed = (stamp - stamp_prev) / 1e9 if stamp_prev else T
            J = state.J if pose else state.J[:3]
            W = make_law(log.law_at(stamp)).weight(state)
            solution = Solution(dq, J, J.dot(dq), W=W, s=log.scaling_at(stamp))
            command = Command(solution, q_ref, state, elapsed)
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
    return reference._replace(R_d=R_d, orientation_error=rotation_error(state.R, R_d))
