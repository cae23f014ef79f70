"""A motion recorded from the nodes as the same table that the ideal loop gives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from redres_ros.controller import Command
from redres_ros.laws import Law
from redres_ros.planner import Planner
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording, row
from redres_ros.waypoints import WaypointTask


@dataclass(frozen=True)
class Log:
    """What went over the wire, by the stamp [ns] of the state: states: q (n,); commands: (q_ref,
    dq), both (n,).
    """

    states: dict[int, np.ndarray]
    commands: dict[int, tuple[np.ndarray, np.ndarray]]

    def until(self, stamp: int | None) -> 'Log':
        """What was before a stamp [ns]; all of it for None."""
        if stamp is None:
            return self
        return Log(
            {at: q for at, q in self.states.items() if at < stamp},
            {at: c for at, c in self.commands.items() if at < stamp},
        )


def replay(
    log: Log,
    begun: int,
    model: RobotModel,
    task: WaypointTask,
    laws: Sequence[tuple[int, Law]],
    T: float,
    ending: str,
) -> Recording:
    """The table from the stamp `begun` [ns], at which the planner began, until the last point was
    reached.

    laws: (stamp from which it was in force, law), oldest first. Figures of a state that was
    recorded without its command, or the other way round, are left out.
    """
    planner = Planner(task)
    rows = []
    finished = False
    dq_prev = np.zeros(model.n)
    stamp_prev = 0
    for stamp in sorted(log.states.keys() & log.commands.keys()):
        q = log.states[stamp]
        (q_ref, dq) = log.commands[stamp]
        if stamp >= begun and not finished:
            state = model.state(q, dq_prev)
            reference = planner.reference(state.x, (stamp - begun) / 1e9)
            finished = reference.finished
            law = next(law for since, law in reversed(laws) if since <= stamp or law is laws[0][1])
            if not finished:
                # more than T where a cycle was missed
                elapsed = (stamp - stamp_prev) / 1e9 if stamp_prev else T
                command = Command(
                    dq,
                    q_ref,
                    state,
                    elapsed,
                    state.J[:3],
                    law.weight(state),
                    s=1.0,
                    limiting='',
                    lost=np.zeros(3),
                )
                rows.append(row((stamp - begun) / 1e9, command, reference))
        dq_prev = dq
        stamp_prev = stamp
    return Recording.of(rows, model.n, T, finished, ending)
