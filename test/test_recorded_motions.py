"""Long motions through all that may happen to a robot are as they were recorded.

So what has no test of its own does not change unnoticed. After a change that is meant, record them
again: python test/test_recorded_motions.py
"""

import contextlib
import csv
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from redres_ros import Controller, Preview, RobotModel, load_task, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.errors import RedresError
from redres_ros.geometry import rotation_matrix
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.modes import Mode
from redres_ros.loop.velocity_input import LoopSettings
from redres_ros.planning.goals import Goals, GoalSettings
from redres_ros.planning.task_executor import TaskExecutor, TaskState
from redres_ros.planning.unachieved import UnachievedVelocity

RECORDED = Path(__file__).with_name('recorded_motions.csv')
JOINTS = ('position', 'velocity', 'acceleration')
BRAKING = {'limit_gains': {'acceleration.reach': 0.02}}
T = 0.002  # [s]
NS = 2_000_000  # [ns]
TICKS = 2500
EVERY = 50  # ticks
SAME = 1e-6  # [rad], [m]; a start 1e-12 rad away leads to at most 2e-8

# Seed, arm, interface, the sources of velocities, and options of the controller. With these seeds
# the arm moves for long, and last bits of its start count for little, also under a limit on jerk.
SCENES: dict[str, tuple[int, str, str, str, dict[str, Any]]] = {
    'hand': (8, 'fr3', 'fri', 'hand', {'task': 'pose', 'limits': JOINTS}),
    'path': (5, 'lwr4', 'ros2_control', 'path hand', {'limits': JOINTS}),
    'jerk': (8, 'iiwa7', 'fci', 'hand path joints', {'limits': (*JOINTS, 'jerk')}),
    'push': (13, 'lwr4', 'fri', 'push path', {'limits': JOINTS, 'preferences': ('posture',)}),
    'lean': (1, 'fr3', 'ros2_control', 'push hand', {'task': 'pose', 'limits': JOINTS}),
    'wall': (1, 'fr3', 'fri', 'hand path', {'limits': (*JOINTS, 'workspace', 'collision')}),
    'torque': (3, 'lwr4', 'fri', 'path joints', {'limits': (*JOINTS, 'torque')}),
    'reach': (14, 'lwr4', 'ros2_control', 'hand', {'task': 'pose', 'limits': JOINTS, **BRAKING}),
    'free': (4, 'gen3', 'ros2_control', 'hand path joints', {'secondary_tasks': ('orientation',)}),
}
NAMES = (*SCENES, 'goals', 'goals of poses', 'goals at length')
LAWS = (
    make_law('minimum_velocity'),
    make_law('minimum_acceleration', horizon=1.0),
    make_law('dynamically_consistent', damping=20.0),
    make_law('minimum_effort_ahead', horizon=0.5),
)


class Scene:
    """A loop and an arm that follows it with a lag, under events that a seed chooses."""

    def __init__(self, name: str) -> None:
        seed, robot, interface, kinds, options = SCENES[name]
        self.random = Random(f'{name} {seed}')
        self.model = RobotModel.named(robot)
        options = {'switch_time': 0.1, **options}
        self.controller = Controller(self.model, LAWS[1], T, robot_interface=interface, **options)
        self.rows = self.controller.m
        self.gains = options.get('limit_gains', {})
        damping = (400.0, 400.0, 400.0, 20.0, 20.0, 20.0)[: self.rows]
        still = (0.0,) * self.rows
        stiffness = (0.0, 500.0, 0.0, 0.0, 0.0, 5.0)[: self.rows]
        admittance = AdmittanceSettings(
            'push' in kinds, 'base', still, damping, stiffness, still, force_limit=30.0
        )
        contact = ContactControl(admittance, T, switch_time=0.1)
        self.loop = CommandLoop(self.controller, LoopSettings(), contact)
        self.kinds = kinds.split()
        self.q = np.array(self.model.arm.start) * (0.3 if name == 'reach' else 1.0)
        self.moved = np.zeros(self.model.n)  # by others
        self.kind = ''
        self.now = 0.0
        self.stamp = 10**12
        self.period = NS
        self.twist = np.zeros(self.rows)
        self.wished = self.twist
        self.wrench = np.zeros(6)
        self.refused = 0

    def vector(self, size: float, n: int) -> np.ndarray:
        return np.array([self.random.uniform(-size, size) for _ in range(n)])

    def happens(self, once_in: float) -> bool:
        return self.random.random() < 1.0 / once_in

    def run(self) -> list[list[float]]:
        """What is known of each EVERYth tick."""
        rows = []
        for tick in range(TICKS):
            self.disturb()
            self.state()
            if self.happens(50):
                self.kind = self.random.choice([*self.kinds, ''])
                self.wished = self.vector(0.15, self.rows)
                if self.happens(2):
                    self.wished[3:] = self.twist[3:] = 0.0
            self.steer()
            if tick % EVERY == EVERY - 1:
                loop = self.loop
                reported = self.refused + bool(loop.error) + bool(loop.warning)
                counts = (list(Mode).index(loop.mode), reported, loop.responses, loop.skipped)
                rows.append([*counts, *self.reference])
        return rows

    @property
    def reference(self) -> np.ndarray:
        published = self.controller.published
        return self.q if published is None else published.q

    def state(self) -> None:
        """The next state, some of which get lost or come late."""
        cycles = 1
        if self.happens(60):
            cycles += self.random.randrange(1, 4)
        if self.happens(400):
            cycles += self.random.randrange(4, 60)
        if self.happens(800):
            self.period = self.random.choice((NS, NS, 3 * NS // 4, 6 * NS // 5))
        self.stamp += cycles * self.period + self.random.randrange(-NS // 20, NS // 20)
        self.now += cycles * self.period / 1e9
        if self.happens(900):
            self.stamp += self.random.choice((-10 * NS, 10**12, 3 * NS // 2))
        self.q = self.q + 0.4 * (self.reference + self.moved - self.q)
        late = self.random.random() * 1e-3
        with contextlib.suppress(RedresError):
            self.loop.step(self.stamp, self.q, self.now + late)
        self.loop.sent = self.now + late + 1e-4

    def steer(self) -> None:
        """A velocity of the source of the moment, to a state or without a stamp."""
        self.twist = self.twist + 0.02 * (self.wished - self.twist)
        now = self.now + 1.2e-3
        stamp = self.stamp if self.kind == 'path' else 0
        if self.kind == 'path' and self.happens(30):
            x, _ = self.model.tip(self.q)
            times = np.arange(0.0, 1.0, 0.1)
            self.loop.preview = self.stamp, Preview(times, x + times[:, None] * self.twist[:3])
        try:
            if self.kind == 'joints':
                dq = np.resize(self.twist, self.model.n)
                self.loop.enter_velocity(stamp, dq, now, of_joints=True)
            elif self.kind in ('path', 'hand') and not self.happens(20):
                self.loop.enter_velocity(stamp, self.twist, now)
            if self.kind == 'push' and not self.happens(40):
                self.wrench = self.wrench + 0.05 * (200.0 * np.resize(self.wished, 6) - self.wrench)
                self.loop.measurements.enter_wrench(self.stamp, self.wrench, 'base')
        except RedresError:
            self.refused += 1

    def disturb(self) -> None:
        """Now and then somebody holds the arm, moves it, or changes what it keeps."""
        loop = self.loop
        if self.happens(300):
            loop.hold(loop.faults.reason == '' and self.happens(3))
        if self.happens(700):
            loop.deactivate()
        if self.happens(150):
            loop.activate()
        if self.happens(500):
            loop.enter_session(self.random.choice(('CMD', 'CMD', 'CMD', 'MON')))
        if self.happens(400):
            self.moved = self.vector(0.03, self.model.n) * self.random.choice((0.0, 0.1, 1.0, 9.0))
        if self.happens(200) and self.controller.policy.limits is not None:
            names = self.controller.policy.limits.names.values()
            scale = self.random.choice((0.3, 0.6, 1.0))
            self.controller.set_limits(names, limit_scale=scale, limit_gains=self.gains)
        if self.happens(300):
            self.controller.switch_law(self.random.choice(LAWS))
        if self.happens(150):
            with contextlib.suppress(RedresError):
                loop.tare()
        if self.happens(1500):
            loop.forget()


def goals_one_after_the_other(name: str) -> list[list[float]]:
    """A planner's goals, one after the other, for an arm that does a part of what they ask for."""
    random = Random(name)
    task_space = 'pose' if name == 'goals of poses' else 'position'
    task = load_task('fr3_square')
    model = RobotModel.named('fr3')
    goals = Goals(model, task, GoalSettings(), task_space)
    q = task.start
    often = 4000 if name == 'goals at length' else 1500
    rows = []
    stamp = 10**12
    scaling = 1.0
    achieves = UnachievedVelocity(model, task_space, T, 0.05)
    executor = TaskExecutor(T, task_space, unachieved=achieves)
    home, _ = model.tip(q)
    for tick in range(4 * TICKS):
        stamp += NS * (1 if random.random() < 0.99 else random.randrange(2, 30))
        if random.random() * often < 8.0:
            scaling = random.choice((0.0, 0.3, 1.0, 1.0, 1.0))
        if random.random() < 0.01:
            executor.mode = random.choice(('moving', 'moving', 'holding'))
        executor.clock.set_scaling(scaling)
        x, R = model.tip(q)
        there = home + np.array([random.uniform(-0.08, 0.08) for _ in range(3)])
        R_there = rotation_matrix(np.array([random.uniform(-0.3, 0.3) for _ in range(3)])) @ R
        with contextlib.suppress(RedresError):
            match random.randrange(often):
                case 0 | 1 | 2:
                    executor.begin(goals.task())
                case 3:
                    executor.begin(goals.home())
                case 4 | 5 | 6 | 7:
                    executor.begin(goals.target(there, R_there))
                case 8 | 9 | 10 | 11:
                    turns = np.stack((R, R_there)) if task_space == 'pose' else None
                    path = Preview((0.1, 1.4), np.stack((x + 0.01, there)), turns)
                    executor.begin(goals.path(path, executor.cycles))
                case 12:
                    executor.set_stop_reason('' if executor.stop_reason else 'a stop')
        step = executor.enter_state(stamp, q, x, R, stamp / 1e9)
        if step is not None and step.dq is not None:
            q = q + T * scaling * step.dq
        elif step is not None and step.dx is not None:
            J = model.jacobian(q, model.arm.tip_frame)[: len(step.dx)]
            q = q + T * scaling * J.T @ np.linalg.solve(J @ J.T, step.dx)
        if tick % (4 * EVERY) == 4 * EVERY - 1:
            preview = executor.preview(0.5)
            ahead = preview.positions[-1] if preview else np.zeros(3)
            number = list(TaskState).index(executor.state)
            rows.append([number, bool(executor.remark), executor.progress, *q, *ahead])
    return rows


def motion(name: str) -> list[list[float]]:
    return Scene(name).run() if name in SCENES else goals_one_after_the_other(name)


@pytest.mark.parametrize('name', NAMES)
def test_what_happens_is_what_was_recorded(name: str) -> None:
    with RECORDED.open(newline='') as file:
        expected = [[float(x) for x in row[1:]] for row in csv.reader(file) if row[0] == name]
    np.testing.assert_allclose(motion(name), expected, rtol=0.0, atol=SAME)


if __name__ == '__main__':
    with RECORDED.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        for name in NAMES:
            writer.writerows([name, *(f'{x:.8g}' for x in row)] for row in motion(name))
