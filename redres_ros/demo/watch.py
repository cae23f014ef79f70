"""`redres watch`: the live state of the nodes in a terminal."""

import threading
import time
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rich.console import RenderableType
from rich.live import Live
from std_msgs.msg import Float64, Int32, String

from redres_ros.demo.live_arm import LiveArm
from redres_ros.demo.remote import Remote
from redres_ros.demo.watch_page import NODES, Heard, JointBar, NodeHealth, page
from redres_ros.errors import RedresError
from redres_ros.nodes.qos import LATCHED, NEWEST

_REFRESH = 5.0  # [Hz]

_LATCHED = {'sim/session_state', 'sim/connection_quality', 'sim/stop_reason', 'planner/state'}
_LAW = 'controller/law'
_LIMITING = 'controller/limiting'
_TIP = 'controller/tip_pose'
_TYPES = {
    **dict.fromkeys((*_LATCHED, _LAW, _LIMITING), String),
    'planner/segment': Int32,
    _TIP: PoseStamped,
}  # all others are a Float64
# Topics of which a glance says as much: to hear each at every tick would cost the controller time.
_FIGURES = {
    'controller/task_scaling': 'scaling',
    'controller/joint_velocity_norm': 'speed',
    'controller/joint_acceleration_norm': 'acceleration',
    'controller/null_velocity_norm': 'null_speed',
    'controller/joint_torque_norm': 'torque',
    'controller/min_singular_value': 'singular_value',
}


class Watch(Node):
    """Keeps the newest word and figure of every topic on the page, and when it came.

    Args:
        namespace: Of the arm's nodes; empty: none.
    """

    def __init__(self, namespace: str = '') -> None:
        super().__init__('watch', namespace=namespace or None)
        self._heard: dict[str, Heard] = {}
        self._remote = Remote(self)
        self._arm: LiveArm | None = None
        self._is_known = True  # whether the arm is, as far as one knows
        for node in ('sim', 'planner'):
            self._listen(node)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_parameters, 100)

    @property
    def heard(self) -> bool:
        """Whether anything has come."""
        return bool(self._heard)

    def page(self) -> RenderableType:
        """The page as it is now."""
        domain = self.context.get_domain_id()
        return page(dict(self._heard), time.monotonic(), domain, self._joints())

    def look(self) -> None:
        """Take in what the arm does; find out which one it is, once its controller is there."""
        if self._arm is not None:
            self._look_at(self._arm)
        elif self._is_known and self._remote.offers('controller'):
            try:
                values = self._remote.parameters('controller')
                self._arm = LiveArm(self, values)
                self._keep(_LAW, values['law'])
            except RedresError:
                self._is_known = False  # the rest of the page goes without it
                self._listen('controller')

    def close(self) -> None:
        """Release the subscriptions."""
        if self._arm is not None:
            self._arm.close()

    def _look_at(self, arm: LiveArm) -> None:
        seen = arm.look()
        if not seen:
            return
        for topic, figure in _FIGURES.items():
            self._keep(topic, getattr(seen[-1], figure))
        self._keep(_TIP, tuple(arm.model.tip(arm.q)[0].tolist()))
        limiting = [f'{place}: {limit}' for place, names in arm.acting.items() for limit in names]
        self._keep(_LIMITING, ', '.join(sorted(limiting)))

    def _joints(self) -> list[JointBar]:
        arm = self._arm
        if arm is None:
            return []
        acting = arm.acting
        bars = []
        for index, name in enumerate(arm.model.joint_names):
            limits = tuple(sorted(acting.get(name, ())))
            bars.append(JointBar(name, float(arm.shares[index]), float(arm.q[index]), limits))
        return bars

    def _listen(self, node: str) -> None:
        """Listen to all that the page shows of a node."""
        for row in NODES[node]:
            topic = row.topic
            quality = LATCHED if topic in _LATCHED else NEWEST
            keep = partial(self._on_message, topic)
            self.create_subscription(_TYPES.get(topic, Float64), topic, keep, quality)

    def _on_message(self, topic: str, message: Any) -> None:
        if topic == _TIP:
            position = message.pose.position
            self._keep(topic, (position.x, position.y, position.z))
        else:
            self._keep(topic, message.data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """What a node of this namespace says of its health."""
        prefix = self.get_namespace().rstrip('/') + '/'
        for status in message.status:
            node = status.name.removeprefix(prefix)
            if node in NODES:
                self._keep(node, NodeHealth(status.message, status.level == DiagnosticStatus.OK))

    def _on_parameters(self, message: ParameterEvent) -> None:
        """Limits may have come or gone, and the law may be another."""
        name = message.node.removeprefix(self.get_namespace().rstrip('/') + '/')
        if name == 'controller' and self._arm is not None:
            changed = {
                p.name: parameter_value_to_python(p.value) for p in message.changed_parameters
            }
            self._arm.apply(changed)
            if 'law' in changed:
                self._keep(_LAW, changed['law'])

    def _keep(self, source: str, value: object) -> None:
        self._heard[source] = Heard(value, time.monotonic())


def watch(node: Watch, stopped: threading.Event, duration: float | None = None) -> None:
    """Show the page.

    Args:
        node: What listens.
        stopped: Ends it.
        duration: Ends it after that time [s]; None: not.
    """
    until = time.monotonic() + duration if duration is not None else float('inf')
    with Live(node.page(), refresh_per_second=_REFRESH) as live:
        while rclpy.ok() and not stopped.is_set() and time.monotonic() < until:
            time.sleep(1.0 / _REFRESH)
            node.look()
            live.update(node.page())
