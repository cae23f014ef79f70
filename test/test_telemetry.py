"""Topics for onlookers cost nothing while nobody looks."""

import time
from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from graph_helpers import PATIENCE
from own_ros import ros
from rclpy.node import Node
from std_msgs.msg import Float64

from redres_ros.nodes.topics import LOOK_PERIOD, Telemetry


class Speaker:
    """A node with two topics, and how often a value was made for each."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.telemetry = Telemetry(node, {'speaker/loudness': Float64, 'speaker/pitch': Float64})
        self.made = {'loudness': 0, 'pitch': 0}

    def speak(self) -> None:
        """Let time pass, and publish both."""
        rclpy.spin_once(self.node, timeout_sec=0.01)
        for topic in self.made:
            self.telemetry.publish(topic, lambda topic=topic: self._make(topic))

    def speak_for(self, duration: float) -> None:
        until = time.monotonic() + duration
        while time.monotonic() < until:
            self.speak()

    def speak_until(self, has_subscribers: bool) -> None:
        until = time.monotonic() + PATIENCE
        while bool(self.telemetry.subscribed) is not has_subscribers:
            assert time.monotonic() < until, f'there never were subscribers: {has_subscribers}'
            self.speak()

    def _make(self, topic: str) -> float:
        self.made[topic] += 1
        return 0.5


@pytest.fixture
def speaker() -> Iterator[Speaker]:
    with ros():
        yield Speaker(Node('speaker'))


def test_while_nobody_listens_nothing_is_made(speaker: Speaker) -> None:
    speaker.speak_for(3.0 * LOOK_PERIOD)
    assert speaker.made == {'loudness': 0, 'pitch': 0}


def test_only_what_is_listened_to_is_made(speaker: Speaker) -> None:
    listener = Node('listener')
    listener.create_subscription(Float64, 'speaker/loudness', lambda message: None, 1)
    speaker.speak_until(has_subscribers=True)
    speaker.speak_for(3.0 * LOOK_PERIOD)
    assert speaker.made['loudness'] > 0
    assert speaker.made['pitch'] == 0


def test_nothing_is_made_any_more_when_the_last_listener_has_gone(speaker: Speaker) -> None:
    listener = Node('listener')
    subscription = listener.create_subscription(
        Float64, 'speaker/loudness', lambda message: None, 1
    )
    speaker.speak_until(has_subscribers=True)
    listener.destroy_subscription(subscription)
    speaker.speak_until(has_subscribers=False)
    made = dict(speaker.made)
    speaker.speak_for(3.0 * LOOK_PERIOD)
    assert speaker.made == made
