"""Tasks that are run again: every arm's own task, ten times with every law.

    python benchmarks/run_again.py [--robot NAME] [--law NAME]

There are no nodes: what the planner's executor asks for goes to the controller's loop, and an ideal
arm follows. In the third run another law takes over, in the fifth the first one comes back, and in
the seventh the arm is held for a second. Exit status 1 if a task does not finish.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from redres_ros import LAWS, Controller, RobotModel, load_task
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.planning.goals import Goals, GoalSettings
from redres_ros.planning.task_executor import UNDER_WAY, TaskExecutor, TaskState
from redres_ros.robots import ARMS

T = 0.002  # [s]
LIMITS = ('position', 'velocity', 'acceleration')
RUNS = 10
HELD = 1.0  # [s]
LONGEST = 300.0  # [s] of a run with the motion to its start


@dataclass(frozen=True)
class Outcome:
    """What became of the runs of a task."""

    finished: int
    remark: str  # of the executor, if one did not finish
    shortest: float  # run without the motion to its start [s]
    longest: float
    drift: float  # from start to end, of the joint farthest off, at most [rad]
    filtered: int  # references that the safety filter changed


class Arm:
    """An ideal arm, the controller's loop and the planner's executor, in virtual time."""

    def __init__(self, robot: str, law: str) -> None:
        self.model = RobotModel.named(robot)
        self.task = load_task(ARMS[robot].task)
        self.controller = Controller(self.model, law, T, limits=LIMITS, switch_time=0.2)
        self.loop = CommandLoop(self.controller)
        self.executor = TaskExecutor(T)
        self.goals = Goals(self.model, self.task, GoalSettings(), 'position')
        self.q = self.task.start
        self.stamp = NANOSECONDS  # of the newest state [ns]

    @property
    def now(self) -> float:
        """The time [s]."""
        return self.stamp / NANOSECONDS

    def tick(self) -> None:
        """One cycle: a state, its response, and the velocity that acts in the next cycle."""
        self.stamp += round(T * NANOSECONDS)
        response = self.loop.step(self.stamp, self.q, self.now)
        x, R = self.model.tip(self.q)
        self.executor.mode = self.loop.mode.value
        if response is not None:
            self.executor.clock.set_scaling(response.scaling)
        step = self.executor.enter_state(self.stamp, self.q, x, R, self.now)
        if step is not None and step.dx is not None:
            self.loop.enter_velocity(self.stamp, step.dx, self.now)
        if step is not None and step.dq is not None:
            self.loop.enter_velocity(self.stamp, step.dq, self.now, of_joints=True)
        if response is not None:
            self.q = response.command.q_ref

    def run_task(self, events: Mapping[float, Callable[[], None]]) -> float:
        """Run the task; returns how long it took, without the motion to its start [s]."""
        self.executor.begin(self.goals.task())
        begun = 0.0  # [s]
        left = dict(events)
        latest = self.now + LONGEST
        while self.executor.state in UNDER_WAY and self.now < latest:
            self.tick()
            if self.executor.state is TaskState.MOVING:
                begun = begun or self.now
                for fraction in [at for at in left if self.executor.progress > at]:
                    left.pop(fraction)()
        return self.now - begun

    def hold(self) -> None:
        """Hold for a while, and go on."""
        self.loop.hold(True)
        for _ in range(round(HELD / T)):
            self.tick()
        self.loop.hold(False)


def run_again(robot: str, law: str) -> Outcome:
    """Ten runs of the arm's own task, with a change of the law and a hold."""
    arm = Arm(robot, law)
    other = 'minimum_velocity' if law != 'minimum_velocity' else 'minimum_acceleration'
    events: dict[int, dict[float, Callable[[], None]]] = {
        2: {0.5: lambda: arm.controller.switch_law(other)},
        4: {0.5: lambda: arm.controller.switch_law(law)},
        6: {0.5: arm.hold},
    }
    durations = []
    drift = 0.0
    for number in range(RUNS):
        durations.append(arm.run_task(events.get(number, {})))
        if arm.executor.state is not TaskState.FINISHED:
            break
        drift = max(drift, float(np.abs(arm.q - arm.task.start).max()))
    has_finished = arm.executor.state is TaskState.FINISHED
    return Outcome(
        len(durations) - (not has_finished),
        '' if has_finished else arm.executor.remark or 'not over in time',
        min(durations),
        max(durations),
        drift,
        arm.loop.safety_filter.count,
    )


def print_runs(robots: list[str], laws: list[str]) -> bool:
    """Print a table of all pairs; whether all finished."""
    print('| arm | law | finished | a run takes [s] | farthest joint at its end [rad] |')
    print('|---|---|---|---|---|', flush=True)
    well = True
    for robot, law in product(robots, laws):
        outcome = run_again(robot, law)
        has_finished = outcome.finished == RUNS
        well = well and has_finished
        remark = f'; {outcome.remark}' if outcome.remark else ''
        filtered = f'; filtered {outcome.filtered}' if outcome.filtered else ''
        print(
            f'| `{robot}` | `{law}` | {outcome.finished} of {RUNS}{remark}{filtered} '
            f'| {outcome.shortest:.1f} to {outcome.longest:.1f} | {outcome.drift:.2f} |',
            flush=True,
        )
    return well


def main() -> int:
    """Console entry point."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--robot', choices=ARMS, action='append', help='again for a further one')
    parser.add_argument('--law', choices=LAWS, action='append', help='again for a further one')
    given = parser.parse_args()
    return 0 if print_runs(given.robot or list(ARMS), given.law or list(LAWS)) else 1


if __name__ == '__main__':
    sys.exit(main())
