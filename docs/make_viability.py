"""Measures which limits an arm can keep from tick to tick, for the table of docs/limits.md.

Run it with: python docs/make_viability.py. It takes two minutes of processor time.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from make_numbers import markdown, write

from redres_ros import Controller, RobotModel
from redres_ros.limits import make_limits
from redres_ros.limits.clearance import CollisionLimit
from redres_ros.robot_interface import Published
from redres_ros.robots.joint_limits import JointLimits

PAGE = Path(__file__).with_name('limits.md')

T = 0.004  # sampling time [s]
STATES = 200  # of each arm and limit
TICKS = 250  # of each motion, in which the tip is asked to stop
ROUNDING = 1e-6  # of a limit
BOX = ('position', 'velocity', 'acceleration')
ARMS = ('lwr4', 'iiwa7', 'fr3', 'gen3')

Excess = Callable[[np.ndarray, np.ndarray, np.ndarray], float]
"""(q, dq_prev, dq) -> by how much a tick exceeds a limit, as a fraction of it."""


def main() -> None:
    """Measure, and write the table."""
    heads = 'arm | limits | states | no next velocity | beyond a limit later | at most by'
    rows = []
    for name in ARMS:
        model = RobotModel.named(name)
        for label, limits, scales, excess in (
            ('joints', BOX, (1.0, 1.0), box_excess(model)),
            ('and `collision`', (*BOX, 'collision'), (1.0, 1.0), collision_excess(model)),
            ('and `torque`', (*BOX, 'torque'), (1.0, 1.0), torque_excess(model, 1.0)),
            ('half the torque', (*BOX, 'torque'), (1.0, 0.5), torque_excess(model, 0.5)),
            ('half of all limits', (*BOX, 'torque'), (0.5, 0.5), torque_excess(model, 0.5)),
        ):
            arm = f'`{name}`' if label == 'joints' else ''
            rows.append((arm, label, measured(model, limits, scales, excess)))
    write({'viability': markdown(heads, rows)}, [PAGE])


def measured(
    model: RobotModel, limits: tuple[str, ...], scales: tuple[float, float], excess: Excess
) -> str:
    """The cells of a row: what becomes of random states that keep the limits.

    Args:
        model: Of the arm.
        limits: Their names.
        scales: Factors on velocities and accelerations, and on torques.
        excess: Of the limit that is looked at.
    """
    random = np.random.default_rng(0)
    limit_scale, torque_scale = scales
    found = []  # the excess of each tick, state by state
    for _ in range(STATES):
        q, dq = random_state(model, limit_scale, random)
        if excess(q, dq, dq) > ROUNDING:  # going on as before breaks it by now
            continue
        controller = Controller(
            model,
            'minimum_acceleration',
            T,
            limits=limits,
            limit_scale=limit_scale,
            torque_scale=torque_scale,
        )
        controller.hold_at(q)
        controller.go_on_from(Published(q, dq, np.zeros(len(q)), dq))
        found.append(motion(controller, q, dq, excess))
    ticks = np.array(found)
    at_once = ticks[:, 0] > ROUNDING
    later = (ticks > ROUNDING).any(axis=1) & ~at_once
    largest = float(ticks.max())
    return (
        f'{len(ticks)} | {at_once.mean():.0%} | {later.mean():.0%} | '
        f'{f"{largest:.0%}" if largest > ROUNDING else "–"}'
    )


def random_state(
    model: RobotModel, limit_scale: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """q (n,) [rad] within the range, and dq (n,) [rad/s] from which each joint stops in time.

    Args:
        model: Of the arm.
        limit_scale: Factor on velocities and accelerations.
        random: Draws them.
    """
    limits = JointLimits.of(model.arm)
    lower = np.maximum(limits.lower, -np.pi)
    upper = np.minimum(limits.upper, np.pi)
    q = random.uniform(lower, upper)
    still = model.state(q, np.zeros(model.n))
    joints = make_limits(('position', 'velocity'), model, limit_scale=limit_scale)
    low, high = joints.at(still, T).box
    return q, random.uniform(low, high)


def motion(controller: Controller, q: np.ndarray, dq: np.ndarray, excess: Excess) -> list[float]:
    """The excess of each tick of an arm whose tip is asked to stop.

    Args:
        controller: Placed at q with dq.
        q: (n,) [rad].
        dq: (n,) [rad/s].
        excess: Of a limit.
    """
    found = []
    for _ in range(TICKS):
        command = controller.update(q, np.zeros(3))
        found.append(excess(q, dq, command.dq))
        q = command.q_ref
        dq = command.dq
    return found


def box_excess(model: RobotModel) -> Excess:
    """How far a tick is beyond the limits of a joint, as a fraction of each."""
    limits = JointLimits.of(model.arm)
    width = np.minimum(limits.upper - limits.lower, 2.0 * np.pi)

    def excess(q: np.ndarray, dq_prev: np.ndarray, dq: np.ndarray) -> float:
        after = q + T * dq
        beyond = np.maximum(limits.lower - after, after - limits.upper) / width
        too_fast = np.abs(dq) / limits.velocity - 1.0
        too_hard = np.abs(dq - dq_prev) / (T * limits.acceleration) - 1.0
        return float(max(beyond.max(), too_fast.max(), too_hard.max()))

    return excess


def torque_excess(model: RobotModel, scale: float) -> Excess:
    """How far the torque of Eq. (6) is beyond its limit, as a fraction of it.

    Args:
        model: Of the arm.
        scale: Factor on torque limits.
    """

    def excess(q: np.ndarray, dq_prev: np.ndarray, dq: np.ndarray) -> float:
        tau = model.torque(q, dq_prev, (dq - dq_prev) / T)
        return float((np.abs(tau) / (scale * model.tau_max)).max()) - 1.0

    return excess


def collision_excess(model: RobotModel) -> Excess:
    """By how much bodies come nearer than their clearance, as a fraction of it."""
    limit = CollisionLimit(model)

    def excess(q: np.ndarray, dq_prev: np.ndarray, dq: np.ndarray) -> float:
        after = q + T * dq
        _, distances, _ = limit.near(model.state(after, dq))
        return 1.0 - float(min(distances, default=limit.clearance)) / limit.clearance

    return excess


if __name__ == '__main__':
    main()
