"""Where the time of a tick goes: the pieces of `Controller.update`, each one called by itself.

    python benchmarks/where_a_tick_goes.py [--calls N]

prints the least time of each piece. A piece by itself finds everything in the processor's caches,
so together they take less than the tick. `redres bench` times whole ticks as they are.
"""

import argparse
import timeit
from collections.abc import Callable
from functools import partial

import numpy as np

from redres_ros.bench.tick import T, controllers, recorded
from redres_ros.kernels.tick import are_usable, integrate
from redres_ros.policy import Policy
from redres_ros.resolution import resolve_in_order, resolve_one
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.vectors import as_vector

REPEATS = 20
TICK = 40  # of the recorded stretch

Pieces = dict[str, Callable[[], object]]


def pieces() -> Pieces:
    """The whole ticks of `redres bench`, then what one is made of, by name."""
    model = RobotModel.named('lwr4_paper')
    stretch = recorded(model, TICK + 1)
    q = stretch.q[TICK].copy()
    dx = stretch.dx[TICK].copy()
    made = controllers(model)
    found: Pieces = {}
    for what in ('', ', limits idle', ', two priorities'):
        tick = partial(made[f'minimum_velocity{what}'].update, q, dx)
        tick()  # fills in open targets
        found[f'tick{what}'] = tick
    found.update(_of_one_task(model, q, stretch.dq_prev[TICK].copy(), dx))
    found.update(_of_limits_and_lower_tasks(model, q, stretch.dq_prev[TICK].copy(), dx))
    return found


def _of_one_task(model: RobotModel, q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> Pieces:
    """What every tick does."""
    controller = controllers(model)['minimum_velocity']
    task = controller.task
    law = controller.law
    state = RobotState(model, q, dq)
    J = task.jacobian(state)
    b = law.bias(state, T)
    q_ref = np.empty(len(q))
    motion = Policy(law)
    return {
        'check of q or dx': lambda: as_vector(q, len(q), 'q'),
        'check that they are finite': lambda: are_usable(q, dx, 1.0),
        'a copy, of which there are three': q.copy,
        'state': lambda: RobotState(model, q, dq),
        'state and Jacobian': lambda: RobotState(model, q, dq).J,
        'rows of the task': lambda: task.jacobian(state),
        'bias': lambda: law.bias(state, T),
        'closed form': lambda: resolve_one(J, dx, b, None),
        'answer, the Jacobian known': lambda: motion.answer(state, task, dx, T),
        'integration': lambda: integrate(q, T, dq, q_ref),
    }


def _of_limits_and_lower_tasks(
    model: RobotModel, q: np.ndarray, dq: np.ndarray, dx: np.ndarray
) -> Pieces:
    """What a tick does beside that."""
    found = controllers(model)
    limits = found['minimum_velocity, limits idle']
    resolver = limits._resolver
    task = limits.task
    state = RobotState(model, q, dq)
    answer = Policy(limits.law).answer(state, task, dx, T)
    (lower,) = found['minimum_velocity, two priorities'].secondary_tasks
    lower = lower.with_initial_targets(state)
    levels = ((answer.J, dx), (lower.jacobian(state), lower.velocity(state)))

    def orientation() -> np.ndarray:
        at_tick = RobotState(model, q, dq)
        _ = at_tick.J
        return at_tick.R

    return {
        'limits: whether they are kept': lambda: resolver.allows(answer, state, T),
        'second task: state, Jacobian and orientation': orientation,
        'second task: rows': lambda: lower.jacobian(state),
        'second task: velocity, the orientation known': lambda: lower.velocity(state),
        'second task: closed form of both': lambda: resolve_in_order(levels, dq, None),
    }


def least_time(call: Callable[[], object], calls: int) -> float:
    """Of one call [us].

    Args:
        call: What is timed.
        calls: How many at a time.
    """
    return 1e6 * min(timeit.repeat(call, number=calls, repeat=REPEATS)) / calls


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--calls', type=int, default=2000)
    options = parser.parse_args()
    print('| piece | least time |')
    print('|---|---|')
    for name, call in pieces().items():
        print(f'| {name} | {least_time(call, options.calls):.2f} µs |', flush=True)


if __name__ == '__main__':
    main()
