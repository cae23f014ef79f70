"""Who may load the page: a browser on this computer, from the page's own address.

A page that steers a robot must not obey other pages. A browser sends along whose page asks (Origin)
and which name it looked up (Host), so a request from elsewhere is recognised, even if a
foreign name was made to point to this computer.
"""

import asyncio
import contextlib
import io
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.client import HTTPConnection
from typing import Any

import viser
import websockets.asyncio.server
from viser import _messages
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from redres_ros.errors import RedresError
from redres_ros.view.dead_man import PATH, TeleopChannel

ADDRESS = '127.0.0.1'

_NAMES = (ADDRESS, 'localhost')
_FOREIGN = 'elsewhere.example'
_PAGE = ('/', '/index.html')
_TIMEOUT = 5.0  # [s] for the page to respond to itself
# What the browser itself may do with a page: load nothing from elsewhere, and call nobody else.
CONTENT = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src data:; connect-src 'self' data: blob: {connect}; base-uri 'none'; form-action 'none'"
)
_HEADERS = {
    'Content-Security-Policy': f"{CONTENT}; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
}

# (connection, request) to a response; None goes on to the page
_Responder = Callable[[Any, Any], Any]


class OriginError(RedresError):
    """A page that is not protected."""


class LoopEvent(asyncio.Event):
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
        self.message_event = LoopEvent()


def refusal(hosts: list[str], origins: list[str], port: int, *, steers: bool) -> str:
    """Why a request is refused; empty if it is not.

    Args:
        hosts: The values of its Host headers.
        origins: Those of its Origin headers.
        port: That of the page.
        steers: Whether it asks for the connection by which a page steers.
    """
    own_hosts = [f'{name}:{port}' for name in _NAMES]
    if len(hosts) != 1 or hosts[0] not in own_hosts:
        return 'This page is served to this computer alone, under its own address.'
    if steers and len(origins) != 1:
        return 'A connection that steers must name the page it comes from.'
    if origins and origins != [f'http://{hosts[0]}']:
        return 'Another page must not steer this one.'
    return ''


def open_server(port: int, label: str, channel: TeleopChannel | None = None) -> viser.ViserServer:
    """A viser server with the origin check.

    Args:
        port: Wanted; the next free one is taken; 0: any.
        label: The title of its controls.
        channel: Channel of the page's own script; None: the page has no script of ours.

    Raises:
        OriginError: It let a foreign request in, as a future viser might.
    """
    _infra.AsyncMessageBuffer = _SafeBuffer  # type: ignore[attr-defined]
    with _guarded(channel), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(ADDRESS, port, label=label, verbose=False)
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)  # they would open a way in from outside
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

    def serve_guarded(
        handler: Any, *arguments: Any, process_request: _Responder, **options: Any
    ) -> Any:
        respond = process_request
        if channel is not None:
            handler = _with_channel(handler, channel)
            respond = _with_script(respond, channel)
        return serve(handler, *arguments, process_request=_judging(respond), **options)

    module.serve = serve_guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        module.serve = serve  # type: ignore[misc]


def _with_channel(handler: Any, channel: TeleopChannel) -> Any:
    async def serve(connection: Any) -> None:
        chosen = channel.serve if connection.request.path == PATH else handler
        await chosen(connection)

    return serve


def _with_script(respond: _Responder, channel: TeleopChannel) -> _Responder:
    def respond_with_script(connection: Any, request: Any) -> Any:
        if 'Upgrade' in request.headers or request.path.partition('?')[0] not in _PAGE:
            return respond(connection, request)
        if 'Accept-Encoding' in request.headers:
            del request.headers['Accept-Encoding']  # packed, it could not be changed
        response = respond(connection, request)
        response.body = response.body.replace(b'<head>', b'<head>' + channel.script, 1)
        del response.headers['Content-Length']
        response.headers['Content-Length'] = str(len(response.body))
        return response

    return respond_with_script


def _judging(respond: _Responder) -> _Responder:
    def judge(connection: Any, request: Any) -> Any:
        headers = request.headers
        hosts = headers.get_all('Host')
        reason = refusal(
            hosts,
            headers.get_all('Origin'),
            connection.local_address[1],
            steers='Upgrade' in headers,
        )
        if reason:
            return connection.respond(HTTPStatus.FORBIDDEN, f'{reason}\n')
        response = respond(connection, request)
        if response is not None:
            for name, value in _HEADERS.items():
                response.headers[name] = value.format(connect=f'ws://{hosts[0]}')
        return response

    return judge


def _check(server: viser.ViserServer) -> None:
    """Send a foreign request; close a server that accepts it."""
    connection = HTTPConnection(ADDRESS, server.get_port(), timeout=_TIMEOUT)
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
