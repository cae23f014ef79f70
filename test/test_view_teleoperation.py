"""The page moves the arm only while its dead-man switch is held."""

import asyncio
import json
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
pytest.importorskip('viser', reason='needs the extra view')

from geometry_msgs.msg import PoseStamped, TwistStamped
from graph_helpers import PATIENCE, await_that, graph
from rclpy.node import Node
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from redres_ros import RobotModel
from redres_ros.graph.client import CallError
from redres_ros.nodes.topics import MODE, REASON
from redres_ros.view import server as serving
from redres_ros.view.controls import Bindings
from redres_ros.view.scene import ArmScene
from redres_ros.view.server import TELEOP_PATH, TIMEOUT, TeleopChannel
from redres_ros.view.teleoperation import Teleoperation, _pull

FORWARD = np.array((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
STILL = np.zeros(6)
VALUES = {
    'controller': {'task_space': 'pose', 'admittance.enabled': False},
    'sim': {'push_link': '', 'push_force': [0.0, 0.0, 0.0]},
}


def test_a_switch_whose_holder_falls_silent_is_free() -> None:
    switch = TeleopChannel()
    assert switch.press('a', FORWARD, 10.0)
    assert switch.direction(10.2)[0] == 1.0
    assert switch.direction(10.0 + TIMEOUT) is None


def test_one_at_a_time_holds_the_switch_and_nobody_else_lets_it_go() -> None:
    switch = TeleopChannel()
    switch.press('a', FORWARD, 10.0)
    assert not switch.press('b', -FORWARD, 10.1)
    switch.release('b')
    assert switch.direction(10.1)[0] == 1.0
    switch.release('a')
    assert switch.direction(10.1) is None


@pytest.mark.parametrize(
    'message',
    ['', '{}', '[1, 0, 0]', '[2, 0, 0, 0, 0, 0]', '[NaN, 0, 0, 0, 0, 0]', '[true, 0, 0, 0, 0, 0]'],
)
def test_what_the_script_would_not_send_is_refused(message: str) -> None:
    with pytest.raises(serving._BeatError):
        serving._read_beat(message)


# What the page's script finds in a browser with a gamepad: a shoulder button is held at first, the
# left stick is pushed forward and right, the right one hardly sideways, and a trigger is pressed.
# Then Shift and two keys are held, until the tab is hidden.
BROWSER = """
const release = {pressed: false, value: 0.0};
const buttons = Array(8).fill(release);
buttons[4] = {pressed: true, value: 1.0};
buttons[7] = {pressed: true, value: 0.75};
const on = {};
const listener = {addEventListener: (name, call) => { on[name] = call; }};
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
  window: listener,
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
    gamepad, let_go, keys, hidden = map(serving._read_beat, done.stdout.splitlines())
    assert np.array_equal(gamepad, (1.0, -0.5, 0.75, 0.0, -0.25, 0.0))
    assert np.array_equal(keys, (-1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert let_go is None and hidden is None


@pytest.fixture(scope='module')
def channel() -> TeleopChannel:
    return TeleopChannel()


@pytest.fixture(scope='module')
def server(channel: TeleopChannel) -> Iterator[Any]:
    server = serving.open_server(0, 'test', channel)
    yield server
    serving.close_server(server)


def opened(server: Any, origin: str = '') -> Any:
    address = f'127.0.0.1:{server.get_port()}'
    return connect(f'ws://{address}{TELEOP_PATH}', origin=origin or f'http://{address}')


def direction(channel: TeleopChannel) -> Any:
    return channel.direction(time.monotonic())


@pytest.mark.parametrize('encoding', ['gzip', 'identity'])
def test_the_page_holds_its_script(server: Any, encoding: str) -> None:
    connection = HTTPConnection('127.0.0.1', server.get_port(), timeout=PATIENCE)
    connection.request('GET', '/', headers={'Accept-Encoding': encoding})
    assert connection.getresponse().read().count(b'Jog the tip') == 1


def test_the_switch_is_held_as_long_as_the_page_says_so(
    server: Any, channel: TeleopChannel
) -> None:
    channel.rows = 6
    with opened(server) as page:
        assert json.loads(page.recv(PATIENCE)) == {'rows': 6}
        page.send('[0, 1, 0, 0, 0, 0]')
        await_that(lambda: direction(channel) is not None, 'the switch')
        page.send('null')
        await_that(lambda: direction(channel) is None, 'its release')


def test_a_page_that_breaks_the_rules_is_cut_off(server: Any, channel: TeleopChannel) -> None:
    with opened(server) as page:
        page.recv(PATIENCE)
        page.send('[1e9, 0, 0, 0, 0, 0]')
        with pytest.raises(ConnectionClosed, match='numbers from -1 to 1'):
            page.recv(PATIENCE)
    assert direction(channel) is None


def test_a_thread_that_sends_meets_no_waiter_of_the_servers_loop(server: Any) -> None:
    event = server._websock_server._broadcast_buffer.message_event
    assert isinstance(event, serving._LoopEvent)

    async def wait() -> None:
        mine = serving._LoopEvent()
        loop = asyncio.get_running_loop()
        thread = threading.Thread(target=mine.set)
        thread.start()
        thread.join()
        assert not mine.is_set()
        loop.call_soon_threadsafe(mine.set)
        await mine.wait()

    asyncio.run(asyncio.wait_for(wait(), PATIENCE))


class Operator:
    """A page of an FR3, and what it has published and asked of the nodes' services."""

    def __init__(self, node: Node, server: Any) -> None:
        self.switch = TeleopChannel()
        self.asked: list[Any] = []
        self.words: dict[str, str] = {}
        self.notices: list[str] = []
        self.twists: list[np.ndarray] = []
        self.targets: list[Any] = []
        node.word = lambda topic: self.words.get(topic, '')
        self.planner = node.create_subscription(PoseStamped, 'target_pose', self.targets.append, 10)
        node.create_subscription(TwistStamped, 'cartesian_velocity', self._on_twist, 10)
        model = RobotModel.named('fr3')
        scene = ArmScene(server, model, np.zeros((0, 3)))
        service = SimpleNamespace(
            trigger=self.asked.append,
            set_parameters=lambda node, values: self.asked.append(values),
        )
        bindings = Bindings(service, VALUES)
        self.page = Teleoperation(server, node, bindings, scene, model, self.switch)

    def _on_twist(self, message: TwistStamped) -> None:
        linear = message.twist.linear
        self.twists.append(np.array((linear.x, linear.y, linear.z)))

    def step(self) -> None:
        self.page.step(time.monotonic())

    def hold(self, direction: np.ndarray = STILL) -> None:
        self.switch.press('somebody', direction, time.monotonic())

    def release(self) -> None:
        self.switch.release('somebody')

    def event(self, phase: str, **others: Any) -> Any:
        client = SimpleNamespace(
            add_notification=lambda title, text, **_: self.notices.append(text)
        )
        return SimpleNamespace(phase=phase, client=client, **others)

    def drag(self, phase: str) -> None:
        asyncio.run(self.page._on_drag(self.event(phase)))

    def push(self, phase: str) -> None:
        positions = {'start_position': (0.0, 0.0, 0.5), 'end_position': (0.1, 0.0, 0.5)}
        asyncio.run(self.page._push_callback('fr3_link4')(self.event(phase, **positions)))


@pytest.fixture
def operator() -> Iterator[Operator]:
    server = serving.open_server(0, 'test')
    with graph(lambda: Node('page')) as (node, _):
        yield Operator(node, server)
    serving.close_server(server)


def test_a_velocity_is_published_while_the_switch_is_held_then_zero_and_nothing_before(
    operator: Operator,
) -> None:
    def moves() -> bool:
        operator.hold(FORWARD)
        operator.step()
        return bool(operator.twists) and operator.twists[-1].tolist() == [0.05, 0.0, 0.0]

    def rests() -> bool:
        operator.release()
        operator.step()
        return not operator.twists[-1].any()

    operator.step()
    assert operator.page._twist_publisher is None
    await_that(moves, 'the velocity')
    await_that(lambda: 'planner/stop' in operator.asked, 'the end of the task')
    await_that(rests, 'the zero')


def test_a_dragged_tip_is_a_target_only_while_the_switch_is_held(operator: Operator) -> None:
    publisher = operator.page._target_publisher
    await_that(lambda: publisher.get_subscription_count() > 0, 'a planner')
    operator.drag('update')
    operator.step()
    assert not operator.page._is_dragged
    operator.hold()
    operator.drag('start')
    await_that(lambda: bool(operator.targets), 'the target')
    operator.step()
    operator.release()
    await_that(lambda: operator.step() or 'planner/stop' in operator.asked, 'the end of the motion')


def test_without_a_planner_a_drag_says_so(operator: Operator) -> None:
    operator.page._target_publisher = SimpleNamespace(get_subscription_count=lambda: 0)
    operator.hold()
    operator.drag('start')
    assert 'no planner' in operator.notices[0] and not operator.page._is_dragged


@pytest.mark.parametrize('how', ['release', 'end'])
def test_a_pushed_link_is_let_go_with_the_switch(operator: Operator, how: str) -> None:
    def forces() -> list[float]:
        operator.step()
        return [values['push_force'][0] for values in operator.asked]

    operator.hold()
    operator.push('start')
    await_that(lambda: forces() == [30.0], 'the push')
    assert operator.asked[0]['push_link'] == 'fr3_link4'
    if how == 'release':
        operator.release()
    else:
        operator.push('end')
    await_that(lambda: forces() == [30.0, 0.0], 'its end')


def test_a_page_that_ends_ends_its_push(operator: Operator) -> None:
    operator.page._pushed = np.array((30.0, 0.0, 0.0))
    stopped = threading.Event()
    stopped.set()
    operator.page.run(stopped)
    assert operator.asked[-1]['push_force'] == [0.0, 0.0, 0.0]


def test_a_push_that_is_refused_is_reported(operator: Operator) -> None:
    def refuse(node: str, values: Any) -> None:
        raise CallError(f'{node} refused')

    operator.page._bindings.client.set_parameters = refuse
    operator.hold()
    operator.push('start')
    await_that(lambda: operator.step() or operator.notices == ['sim refused'], 'the refusal')


def test_a_spring_pulls_no_harder_than_allowed() -> None:
    assert _pull((0.0, 0.0, 0.0), (0.0, 9.0, 0.0), 40.0).tolist() == [0.0, 40.0, 0.0]
    assert not _pull((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 40.0).any()


@pytest.mark.parametrize(
    ('topic', 'word', 'hint'),
    [
        (MODE, 'holding', '"resume"'),
        (MODE, 'inactive', 'activate'),
        (MODE, 'mirroring', 'takes no commands'),
        (REASON, 'too fast', '"reset the robot"'),
    ],
)
def test_an_arm_that_does_not_move_says_why(
    operator: Operator, topic: str, word: str, hint: str
) -> None:
    operator.words[topic] = word
    assert operator.page._status() == ''  # nobody asks for anything
    operator.page._twist_publisher = SimpleNamespace(get_subscription_count=lambda: 1)
    operator.page._asked_at = time.monotonic() - 1.0
    assert hint in operator.page._status()
