"""Commands for ros2_control: the topic of its forward_position_controller."""

import time
from collections.abc import Sequence

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray

from redres_ros.nodes.topics import PUBLISH, STEADY
from redres_ros.types import JointPositions

_CONTROLLER = 'forward_position_controller'
_LOOK = 0.1  # [s] between checks of the subscribers
_PATIENCE = 2.0  # [s] to wait for the parameters of a subscriber, which may have none
_ASK_AGAIN = 1.0  # [s] after a wrong order, or no response


class Forwarding:
    """Publishes positions, numbers without names, once the order of their joints is confirmed.

    Attributes:
        error: Why nothing is forwarded; empty if there is no error.
    """

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        """For the joints of those names, from base to tip."""
        self.error = ''
        self._node = node
        self._names = list(names)
        self._publisher = node.create_publisher(
            Float64MultiArray, f'{_CONTROLLER}/commands', PUBLISH
        )
        self._client = node.create_client(GetParameters, f'{_CONTROLLER}/get_parameters')
        self._forget()
        node.create_timer(_LOOK, self._look, clock=STEADY)

    @property
    def is_pending(self) -> bool:
        """Whether there is a subscriber whose order of joints is unknown or wrong."""
        return not self._is_confirmed and self._publisher.get_subscription_count() > 0

    def publish(self, q_ref: JointPositions) -> None:
        """Forward a reference, if the order of its joints is known to be right."""
        if self._is_confirmed:
            self._publisher.publish(Float64MultiArray(data=q_ref.tolist()))

    def _forget(self) -> None:
        """There is no subscriber: the next one may have another order."""
        self.error = ''
        self._is_confirmed = False
        self._response: Future | None = None
        self._asked_at = 0.0  # [s]
        self._waits_since = 0.0  # [s]; 0: no subscriber waits

    def _look(self) -> None:
        if self._publisher.get_subscription_count() == 0:
            self._forget()
            return
        if self._is_confirmed:
            return
        now = time.monotonic()
        self._waits_since = self._waits_since or now
        if self._response is not None and self._response.done():
            self._judge(self._response)
        elif not self._client.service_is_ready():
            self._go_without(now)
        elif now - self._asked_at > _ASK_AGAIN:
            self._asked_at = now
            self._response = self._client.call_async(GetParameters.Request(names=['joints']))

    def _judge(self, response: Future) -> None:
        self._response = None
        values = response.result().values
        joints = list(values[0].string_array_value) if values else []
        self._is_confirmed = joints == self._names
        self.error = ''
        if not self._is_confirmed:
            self.error = (
                f'{_CONTROLLER} has the joints {", ".join(joints)}; expected '
                f'{", ".join(self._names)}: nothing is forwarded until its parameter joints matches'
            )

    def _go_without(self, now: float) -> None:
        """Forward to a subscriber without parameters. Those of ros2_control's own controller may
        be discovered later than its subscription.
        """
        ends = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        is_of_ros2_control = any(end.node_name == _CONTROLLER for end in ends)
        if not is_of_ros2_control and now - self._waits_since > _PATIENCE:
            self._is_confirmed = True
            self._node.get_logger().warning(
                f'the subscriber of {_CONTROLLER}/commands has no parameter joints; it must expect '
                f'them in the order {", ".join(self._names)}'
            )
