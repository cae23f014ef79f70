"""Publishes the robot's states through a network with faults."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.nodes.qos import PUBLISH
from redres_ros.nodes.wire import JointStateWriter, stamp_of


class Network(Protocol):
    """Delays, loses, or duplicates what is sent."""

    def send(self, message: bytes, tick: int) -> None:
        """Put a message in.

        Args:
            message: Given out as it is.
            tick: The present one.
        """

    def receive(self, tick: int) -> list[bytes]:
        """The messages that arrive by a tick."""
        ...


class StatePublisher:
    """Publishes `joint_states` as they arrive through a network.

    Args:
        node: The sim.
        joint_names: In the order of every array.
        network: Carries the states.
    """

    def __init__(self, node: Node, joint_names: Sequence[str], network: Network) -> None:
        self._publisher = node.create_publisher(JointState, 'joint_states', PUBLISH)
        self._writer = JointStateWriter(joint_names)
        self._network = network
        nothing = np.zeros(len(joint_names))
        self._newest = self._writer.written(0, nothing, nothing)  # of those that got out

    @property
    def newest(self) -> int:
        """Stamp of the newest published state [ns]; 0 before the first."""
        return stamp_of(self._newest)

    def send(self, stamp: int, q: np.ndarray, dq: np.ndarray, tick: int) -> None:
        """Send a state into the network.

        Args:
            stamp: Of the state [ns].
            q: Joint positions, (n,) [rad].
            dq: Joint velocities, (n,) [rad/s].
            tick: The present one.
        """
        self._network.send(self._writer.written(stamp, q, dq), tick)

    def publish(self, tick: int) -> None:
        """Publish what has arrived by this tick."""
        for arriving in self._network.receive(tick):
            self._publisher.publish(arriving)
            self._newest = max(self._newest, arriving, key=stamp_of)

    def publish_again(self) -> None:
        """Publish the newest state again: it may have been lost."""
        self._publisher.publish(self._newest)
