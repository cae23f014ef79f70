"""Messages between nodes of one process, without a way through DDS."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from geometry_msgs.msg import TwistStamped
from graph_helpers import PATIENCE, START, Observer, await_that, graph
from messages import to_twist
from own_ros import ros
from rclpy.node import Node
from std_msgs.msg import Float64

from redres_ros.nodes.composed import IntraProcess
from redres_ros.nodes.runtime import Spinner
from redres_ros.nodes.topics import NEWEST, PUBLISH

pytestmark = pytest.mark.slow


class Talker(Node):
    """Says numbers on three topics."""

    def __init__(self, name: str = 'talker', namespace: str = '/') -> None:
        super().__init__(name, namespace=namespace)
        self.said = {
            topic: self.create_publisher(Float64, topic, PUBLISH)
            for topic in ('inner', 'open', 'other')
        }


class Listener(Node):
    """Keeps what it receives, and the thread in which that happens."""

    def __init__(self, received: list[Any], name: str = 'listener', namespace: str = '/') -> None:
        super().__init__(name, namespace=namespace)
        for topic in ('inner', 'open', 'other', 'shared'):
            self.create_subscription(
                Float64,
                topic,
                lambda message, topic=topic: received.append(
                    (self.get_name(), topic, message, threading.get_ident())
                ),
                NEWEST,
            )


@pytest.fixture
def intra_process() -> Iterator[IntraProcess]:
    """In a domain of its own."""
    with ros():
        yield IntraProcess(('inner',), open_topics=('open',), shared_topics=('shared',))


def test_receivers_are_called_within_publish_in_the_order_in_which_they_were_made(
    intra_process: IntraProcess,
) -> None:
    received: list[Any] = []
    first, second = (intra_process.node(Listener)(received, name) for name in ('first', 'second'))
    talker = intra_process.node(Talker)()
    talker.said['inner'].publish(Float64(data=1.5))
    assert [(name, topic, message.data, thread) for name, topic, message, thread in received] == [
        (name, 'inner', 1.5, threading.get_ident()) for name in ('first', 'second')
    ]
    for node in (first, second, talker):
        node.destroy_node()


def test_nodes_in_other_namespaces_do_not_get_it(intra_process: IntraProcess) -> None:
    received: list[Any] = []
    nodes = (
        intra_process.node(Listener)(received, namespace='/left'),
        intra_process.node(Talker)(namespace='/right'),
    )
    nodes[1].said['inner'].publish(Float64(data=1.0))
    assert not received
    for node in nodes:
        node.destroy_node()


def test_others_receive_every_topic_but_reach_only_open_and_ordinary_ones(
    intra_process: IntraProcess,
) -> None:
    received_inside: list[Any] = []
    received_outside: list[Any] = []
    inside = (
        intra_process.node(Talker)('talker_inside'),
        intra_process.node(Listener)(received_inside, 'listener_inside'),
    )
    outside = Talker('talker_outside'), Listener(received_outside, 'listener_outside')
    stopped = threading.Event()
    spinner = Spinner((*inside, *outside), stopped)

    def say(talker: Talker, received: list[Any], topics: set[str]) -> None:
        until = time.monotonic() + PATIENCE
        while not topics <= {topic for _, topic, _, _ in received} and time.monotonic() < until:
            for topic in talker.said:
                talker.said[topic].publish(Float64(data=1.0))
            spinner.sleep(0.05)

    say(inside[0], received_outside, {'inner', 'open', 'other'})
    assert {topic for _, topic, _, _ in received_outside} == {'inner', 'open', 'other'}
    received_inside.clear()
    say(outside[0], received_inside, {'open', 'other'})
    assert {topic for _, topic, _, _ in received_inside} == {'open', 'other'}
    spinner.close()
    for node in (*inside, *outside):
        node.destroy_node()


def test_receivers_of_a_shared_topic_get_each_message_of_another_process_by_one_subscription(
    intra_process: IntraProcess,
) -> None:
    received: list[Any] = []
    inside = [intra_process.node(Listener)(received, name) for name in ('first', 'second')]
    outside = rclpy.create_node('outside')
    publisher = outside.create_publisher(Float64, 'shared', PUBLISH)
    spinner = Spinner((*inside, outside), threading.Event())
    until = time.monotonic() + PATIENCE
    while not received and time.monotonic() < until:
        publisher.publish(Float64(data=1.0))
        spinner.sleep(0.05)
    spinner.close()
    for node in (*inside, outside):
        node.destroy_node()
    (first, _, message, _), (second, _, same, _) = received[:2]
    assert (first, second) == ('first', 'second')
    assert message is same


def test_planner_and_controller_in_one_process_move_a_robot_in_another(tmp_path: Path) -> None:
    with graph(Observer) as (observer, start):
        start('sim', tmp_path / 'sim.log', patience=5.0)
        composed = start('composed --no-sim', tmp_path / 'composed.log', autostart=True)
        await_that(lambda: observer.speed > 0.02, 'motion', every=0.02)
        await_that(lambda: observer.commands, 'commands at the observer')
        composed.check()
        observer.assert_all_was_well()


def test_a_wait_in_the_thread_of_the_executor_ends_when_a_callback_sets_the_event(
    intra_process: IntraProcess,
) -> None:
    node = rclpy.create_node('node')
    stopped = threading.Event()
    event = threading.Event()
    spinner = Spinner([node], stopped)
    assert not spinner.wait(event, 0.05)
    node.create_timer(0.05, event.set)
    begun = time.monotonic()
    assert spinner.wait(event, PATIENCE)
    assert time.monotonic() - begun < PATIENCE / 2.0
    spinner.close()
    node.destroy_node()


def test_task_velocities_from_another_process_move_the_composed_arm(tmp_path: Path) -> None:
    with graph(Observer) as (observer, start):
        composed = start(
            'composed', tmp_path / 'composed.log', patience=5.0, start=tuple(START.tolist())
        )
        observer.await_command_mode()
        teleoperation = observer.create_publisher(TwistStamped, 'cartesian_velocity', PUBLISH)

        def moved() -> bool:
            teleoperation.publish(to_twist(observer.at, 'world', np.array((0.0, -0.1, 0.0))))
            return observer.speed > 0.02

        await_that(moved, 'motion', every=0.02)
        composed.check()
        observer.assert_all_was_well()
