"""An operator's commands as messages; and `redres teleop`: keys of a terminal as velocities."""

import math
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
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from redres_ros.errors import RangeError, RedresError, one_line
from redres_ros.files.signals import handled
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.topics import ACTIVE_LIMITS, NEWEST, PUBLISH
from redres_ros.nodes.wire import TwistWriter

# Row of the task velocity and sign along it, by key. The left hand moves, the right hand turns.
WAYS = {key: (place // 2, 1.0 - 2.0 * (place % 2)) for place, key in enumerate('wsadrfljikuo')}
HELP = """\
w s  forward, back (x)      l j  turn about x
a d  left, right (y)        i k  turn about y
r f  up, down (z)           u o  turn about z
+ -  faster, slower         space  stop        Ctrl-C  end"""

_TOPIC = 'cartesian_velocity'
_LAST_ZEROS = 0.3  # [s] for which zeros follow a motion; then others may have the topic
_NOW = 0  # a stamp that means: as soon as it comes
_HELD = 0.6  # [s] a terminal reports no release of a key; it repeats one within half a second
_GAIN = 1.25  # of the speed, for each press of a key
_SPEEDS = (0.001, 2.0)  # [m/s]
_TURNS = (0.001, 6.0)  # [rad/s]
_PERIOD = 0.02  # [s] between messages
_MOST_KEYS = 64  # read at once
_ENDING = (signal.SIGTERM, signal.SIGHUP)  # these would end the process without clean-up
_CLEAR = '\r\x1b[K'  # a terminal's line


class KeyMap:
    """The task velocity of the held keys.

    Args:
        speed: Of a key that moves [m/s].
        turn: Of a key that turns [rad/s].

    Raises:
        RangeError: A speed that is none, or that no arm should have from a keyboard.
    """

    def __init__(self, speed: float = 0.05, turn: float = 0.3) -> None:
        _check('speed', speed, _SPEEDS, 'm/s')
        _check('turn', turn, _TURNS, 'rad/s')
        self.speed = speed
        self.turn = turn
        self._signs = np.zeros(6)
        self._until = np.full(6, -math.inf)  # [s] when a row's key counts as released

    def press(self, key: str, now: float) -> None:
        """Process a key; any key without a meaning stops the arm.

        Args:
            key: A single character.
            now: When it came [s].
        """
        if key.lower() in WAYS:
            row, sign = WAYS[key.lower()]
            self._signs[row] = sign
            self._until[row] = now + _HELD
        elif key in '+-':
            gain = _GAIN if key == '+' else 1.0 / _GAIN
            self.speed = min(max(self.speed * gain, _SPEEDS[0]), _SPEEDS[1])
            self.turn = min(max(self.turn * gain, _TURNS[0]), _TURNS[1])
        else:
            self._until[:] = -math.inf

    def twist(self, now: float) -> np.ndarray:
        """Task velocity (6,) [m/s], [rad/s]."""
        held = now < self._until
        speeds = np.repeat((self.speed, self.turn), 3)
        return np.where(held, self._signs * speeds, 0.0)


def _check(name: str, value: float, allowed: tuple[float, float], unit: str) -> None:
    if not allowed[0] <= value <= allowed[1]:
        raise RangeError(name, value, *allowed, unit)


class _TerminalError(RedresError):
    """There is no terminal to read keys from."""


class TwistPublisher:
    """Publishes on `cartesian_velocity`, and nothing while no velocity is asked for.

    When a motion begins it stops the planner, which would pull the tip back to its path or goal.

    Args:
        node: Publishes.
        frame: Link along whose axes the velocities are; empty: the base.
    """

    def __init__(self, node: Node, frame: str = '') -> None:
        self._writer = TwistWriter(frame)
        self._moved_at = -np.inf  # [s] when the task velocity was last not zero
        self._publisher = node.create_publisher(TwistStamped, _TOPIC, PUBLISH)
        self._planner_stop = node.create_client(Trigger, 'planner/stop')
        self._planner_leads = False  # as far as is known, since the motion began

    def publish(self, dx: np.ndarray, now: float) -> None:
        """Publish a task velocity, unless none was asked for lately.

        Args:
            dx: (6,) [m/s], [rad/s].
            now: [s].
        """
        if dx.any():
            self._take_over(now)
            self._moved_at = now
        if now - self._moved_at < _LAST_ZEROS:
            self._publisher.publish(self._writer.written(_NOW, dx))

    def _take_over(self, now: float) -> None:
        """Stop the planner, if there is one, once in each motion."""
        if now - self._moved_at >= _LAST_ZEROS:
            self._planner_leads = True
        if self._planner_leads and self._planner_stop.service_is_ready():
            self._planner_stop.call_async(Trigger.Request())
            self._planner_leads = False

    def stop(self) -> None:
        """Publish a zero task velocity, if there was another."""
        if np.isfinite(self._moved_at):
            self._publisher.publish(self._writer.written(_NOW, np.zeros(6)))

    @property
    def listeners(self) -> int:
        """Number of its subscribers."""
        return self._publisher.get_subscription_count()


class TargetPublisher:
    """Publishes on `target_pose`, in the frame of the base."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(PoseStamped, 'target_pose', PUBLISH)

    def publish(self, x: np.ndarray, R: np.ndarray) -> None:
        """Publish a target of now.

        Args:
            x: Position, (3,) [m].
            R: Orientation, (3, 3).
        """
        self._publisher.publish(to_pose(_NOW, '', x, R))

    @property
    def listeners(self) -> int:
        """Number of its subscribers."""
        return self._publisher.get_subscription_count()


class Teleop(Node):
    """Publishes the task velocity of the keys, and nothing while none was pressed lately.

    Args:
        key_map: What the keys ask for.
        frame: Whose axes the velocities are in.
        namespace: Of the robot; empty for none.
    """

    def __init__(self, key_map: KeyMap, frame: str, namespace: str = '') -> None:
        super().__init__('teleop', namespace=namespace or None)
        self.key_map = key_map
        self.twists = TwistPublisher(self, frame)
        self.limits = ''  # what was reported of them last
        self.create_subscription(String, ACTIVE_LIMITS, self._on_limits, NEWEST)

    def _on_limits(self, message: String) -> None:
        self.limits = one_line(message.data)

    def publish(self, now: float) -> np.ndarray:
        """Publish the task velocity of now [s]; it is returned, (6,)."""
        dx = self.key_map.twist(now)
        self.twists.publish(dx, now)
        return dx


def check_terminal() -> None:
    """Raise _TerminalError if standard input is not a terminal."""
    if sys.stdin is None or not sys.stdin.isatty():
        raise _TerminalError('standard input is not a terminal; keys cannot be read')


@contextmanager
def _keyboard() -> Iterator[int]:
    """The file to read single keys from, without echo; the terminal is restored afterwards.

    Ctrl-C stays a signal. Ctrl-Z is off: in the background it could not stop the arm.
    """
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


def steer(node: Teleop) -> None:
    """Publish the keys' task velocity until Ctrl-C, then zero."""
    with _keyboard() as terminal:
        print(HELP, flush=True)
        try:
            _steer(node, terminal)
        finally:
            node.twists.stop()
            print(_CLEAR, end='', flush=True)


def _steer(node: Teleop, terminal: int) -> None:
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
                node.key_map.press(key, time.monotonic())
        line = _line(node, node.publish(time.monotonic()))
        if line != shown:
            width = shutil.get_terminal_size().columns - 1
            print(f'{_CLEAR}{line[:width]}', end='', flush=True)
            shown = line


def _line(node: Teleop, dx: np.ndarray) -> str:
    """What is asked for, and what limits leave of it, in words."""
    if not node.twists.listeners:
        return f'{_TOPIC} has no subscriber; is the controller running in this ROS domain?'
    speeds = f'{node.key_map.speed:.3f} m/s, {node.key_map.turn:.2f} rad/s'
    moves = [
        f'{axis} {value:+.3f}'
        for axis, value in zip(('x', 'y', 'z', 'rx', 'ry', 'rz'), dx, strict=True)
        if value
    ]
    asked = f'{speeds} | {"  ".join(moves) or "standing still"}'
    return f'{asked} | {node.limits}' if moves and node.limits else asked
