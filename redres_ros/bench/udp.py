"""A bare echo over UDP between two Python processes: what the machine allows, without ROS.

`python -m redres_ros.bench.udp` prints its port and echoes until its standard input is closed.
"""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from redres_ros.bench.processor_time import ProcessorMeter
from redres_ros.bench.round_trips import RoundTrips

_HOST = '127.0.0.1'
_LARGEST = 65536  # [bytes]
_SIZE = 300  # [bytes], about that of a state of seven joints
_STRAGGLERS = 0.1  # [s] for which answers are awaited after the last state


def measure_udp(period: float, duration: float) -> RoundTrips:
    """Datagrams of the size of a state to an echo and back.

    Args:
        period: From one datagram to the next [s].
        duration: Of the measurement [s].
    """
    count = max(round(duration / period), 1)
    answered = [float('inf')] * count
    sent = []
    with echo_process() as (pid, port), _connected(port) as client:
        listener = threading.Thread(target=_listen, args=(client, answered), daemon=True)
        listener.start()
        meter = ProcessorMeter({'udp': pid})
        begun = time.monotonic()
        for number in range(count):
            time.sleep(max(begun + number * period - time.monotonic(), 0.0))
            sent.append(time.monotonic())
            client.send(number.to_bytes(8, 'little').ljust(_SIZE))
        shares = meter.shares()
        time.sleep(_STRAGGLERS)
        client.shutdown(socket.SHUT_RDWR)  # which ends the listener
        listener.join()
    return RoundTrips.from_times(period, sent, answered, shares)


@contextmanager
def echo_process() -> Iterator[tuple[int, int]]:
    """An echo in a process of its own; yields its process number and its port."""
    command = [sys.executable, '-m', __name__]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin
        assert process.stdout
        try:
            yield process.pid, int(process.stdout.readline())
        finally:
            process.stdin.close()


def _connected(port: int) -> socket.socket:
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.connect((_HOST, port))
    return client


def _listen(client: socket.socket, answered: list[float]) -> None:
    while content := client.recv(_LARGEST):
        answered[int.from_bytes(content[:8], 'little')] = time.monotonic()


def main() -> int:
    """Echo until standard input is closed, be it by the end of the process that holds it."""
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server.bind((_HOST, 0))
    print(server.getsockname()[1], flush=True)
    threading.Thread(target=_echo, args=(server,), daemon=True).start()
    sys.stdin.read()
    return 0


def _echo(server: socket.socket) -> None:
    while True:
        content, client = server.recvfrom(_LARGEST)
        server.sendto(content, client)


if __name__ == '__main__':
    sys.exit(main())
