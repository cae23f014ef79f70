"""The controller's other interfaces: what sensors measure, and commands for ros2_control."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from redres_ros.contact import BASE, TIP
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.nodes.conversions import JointMapper, stacked, to_nanoseconds
from redres_ros.nodes.diagnostics import Diagnostics
from redres_ros.nodes.parameters import with_changes
from redres_ros.nodes.topics import NEWEST, PUBLISH, STEADY
from redres_ros.preferences import Compliance
from redres_ros.types import JointPositions

ADMITTANCE = 'admittance.'  # before the names of its parameters
_TORQUES = Compliance.measurement

_FORWARDING = 'forward_position_controller'
_LOOK = 0.1  # [s] between checks of the subscribers
_ASK_AGAIN = 1.0  # [s] after a wrong order, or no response


class Sensors:
    """Topics and the service of contact and of measured preferences.

    A topic is subscribed to when it is first needed: a wrench in every cycle costs both sides time.
    """

    def __init__(
        self, node: Node, controller: Controller, loop: CommandLoop, diagnostics: Diagnostics
    ) -> None:
        self._node = node
        self._controller = controller
        self._loop = loop
        self._contact = loop.measurements.contact
        self._diagnostics = diagnostics
        self._rows = controller.m  # of the task; joints that are steered have others
        self.check({})
        self._joints = JointMapper(controller.model.joint_names)
        self._subscribed: set[str] = set()
        # Whether external torques are efforts less the model's: until others publish them.
        self.from_effort = False
        node.create_service(Trigger, 'controller/tare', self._on_tare)

    def check(self, changes: dict[str, Any]) -> None:
        """Raise RedresError for changes of parameters that would be refused."""
        settings = with_changes(self._contact.settings, changes, ADMITTANCE)
        settings.check(self._rows)
        if settings.frame not in (BASE, TIP):
            model = self._controller.model
            model.position(np.zeros(model.n), settings.frame)

    def apply(self, changes: dict[str, Any]) -> None:
        """Take over changes of parameters by name, and subscribe to what is needed."""
        settings = with_changes(self._contact.settings, changes, ADMITTANCE)
        if settings != self._contact.settings:
            self._contact.set_settings(settings)
        if settings.enabled:
            self._subscribe('wrench', WrenchStamped, self._enter_wrench)
        for name in self._controller.policy.measurements:
            if name != _TORQUES:
                self._subscribe(name, Float64MultiArray, partial(self._enter_values, name))
            elif name not in self._subscribed:
                self.from_effort = True
                self._subscribe(name, JointState, self._enter_torques)

    def enter_effort(self, message: JointState) -> None:
        """Take the efforts of a state, after a response."""
        response = self._loop.newest_response
        if response is None:
            return
        with self._diagnostics.judging(_TORQUES):
            efforts = self._joints.in_order(message, 'effort')
            self._loop.measurements.enter(_TORQUES, 0, response.command.tau - efforts)

    def _subscribe(self, topic: str, kind: type, enter: Callable[[Any], None]) -> None:
        if topic in self._subscribed:
            return
        self._subscribed.add(topic)
        receive = partial(self._receive, topic, enter)
        self._node.create_subscription(kind, topic, receive, NEWEST)

    def _receive(self, topic: str, enter: Callable[[Any], None], message: Any) -> None:
        with self._diagnostics.judging(topic):
            enter(message)

    def _enter_wrench(self, message: WrenchStamped) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        frame = message.header.frame_id
        wrench = stacked(message.wrench.force, message.wrench.torque)
        self._loop.measurements.enter_wrench(stamp, wrench, frame, time.time_ns())

    def _enter_torques(self, message: JointState) -> None:
        self.from_effort = False
        torques = self._joints.in_order(message, 'effort')
        stamp = to_nanoseconds(message.header.stamp)
        self._loop.measurements.enter(_TORQUES, stamp, torques, time.time_ns())

    def _enter_values(self, name: str, message: Float64MultiArray) -> None:
        """Record a measurement of any length that a preference or limit uses."""
        self._loop.measurements.enter(name, 0, np.array(message.data))

    def _on_tare(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._subscribe('wrench', WrenchStamped, self._enter_wrench)
        try:
            self._loop.tare()
        except RedresError as error:
            return Trigger.Response(success=False, message=str(error))
        return Trigger.Response(success=True, message='the measured wrench counts as zero')


class Forwarding:
    """Publishes positions, numbers without names, once the order of their joints is confirmed."""

    def __init__(self, node: Node, joint_names: Sequence[str]) -> None:
        self.error = ''  # why nothing is forwarded
        self._names = list(joint_names)
        self._publisher = node.create_publisher(
            Float64MultiArray, f'{_FORWARDING}/commands', PUBLISH
        )
        self._client = node.create_client(GetParameters, f'{_FORWARDING}/get_parameters')
        self._is_confirmed = False
        self._response: Future | None = None
        self._asked_at = 0.0  # [s]
        node.create_timer(_LOOK, self._look, clock=STEADY)

    @property
    def is_pending(self) -> bool:
        """Whether there is a subscriber whose order of joints is unknown or wrong."""
        return not self._is_confirmed and self._publisher.get_subscription_count() > 0

    def publish(self, q_ref: JointPositions) -> None:
        """Forward a reference, if the order of its joints is known to be right."""
        if self._is_confirmed:
            self._publisher.publish(Float64MultiArray(data=q_ref.tolist()))

    def _look(self) -> None:
        if self._publisher.get_subscription_count() == 0:
            # The next subscriber may have another order.
            self.error = ''
            self._is_confirmed = False
            self._response = None
        elif self._is_confirmed:
            return
        elif self._response is not None and self._response.done():
            self._judge(self._response)
        elif self._client.service_is_ready() and time.monotonic() - self._asked_at > _ASK_AGAIN:
            self._asked_at = time.monotonic()
            self._response = self._client.call_async(GetParameters.Request(names=['joints']))

    def _judge(self, response: Future) -> None:
        self._response = None
        values = response.result().values
        joints = list(values[0].string_array_value) if values else []
        self._is_confirmed = joints == self._names
        self.error = ''
        if not self._is_confirmed:
            self.error = (
                f'{_FORWARDING} has the joints {", ".join(joints)}; expected '
                f'{", ".join(self._names)}: nothing is forwarded until its parameter joints matches'
            )
