"""`redres record`: records every message of a graph in a file, without rosbag."""

import threading
import time
from collections.abc import Collection

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from redres_ros.graph.client import CallError
from redres_ros.graph.graph_monitor import GraphMonitor
from redres_ros.graph.mcap_file import McapFile
from redres_ros.graph.message_text import TypeTextError, find_type

_PERIOD = 0.2  # [s] from one look at what has come to the next: to look costs more than to wait
_SEARCH = 1.0  # [s] from one search for new topics to the next
_WAITING = 4000  # messages of a topic that may wait: those of some seconds
_DESCRIPTION = 'robot_description'
_PARAMETERS = '/get_parameters'  # how the service ends that every node with parameters offers

# Best effort, as the nodes' own subscriptions: a recorder must not delay the nodes.
_QUALITY = QoSProfile(depth=_WAITING, reliability=ReliabilityPolicy.BEST_EFFORT)
# The last message was kept for us, and those that follow must all wait for us.
_KEPT = QoSProfile(depth=_WAITING, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class GraphRecorder(GraphMonitor):
    """Records the messages of all topics of a graph.

    Args:
        file: File to write.
        wanted: Names of topics; empty for all.
    """

    def __init__(self, file: McapFile, wanted: Collection[str] = ()) -> None:
        super().__init__('record')
        self.messages = 0  # written so far
        self._file = file
        self._wanted = {self.resolve_topic_name(name) for name in wanted}
        self._channels: dict[str, int] = {}  # by topic
        self._refused: set[str] = set()
        self._description = ''

    def run(self, stopped: threading.Event, duration: float | None = None) -> None:
        """Record.

        Args:
            stopped: Ends it.
            duration: Ends it after that time [s]; None: not.
        """
        until = time.monotonic() + duration if duration is not None else float('inf')
        search = 0.0
        while not stopped.wait(_PERIOD) and time.monotonic() < until:
            if time.monotonic() >= search:
                self._find_topics()
                search = time.monotonic() + _SEARCH
            self._write()
        self._write()
        self._attach()

    @property
    def topics(self) -> int:
        """How many topics are recorded."""
        return len(self._channels)

    def _find_topics(self) -> None:
        for topic, kinds in self.get_topic_names_and_types():
            known = topic in self._channels or topic in self._refused
            if known or (self._wanted and topic not in self._wanted):
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            try:
                kind = find_type(kinds[0])
            except TypeTextError as error:
                self._refused.add(topic)
                self.get_logger().warning(f'{topic} is left out: {error}')
                continue
            latched = all(
                publisher.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
                for publisher in publishers
            )
            self.samples.add(topic, kind, _KEPT if latched else _QUALITY)
            self._channels[topic] = self._file.add_topic(topic, kind)

    def _write(self) -> None:
        """What has come since the last time."""
        write = self._file.write
        for topic, channel in self._channels.items():
            for data, sent, received in self.samples.take(topic):
                write(channel, data, sent, received)
                self.messages += 1
                if topic.endswith(_DESCRIPTION):
                    self._description = deserialize_message(data, String).data

    def _attach(self) -> None:
        """The arm and the nodes' parameters."""
        if self._description:
            self._file.attach_urdf(self._description)
        nodes = {}
        for service, _ in self.get_service_names_and_types():
            node = service.removesuffix(_PARAMETERS)
            if node == service or node == self.get_fully_qualified_name():
                continue
            try:
                nodes[node] = self.client.parameters(node)
            except CallError:
                continue  # it has gone
        if nodes:
            self._file.attach_parameters(nodes)
