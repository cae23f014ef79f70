"""The robot's states on their way out, over a link that may have faults."""

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.fake_robot.network_model import Link, NetworkModel
from redres_ros.nodes.qos import PUBLISH
from redres_ros.nodes.wire import JointStateWriter, stamp_of


class StatePublisher:
    """Publishes `joint_states`, as its link lets them through.

    Args:
        node: The sim.
        joint_names: In the order of every array.
        seed: Of the link's faults.
        link: What happens on the way; may be set at any time.
    """

    def __init__(self, node: Node, joint_names: Sequence[str], seed: int, link: Link) -> None:
        self._publisher = node.create_publisher(JointState, 'joint_states', PUBLISH)
        self._writer = JointStateWriter(joint_names)
        self._under_way: NetworkModel[bytes] = NetworkModel(f'{seed} states', link)
        nothing = np.zeros(len(joint_names))
        self._newest = self._writer.written(0, nothing, nothing)  # of those that got out

    @property
    def newest(self) -> int:
        """Stamp of the newest state that got out [ns]; 0 before the first."""
        return stamp_of(self._newest)

    def set_link(self, link: Link) -> None:
        """From the next state on."""
        self._under_way.link = link

    def send(self, stamp: int, q: np.ndarray, dq: np.ndarray, tick: int) -> None:
        """Put a state on its way.

        Args:
            stamp: Of the state [ns].
            q: Joint positions, (n,) [rad].
            dq: Joint velocities, (n,) [rad/s].
            tick: The present one.
        """
        self._under_way.send(self._writer.written(stamp, q, dq), tick)

    def publish(self, tick: int) -> None:
        """Publish what has come through by this tick."""
        for arriving in self._under_way.receive(tick):
            self._publisher.publish(arriving)
            self._newest = max(self._newest, arriving, key=stamp_of)

    def publish_again(self) -> None:
        """Publish the newest state once more: it may have got lost."""
        self._publisher.publish(self._newest)
