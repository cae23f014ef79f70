"""The limit on the jerk: kept in every motion, with acceleration, velocity and position."""

from dataclasses import replace

import numpy as np
import pytest
from nightly import NIGHTLY
from scipy.optimize import linprog
from test_limits import do_meet

from redres_ros import LAWS, Controller, RobotModel
from redres_ros.command import ROBOT_INTERFACES
from redres_ros.kernels.boxes import BOXES, NO_LIMITS, fill_boxes
from redres_ros.limits import make_limits
from redres_ros.robot_model import RobotState
from redres_ros.robots.joint_limits import JointLimits

ALL = ('position', 'velocity', 'acceleration', 'jerk')
ROUNDING = 1e-9
MOTIONS = pytest.mark.parametrize(
    ('A', 'J', 'T', 'V', 'width'),
    [
        (10.0, 5000.0, 0.001, 2.6, 2.0),  # FR3
        (10.0, 1000.0, 0.002, 2.0, 1.0),
        (10.0, 200.0, 0.002, 1.5, 2.0),
        (2.0, 20.0, 0.01, 1.0, 0.6),
        (10.0, 5000.0, 0.001, 2.6, 0.02),
    ],
)


class Joints:
    """Many joints, each with the same four limits, and all in states of their own."""

    def __init__(self, count: int, A: float, J: float, T: float, V: float, width: float) -> None:
        self.A, self.J, self.T, self.V, self.end = A, J, T, V, width / 2.0
        self.limits = np.full(count, NO_LIMITS)
        self.limits['J'] = J
        for name in ('A', 'A_arm'):
            self.limits[name] = A
        self.limits['V'] = V
        self.limits['lower'][:, 0] = -self.end
        self.limits['upper'][:, 0] = self.end
        self.limits['A_stop'][:, 0] = A
        self.q = np.zeros(count)
        self.v = np.zeros(count)
        self.a = np.zeros(count)

    def box(self, lost: float = 0.0) -> tuple[np.ndarray, np.ndarray, bool]:
        boxes = np.empty((BOXES + 1, 2, len(self.q)))
        state = self.v, self.q, self.v, self.a, self.T
        fill_boxes(*state, self.limits, boxes, 1.0, 1.0, lost)
        return *boxes[-1], do_meet(boxes)

    def move(self, v: np.ndarray) -> None:
        self.a = (v - self.v) / self.T
        self.v = v
        self.q = self.q + self.T * v


@MOTIONS
def test_long_random_motions_never_meet_an_empty_box(A, J, T, V, width):
    """To an end of the box, to a velocity, or anywhere: a million ticks by night."""
    random = np.random.default_rng(0)
    count = 500
    joints = Joints(count, A, J, T, V, width)
    joints.q = random.uniform(-width / 2.0, width / 2.0, count)
    kind = random.integers(0, 4, count)
    target = np.zeros(count)
    for _ in range(2000 if NIGHTLY else 150):
        lower, upper, kept = joints.box()
        assert kept
        changes = random.random(count) < 0.02
        kind = np.where(changes, random.integers(0, 4, count), kind)
        target = np.where(changes, random.uniform(-1.5 * V, 1.5 * V, count), target)
        between = lower + random.random(count) * (upper - lower)
        choices = [kind == 0, kind == 1, kind == 2]
        v = np.select(choices, [upper, lower, between], np.clip(target, lower, upper))
        before = joints.a
        joints.move(v)
        assert np.abs(joints.a - before).max() <= J * T * (1.0 + ROUNDING)
        assert np.abs(joints.a).max() <= A * (1.0 + ROUNDING)
        assert np.abs(v).max() <= V * (1.0 + ROUNDING)
        assert np.abs(joints.q).max() <= width / 2.0 + ROUNDING


def largest_velocity(joints: Joints) -> float:
    """The largest next velocity after which some motion comes to rest, by linear programming.

    The accelerations of 40 ticks are the variables. NaN: there is none.
    """
    T, A, v = joints.T, joints.A, joints.v[0]
    N = 40
    velocities = T * np.tril(np.ones((N, N)))
    positions = T * np.tril(np.ones((N, N))) @ velocities
    changes = np.eye(N) - np.eye(N, k=-1)
    first = np.eye(N)[0] * joints.a[0]
    most = joints.J * T * np.ones(N)
    left = joints.end - joints.q[0] - v * T * np.arange(1, N + 1)
    ends = most + first, most - first, np.full(N, joints.V - v), left
    found = linprog(
        -np.eye(N)[0],
        A_ub=np.vstack((changes, -changes, velocities, positions)),
        b_ub=np.concatenate(ends),
        A_eq=np.vstack((velocities[-1], np.eye(N)[-1])),
        b_eq=np.array((-v, 0.0)),
        bounds=[(-A, A)] * N,
    )
    return v + T * found.x[0] if found.status == 0 else np.nan


def test_the_largest_velocity_is_nearly_that_of_linear_programming():
    """And never larger. The braking that is looked ahead to is not the shortest one of all."""
    random = np.random.default_rng(1)
    acted = 0
    for _ in range(400 if NIGHTLY else 40):
        joints = Joints(1, 10.0, 1000.0, 0.01, 0.8, 2.0)
        joints.q[:] = random.uniform(0.9, 1.0)
        joints.v[:] = random.uniform(-0.2, 0.6)
        joints.a[:] = random.uniform(-10.0, 10.0)
        best = largest_velocity(joints)
        _, upper, kept = joints.box()
        if not kept or np.isnan(best):
            continue
        assert best - 0.02 <= upper[0] <= best + 1e-7
        acted += upper[0] < joints.v[0] + 0.1 - ROUNDING
    assert acted > 10


@pytest.mark.parametrize('start', [0.0, 1.1])
def test_a_joint_that_is_pushed_out_comes_to_rest_at_its_end_also_from_beyond(start):
    joints = Joints(1, 10.0, 5000.0, 0.001, 2.6, 2.0)
    joints.q[:] = start
    for _ in range(2000):
        before = joints.a
        joints.move(joints.box()[1])
        assert np.abs(joints.a - before).max() <= 5.0 * (1.0 + ROUNDING)
    assert joints.q[0] == pytest.approx(1.0, abs=1e-6)
    assert abs(joints.v[0]) < 1e-6
    assert abs(joints.a[0]) < 1e-3


@pytest.mark.parametrize('lost', [1, 2, 3])
def test_what_a_robot_sees_after_lost_commands_keeps_the_limits(lost):
    """In any order. It bridges them with constant acceleration; the limits know of nothing."""
    count = 100
    joints = Joints(count, 10.0, 5000.0, 0.001, 2.6, 2.0)
    joints.limits['A_jerk'] = joints.A
    random = np.random.default_rng(0)
    p, v, a = np.zeros((3, count))  # of the robot
    gone = np.zeros(count)  # commands, since three in a row came
    came = np.full(count, 3)  # in a row
    for k in range(1000):
        if k % 60 == 0:
            target = random.normal(size=count)
        lower, upper, _ = joints.box(float(lost))
        joints.move(np.clip(target, lower, upper))
        gone = np.where(came > 2, 0, gone)
        is_lost = (gone < lost) & (random.random(count) < 0.2)
        gone = gone + is_lost
        came = np.where(is_lost, 0, came + 1)
        seen = ((joints.q - p) / joints.T - v) / joints.T
        assert np.abs(seen[~is_lost]).max() <= joints.A * (1.0 + 1e-6)
        assert np.abs(seen - a)[~is_lost].max() <= joints.J * joints.T * (1.0 + 1e-6)
        a = np.where(is_lost, a, seen)
        v = np.where(is_lost, v + joints.T * a, (joints.q - p) / joints.T)
        p = np.where(is_lost, p + joints.T * v, joints.q)
        assert np.abs(v).max() <= joints.V * (1.0 + 1e-6)


@pytest.mark.parametrize(('law', 'lost'), [*((law, 0) for law in LAWS), ('minimum_velocity', 3)])
def test_commands_keep_the_jerk_through_switches_and_stops_that_end_at_rest(law, lost):
    model = RobotModel.named('fr3')
    T = 0.001
    interface = replace(ROBOT_INTERFACES['fci'], lost=lost)
    options = {'task': 'pose', 'limits': ALL, 'robot_interface': interface}
    controller = Controller(model, law, T, switch_time=0.05, **options)
    random = np.random.default_rng(0)
    q = np.array(model.arm.start)
    ddq = np.zeros(7)
    ticks = 21_000 if NIGHTLY else 1400
    for k in range(ticks + 300):
        if k % 100 == 0:
            dx = random.normal(scale=(0.3, 0.3, 0.3, 1.0, 1.0, 1.0))
        if k % 350 == 300 or k == ticks:
            controller.hold()
        elif k % 350 == 0:
            controller.resume()
            controller.switch_law(random.choice(list(LAWS)) if k else law)
        command = controller.update(q, dx)
        q = command.q_ref
        assert np.abs(command.ddq - ddq).max() <= 5000.0 * T * (1.0 + 1e-6)
        assert np.abs(command.ddq).max() <= 10.0 * (1.0 + 1e-6)
        ddq = command.ddq
    assert not controller.published.dq.any()


def test_under_the_jerk_limit_alone_the_arm_keeps_its_acceleration_at_the_same_scale() -> None:
    model = RobotModel.named('fr3')
    controller = Controller(model, 'minimum_velocity', 0.001, limits=('jerk',), limit_scale=0.5)
    A = 0.5 * np.array(model.arm.acceleration_limit)
    q = np.array(model.arm.start)
    most = 0.0
    for _ in range(300):
        command = controller.update(q, np.array((1.0, 0.0, 0.0)))
        q = command.q_ref
        most = max(most, np.abs(command.ddq / A).max())
    assert 0.9 < most <= 1.0


def test_near_the_ends_of_its_ranges_an_fr3_is_no_faster_than_the_robot_allows() -> None:
    """To either end, to a velocity, or anywhere, at both positions of a tick; and with no joint
    left without a velocity.
    """
    model = RobotModel.named('fr3')
    limits = make_limits((*ALL, 'end_speed'), model)
    robot = JointLimits.of(model.arm)
    T = 0.001
    random = np.random.default_rng(0)
    q = np.array(model.arm.start)
    dq = np.zeros(model.n)
    ddq = np.zeros(model.n)
    for k in range(4000):
        if k % 50 == 0:
            target = random.uniform(-5.0, 5.0, model.n)
        if k % 400 == 0:
            kind = random.integers(0, 3, model.n)
        bounds = limits.at(RobotState(model, q, dq, ddq), T)
        assert do_meet(bounds.boxes)
        lower, upper = bounds.box
        v = np.select([kind == 0, kind == 1], [upper, lower], np.clip(target, lower, upper))
        for place in (q, q + T * v):
            slowest, fastest = robot.velocities_at(place)
            assert (slowest - ROUNDING <= v).all()
            assert (v <= fastest + ROUNDING).all()
        ddq = (v - dq) / T
        dq = v
        q = q + T * dq


def test_a_robot_that_goes_on_at_its_acceleration_is_met_where_it_is():
    """In cycles without a state, and so without a command, of which the controller knows."""
    T, A, J = 0.001, 10.0, 5000.0
    model = RobotModel.named('fr3')
    interface = replace(ROBOT_INTERFACES['fci'], lost=0)
    controller = Controller(model, 'minimum_velocity', T, limits=ALL, robot_interface=interface)
    random = np.random.default_rng(0)
    q = np.array(model.arm.start)
    p, v, a = q, np.zeros(7), np.zeros(7)  # of the robot
    for k in range(1000):
        if k % 60 == 0:
            dx = random.normal(scale=0.5, size=3)
        missed = int(random.integers(1, 4)) if k and random.random() < 0.1 else 0
        for _ in range(missed):
            v = v + T * a
            p = p + T * v
        q = controller.update(p, dx, missed).q_ref
        seen = ((q - p) / T - v) / T
        assert np.abs(seen).max() <= A * (1.0 + 1e-6)
        assert np.abs(seen - a).max() <= J * T * (1.0 + 1e-6)
        p, v, a = q, (q - p) / T, seen
