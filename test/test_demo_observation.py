"""From the nodes' messages to a table and a summary."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Int32, String

from redres_ros.controller import Controller
from redres_ros.demo.observation import COMMANDS, DESIRED, LAW, SEGMENT, STATES, Log, replay
from redres_ros.demo.outcome import motion_values
from redres_ros.graph.monitor import Sample
from redres_ros.laws import make_law
from redres_ros.nodes.conversions import to_time
from redres_ros.nodes.topics import REASON, TASK_BEGUN, TASK_STATE
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import MotionRecorder, Recording

T = 0.002  # [s]
PERIOD = 2_000_000  # [ns]
NAMES = RobotModel.named('lwr4_paper').joint_names
ZERO = np.zeros(7)
Seen = tuple[Recording, Log, RobotModel]


class Graph:
    """Nodes that publish into a log, at instants [ns] that go up."""

    def __init__(self) -> None:
        self.log = Log(NAMES)
        self.now = 10**15

    def publish(self, topic: str, message: Any) -> None:
        self.now += 1000
        self.log.enter(topic, Sample(serialize_message(message), self.now))

    def publish_state(self, tick: int, q: np.ndarray = ZERO) -> None:
        self.publish(STATES, joint_state(tick, q))

    def publish_command(self, tick: int, q: np.ndarray = ZERO, dq: np.ndarray = ZERO) -> None:
        self.publish(COMMANDS, joint_state(tick, q, dq))

    def publish_desired(self, tick: int, x: np.ndarray = ZERO) -> None:
        message = PoseStamped()
        message.header.stamp = to_time(tick * PERIOD)
        position = message.pose.position
        position.x, position.y, position.z = map(float, x[:3])
        self.publish(DESIRED, message)

    def publish_word(self, topic: str, word: str) -> None:
        self.publish(topic, String(data=word))


def joint_state(tick: int, q: np.ndarray, dq: np.ndarray = ZERO) -> JointState:
    message = JointState(name=NAMES, position=q.tolist(), velocity=dq.tolist())
    message.header.stamp = to_time(tick * PERIOD)
    return message


def ticks(stamps: list[int]) -> list[int]:
    return [stamp // PERIOD for stamp in stamps]


def test_a_message_without_a_stamp_belongs_to_the_newest_stamp_of_its_node_before_it() -> None:
    graph = Graph()
    graph.publish_word(TASK_STATE, 'idle')
    graph.publish_desired(7)
    graph.publish(SEGMENT, Int32(data=2))
    graph.publish_state(8)
    graph.publish_desired(9)
    graph.publish(SEGMENT, Int32(data=2))
    graph.publish_word(TASK_STATE, 'moving')
    assert graph.log.changes(TASK_STATE) == {0: 'idle', 9 * PERIOD: 'moving'}
    assert graph.log.changes(SEGMENT) == {7 * PERIOD: 2}
    stamps = [6 * PERIOD, 7 * PERIOD, 9 * PERIOD]
    assert graph.log.values_at(SEGMENT, stamps, 0) == [2, 2, 2]
    assert graph.log.values_at(TASK_STATE, stamps, '') == ['idle', 'idle', 'moving']
    assert graph.log.values_at(LAW, stamps, 'none') == ['none'] * 3


def test_rounds_are_what_the_planner_moved_through_until_the_robot_stopped() -> None:
    graph = Graph()
    words = {10: 'moving', 13: 'finished', 20: 'moving'}
    for tick in range(30):
        graph.publish_state(tick)
        if tick == 22:
            graph.publish_word(REASON, 'a reason')
        if 10 <= tick < 16 or 20 <= tick < 26:
            graph.publish_desired(tick)
        if tick in words:
            graph.publish_word(TASK_STATE, words[tick])
    log = graph.log
    assert ticks(log.under_way()) == [10, 11, 12, 20, 21, 22]
    assert log.stopped() == (22 * PERIOD, 'a reason')


def test_a_word_from_before_a_task_began_is_not_its_ending() -> None:
    graph = Graph()
    graph.publish_word(TASK_STATE, 'finished')  # of the round before
    graph.publish(TASK_BEGUN, to_time(PERIOD))
    assert graph.log.ending() == ''
    graph.publish_word(TASK_STATE, 'moving')
    assert graph.log.ending() == ''
    graph.publish_word(TASK_STATE, 'finished')
    assert graph.log.ending() == 'finished'


def test_a_state_that_the_planner_missed_is_part_of_the_motion() -> None:
    graph = Graph()
    for tick in range(10, 15):
        graph.publish_state(tick)
    graph.publish_desired(10)
    graph.publish_word(TASK_STATE, 'moving')
    graph.publish_desired(13, np.full(3, 0.3))
    assert ticks(graph.log.under_way()) == [10, 11, 12, 13]
    between = graph.log.desired_at([11 * PERIOD, 12 * PERIOD])
    np.testing.assert_allclose(between[:, :3], [[0.1] * 3, [0.2] * 3])


@pytest.fixture(scope='module')
def seen() -> Seen:
    """The beginning of an ideal loop: its own table, and what nodes would have published of it."""
    model = RobotModel.named('lwr4_paper')
    task = load_task('rectangle')
    controller = Controller(model, make_law('dynamically_consistent'), T)
    planner = Planner(task)
    graph = Graph()
    q = task.start
    motion = MotionRecorder(model, T)
    for k in range(200):
        reference = planner.reference(model.tip(q)[0], k * T)
        command = controller.update(q, reference.dx)
        motion.add(k * T, command, reference, command.s)
        tick = k + 1000
        graph.publish_state(tick, q)
        graph.publish_command(tick, command.q_ref, command.dq)
        graph.publish_word(LAW, 'dynamically_consistent')
        graph.publish_desired(tick, reference.x_d)
        graph.publish(SEGMENT, Int32(data=reference.segment))
        graph.publish_word(TASK_STATE, 'moving')
        q = command.q_ref
    return motion.recording(''), graph.log, model


@pytest.mark.parametrize('unseen', [0, 100])
def test_the_table_of_the_commands_seen_is_that_of_the_loop(seen: Seen, unseen: int) -> None:
    expected, log, model = seen
    log = deepcopy(log)
    for stamp in sorted(log.commands)[:unseen]:
        del log.commands[stamp]
    got = replay(log, model, make_law, T)
    rows = expected.data[unseen + 1 if unseen else 0 :]  # the first one seen is no jump from rest
    np.testing.assert_allclose(got.data, rows, rtol=1e-9, atol=1e-9)


def test_the_figures_of_a_motion_are_those_of_its_rows(seen: Seen) -> None:
    recording, _, _ = seen
    task = load_task('rectangle')
    motion = motion_values(recording, task, 0.1)
    assert motion['error'][0] == recording['task_error'].max()
    # From a path along y.
    path_deviation = recording.vectors('x')[:, (0, 2)] - task.waypoints[0, (0, 2)]
    largest = np.linalg.norm(path_deviation, axis=1).max()
    assert motion['path_deviation'][0] == pytest.approx(largest)
    assert motion['seconds'] == pytest.approx(199 * T)
    assert motion['still'] == pytest.approx(T * (recording['joint_velocity_norm'] <= 1e-4).sum())
