"""The page's server: only a browser on this computer, at the page's own address, may load the page
and steer by it.

A page that steers a robot must not obey other pages. A browser sends along whose page asks (Origin)
and which name it looked up (Host), so a request from elsewhere is recognised, even if a
foreign name was made to point to this computer.
"""

import asyncio
import contextlib
import io
import logging
from collections.abc import Awaitable, Callable
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any

import viser
import websockets.asyncio.server

from redres_ros.errors import RedresError

ADDRESS = '127.0.0.1'
TELEOP_PATH = '/teleop'  # of the connection by which the page's script steers

# What the browser may do with the page: load nothing from elsewhere, and show it in no other.
_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src data:; connect-src 'self' data: blob: ws://{host}; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
_SCRIPT = Path(__file__).with_name('teleop.js')

_Handler = Callable[[Any], Awaitable[None]]  # of a connection


class OriginError(RedresError):
    """A page that is not protected."""


class _Server(viser.ViserServer):
    def request_share_url(self, verbose: bool = True) -> None:
        """Open no way in from outside, which any browser at the page may ask for."""


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets; from other threads it is left alone.

    viser 1.1 sets an asyncio.Event from whichever thread sends a message, and once more in its own
    loop. The first may meet a waiter that comes or goes: 'deque mutated during iteration', which
    ended the page on a busy machine.
    """

    def set(self) -> None:
        """Wake those who wait, in the loop's own thread."""
        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop()
            super().set()


def open_server(port: int, label: str, teleop: _Handler) -> viser.ViserServer:
    """A viser server that checks every request, at the next free port; 0: any. Connections of the
    page's script go to `teleop`.

    Raises OriginError if viser serves in another way than 1.1 does, and so without the check.
    """
    library = websockets.asyncio.server
    serve = library.serve
    is_checked = False

    def _serve_checked(
        handler: _Handler, *arguments: Any, process_request: Any, **options: Any
    ) -> Any:
        nonlocal is_checked
        is_checked = True

        async def handle(connection: Any) -> None:
            await (teleop if connection.request.path == TELEOP_PATH else handler)(connection)

        respond = partial(_respond, process_request)
        return serve(handle, *arguments, process_request=respond, **options)

    # viser has no option for this.
    library.serve = _serve_checked  # type: ignore[assignment, misc]
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            server = _Server(ADDRESS, port, label=label, verbose=False)
    finally:
        library.serve = serve  # type: ignore[misc]
    if not is_checked:
        server.stop()
        raise OriginError(
            f'viser {viser.__version__} would accept requests from elsewhere; '
            'the page is not served'
        )
    server._websock_server._broadcast_buffer.message_event = _LoopEvent()
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    # Chromium opens connections in advance and closes them unused: no reason for a traceback.
    logging.getLogger('websockets.server').setLevel(logging.CRITICAL)
    return server


def _respond(respond: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
    """viser's response with our title and script in the page; or a refusal; None: a websocket."""
    headers = request.headers
    hosts = headers.get_all('Host')
    port = connection.local_address[1]
    reason = _refusal(hosts, headers.get_all('Origin'), port, steers='Upgrade' in headers)
    if reason:
        return connection.respond(HTTPStatus.FORBIDDEN, f'{reason}\n')
    if 'Accept-Encoding' in headers:
        del headers['Accept-Encoding']  # packed, the page could not be changed
    response = respond(connection, request)
    if response is not None and response.status_code == HTTPStatus.OK:  # the page, all in one file
        head = f'<head><title>redres</title><script>{_SCRIPT.read_text("utf-8")}</script>'
        response.body = response.body.replace(b'<head>', head.encode(), 1)
        del response.headers['Content-Length']
        response.headers['Content-Length'] = str(len(response.body))
        response.headers['Content-Security-Policy'] = _POLICY.format(host=hosts[0])
    return response


def _refusal(hosts: list[str], origins: list[str], port: int, *, steers: bool) -> str:
    """Why these Host and Origin headers are refused, or ''; `steers`: of a socket that steers."""
    if len(hosts) != 1 or hosts[0] not in (f'{ADDRESS}:{port}', f'localhost:{port}'):
        return 'This page is served to this computer alone, under its own address.'
    if steers and len(origins) != 1:
        return 'A connection that steers must name the page it comes from.'
    if origins and origins != [f'http://{hosts[0]}']:
        return 'Another page must not steer this one.'
    return ''
