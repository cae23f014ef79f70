"""The dead-man switch of the page, and the connection by which its script holds it."""

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import RedresError
from redres_ros.graph.teleop import WAYS

TIMEOUT = 0.3  # [s] after which a browser that has fallen silent counts as having let go
PATH = '/teleop'  # of the connection

_LONGEST = 500  # letters of a message
_SCRIPT = Path(__file__).with_name('teleop.js')
_REFUSED = 1008  # of WebSocket: a message that breaks the rules
_BUSY = 'somebody else holds the dead-man switch'


class BeatError(RedresError):
    """A message that is none of the page's script."""


class _Beat(NamedTuple):
    """The last message of the one who holds the switch: by whom, when [s], and (6,), -1 to 1."""

    who: object
    at: float
    direction: np.ndarray


class DeadMan:
    """A switch that one connection at a time can hold, by repeating so."""

    def __init__(self) -> None:
        self._beat: _Beat | None = None
        self._lock = threading.Lock()

    def press(self, who: object, direction: np.ndarray, now: float) -> bool:
        """Hold the switch; whether nobody else does.

        Args:
            who: The connection.
            direction: Direction of the velocity that is asked for, fractions -1 to 1 of the speeds,
                (6,).
            now: [s].
        """
        with self._lock:
            beat = self._beat
            if beat is not None and beat.who is not who and now - beat.at < TIMEOUT:
                return False
            self._beat = _Beat(who, now, direction)
            return True

    def release(self, who: object) -> None:
        """Release the switch, if it is this connection that holds it."""
        with self._lock:
            if self._beat is not None and self._beat.who is who:
                self._beat = None

    def is_held(self, now: float) -> bool:
        """Whether the switch is held at a time [s]."""
        beat = self._beat
        return beat is not None and now - beat.at < TIMEOUT

    def direction(self, now: float) -> np.ndarray:
        """What is asked for at a time [s], fractions -1 to 1, (6,); zero if the switch is free."""
        beat = self._beat
        if beat is None or now - beat.at >= TIMEOUT:
            return np.zeros(6)
        return beat.direction


def read_beat(message: str | bytes) -> np.ndarray | None:
    """The direction in a message of the page's script, (6,); None if the switch was let go.

    Raises:
        BeatError: It is no such message.
    """
    try:
        values = json.loads(message[:_LONGEST])
    except ValueError:
        raise BeatError('no JSON; expected null or 6 numbers') from None
    if values is None:
        return None
    if not isinstance(values, list) or len(values) != 6:
        raise BeatError('expected null or 6 numbers')
    if not all(type(value) in (int, float) and abs(value) <= 1.0 for value in values):
        raise BeatError('expected numbers from -1 to 1')
    return np.array(values, dtype=float)


class TeleopChannel:
    """Takes what the page's script sends, and shows it a line of text."""

    def __init__(self) -> None:
        self.dead_man = DeadMan()
        self.rows = 0  # of a task velocity: 3 or 6; 0: nothing can be steered yet
        self.status: Callable[[], str] = str  # what the operator should know

    @property
    def script(self) -> bytes:
        """The element that goes into the page."""
        keys = {f'Key{key.upper()}': way for key, way in WAYS.items()}
        text = _SCRIPT.read_text(encoding='utf-8').replace('__KEYS__', json.dumps(keys))
        return f'<script>{text}</script>'.encode()

    async def serve(self, connection: Any) -> None:
        """Serve a connection until it ends, which lets the switch go."""
        await connection.send(json.dumps({'rows': self.rows}))
        shown = ''
        try:
            async for message in connection:
                text = self._enter(connection, message)
                if text != shown:
                    shown = text
                    await connection.send(json.dumps({'text': text}))
        except BeatError as error:
            await connection.close(_REFUSED, str(error))
        finally:
            self.dead_man.release(connection)

    def _enter(self, connection: object, message: str | bytes) -> str:
        """The line to show after a message."""
        direction = read_beat(message)
        if direction is None:
            self.dead_man.release(connection)
            return ''
        if not self.dead_man.press(connection, direction, time.monotonic()):
            return _BUSY
        return self.status()
