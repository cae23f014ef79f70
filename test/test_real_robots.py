"""docs/real_robots.md: each robot's parameters, on a stand-in with its topics and its rules."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from rclpy.qos import (
    QoSCompatibility,
    QoSProfile,
    qos_check_compatible,
    qos_profile_sensor_data,
    qos_profile_system_default,
)
from stand_in import (
    FrankaRules,
    Habits,
    Judge,
    LbrGuard,
    Slowing,
    StandIn,
    behind_ros2_control,
    fr3_rules,
)
from test_urdf import PARTS, urdf
from ur_linear_axis import ur_linear_axis
from virtual_graph import Graph

from redres_ros.files.installation import share_path
from redres_ros.files.text import read_yaml
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.topics import LATCHED, NEWEST, PUBLISH
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm, arm_from_urdf, find_arm
from redres_ros.robots.joint_limits import JointLimits, with_accelerations

FOLDER = share_path('config/robots')
PAGE = Path(__file__).parents[1] / 'docs' / 'real_robots.md'
RAIL = PARTS['yaw'].replace('"revolute"', '"prismatic"').replace('"0 0 1"', '"0 1 0"')
ON_A_RAIL = urdf(yaw=RAIL).replace('"tip"', '"tool0"')


UR = ur_linear_axis()
KUKA = find_arm('iiwa7').description().replace('lbr_A', 'joint_')  # their arm is an iiwa 14
SIMULATED = find_arm('gen3').description()
UR_ACCELERATION = (1.0, *(5.0,) * 6)  # [m/s^2], [rad/s^2]


class Robot(NamedTuple):
    """A robot as its driver shows it."""

    arm: Arm
    judge: Callable[[JointLimits, float], Judge]  # its rules, made of limits and the period
    others: tuple[str, ...] = ()  # joints of a gripper
    description: str = ''  # what is published


ROBOTS = {
    'lbr_iiwa7': Robot(find_arm('iiwa7'), LbrGuard),
    'franka_fr3': Robot(find_arm('fr3'), fr3_rules, ('fr3_finger_joint1', 'fr3_finger_joint2')),
    'kinova_gen3': Robot(find_arm('gen3'), FrankaRules, ('robotiq_85_left_knuckle_joint',)),
    'ros2_control': Robot(
        arm_from_urdf(ON_A_RAIL, 'tool0'), FrankaRules, ('finger',), description=ON_A_RAIL
    ),
    'kuka_drivers': Robot(
        with_accelerations(arm_from_urdf(KUKA, 'tool0'), (10.0,) * 7), LbrGuard, description=KUKA
    ),
    'mujoco_ros2_control': Robot(
        arm_from_urdf(SIMULATED, 'tool0'), LbrGuard, ('finger',), description=SIMULATED
    ),
    'ur_linear_axis': Robot(
        with_accelerations(arm_from_urdf(UR, 'tool0'), UR_ACCELERATION), LbrGuard, description=UR
    ),
}
BY_DEFAULT = ('position', 'velocity', 'acceleration')  # limits
UP = np.array((0.0, 0.0, 0.02))  # [m]
SPEED_OF_SIMULATION = 0.5  # of the computer's clock
EVERY = pytest.mark.parametrize('name', ROBOTS)
SOME = pytest.mark.parametrize('name', by_day(3, ROBOTS))


def parameters_of(name: str) -> dict[str, Any]:
    parameters: dict[str, Any] = read_yaml(FOLDER / f'{name}.yaml')['/**']['ros__parameters']
    return parameters


def rate_of(name: str) -> float:
    rate: float = parameters_of(name)['rate']
    return rate


def move(name: str, graph: Graph, robot: StandIn) -> str:
    """Send a target 2 cm above the tip, and wait until the planner has done; its last word."""
    words: list[str] = []
    graph.listen('planner/state', 'test', lambda message: words.append(message.data))
    graph.clock.advance(0.5)
    model = RobotModel(ROBOTS[name].arm)
    x, R = model.tip(robot.q)
    graph.publish('target_pose', to_pose(0, '', x + UP, R))
    for _ in range(60):
        graph.clock.advance(0.1)
        if words[-1] == 'finished':
            break
    assert np.linalg.norm(model.tip(robot.q)[0] - x - UP) < 2e-3
    return words[-1]


def stand_in(name: str, graph: Graph) -> StandIn:
    robot = ROBOTS[name]
    rate = rate_of(name)
    limits = JointLimits.of(robot.arm)
    judge = robot.judge(limits, 1.0 / rate)
    start = np.array(robot.arm.start)
    speed = SPEED_OF_SIMULATION if 'use_sim_time' in parameters_of(name) else 0.0
    habits = Habits(others=robot.others, simulated=speed)
    return StandIn(graph, limits, start, rate, judge, habits)


@pytest.mark.parametrize(
    ('publisher', 'subscription'),
    [
        (qos_profile_system_default, NEWEST),  # states
        (qos_profile_sensor_data, NEWEST),
        (PUBLISH, qos_profile_system_default),  # commands
        (PUBLISH, qos_profile_sensor_data),
        (LATCHED, LATCHED),  # robot_description
    ],
)
def test_what_drivers_send_and_expect_matches_the_nodes(
    publisher: QoSProfile, subscription: QoSProfile
) -> None:
    compatible, reason = qos_check_compatible(publisher, subscription)
    # A warning is given for what both sides leave open, as their liveliness.
    assert compatible != QoSCompatibility.ERROR, reason


@pytest.mark.slow
@SOME
def test_the_robot_moves_and_has_nothing_to_complain_of(name: str) -> None:
    with behind_ros2_control(FOLDER / f'{name}.yaml', ROBOTS[name].description) as graph:
        robot = stand_in(name, graph)
        assert move(name, graph, robot) == 'finished'
    assert robot.complaints == []
    steps = np.abs(np.diff(robot.way, axis=0)).max()
    fastest = 0.2 * JointLimits.of(ROBOTS[name].arm).velocity.max()  # [rad/s]
    assert 0.0 < steps <= fastest / rate_of(name) + 1e-9


@pytest.mark.slow
def test_after_a_reflex_no_task_goes_on_by_itself() -> None:
    with behind_ros2_control(FOLDER / 'franka_fr3.yaml') as graph:
        words: list[str] = []
        graph.listen('planner/state', 'test', lambda message: words.append(message.data))
        robot = stand_in('franka_fr3', graph)
        graph.clock.advance(0.5)
        assert graph.call('planner/start').success
        graph.clock.advance(1.0)
        assert words[-1] == 'moving'
        robot.fail_read()
        graph.clock.advance(0.8)
        robot.recover()
        graph.clock.advance(0.5)
        stood = robot.q
        graph.clock.advance(0.5)
        assert words[-1] == 'idle'
        assert np.array_equal(robot.q, stood)


@pytest.mark.slow
def test_with_the_30_hz_copy_of_a_franka_arms_states_nothing_moves_and_rates_are_named() -> None:
    with behind_ros2_control(FOLDER / 'franka_fr3.yaml') as graph:
        arm = ROBOTS['franka_fr3'].arm
        steady = Habits(jitter=0.0)
        robot = StandIn(graph, JointLimits.of(arm), np.array(arm.start), 30.0, habits=steady)
        graph.clock.advance(2.0)
        x, R = RobotModel(arm).tip(robot.q)
        graph.publish('target_pose', to_pose(0, '', x + UP, R))
        graph.clock.advance(2.0)
    assert ('controller', 'states come at 30 Hz; expected 1000 Hz (parameter rate)') in graph.log
    assert np.ptp(robot.way, axis=0).max() == 0.0


def test_near_the_ends_of_its_ranges_a_franka_arm_is_as_fast_as_its_manual_says() -> None:
    limits = JointLimits.of(ROBOTS['franka_fr3'].arm)
    for share in np.linspace(0.0, 1.0, 2001):
        q = limits.lower + share * (limits.upper - limits.lower)
        expected = Slowing().fastest(q, limits)
        np.testing.assert_allclose(limits.velocities_at(q), expected, rtol=0.0, atol=1e-12)
    assert 'end_speed' in parameters_of('franka_fr3')['limits']


def test_every_file_of_a_robot_is_tested() -> None:
    assert sorted(path.stem for path in FOLDER.glob('*.yaml')) == sorted(ROBOTS)


@EVERY
def test_first_steps_are_at_reduced_limits(name: str) -> None:
    controller = parameters_of(name)
    assert controller['limit_scale'] <= 0.25
    assert set(controller.get('limits', BY_DEFAULT)) >= set(BY_DEFAULT)
