"""`redres watch`: the live state of the controller in a terminal."""

import threading
import time
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from std_msgs.msg import Float64, Int32, String

from redres_ros.nodes.qos import LATCHED, NEWEST

_REFRESH = 5.0  # [Hz]

_NUMBERS = {  # topic -> (type, what it is, unit, factor)
    'planner/segment': (Int32, 'segment', '', 1),
    'planner/task_error': (Float64, 'task error', 'mm', 1e3),
    'controller/joint_velocity_norm': (Float64, 'joint velocity', 'rad/s', 1.0),
    'controller/joint_acceleration_norm': (Float64, 'joint acceleration', 'rad/s^2', 1.0),
    'controller/null_velocity_norm': (Float64, 'null-space velocity', 'rad/s', 1.0),
    'controller/joint_torque_norm': (Float64, 'joint torque', 'Nm', 1.0),
    'controller/min_singular_value': (Float64, 'smallest singular value', '', 1.0),
}
_LATCHED_WORDS = {
    'sim/session_state': 'session',
    'sim/connection_quality': 'connection',
    'sim/stop_reason': 'stopped because',
    'planner/state': 'planner',
}


class Watch(Node):
    """Listens to every signal and keeps the newest of each."""

    def __init__(self) -> None:
        super().__init__('watch')
        self._values: dict[str, Any] = {}
        topics = [(kind, topic, NEWEST) for topic, (kind, *_) in _NUMBERS.items()]
        for kind, topic, quality in (
            *topics,
            *((String, topic, LATCHED) for topic in _LATCHED_WORDS),
        ):
            self.create_subscription(
                kind, topic, lambda message, topic=topic: self._keep(topic, message.data), quality
            )
        self.create_subscription(
            String, 'controller/law', lambda message: self._keep('law', message.data), NEWEST
        )
        self.create_subscription(PoseStamped, 'controller/tip_pose', self._on_pose, NEWEST)

    @property
    def heard(self) -> bool:
        """Whether anything has come."""
        return bool(self._values)

    def table(self) -> Table:
        """The newest values; a dash for what has not come."""
        table = Table(title=f'ROS domain {self.context.get_domain_id()}', show_header=False)
        for topic, label in (('law', 'law'), *_LATCHED_WORDS.items(), ('tip', 'tip [m]')):
            table.add_row(escape(label), escape(str(self._values.get(topic, '-'))))
        for topic, (_, label, unit, factor) in _NUMBERS.items():
            value = self._values.get(topic)
            table.add_row(
                escape(f'{label} [{unit}]' if unit else label),
                '-' if value is None else f'{value * factor:.4g}',
            )
        return table

    def _keep(self, name: str, value: Any) -> None:
        self._values[name] = value

    def _on_pose(self, message: PoseStamped) -> None:
        position = message.pose.position
        self._keep('tip', f'{position.x:+.4f} {position.y:+.4f} {position.z:+.4f}')


def watch(node: Watch, stopped: threading.Event, duration: float | None = None) -> None:
    """Show the table until the event is set, or for some seconds."""
    until = time.monotonic() + duration if duration is not None else float('inf')
    with Live(node.table(), refresh_per_second=_REFRESH) as live:
        while rclpy.ok() and not stopped.is_set() and time.monotonic() < until:
            time.sleep(1.0 / _REFRESH)
            live.update(node.table())
