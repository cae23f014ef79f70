"""The live page: who may load it, what it shows, and that a click steers the node."""

import asyncio
import re
import socket
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
pytest.importorskip('viser', reason='needs the extra view')

from graph_helpers import PATIENCE, await_that, graph, read_parameters, to_joint_state
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int32

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.command import norm
from redres_ros.errors import ArrayError
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import WORDS, GraphMonitor, LiveArm, NodeHealth, Sampler
from redres_ros.nodes import controller_telemetry
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.controller_telemetry import MotionTelemetry, from_message
from redres_ros.nodes.topics import SESSION, TASK_STATE
from redres_ros.planning.task_executor import TaskState
from redres_ros.robots import ARMS
from redres_ros.view import panel
from redres_ros.view import server as serving
from redres_ros.view.controls import Bindings, _act_in_order
from redres_ros.view.scene import _shapes_of

T = 0.002  # [s]
DX = np.array((0.0, 0.6, -0.3))  # [m/s]
PORT = 8080
BROWSER_PATIENCE = 100.0  # [s]; it draws without a graphics card
CHROMIUM = ('/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome')


@pytest.mark.parametrize('host', ['127.0.0.1:8080', 'localhost:8080'])
def test_a_browser_at_the_pages_own_address_is_let_in(host: str) -> None:
    assert not serving._refusal([host], [], PORT, steers=False)
    assert not serving._refusal([host], [f'http://{host}'], PORT, steers=True)


@pytest.mark.parametrize(
    ('hosts', 'origins', 'steers'),
    [
        (['elsewhere.example:8080'], [], False),
        (['127.0.0.1:8081'], [], False),
        ([], [], False),
        (['localhost:8080', 'elsewhere.example'], [], False),
        (['localhost:8080'], ['http://elsewhere.example'], True),
        (['localhost:8080'], ['http://localhost:8081'], True),
        (['localhost:8080'], ['http://127.0.0.1:8080'], True),
        (['localhost:8080'], ['null'], True),
        (['localhost:8080'], [], True),
        (['localhost:8080'], ['http://localhost:8080', 'http://elsewhere.example'], True),
        (['localhost:8080'], ['http://elsewhere.example'], False),
    ],
)
def test_everybody_else_is_refused(hosts: list[str], origins: list[str], steers: bool) -> None:
    assert serving._refusal(hosts, origins, PORT, steers=steers)


async def ignore(connection: Any) -> None:
    """Serve nothing to a connection that steers."""


@pytest.fixture(scope='module')
def server() -> Iterator[Any]:
    server = serving.open_server(0, 'test', ignore)
    yield server
    server.stop()


def ask(server: Any, **headers: str) -> Any:
    connection = HTTPConnection('127.0.0.1', server.get_port(), timeout=PATIENCE)
    connection.request('GET', '/', headers={key.replace('_', '-'): v for key, v in headers.items()})
    response = connection.getresponse()
    response.text = response.read().decode()
    connection.close()
    return response


def test_the_page_may_load_nothing_from_elsewhere_and_stand_in_no_frame(server: Any) -> None:
    response = ask(server)
    assert response.status == 200
    policy = response.headers['Content-Security-Policy']
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
    assert 'http' not in policy and policy.count('ws:') == 1
    assert f'ws://127.0.0.1:{server.get_port()};' in policy


def test_the_browser_shows_our_title(server: Any) -> None:
    # Of several titles the first one counts.
    assert re.findall('<title>(.*?)</title>', ask(server).text)[0] == 'redres'


def test_a_foreign_host_and_a_foreign_page_get_nothing(server: Any) -> None:
    assert ask(server, Host='elsewhere.example').status == 403
    upgrade = {
        'Connection': 'Upgrade',
        'Upgrade': 'websocket',
        'Sec_WebSocket_Version': '13',
        'Sec_WebSocket_Key': 'AAAAAAAAAAAAAAAAAAAAAA==',
    }
    assert ask(server, **upgrade, Origin='http://elsewhere.example').status == 403
    assert ask(server, **upgrade).status == 403
    own = f'http://127.0.0.1:{server.get_port()}'
    assert ask(server, **upgrade, Origin=own).status == 101


def test_only_this_computer_reaches_the_page(server: Any) -> None:
    with socket.socket() as probe:  # another address of the same computer
        assert probe.connect_ex(('127.0.0.2', server.get_port())) != 0


def test_nobody_at_the_page_can_open_a_way_in_from_outside(server: Any) -> None:
    assert server.request_share_url() is None


def test_a_server_without_the_check_is_shut(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped: list[str] = []
    another = SimpleNamespace(stop=lambda: stopped.append('stopped'))
    monkeypatch.setattr(serving, '_Server', lambda *_, **__: another)
    with pytest.raises(serving.OriginError, match='requests from elsewhere'):
        serving.open_server(0, 'test', ignore)
    assert stopped


def test_words_of_the_graph_cannot_become_part_of_the_page() -> None:
    evil = '<img src=x onerror=alert(1)>'
    shown = panel.state_text(dict.fromkeys(WORDS, evil), {'sim': NodeHealth(evil, True)}, 0.0)
    arm = SimpleNamespace(joint_names=[evil], q_min=np.zeros(1), q_max=np.ones(1))
    shown += panel.joint_bars(arm, np.array([0.5]), f'{evil}2: {evil}')
    assert '<img' not in shown and shown.count('&lt;img') == len(WORDS) + 4


def test_the_progress_of_a_goal_is_shown_while_it_is_under_way() -> None:
    newest = dict.fromkeys(WORDS, '')
    assert '43%' in panel.state_text({**newest, TASK_STATE: 'homing'}, {}, 0.43)
    assert '100%' not in panel.state_text({**newest, TASK_STATE: 'finished'}, {}, 1.0)


@pytest.mark.parametrize('name', ARMS)
def test_every_link_of_an_arm_is_drawn(name: str) -> None:
    model = RobotModel.named(name)
    drawn = {shape.parentJoint - 1 for shape in _shapes_of(model.arm)}
    assert drawn >= set(range(model.n - 1))


@pytest.fixture(scope='module')
def motion() -> SimpleNamespace:
    """A motion into the limits: what a controller was asked and has commanded."""
    model = RobotModel.named('lwr4_paper')
    law = make_law('minimum_acceleration', damping=10.0)
    names = ('position', 'velocity', 'acceleration', 'torque')
    controller = Controller(model, law, T, limits=names, limit_scale=0.2)
    q = load_task('rectangle').start
    commands = []
    for _ in range(300):
        commands.append(controller.update(q, DX))
        q = commands[-1].q_ref
    return SimpleNamespace(model=model, commands=commands)


def test_a_snapshot_that_no_controller_would_send_is_passed_over() -> None:
    message = Float64MultiArray(data=[*range(7), *np.arange(2.0)])
    figures, q = from_message(message, 2)
    assert (list(figures.values()), q.tolist()) == ([*range(7)], [0.0, 1.0])
    with pytest.raises(ArrayError, match='9 numbers; expected 14'):
        from_message(message, 7)
    message.data[3] = np.nan
    with pytest.raises(ArrayError):
        from_message(message, 2)


class SubscribedTelemetry:
    """Telemetry of which somebody listens to what is published now and then: keeps it."""

    subscribed = frozenset({'snapshot', 'active_limits', 'task_scaling'})

    def __init__(self, *_: object) -> None:
        self.messages: dict[str, list[Any]] = {name: [] for name in self.subscribed}

    def publish(self, name: str, make: Any) -> None:
        if name in self.subscribed:
            self.messages[name].append(make())


def test_snapshots_are_few_and_hide_no_peak_between_them(
    motion: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(controller_telemetry, 'Telemetry', SubscribedTelemetry)
    node = SimpleNamespace(get_name=lambda: 'controller')
    motion_telemetry = MotionTelemetry(node, 'world', T)
    for tick, command in enumerate(motion.commands):
        response = SimpleNamespace(stamp=tick, command=command, scaling=command.s)
        motion_telemetry.publish(response, None)
    messages = motion_telemetry._telemetry.messages
    reported = [from_message(message, motion.model.n) for message in messages['snapshot']]
    assert len(reported) == len(motion.commands) // 25
    assert len(messages['active_limits']) == len(motion.commands) // 50
    assert len(messages['task_scaling']) == len(motion.commands) // 4
    for (figures, q), first in zip(reported, count(0, 25), strict=False):
        since = motion.commands[first : first + 25]
        newest = since[-1]
        assert figures['joint_velocity_norm'] == max(norm(each.dq) for each in since)
        assert figures['joint_acceleration_norm'] == max(norm(each.ddq) for each in since)
        assert figures['joint_torque_norm'] == norm(newest.tau)
        assert figures['task_scaling'] == newest.s
        assert np.array_equal(q, newest.state.q)


def test_the_arm_is_where_it_was_measured_also_while_the_controller_is_silent(motion, monkeypatch):
    monkeypatch.setattr('redres_ros.graph.monitor._SILENCE', 0.1)
    with graph(ControllerNode) as (controller, _):
        values = read_parameters(controller, 'controller')
    with graph(lambda: Node('robot')) as (node, _):
        monitor = GraphMonitor('test')
        arm = LiveArm(monitor, values)
        assert arm.model.arm == controller._controller.model.arm
        quality = QoSProfile(depth=1)
        states = node.create_publisher(JointState, 'joint_states', quality)
        snapshots = node.create_publisher(Float64MultiArray, controller_telemetry.TOPIC, quality)
        moved = np.linspace(0.1, 0.7, motion.model.n)
        q = motion.commands[0].state.q

        def arrived(publisher: Any, message: Any, expected: np.ndarray) -> bool:
            publisher.publish(message)
            arm.look()
            return np.array_equal(arm.q, expected)

        state = to_joint_state(5, motion.model.joint_names, moved, np.zeros(motion.model.n))
        await_that(lambda: arrived(states, state, moved), 'the state')
        snapshot = Float64MultiArray(data=[*range(7), *q])
        await_that(lambda: arrived(snapshots, snapshot, q), 'the snapshot')
        await_that(lambda: arrived(states, state, moved), 'the state after the snapshot')
        monitor.destroy_node()


def test_changes_that_cannot_be_are_passed_over() -> None:
    known = {'law': 'minimum_velocity', 'damping': 10.0, 'limits': ['position']}
    bindings = Bindings(SimpleNamespace(), {'controller': known})
    bindings.show('controller', {'law': 5, 'damping': 'x', 'limits': ['velocity'], 'unknown': 1})
    assert bindings.values['controller'] == {**known, 'limits': ['velocity']}


def test_a_setting_that_a_node_refuses_is_shown_as_the_node_has_it() -> None:
    reported: list[str] = []

    def refuse(of: str, values: dict[str, Any]) -> None:
        raise CallError(f'{of} refused')

    bindings = Bindings(
        SimpleNamespace(set_parameters=refuse), {'controller': {'law': 'minimum_torque'}}
    )
    shown: list[str] = []
    bindings.on_change('controller', 'law', shown.append)
    client = SimpleNamespace(add_notification=lambda title, text, **_: reported.append(text))
    bindings.set(SimpleNamespace(client=client), 'controller', {'law': 'minimum_velocity'})
    assert shown == ['minimum_torque'] and reported == ['controller refused']


def test_what_is_clicked_in_quick_succession_is_done_in_that_order() -> None:
    done: list[str] = []
    clicks: list[Any] = []
    is_held = threading.Event()

    def act(event: Any, name: str) -> None:
        assert name != 'stop' or is_held.wait(PATIENCE)
        done.append(name)

    _act_in_order(SimpleNamespace(on_click=clicks.append), act)
    buttons = SimpleNamespace(value='stop')
    for buttons.value in ('stop', 'home'):
        asyncio.run(clicks[0](SimpleNamespace(target=buttons)))
    is_held.set()
    await_that(lambda: done == ['stop', 'home'], 'both')


def test_samples_wait_in_their_order_until_they_are_taken() -> None:
    with graph(lambda: Node('sampled')) as (node, _):
        sampler = Sampler(node)
        sampler.add('numbers', Int32, QoSProfile(depth=100))
        publisher = node.create_publisher(Int32, 'numbers', QoSProfile(depth=100))
        await_that(lambda: publisher.get_subscription_count() == 1, 'the sampler')
        for number in range(50):
            publisher.publish(Int32(data=number))
        taken: list[Any] = []
        await_that(lambda: taken.extend(sampler.take('numbers')) or len(taken) == 50, 'samples')
        expected = [serialize_message(Int32(data=number)) for number in range(50)]
        assert [sample.data for sample in taken] == expected
        assert all(sample.sent > 0 for sample in taken)
        assert sampler.newest('numbers') is None
        sampler.close()


@pytest.fixture
def chromium() -> Iterator[Any]:
    """A page of a headless Chromium that is on this machine."""
    playwright = pytest.importorskip('playwright.sync_api', reason='needs playwright')
    path = next((path for path in CHROMIUM if Path(path).exists()), None)
    if path is None:
        pytest.skip(f'needs a Chromium: none of {", ".join(CHROMIUM)} is there')
    with playwright.sync_playwright() as driver:
        software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']
        browser = driver.chromium.launch(executable_path=path, args=['--no-sandbox', *software])
        page = browser.new_page(viewport={'width': 900, 'height': 600})
        page.set_default_timeout(1e3 * BROWSER_PATIENCE)
        yield page
        browser.close()


@pytest.mark.slow
def test_a_phone_shows_the_arm_and_one_bar_of_the_controls(chromium: Any, server: Any) -> None:
    chromium.set_viewport_size({'width': 390, 'height': 844})
    chromium.goto(f'http://127.0.0.1:{server.get_port()}')
    bar = chromium.get_by_text('test', exact=True)
    await_that(lambda: bar.is_visible() and bar.bounding_box()['y'] > 780, 'the bar at the bottom')


@pytest.mark.realtime
def test_what_is_clicked_at_the_page_is_done_by_the_nodes(chromium: Any, tmp_path: Path) -> None:
    asked: list[str] = []
    chromium.on('request', lambda request: asked.append(request.url))
    with graph(lambda: GraphMonitor('test')) as (node, start):
        # What the browser draws may hold up the controller; the robot waits for it.
        start('sim', tmp_path / 'sim.log', patience=PATIENCE)
        for name in ('controller', 'planner'):
            start(name, tmp_path / f'{name}.log')
        log = tmp_path / 'view.log'
        start('view.page', log, port=18280, patience=100.0)
        await_that(lambda: node.word(SESSION) == 'CMD', 'command mode')
        await_that(lambda: 'page: ' in log.read_text(), 'the page', patience=BROWSER_PATIENCE)
        address = log.read_text().partition('page: ')[2].strip()
        chromium.goto(address)
        # Events of their own: a real click waits until all that is drawn has come to rest.
        chromium.get_by_role('combobox', name='law').dispatch_event('click')
        chromium.get_by_role('option', name='minimum_kinetic_energy').dispatch_event('click')
        chromium.get_by_role('checkbox', name='torque').dispatch_event('click')
        chromium.get_by_role('button', name='start').dispatch_event('click')
        await_that(
            lambda: node.word(TASK_STATE) in (TaskState.MOVING.value, TaskState.FINISHED.value),
            'the task',
        )
        chromium.get_by_role('button', name='stop', exact=True).dispatch_event('click')
        chromium.get_by_role('button', name='home').dispatch_event('click')
        await_that(
            lambda: node.word(TASK_STATE) in (TaskState.HOMING.value, TaskState.FINISHED.value),
            'the motion to the start',
        )
        controller = read_parameters(node, 'controller')
        assert controller['law'] == 'minimum_kinetic_energy'
        assert 'torque' in controller['limits'] and 'position' in controller['limits']
        chromium.get_by_text('Robot: CMD').wait_for()
    assert asked and all(url.startswith((address, f'blob:{address}')) for url in asked)
