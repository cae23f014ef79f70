"""Recordings: what was said is in the file, and readers that are not ours understand it."""

import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
pytest.importorskip('mcap_ros2', reason='needs mcap-ros2-support, the independent reader')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovariance, TwistStamped
from graph_helpers import PATIENCE, Probe, await_that, graph, to_joint_state, udp_sockets
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from messages import to_twist
from own_ros import ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from redres_ros.cli import main
from redres_ros.graph.mcap_file import McapFile, merge
from redres_ros.graph.message_text import TypeTextError, definition_of, find_type, name_of
from redres_ros.graph.recorder import GraphRecorder
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import spun
from redres_ros.nodes.sim import SimNode
from redres_ros.nodes.topics import LATCHED
from redres_ros.robot_model import RobotModel

NAMES = ('a', 'b')
MS = 1_000_000  # [ns]
CONFIG = Path(__file__).parents[1] / 'config'


def read(path: Path) -> list[Any]:
    """Topic, message and time of each message, by a reader that knows nothing of us."""
    with path.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, decoded, message.log_time)
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]


def state(tick: int) -> JointState:
    return to_joint_state(tick * MS, NAMES, _pair(tick), _pair(-tick))


def _pair(value: float) -> Any:
    import numpy as np

    return np.array((value, 2.0 * value))


# --- the file -------------------------------------------------------------------------------------


def test_an_independent_reader_finds_every_field(tmp_path: Path) -> None:
    value = KeyValue(key='quality', value='GOOD')
    status = DiagnosticStatus(level=b'\x01', name='sim', message='late', values=[value])
    pose = PoseWithCovariance()
    pose.covariance[35] = 4.0
    pose.pose.orientation.w = 0.5
    given = [state(7), to_twist(3 * MS, 'world', _pair(1.0).repeat(3)), pose]
    given.append(DiagnosticArray(status=[status]))
    with McapFile(tmp_path / 'all.mcap') as file:
        for number, message in enumerate(given):
            channel = file.add_topic(f'/topic_{number}', type(message))
            file.write(channel, serialize_message(message), number, number + 10)
    found = {topic: (message, time) for topic, message, time in read(tmp_path / 'all.mcap')}
    joints = found['/topic_0'][0]
    assert list(joints.name) == list(NAMES) and list(joints.velocity) == [-7.0, -14.0]
    assert joints.header.stamp.nanosec == 7 * MS and found['/topic_0'][1] == 10
    assert found['/topic_1'][0].twist.angular.z == 2.0
    assert found['/topic_2'][0].covariance[35] == 4.0
    assert found['/topic_2'][0].pose.orientation.w == 0.5
    read_status = found['/topic_3'][0].status[0]
    assert (read_status.message, read_status.values[0].value) == ('late', 'GOOD')


def test_files_of_nodes_become_one_in_the_order_of_time(tmp_path: Path) -> None:
    paths = [tmp_path / 'sim.mcap', tmp_path / 'controller.mcap']
    with McapFile(paths[0], in_chunks=False) as sim, McapFile(paths[1]) as controller:
        states = sim.add_topic('/joint_states', JointState)
        received = sim.add_topic('/joint_command', JointState, is_received=True)
        commands = controller.add_topic('/joint_command', JointState)
        for tick in range(20):
            data = serialize_message(state(tick))
            sim.write(states, data, 10 * tick, 10 * tick)
            controller.write(commands, data, 10 * tick + 3, 10 * tick + 3)
            sim.write(received, data, 10 * tick + 5, 10 * tick + 5)
    with McapFile(tmp_path / 'run.mcap') as file:
        merge(paths, file)
    found = read(tmp_path / 'run.mcap')
    assert [topic for topic, _, _ in found] == 20 * ['/joint_states', '/joint_command']
    assert [message.header.stamp.nanosec for _, message, _ in found[::2]] == [
        tick * MS for tick in range(20)
    ]
    times = [time for _, _, time in found]
    assert times == sorted(times)


def test_the_arm_and_the_parameters_are_beside_the_messages(tmp_path: Path) -> None:
    with McapFile(tmp_path / 'run.mcap') as file:
        file.attach_urdf('<robot/>')
        file.attach_parameters({'/controller': {'law': 'minimum_velocity', 'rate': 500.0}})
    with (tmp_path / 'run.mcap').open('rb') as stream:
        attached = {each.name: each.data for each in make_reader(stream).iter_attachments()}
        stream.seek(0)
        header = make_reader(stream).get_header()
    assert header.profile == 'ros2'
    assert attached['robot_description.urdf'] == b'<robot/>'
    parameters = yaml.safe_load(attached['parameters.yaml'])
    assert parameters['/controller']['ros__parameters']['law'] == 'minimum_velocity'


def test_a_type_is_reported_with_all_that_it_is_made_of() -> None:
    text = definition_of(TwistStamped)
    for name in ('std_msgs/Header', 'builtin_interfaces/Time', 'geometry_msgs/Vector3'):
        assert f'MSG: {name}\n' in text
    assert 'float64 x' in text and name_of(TwistStamped) == 'geometry_msgs/msg/TwistStamped'


def test_a_type_that_is_not_here_is_refused_by_name() -> None:
    with pytest.raises(TypeTextError, match='no_such_msgs/msg/Item'):
        find_type('no_such_msgs/msg/Item')


def test_layouts_show_what_is_recorded() -> None:
    topics = published_topics()
    foxglove = json.loads((CONFIG / 'foxglove.json').read_text())
    shown = re.findall(r'"(/[a-z_/]+)\.\w+"', json.dumps(foxglove))
    assert set(shown) <= topics
    panels = set(re.findall(r'\w+![a-z]+', json.dumps(foxglove['layout'])))
    assert panels == set(foxglove['configById'])
    curves = [curve.get('name') for curve in ET.parse(CONFIG / 'plotjuggler.xml').iter('curve')]
    joints = RobotModel.named('lwr4_paper').joint_names
    known = {f'{topic}/data' for topic in topics}
    known |= {f'/joint_states/{joint}/position' for joint in joints}
    known |= {f'/joint_command/{joint}/velocity' for joint in joints}
    assert set(curves) <= known


def published_topics() -> set[str]:
    """Full names of all topics that sim, controller and planner publish on."""
    topics: set[str] = set()
    with ros():
        for cls in (SimNode, ControllerNode, PlannerNode):
            node = cls()
            found = node.get_publisher_names_and_types_by_node(node.get_name(), '/')
            topics |= {topic for topic, _ in found}
            node.destroy_node()
    return topics


def test_a_package_that_holds_no_messages_is_not_even_imported() -> None:
    for name in ('this/msg/Zen', 'os.path/msg/Item', '/msg/Item'):
        with pytest.raises(TypeTextError):
            find_type(name)
    assert 'this' not in sys.modules


# --- beside a running graph -----------------------------------------------------------------------


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """What a recorder of two topics has received, in a domain of its own."""
    path = tmp_path / 'graph.mcap'
    stopped = threading.Event()
    with (
        McapFile(path) as file,
        graph(lambda: GraphRecorder(file, ('numbers', 'robot_description'))) as (recorder, _),
    ):
        numbers = recorder.create_publisher(Float64, 'numbers', 10)
        latched = recorder.create_publisher(String, 'robot_description', LATCHED)
        latched.publish(String(data='<robot/>'))
        thread = threading.Thread(target=recorder.run, args=(stopped,))
        thread.start()
        await_that(lambda: numbers.get_subscription_count() == 1, 'the recorder')
        await_that(lambda: recorder.messages == 1, 'the message that was kept')
        for number in range(2000):
            numbers.publish(Float64(data=float(number)))
            if number % 100 == 0:
                stopped.wait(0.005)
                latched.publish(String(data=f'<robot name="{number}"/>'))
        await_that(lambda: recorder.messages == 2021, 'the messages')
        stopped.set()
        thread.join()
    return path


def test_no_message_of_a_running_graph_is_lost(recording: Path) -> None:
    found = read(recording)
    numbers = [message.data for topic, message, _ in found if topic == '/numbers']
    assert numbers == [float(number) for number in range(2000)]
    descriptions = [message.data for topic, message, _ in found if topic == '/robot_description']
    changed = [f'<robot name="{number}"/>' for number in range(0, 2000, 100)]
    assert descriptions == ['<robot/>', *changed]


# --- the command ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['run.bag'], 'expected a name that ends in .mcap'),
        (['no/such/run.mcap', '--duration', '-1'], 'duration is -1.0'),
        (['/dev/null/run.mcap'], 'cannot write /dev/null/run.mcap'),
    ],
)
def test_what_cannot_be_recorded_is_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['record', *arguments]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_what_is_said_while_the_recorder_stands_still_waits_for_it(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    with own_domain(), spun(Probe) as probe:
        numbers = probe.create_publisher(Float64, 'numbers', 10)
        command = [sys.executable, '-m', 'redres_ros.cli', 'record', path, '--topics', 'numbers']
        recorder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        await_that(lambda: numbers.get_subscription_count() == 1, 'the recorder')
        recorder.send_signal(signal.SIGSTOP)
        for number in range(400):  # usually 255 fill a socket
            numbers.publish(Float64(data=float(number)))
        recorder.send_signal(signal.SIGCONT)
        await_that(lambda: not any(map(waiting_in, udp_sockets(recorder.pid))), 'the recorder')
        recorder.send_signal(signal.SIGINT)
        assert recorder.communicate(timeout=PATIENCE)[0]
    assert recorder.returncode == 0
    assert [message.data for _, message, _ in read(path)] == [float(k) for k in range(400)]


def waiting_in(socket: list[str]) -> bool:
    """Whether something that has come has not been taken."""
    return not socket[4].endswith(':00000000')
