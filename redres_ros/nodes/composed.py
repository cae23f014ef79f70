"""Executable `composed`: the nodes sim, controller and planner in one process and one thread.

States, commands and task velocities are handed over directly, not through DDS. Other processes can
still listen, and send task velocities.

With --no-sim there is no sim: a robot publishes the states and receives the commands. Controller
and planner share one subscription to the states; the controller responds first, and the planner
computes once the robot has the command.
"""

import sys
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode, WaitingPlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode

_NO_SIM = '--no-sim'


class IntraProcess:
    """Makes nodes that pass their messages on some topics directly within publish().

    Receivers are called in the thread of the publisher and in the order of their creation, before
    the message goes out to other processes.

    Args:
        topics: Other processes may subscribe to these; their publications are ignored.
        open_topics: These take publications of other processes too. A message from within then
            comes a second time, by DDS.
        shared_topics: These come from other processes only, by one subscription for all receivers.
    """

    def __init__(
        self,
        topics: Collection[str],
        open_topics: Collection[str] = (),
        shared_topics: Collection[str] = (),
    ) -> None:
        self._handed = {*topics, *open_topics, *shared_topics}
        self.open_topics = open_topics
        self.shared_topics = shared_topics
        self._receivers: dict[str, list[Callable[[Any], None]]] = {}  # by the topic's full name

    def node(self, cls: type[Node]) -> type[Node]:
        """The same node, handing over."""
        return type(cls.__name__, (cls, _Handing), {'intra_process': self})

    def receivers_of(self, node: Node, topic: str) -> list[Callable[[Any], None]] | None:
        """Who gets the messages on a topic of a node; None for one that goes through DDS alone.

        Args:
            node: The publisher or subscriber.
            topic: As the node names it.
        """
        if topic not in self._handed:
            return None
        return self._receivers.setdefault(node.resolve_topic_name(topic), [])


def _hand_over(receivers: list[Callable[[Any], None]], message: Any) -> None:
    for receive in receivers:
        receive(message)


class _Handing(Node):
    """Mixed in between a node's class and rclpy's: records what passes."""

    intra_process: IntraProcess

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any
    ) -> Any:
        publisher = super().create_publisher(msg_type, topic, qos_profile, **options)
        receivers = self.intra_process.receivers_of(self, topic)
        return publisher if receivers is None else _Publisher(publisher, receivers)

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos_profile: QoSProfile | int,
        **options: Any,
    ) -> Any:
        intra_process = self.intra_process
        receivers = intra_process.receivers_of(self, topic)
        if receivers is not None:
            receivers.append(callback)
            if topic in intra_process.shared_topics and len(receivers) == 1:
                callback = partial(_hand_over, receivers)
            elif topic not in intra_process.open_topics:
                return None
        return super().create_subscription(msg_type, topic, callback, qos_profile, **options)


class _Publisher:
    """Hands over before it publishes."""

    def __init__(self, publisher: Publisher, receivers: list[Callable[[Any], None]]) -> None:
        self._publisher = publisher
        self._receivers = receivers

    def get_subscription_count(self) -> int:
        """Receivers in this process and subscriptions in others."""
        return len(self._receivers) + self._publisher.get_subscription_count()

    def publish(self, message: Any) -> None:
        """Hand it to the receivers of this process, then publish it."""
        _hand_over(self._receivers, message)
        self._publisher.publish(message)


def run_composed(
    adapt: Callable[[type[Node]], type[Node]] = lambda cls: cls,
    arguments: list[str] | None = None,
    *,
    with_sim: bool = True,
) -> int:
    """Run the nodes until they are asked to end; the controller gets a state before the planner.

    Args:
        adapt: Gives a class in place of each node's.
        arguments: The command line; None for that of the process.
        with_sim: Whether the fake robot is among them.

    Returns:
        The exit status.
    """
    of_robot = ('joint_states', 'joint_command') if with_sim else ()
    intra_process = IntraProcess(
        (*of_robot, 'controller/task_scaling'),
        open_topics=('cartesian_velocity',),
        shared_topics=() if with_sim else ('joint_states',),
    )
    classes: list[type[Node]] = [ControllerNode, WaitingPlannerNode]
    if with_sim:
        classes = [SimNode, ControllerNode, PlannerNode]
    makes = [intra_process.node(adapt(cls)) for cls in classes]
    return run_nodes(*makes, arguments=arguments)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    given = sys.argv if arguments is None else arguments
    return run_composed(arguments=arguments, with_sim=_NO_SIM not in given)


if __name__ == '__main__':
    sys.exit(main())
