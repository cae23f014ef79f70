"""What an open page costs the controller, and how soon a click at it is done.

    python benchmarks/open_page.py [SECONDS [TIMES]]

One graph with a moving arm runs all the time. Beside it a page is started, opened by a client that
draws nothing, and ended again, TIMES over; answers are timed for SECONDS with and without it.
Printed are their medians. Then the slider of the damping is moved fifty times; a click is done when
the controller tells of its new parameter.
"""

import json
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from websockets.sync.client import ClientConnection, connect

from redres_ros.bench.loop import PARAMETERS
from redres_ros.bench.round_trips import RoundTrips
from redres_ros.demo.processes import NodeProcess, own_domain
from redres_ros.graph.mcap_file import read_messages
from redres_ros.nodes.runtime import spun

RATE = 500.0  # [Hz]
RECORDED = ('joint_states', 'joint_command')
CLICKS = 50
SETTLING = 1.0  # [s] after the page was opened or closed
PATIENCE = 120.0  # [s] for the page to be there; the first start compiles
SLIDER = 'damping [1/s]'
CAMERA = {
    'type': 'ViewerCameraMessage',
    'wxyz': (1.0, 0.0, 0.0, 0.0),
    'position': (2.0, 2.0, 2.0),
    'fov': 1.0,
    'near': 0.1,
    'far': 100.0,
    'image_height': 600,
    'image_width': 800,
    'look_at': (0.0, 0.0, 0.0),
    'up_direction': (0.0, 0.0, 1.0),
}
_SIZES = struct.Struct('<QQ')  # before a message: of its content, and of that compressed


def main() -> int:
    """Measure and print."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    times = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    with tempfile.TemporaryDirectory() as directory:
        parts, clicks = measure(Path(directory), seconds, times)
    open_ = 1e6 * RoundTrips.joined(parts[True]).times.quantile(0.5)
    closed = 1e6 * RoundTrips.joined(parts[False]).times.quantile(0.5)
    print(f'median {open_:.0f} us with a page, {closed:.0f} us without: {open_ / closed - 1:+.1%}')
    for is_open, kept in parts.items():
        medians = [round(1e6 * part.times.quantile(0.5)) for part in kept]
        print(f'  {"with" if is_open else "without"}: {json.dumps(medians)}')
    done = 1e3 * np.array(clicks)
    print(f'click: median {np.median(done):.0f} ms, largest {done.max():.0f} ms of {CLICKS}')
    return 0


def measure(
    out: Path, seconds: float, times: int
) -> tuple[dict[bool, list[RoundTrips]], list[float]]:
    """Answers by whether a page was open, and how long clicks took [s].

    Args:
        out: Directory for what the nodes print, and for the recording.
        seconds: For which answers are timed with and without a page.
        times: How often.
    """
    parts: dict[bool, list[RoundTrips]] = {True: [], False: []}
    with own_domain(), graph(out):
        windows = []
        for _ in range(times):
            with page(out) as address, Client(address):
                windows.append((True, window(seconds)))
            windows.append((False, window(seconds)))
        with page(out) as address, Client(address) as client, spun(Listener) as listener:
            await_events(client, listener)
            clicks = [click(client, listener, 10.5 - 0.5 * (k % 2)) for k in range(CLICKS)]
    messages = list(read_messages(out / 'robot.mcap'))
    for is_open, span in windows:
        parts[is_open].append(RoundTrips.from_messages(1.0 / RATE, messages, span, {}))
    return parts, clicks


@contextmanager
def graph(out: Path) -> Iterator[None]:
    """The nodes, with a recording of the robot.

    Args:
        out: Directory for what they print, and for the recording.
    """
    with ExitStack() as stack:
        for name in ('planner', 'controller', 'sim'):
            recording = out / 'robot.mcap' if name == 'sim' else None
            given = {'rate': RATE, **PARAMETERS.get(name, {})}
            log = out / f'{name}.log'
            node = NodeProcess(name, log, given, recording=recording, topics=RECORDED)
            stack.callback(node.end)
        yield


@contextmanager
def page(out: Path) -> Iterator[str]:
    """A page beside them; yields where it is.

    Args:
        out: Directory for what it prints.
    """
    process = NodeProcess('view.serve', out / 'view.log', {'patience': PATIENCE})
    try:
        until = time.monotonic() + PATIENCE
        while 'page: http://' not in process.last_line() and time.monotonic() < until:
            process.check()
            time.sleep(0.1)
        yield process.last_line().rpartition('http://')[2]
    finally:
        process.end()


def window(seconds: float) -> tuple[float, float]:
    """The instants between which states count [s]."""
    time.sleep(SETTLING)
    begin = time.time()
    time.sleep(seconds)
    return begin, time.time()


class Client:
    """Has the page open, and draws nothing.

    Args:
        address: Of the page.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._slider = ''

    def __enter__(self) -> 'Client':
        self._socket: ClientConnection = connect(
            f'ws://{self._address}',
            origin=f'http://{self._address}',  # type: ignore[arg-type]
            subprotocols=[f'viser-v{viser.__version__}'],  # type: ignore[list-item]
            max_size=None,
        )
        self._send(CAMERA)
        threading.Thread(target=self._listen, daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()

    def move(self, value: float) -> None:
        """Move the slider to a value."""
        while not self._slider:
            time.sleep(0.01)
        self._send({'type': 'GuiUpdateMessage', 'uuid': self._slider, 'updates': {'value': value}})

    def _send(self, message: dict[str, Any]) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def _listen(self) -> None:
        for data in self._socket:
            if not self._slider and isinstance(data, bytes):
                self._find_slider(data)

    def _find_slider(self, data: bytes) -> None:
        _, size = _SIZES.unpack_from(data)
        content = zstandard.ZstdDecompressor().decompress(data[_SIZES.size : _SIZES.size + size])
        for message in msgspec.msgpack.decode(content)['messages']:
            if message.get('props', {}).get('label') == SLIDER:
                self._slider = message['uuid']


class Listener(Node):
    """Hears of parameters that were set."""

    def __init__(self) -> None:
        super().__init__('open_page')
        self.heard = threading.Event()
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_event, 10)

    def _on_event(self, event: ParameterEvent) -> None:
        if event.node == '/controller' and event.changed_parameters:
            self.heard.set()


def await_events(client: Client, listener: Listener) -> None:
    """Click until the listener hears of it: DDS may tell the controller of it seconds later.

    Args:
        client: Clicks.
        listener: Is new.
    """
    value = 20.0
    while np.isinf(click(client, listener, value, patience=1.0)):
        value += 0.5


def click(client: Client, listener: Listener, value: float, patience: float = 5.0) -> float:
    """How long it takes until the controller has what was clicked [s].

    Args:
        client: Clicks.
        listener: Hears of it.
        value: Of the slider.
        patience: How long to listen [s]; infinity is returned after that.
    """
    time.sleep(0.2)
    listener.heard.clear()
    begun = time.monotonic()
    client.move(value)
    if not listener.heard.wait(patience):
        return float('inf')
    return time.monotonic() - begun


if __name__ == '__main__':
    sys.exit(main())
