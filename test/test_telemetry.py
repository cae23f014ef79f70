"""Topics for onlookers cost nothing while nobody looks."""

from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from graph_helpers import await_that
from own_ros import ros
from rclpy.node import Node
from std_msgs.msg import Float64

from redres_ros.nodes.topics import Telemetry


class Speaker(Node):
    """A node with two topics, and how often a value was made for each."""

    def __init__(self) -> None:
        super().__init__('speaker')
        self.telemetry = Telemetry(self, {'speaker/loudness': Float64, 'speaker/pitch': Float64})
        self.made = {'loudness': 0, 'pitch': 0}

    def speak(self) -> None:
        """Let time pass, and publish both."""
        rclpy.spin_once(self, timeout_sec=0.01)
        for topic in self.made:
            self.telemetry.publish(topic, lambda topic=topic: self._make(topic))

    def speak_to(self, *subscribed: str) -> None:
        """Go on until just these have a subscriber, and then twice more."""
        await_that(lambda: self.speak() or self.telemetry.subscribed == set(subscribed), 'it')
        self.speak()
        self.speak()

    def _make(self, topic: str) -> float:
        self.made[topic] += 1
        return 0.5


@pytest.fixture
def speaker() -> Iterator[Speaker]:
    with ros():
        yield Speaker()


def test_a_value_is_made_only_while_its_topic_has_a_subscriber(speaker: Speaker) -> None:
    speaker.speak_to()
    assert speaker.made == {'loudness': 0, 'pitch': 0}
    listener = Node('listener')
    subscription = listener.create_subscription(Float64, 'speaker/loudness', print, 1)
    speaker.speak_to('loudness')
    assert speaker.made['loudness'] > 0
    listener.destroy_subscription(subscription)
    speaker.speak_to()
    made = speaker.made['loudness']
    speaker.speak()
    assert speaker.made == {'loudness': made, 'pitch': 0}
