"""Tasks that are run again: every arm's own task, ten times with every law, and how far a closed
path leaves the joints from where they began.

    python benchmarks/run_again.py runs [--robot NAME] [--law NAME]
    python benchmarks/run_again.py drift

`runs` has no nodes: what the planner's executor asks for goes to the controller's loop, and an
ideal arm follows. In the third run another law takes over, in the fifth the first one comes back,
and in the seventh the arm is held for a second. Exit status 1 if a task does not finish. `drift`
drives the closed paths of all arms in the paper's ideal loop.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from redres_ros import LAWS, Controller, RobotModel, WaypointTask, load_task, run
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.planning.goals import Goals, GoalSettings
from redres_ros.planning.task_executor import UNDER_WAY, TaskExecutor, TaskState
from redres_ros.preferences import Posture
from redres_ros.robots import ARMS
from redres_ros.tasks import Configuration

T = 0.002  # [s]
LIMITS = ('position', 'velocity', 'acceleration')
RUNS = 10
HELD = 1.0  # [s]
LONGEST = 300.0  # [s] of a run with the motion to its start


@dataclass(frozen=True)
class Outcome:
    """What became of the runs of a task.

    Attributes:
        finished: How many did.
        remark: Of the executor, where one did not.
        shortest: Duration of a run without the motion to its start [s].
        longest: The same.
        drift: From the start to the end of a run, of the joint farthest off, at most [rad].
        filtered: How often the safety filter changed a reference.
    """

    finished: int
    remark: str
    shortest: float
    longest: float
    drift: float
    filtered: int


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
        self.executor.set_mode(self.loop.mode.value)
        if response is not None:
            self.executor.clock.set_scaling(response.scaling)
        step = self.executor.enter_state(self.stamp, self.q, x, R, self.now)
        if step is not None and step.dx is not None:
            self.loop.enter_twist(self.stamp, step.dx, self.now)
        if step is not None and step.dq is not None:
            self.loop.enter_joint_velocity(self.stamp, step.dq, self.now)
        if response is not None:
            self.q = response.command.q_ref

    def run_task(self, events: Mapping[float, Callable[[], None]]) -> float:
        """Run the task; returns how long it took, without the motion to its start [s].

        Args:
            events: What happens at which fraction of the goal.
        """
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
    """Ten runs of the arm's own task, with a change of the law and a hold.

    Args:
        robot: A name in ARMS.
        law: A name in LAWS.
    """
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


def closed_path(robot: str) -> WaypointTask:
    """The arm's own task, and back along the same points if it ends elsewhere."""
    task = load_task(ARMS[robot].task)
    ends = task.waypoints[0], task.waypoints[-1]
    if np.allclose(*ends, atol=1e-9):
        return task
    return replace(task, waypoints=np.vstack((task.waypoints, task.waypoints[-2::-1])))


def drift(robot: str, law: str, **settings: object) -> float:
    """Distance of the joint farthest from its start after a closed path [rad]; NaN: it never ends.

    Args:
        robot: A name in ARMS.
        law: A name in LAWS.
        settings: Of the controller.
    """
    task = closed_path(robot)
    recording = run(Controller(RobotModel.named(robot), law, T, **settings), task)
    if not recording.finished:
        return float('nan')
    return float(np.abs(recording.vectors('q1')[-1] - task.start).max())


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


def print_drift() -> None:
    """Print a table of closed paths: with limits and what closes them, then for every arm."""
    preference = Posture(gain=25.0)
    columns: dict[str, dict[str, object]] = {
        'no limits': {},
        'limits': {'limits': LIMITS},
        'limits, `posture=25`': {'limits': LIMITS, 'preferences': (preference,)},
        'limits, `configuration`': {'limits': LIMITS, 'secondary_tasks': (Configuration(),)},
    }
    print(f'| law | {" | ".join(columns)} |')
    print('|---' * (len(columns) + 1) + '|', flush=True)
    for law, cls in LAWS.items():
        cells = []
        for settings in columns.values():
            takes_none = 'preferences' in settings and not cls.has_memory
            figure = 'takes no preference' if takes_none else _figure('lwr4_paper', law, settings)
            cells.append(figure)
        print(f'| `{law}` | {" | ".join(cells)} |', flush=True)
    print(f'\n| law | {" | ".join(f"`{robot}`" for robot in ARMS)} |')
    print('|---' * (len(ARMS) + 1) + '|', flush=True)
    for law in LAWS:
        cells = [_figure(robot, law, columns['limits']) for robot in ARMS]
        print(f'| `{law}` | {" | ".join(cells)} |', flush=True)


def _figure(robot: str, law: str, settings: dict[str, object]) -> str:
    distance = drift(robot, law, **settings)
    return 'does not end' if np.isnan(distance) else f'{distance:.2f}'


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('what', choices=('runs', 'drift'))
    parser.add_argument('--robot', choices=ARMS, action='append', help='again for a further one')
    parser.add_argument('--law', choices=LAWS, action='append', help='again for a further one')
    given = parser.parse_args(arguments)
    if given.what == 'drift':
        print_drift()
        return 0
    return 0 if print_runs(given.robot or list(ARMS), given.law or list(LAWS)) else 1


if __name__ == '__main__':
    sys.exit(main())
