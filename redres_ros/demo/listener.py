"""What a demo hears of its nodes: what they say of themselves, and how far the robot's clock is."""

import time
from functools import partial

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.nodes.qos import LATCHED, NEWEST
from redres_ros.nodes.session_topics import REASON, SESSION
from redres_ros.nodes.task_topics import TASK_STATE
from redres_ros.nodes.wire import stamp_of
from redres_ros.planning.task_executor import TaskState


class DemoListener(Node):
    """Keeps the newest words of session and planner, and the newest state as it came.

    States are kept unread: to read each would take a good part of a core. Whoever needs one asks
    for it.
    """

    def __init__(self) -> None:
        super().__init__('demo_listener')
        self.heard_at = time.monotonic()  # [s] when the newest state came
        self.began = 0  # stamp [ns] of the newest state when a task began last; 0 before the first
        self.first_began = 0  # and when it began first
        self._state = b''
        self._words = {SESSION: '', REASON: '', TASK_STATE: ''}
        self.create_subscription(JointState, 'joint_states', self._on_state, NEWEST, raw=True)
        for topic in self._words:
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)

    def word(self, topic: str) -> str:
        """What was said last; empty before anything was."""
        return self._words[topic]

    @property
    def newest(self) -> int:
        """Stamp of the newest state [ns]; 0 before the first."""
        return stamp_of(self._state) if self._state else 0

    def _on_word(self, topic: str, message: String) -> None:
        self._words[topic] = message.data
        if topic == TASK_STATE and message.data == TaskState.MOVING.value:
            self.began = self.newest
            self.first_began = self.first_began or self.newest

    def _on_state(self, message: bytes) -> None:
        self._state = message
        self.heard_at = time.monotonic()
