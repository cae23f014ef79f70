"""Moves the arm while the page's dead-man switch is held: by its buttons, keys or a gamepad."""

import json
import time
from typing import Any, NamedTuple

import numpy as np
import viser
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_srvs.srv import Trigger

from redres_ros.nodes.conversions import to_twist
from redres_ros.nodes.topics import PUBLISH, STEADY
from redres_ros.types import Seconds

_NOW = 0  # a stamp that means: as soon as it comes
_PERIOD = 0.02  # [s] between task velocities
_TIMEOUT = 0.3  # [s] after which a browser that has fallen silent counts as having let go
_LAST_ZEROS = 0.3  # [s] for which zeros follow a motion; then others may have the topic
_SPEED = (0.05, 0.5)  # [m/s] at first, and at most
_TURN = (0.3, 2.0)  # [rad/s]
_LONGEST = 500  # letters of a message
_RULE_BROKEN = 1008  # of WebSocket


class _Beat(NamedTuple):
    """The last message of the one who holds the switch."""

    who: object
    at: Seconds
    direction: np.ndarray


class DeadManSwitch:
    """Held by one connection at a time, which repeats so; pressed and released in one thread."""

    def __init__(self) -> None:
        self._beat: _Beat | None = None

    def press(self, who: object, direction: np.ndarray, now: Seconds) -> bool:
        """Whether the switch could be taken; the direction (6,) is in fractions of the speeds."""
        beat = self._beat
        if beat is not None and beat.who is not who and now - beat.at < _TIMEOUT:
            return False
        self._beat = _Beat(who, now, direction)
        return True

    def release(self, who: object) -> None:
        """Release the switch, if it is this connection that holds it."""
        if self._beat is not None and self._beat.who is who:
            self._beat = None

    def direction(self, now: Seconds) -> np.ndarray:
        """The direction asked for, (6,); zero if the switch is free."""
        beat = self._beat
        return beat.direction if beat is not None and now - beat.at < _TIMEOUT else np.zeros(6)


class Teleoperation:
    """Publishes `cartesian_velocity` while a browser asks for one, and zeros for a moment after."""

    def __init__(self, node: Node, rows: int) -> None:
        self._node = node
        self._rows = rows  # 3 or 6, as the task
        self._switch = DeadManSwitch()
        # Made for the first motion: `redres check` remarks on several publishers of the topic.
        self._publisher: Publisher | None = None
        self._stop_client = node.create_client(Trigger, 'planner/stop')
        self._moved_at = -np.inf  # [s] when a velocity was asked for last

    def start(self, gui: viser.GuiApi) -> None:
        """Add the speeds to the page, and publish from now on."""
        with gui.add_folder('speed of jogging'):
            self._speed = gui.add_slider('speed [m/s]', 0.005, _SPEED[1], 0.005, _SPEED[0])
            self._turn = gui.add_slider('turning [rad/s]', 0.05, _TURN[1], 0.05, _TURN[0])
            self._turn.visible = self._rows == 6
        self._node.create_timer(_PERIOD, self._publish, clock=STEADY)

    async def serve(self, connection: Any) -> None:
        """Serve a connection of the page's script until it ends, which lets the switch go."""
        await connection.send(json.dumps({'rows': self._rows}))
        shown = ''
        try:
            async for message in connection:
                text = self._enter(connection, message)
                if text != shown:
                    shown = text
                    await connection.send(json.dumps({'text': text}))
        except ValueError as error:
            await connection.close(_RULE_BROKEN, str(error))
        finally:
            self._switch.release(connection)

    def _enter(self, connection: object, message: str | bytes) -> str:
        """The line to show after a message."""
        direction = _read_beat(message)
        if direction is None:
            self._switch.release(connection)
        elif not self._switch.press(connection, direction, time.monotonic()):
            return 'somebody else holds the dead-man switch'
        return ''

    def _publish(self) -> None:
        now = time.monotonic()
        dx = self._switch.direction(now) * np.repeat((self._speed.value, self._turn.value), 3)
        if dx.any():
            if self._publisher is None:
                self._publisher = self._node.create_publisher(
                    TwistStamped, 'cartesian_velocity', PUBLISH
                )
            if now - self._moved_at >= _LAST_ZEROS:
                # Else the planner pulls the tip back to its path.
                self._stop_client.call_async(Trigger.Request())
            self._moved_at = now
        if self._publisher and now - self._moved_at < _LAST_ZEROS:
            self._publisher.publish(to_twist(_NOW, '', dx))


def _read_beat(message: str | bytes) -> np.ndarray | None:
    """The direction in a message; None: the switch was let go. Raises ValueError for any other."""
    values = json.loads(message[:_LONGEST])
    if values is None:
        return None
    if not isinstance(values, list) or len(values) != 6:
        raise ValueError('expected null or 6 numbers')
    if not all(type(value) in (int, float) and abs(value) <= 1.0 for value in values):
        raise ValueError('expected numbers from -1 to 1')
    return np.array(values, dtype=float)
