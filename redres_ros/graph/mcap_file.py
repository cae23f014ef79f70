"""Writes and reads MCAP files, which Foxglove, PlotJuggler and rosbag2 can read."""

import struct
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, Self

import yaml
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from rclpy.serialization import deserialize_message

from redres_ros.graph.message_text import definition_of, find_type, name_of

_URDF = 'robot_description.urdf'
_PARAMETERS = 'parameters.yaml'
_RECEIVED = {'direction': 'received'}  # of a channel
_BUFFER = 16384  # [bytes] written at once, so that no cycle of a node has much to write


class RecordedMessage(NamedTuple):
    """A message in a file.

    Attributes:
        topic: Its full name.
        kind: Its type, such as 'sensor_msgs/msg/JointState'.
        data: Bytes as they go over the wire.
        sent: When it was published [ns].
        time: When the writer of the file published or received it [ns].
        is_received: Whether it received the message.
    """

    topic: str
    kind: str
    data: bytes
    sent: int
    time: int
    is_received: bool

    @property
    def content(self) -> Any:
        """The message itself."""
        return deserialize_message(self.data, find_type(self.kind))


class McapFile:
    """Writes serialised messages.

    Args:
        path: Path of the file, which is overwritten.
        in_chunks: With an index, for readers that jump. Without, all but the last 16 kB can be
            read even if this process is killed.
    """

    def __init__(self, path: Path, *, in_chunks: bool = True) -> None:
        # Chunks are not compressed: that would take more of a processor than all the rest.
        self._stream = path.open('wb', buffering=_BUFFER)
        self._writer = Writer(
            self._stream, compression=CompressionType.NONE, use_chunking=in_chunks
        )
        self._writer.start(profile='ros2', library='redres_ros')
        self._schemas: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def add_topic(self, topic: str, kind: Any, *, is_received: bool = False) -> int:
        """Declare a topic, before its first message; the number of its channel.

        Args:
            topic: Its full name.
            kind: Type of its messages.
            is_received: Whether the messages are noted by their receiver, not by their publisher.
        """
        name = name_of(kind)
        if name not in self._schemas:
            text = definition_of(kind).encode()
            self._schemas[name] = self._writer.register_schema(name, 'ros2msg', text)
        metadata = _RECEIVED if is_received else {}
        return self._writer.register_channel(topic, 'cdr', self._schemas[name], metadata)

    def write(self, channel: int, data: bytes, sent: int, received: int) -> None:
        """Append a message.

        Args:
            channel: That of its topic.
            data: Bytes as they went over the wire.
            sent: When it was published [ns].
            received: When it came [ns].
        """
        self._writer.add_message(channel, received, data, sent)

    def attach_urdf(self, text: str) -> None:
        """Add the text of the arm's URDF to the file."""
        self._attach(_URDF, 'text/xml', text)

    def attach_parameters(self, nodes: Mapping[str, Mapping[str, Any]]) -> None:
        """Add parameters by the names of node and parameter, as nodes can be started with them."""
        content = {node: {'ros__parameters': dict(values)} for node, values in nodes.items()}
        self._attach(_PARAMETERS, 'application/yaml', yaml.safe_dump(content))

    def _attach(self, name: str, media_type: str, text: str) -> None:
        now = time.time_ns()
        self._writer.add_attachment(now, now, name, media_type, text.encode())


def read_messages(path: Path) -> Iterator[RecordedMessage]:
    """The messages in order, one in memory at a time, up to the last complete one."""
    kinds: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    with path.open('rb') as stream, suppress(McapError, struct.error):
        for record in StreamReader(stream).records:
            if isinstance(record, Message):
                channel = channels[record.channel_id]
                yield RecordedMessage(
                    channel.topic,
                    kinds[channel.schema_id],
                    record.data,
                    record.publish_time,
                    record.log_time,
                    channel.metadata == _RECEIVED,
                )
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Schema):
                kinds[record.id] = record.name


def merge(paths: Iterable[Path], file: McapFile) -> None:
    """Write what nodes have published into one file, in the order of time.

    Args:
        paths: Paths of the nodes' own files.
        file: File to write.
    """
    messages = [
        message for path in paths for message in read_messages(path) if not message.is_received
    ]
    channels: dict[str, int] = {}
    for message in sorted(messages, key=attrgetter('time')):
        if message.topic not in channels:
            channels[message.topic] = file.add_topic(message.topic, find_type(message.kind))
        file.write(channels[message.topic], message.data, message.time, message.time)
