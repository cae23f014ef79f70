"""A bare echo over UDP between two Python processes: what the machine allows, without ROS.

`python -m redres_ros.bench.udp` prints its port and echoes until its standard input is closed.
"""

import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LARGEST = 65536  # [bytes]
_HOST = '127.0.0.1'


@contextmanager
def echo_process() -> Iterator[tuple[int, int]]:
    """An echo in a process of its own; yields its process number and its port."""
    command = [sys.executable, '-m', __name__]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process.pid, int(process.stdout.readline())
        finally:
            process.stdin.close()


class Client:
    """Sends numbered datagrams of a size [bytes] to an echo, and tells `on_answer` the number of
    each that is back.
    """

    def __init__(self, port: int, size: int, on_answer: Callable[[int], None]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._on_answer = on_answer
        self._socket.connect((_HOST, port))
        self._padding = bytes(max(size - 8, 0))
        threading.Thread(target=self._receive, name='udp', daemon=True).start()

    def send(self, number: int) -> None:
        """Send one."""
        self._socket.send(number.to_bytes(8, 'little') + self._padding)

    def _receive(self) -> None:
        while True:
            self._on_answer(int.from_bytes(self._socket.recv(_LARGEST)[:8], 'little'))


def _echo(server: socket.socket) -> None:
    while True:
        server.sendto(*server.recvfrom(_LARGEST))


def main() -> int:
    """Echo until standard input is closed, be it by the end of the process that started this one."""
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server.bind((_HOST, 0))
    print(server.getsockname()[1], flush=True)
    threading.Thread(target=_echo, args=(server,), daemon=True).start()
    sys.stdin.read()
    return 0


if __name__ == '__main__':
    sys.exit(main())
