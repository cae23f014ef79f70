"""A file of messages in the MCAP format, which Foxglove, PlotJuggler and rosbag2 read."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml
from mcap.writer import CompressionType, Writer

from redres_ros.graph.message_text import definition_of, name_of

_URDF = 'robot_description.urdf'
_PARAMETERS = 'parameters.yaml'


class McapFile:
    """Writes messages as they go over the wire.

    Args:
        path: Of the file, which is made anew.
    """

    def __init__(self, path: Path) -> None:
        # Chunks are not compressed: that would take more of a processor than all the rest.
        self._stream = path.open('wb')
        self._writer = Writer(self._stream, compression=CompressionType.NONE)
        self._writer.start(profile='ros2', library='redres_ros')
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def add_topic(self, topic: str, kind: Any) -> None:
        """Declare a topic, before its first message.

        Args:
            topic: Its name.
            kind: Type of its messages.
        """
        name = name_of(kind)
        if name not in self._schemas:
            text = definition_of(kind).encode()
            self._schemas[name] = self._writer.register_schema(name, 'ros2msg', text)
        self._channels[topic] = self._writer.register_channel(topic, 'cdr', self._schemas[name])

    def write(self, topic: str, data: bytes, sent: int, received: int) -> None:
        """Append a message.

        Args:
            topic: Declared before.
            data: As it went over the wire.
            sent: When it was published [ns].
            received: When it came [ns].
        """
        self._writer.add_message(self._channels[topic], received, data, sent)

    def attach_urdf(self, text: str, time: int) -> None:
        """Put the arm's URDF beside the messages.

        Args:
            text: The URDF.
            time: An instant [ns].
        """
        self._attach(_URDF, 'text/xml', text, time)

    def attach_parameters(self, nodes: Mapping[str, Mapping[str, Any]], time: int) -> None:
        """Put the nodes' parameters beside them, as a file that nodes can be started with.

        Args:
            nodes: Values of parameters by the names of node and parameter.
            time: An instant [ns].
        """
        content = {node: {'ros__parameters': dict(values)} for node, values in nodes.items()}
        self._attach(_PARAMETERS, 'application/yaml', yaml.safe_dump(content), time)

    def _attach(self, name: str, media_type: str, text: str, time: int) -> None:
        self._writer.add_attachment(time, time, name, media_type, text.encode())
