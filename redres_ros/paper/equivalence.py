"""Difference of a velocity law from its second-order scheme."""

from typing import NamedTuple

import numpy as np

from redres_ros.command import norms
from redres_ros.controller import Controller
from redres_ros.laws import Law
from redres_ros.paper.second_order import Scheme, SecondOrderController, step
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import Recording
from redres_ros.types import Seconds


class Difference(NamedTuple):
    """Largest |dq_I - dq_II| of a law (I) and its scheme (II) [rad/s]. Where a loop amplifies
    rounding, only same_past stays small.
    """

    max: float  # each in a closed loop of its own
    same_past: float  # the scheme being given at each tick what the law had


def difference(
    law: Law, scheme: Scheme, T: Seconds, task: WaypointTask, model: RobotModel
) -> Difference:
    """The task executed by a law and by a scheme, each in its own closed loop, both with the
    scheme's preference.
    """
    preferences = (scheme.preference,) if scheme.preference else ()
    one = run(Controller(model, law, T, preferences=preferences), task)
    two = run(SecondOrderController(model, scheme, T), task)
    apart = velocity_difference(one, two)
    same_past = _with_same_past(one, model, scheme)[: len(apart)]
    return Difference(float(apart.max()), float(same_past.max()))


def velocity_difference(law: Recording, scheme: Recording) -> np.ndarray:
    """|dq_I - dq_II| in each tick that both have, (N,) [rad/s]."""
    dq_I = law.vectors('dq1')
    dq_II = scheme.vectors('dq1')
    both = min(len(dq_I), len(dq_II))
    return norms(dq_I[:both] - dq_II[:both])


def _with_same_past(law: Recording, model: RobotModel, scheme: Scheme) -> np.ndarray:
    """|dq_I - dq_II| of a law's motion and a scheme that is given at each tick what the law had,
    (ticks,) [rad/s].
    """
    differences = []
    dq_prev = np.zeros(model.n)
    J_prev = np.zeros((3, model.n))
    dx_prev = np.zeros(3)
    for q, dq in zip(law.vectors('q1'), law.vectors('dq1'), strict=True):
        state = model.state(q, dq_prev)
        dx = state.J[:3] @ dq
        dq_II = step(scheme, law.T, state, J_prev, dx, dx_prev)
        differences.append(np.linalg.norm(dq - dq_II))
        dq_prev = dq
        J_prev = state.J[:3]
        dx_prev = dx
    return np.array(differences)
