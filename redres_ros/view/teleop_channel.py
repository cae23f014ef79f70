"""The connection between the page's own script and the dead-man switch."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from redres_ros.graph.key_map import WAYS
from redres_ros.view.dead_man import BeatError, DeadMan, read_beat

PATH = '/teleop'

_SCRIPT = Path(__file__).with_name('teleop.js')
_REFUSED = 1008  # of WebSocket: a message that breaks the rules
_BUSY = 'somebody else holds the dead-man switch'


class TeleopChannel:
    """Takes what the page's script sends, and shows it a line of text.

    Args:
        dead_man: The switch.
    """

    def __init__(self, dead_man: DeadMan) -> None:
        self.dead_man = dead_man
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
