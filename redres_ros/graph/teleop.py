"""`redres teleop`: keys of a terminal as cartesian_velocity."""

import os
import select
import shutil
import signal
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.errors import RedresError, one_line
from redres_ros.files.signals import handled
from redres_ros.graph.key_map import HELP, KeyMap
from redres_ros.graph.operator_topics import TOPIC, TwistPublisher
from redres_ros.loop.limit_report import LimitReport, read
from redres_ros.nodes.qos import NEWEST
from redres_ros.nodes.session_topics import ACTIVE_LIMITS

_PERIOD = 0.02  # [s] between messages
_MOST_KEYS = 64  # read at once
_ENDING = (signal.SIGTERM, signal.SIGHUP)  # these would end the process without clean-up
_CLEAR = '\r\x1b[K'  # a terminal's line
_BAR = 10  # characters


class TerminalError(RedresError):
    """There is no terminal to read keys from."""


class Teleop(Node):
    """Publishes the task velocity of the keys, and nothing while none was pressed lately.

    Args:
        key_map: What the keys ask for.
        frame: Whose axes the velocities are in.
        namespace: Of the robot; empty for none.
    """

    def __init__(self, key_map: KeyMap, frame: str, namespace: str = '') -> None:
        super().__init__('teleop', namespace=namespace or None)
        self._key_map = key_map
        self.twists = TwistPublisher(self, frame)
        self.limits = read('')  # what was reported of them last
        self.create_subscription(String, ACTIVE_LIMITS, self._on_limits, NEWEST)

    def _on_limits(self, message: String) -> None:
        self.limits = read(one_line(message.data))

    def publish(self, now: float) -> np.ndarray:
        """Publish the task velocity of now [s]; it is returned, (6,)."""
        dx = self._key_map.twist(now)
        self.twists.publish(dx, now)
        return dx


def check_terminal() -> None:
    """Raise TerminalError if standard input is no terminal."""
    if sys.stdin is None or not sys.stdin.isatty():
        raise TerminalError('standard input is no terminal; keys cannot be read')


@contextmanager
def keyboard() -> Iterator[int]:
    """Read single keys without echo; restore the terminal afterwards.

    Ctrl-C stays a signal. Ctrl-Z is off: in the background it could not stop the arm.

    Yields:
        The file to read from.

    Raises:
        TerminalError: Standard input is no terminal.
    """
    check_terminal()
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    with handled(_interrupt, *_ENDING):
        try:
            tty.setcbreak(terminal)
            changed = termios.tcgetattr(terminal)
            changed[6][termios.VSUSP] = b'\0'
            termios.tcsetattr(terminal, termios.TCSANOW, changed)
            yield terminal
        finally:
            termios.tcsetattr(terminal, termios.TCSAFLUSH, before)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def steer(node: Teleop, key_map: KeyMap) -> None:
    """Publish the keys' task velocity until Ctrl-C, then zero.

    Args:
        node: Publishes.
        key_map: Takes the keys.
    """
    with keyboard() as terminal:
        print(HELP, flush=True)
        try:
            _steer(node, key_map, terminal)
        finally:
            node.twists.stop()
            print(_CLEAR, end='', flush=True)


def _steer(node: Teleop, key_map: KeyMap, terminal: int) -> None:
    shown = ''
    while True:
        due = time.monotonic() + _PERIOD
        while (left := due - time.monotonic()) > 0.0:
            if not select.select([terminal], [], [], left)[0]:
                continue
            keys = os.read(terminal, _MOST_KEYS)
            if not keys:
                return  # the terminal has gone
            for key in keys.decode(errors='replace'):
                key_map.press(key, time.monotonic())
        dx = node.publish(time.monotonic())
        line = _line(dx, key_map, node.twists.listeners, node.limits)
        if line != shown:
            width = shutil.get_terminal_size().columns - 1
            print(f'{_CLEAR}{line[:width]}', end='', flush=True)
            shown = line


def _line(dx: np.ndarray, key_map: KeyMap, listeners: int, limits: LimitReport) -> str:
    """What is asked for, and what limits leave of it, in words."""
    if not listeners:
        return f'{TOPIC} has no subscriber; is the controller running in this ROS domain?'
    speeds = f'{key_map.speed:.3f} m/s, {key_map.turn:.2f} rad/s'
    moves = [
        f'{axis} {value:+.3f}'
        for axis, value in zip(('x', 'y', 'z', 'rx', 'ry', 'rz'), dx, strict=True)
        if value
    ]
    asked = f'{speeds} | {"  ".join(moves) or "standing still"}'
    return f'{asked} | {limit_bar(limits)}' if moves and limits.limit else asked


def limit_bar(limits: LimitReport) -> str:
    """A bar of what is executed, and a word on what limits it."""
    full = round(_BAR * min(max(limits.least, 0.0), 1.0))
    bar = '#' * full + '-' * (_BAR - full)
    away = f', away {limits.away}' if limits.away else ''
    return f'[{bar}] {limits.limit}{away}'
