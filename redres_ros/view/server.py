"""Who may load the page, and who steers by it: a browser on this computer, from the page's own
address, while it holds the dead-man switch.

A page that steers a robot must not obey other pages. A browser sends along whose page asks (Origin)
and which name it looked up (Host), so a request from elsewhere is recognised, even if a
foreign name was made to point to this computer.
"""

import asyncio
import contextlib
import io
import json
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.client import HTTPConnection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import viser
import websockets.asyncio.server
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from redres_ros.errors import RedresError
from redres_ros.types import Seconds

ADDRESS = '127.0.0.1'
TELEOP_PATH = '/teleop'  # of the connection by which the page's script holds the switch
TIMEOUT = 0.3  # [s] after which a browser that has fallen silent counts as having let go

_NAMES = (ADDRESS, 'localhost')
_FOREIGN = 'elsewhere.example'
_PAGE = ('/', '/index.html')
_PATIENCE = 5.0  # [s] for the page to respond to itself
# What the browser itself may do with a page: load nothing from elsewhere, and call nobody else.
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src data:; connect-src 'self' data: blob: {connect}; base-uri 'none'; form-action 'none'"
)
_HEADERS = {
    'Content-Security-Policy': f"{CONTENT_POLICY}; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
}
_LONGEST = 500  # letters of a message
_SCRIPT = Path(__file__).with_name('teleop.js')
_RULE_BROKEN = 1008  # of WebSocket


class OriginError(RedresError):
    """A page that is not protected."""


class _BeatError(RedresError):
    """A message that is none of the page's script."""


class _Beat(NamedTuple):
    """The last message of the one who holds the switch."""

    who: object
    at: Seconds
    direction: np.ndarray


def _read_beat(message: str | bytes) -> np.ndarray | None:
    """The direction in a message of the page's script; None if the switch was let go.

    Raises _BeatError.
    """
    try:
        values = json.loads(message[:_LONGEST])
    except ValueError:
        raise _BeatError('no JSON; expected null or 6 numbers') from None
    if values is None:
        return None
    if not isinstance(values, list) or len(values) != 6:
        raise _BeatError('expected null or 6 numbers')
    if not all(type(value) in (int, float) and abs(value) <= 1.0 for value in values):
        raise _BeatError('expected numbers from -1 to 1')
    return np.array(values, dtype=float)


class TeleopChannel:
    """The dead-man switch: takes what the page's script sends, and shows it a line of text.

    One connection at a time can hold the switch, by repeating so.

    Attributes:
        rows: Of a task velocity: 3 or 6; 0: nothing can be steered yet.
        status: What the operator should know.
    """

    def __init__(self) -> None:
        self.rows = 0
        self.status: Callable[[], str] = str
        self._beat: _Beat | None = None
        self._lock = threading.Lock()

    def press(self, who: object, direction: np.ndarray, now: Seconds) -> bool:
        """Hold the switch; whether nobody else does. The direction (6,) is of fractions -1 to 1 of
        the speeds.
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

    def direction(self, now: Seconds) -> np.ndarray | None:
        """The direction asked for, (6,); None if the switch is free."""
        beat = self._beat
        return beat.direction if beat is not None and now - beat.at < TIMEOUT else None

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
        except _BeatError as error:
            await connection.close(_RULE_BROKEN, str(error))
        finally:
            self.release(connection)

    def _enter(self, connection: object, message: str | bytes) -> str:
        """The line to show after a message."""
        direction = _read_beat(message)
        if direction is None:
            self.release(connection)
            return ''
        if not self.press(connection, direction, time.monotonic()):
            return 'somebody else holds the dead-man switch'
        return self.status()


def _refusal(hosts: list[str], origins: list[str], port: int, *, steers: bool) -> str:
    """Why a request with these Host and Origin headers is refused; empty if it is not. It steers if
    it asks for the connection by which a page steers.
    """
    own_hosts = [f'{name}:{port}' for name in _NAMES]
    if len(hosts) != 1 or hosts[0] not in own_hosts:
        return 'This page is served to this computer alone, under its own address.'
    if steers and len(origins) != 1:
        return 'A connection that steers must name the page it comes from.'
    if origins and origins != [f'http://{hosts[0]}']:
        return 'Another page must not steer this one.'
    return ''


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets; from other threads it is left alone.

    viser 1.1 sets an asyncio.Event from whichever thread sends a message, and once more in its own
    loop. The first may meet a waiter that comes or goes: 'deque mutated during iteration', which
    ended the page on a busy machine.
    """

    def set(self) -> None:
        """Wake those who wait, in the loop's own thread."""
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _SafeBuffer(AsyncMessageBuffer):
    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.message_event = _LoopEvent()


class _Server(viser.ViserServer):
    def request_share_url(self, verbose: bool = True) -> None:
        """Open no way in from outside, which any browser at the page may ask for."""


def open_server(port: int, label: str, channel: TeleopChannel | None = None) -> viser.ViserServer:
    """A viser server that checks every request, at the next free port; 0: any. Without a channel
    the page does not steer.

    Raises OriginError if it accepted a foreign request, as a future viser might.
    """
    _infra.AsyncMessageBuffer = _SafeBuffer  # type: ignore[attr-defined]
    with _guarded(channel), contextlib.redirect_stdout(io.StringIO()):
        server = _Server(ADDRESS, port, label=label, verbose=False)
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    # Chromium opens connections in advance and closes them unused: no reason for a traceback.
    logging.getLogger('websockets.server').setLevel(logging.CRITICAL)
    _check(server)
    return server


def close_server(server: viser.ViserServer) -> None:
    """Stop the server; viser would print a line."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _guarded(channel: TeleopChannel | None) -> Iterator[None]:
    """Have the next websocket server check every request, for which viser has no option."""
    module = websockets.asyncio.server
    serve = module.serve

    def serve_guarded(handler: Any, *arguments: Any, process_request: Any, **options: Any) -> Any:
        respond = _checked(process_request, channel is not None)

        async def handle(connection: Any) -> None:
            if channel is not None and connection.request.path == TELEOP_PATH:
                await channel.serve(connection)
            else:
                await handler(connection)

        return serve(handle, *arguments, process_request=respond, **options)

    module.serve = serve_guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        module.serve = serve  # type: ignore[misc]


def _checked(respond: Callable[[Any, Any], Any], with_script: bool) -> Callable[[Any, Any], Any]:
    """viser's response to a request, after the check and with our headers; None goes on to a
    websocket.
    """
    script = f'<script>{_SCRIPT.read_text(encoding="utf-8")}</script>'.encode()

    def respond_checked(connection: Any, request: Any) -> Any:
        headers = request.headers
        hosts = headers.get_all('Host')
        steers = 'Upgrade' in headers
        port = connection.local_address[1]
        reason = _refusal(hosts, headers.get_all('Origin'), port, steers=steers)
        if reason:
            return connection.respond(HTTPStatus.FORBIDDEN, f'{reason}\n')
        is_page = not steers and request.path.partition('?')[0] in _PAGE
        if is_page and 'Accept-Encoding' in headers:
            del headers['Accept-Encoding']  # packed, the page could not be changed
        response = respond(connection, request)
        if response is None:
            return None
        if is_page and with_script:
            response.body = response.body.replace(b'<head>', b'<head>' + script, 1)
            del response.headers['Content-Length']
            response.headers['Content-Length'] = str(len(response.body))
        for name, value in _HEADERS.items():
            response.headers[name] = value.format(connect=f'ws://{hosts[0]}')
        return response

    return respond_checked


def _check(server: viser.ViserServer) -> None:
    """Send a foreign request; close a server that accepts it."""
    connection = HTTPConnection(ADDRESS, server.get_port(), timeout=_PATIENCE)
    try:
        connection.request('GET', '/', headers={'Host': _FOREIGN})
        status = connection.getresponse().status
    finally:
        connection.close()
    if status != HTTPStatus.FORBIDDEN:
        close_server(server)
        raise OriginError(
            f'viser {viser.__version__} accepts requests from elsewhere ({status}); '
            'the page is not served'
        )
