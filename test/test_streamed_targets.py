"""Targets that a policy streams, jumping as they may: the real nodes, in virtual time."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from nightly import NIGHTLY
from reference_judge import ReferenceJudge, judge_graph
from virtual_graph import VirtualRun, virtual_run

from redres_ros import RobotModel
from redres_ros.geometry import rotation_matrix
from redres_ros.nodes.conversions import to_pose
from redres_ros.planning.task_executor import TaskState
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

RATE = 100.0  # [Hz]
ARM = 'fr3'
MODEL = RobotModel.named(ARM)
POSE = {'task_space': 'pose'}
SECONDS = 1800.0 if NIGHTLY else 15.0  # of virtual time
JUMP = 0.3  # [m], [rad] standard deviation of a target about the start


@pytest.fixture
def run() -> Iterator[VirtualRun]:
    """A robot in command mode whose planner waits for targets."""
    with virtual_run(RATE, ARM, controller=POSE, planner=POSE) as made:
        made.run(0.5)
        assert made.commanding
        yield made


@pytest.fixture
def judge(run: VirtualRun) -> ReferenceJudge:
    return judge_graph(run.graph, JointLimits.of(MODEL.arm), RATE, 'extrapolate')


def tip(run: VirtualRun) -> tuple[np.ndarray, np.ndarray]:
    """Where the tip is: position (3,) [m] and orientation (3, 3)."""
    return MODEL.tip(run.nodes['sim']._robot.plant.q)


def send(run: VirtualRun, x: np.ndarray, R: np.ndarray) -> None:
    run.graph.publish('target_pose', to_pose(0, '', x, R))


def test_random_jumps_at_20_to_60_hz_are_followed_within_all_limits(
    run: VirtualRun, judge: ReferenceJudge
) -> None:
    rng = np.random.default_rng(24)
    x, R = tip(run)
    way = 0.0  # [m] of the tip
    end = run.now + SECONDS
    while run.now < end:
        jump = rng.normal(scale=JUMP, size=6)
        send(run, x + jump[:3], rotation_matrix(jump[3:]) @ R)
        before = tip(run)[0]
        run.run(1.0 / rng.uniform(20.0, 60.0))
        way += float(np.linalg.norm(tip(run)[0] - before))
    judge.assert_followable()
    assert run.nodes['planner']._run.state is TaskState.MOVING
    assert way > 0.01 * SECONDS  # it moves, and does not begin anew with each of them


def test_a_target_in_the_middle_of_a_motion_makes_no_stop(run: VirtualRun) -> None:
    x, R = tip(run)
    send(run, x + np.array((0.0, 0.3, 0.0)), R)
    run.run(1.3)
    speeds = []
    send(run, x + np.array((0.05, 0.4, 0.0)), R)
    for _ in range(10):
        before = tip(run)[0]
        run.run(0.05)
        speeds.append(float(np.linalg.norm(tip(run)[0] - before)) / 0.05)
    assert min(speeds) > 0.1
