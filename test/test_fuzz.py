"""Random messages on every topic and random values for every parameter: no node fails, and nothing
bad gets through.

They go straight into the callbacks of nodes in this process: some hundreds, and with
REDRES_NIGHTLY=1 ten thousand.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from graph_helpers import (
    NAMES,
    PERIOD,
    START,
)
from nightly import NIGHTLY
from own_ros import ros
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.conversions import to_joint_state, to_nanoseconds
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.sim import SimNode
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

CASES = 10_000 if NIGHTLY else 400
FIRST = 10**18  # [ns] stamp of the first state
END = 2**31 * 10**9  # [ns] beyond what a stamp can hold
LIMITS = JointLimits.of(find_arm('lwr4_paper'))

few = settings(
    max_examples=CASES // 5,
    derandomize=CASES < 10_000,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

# --- what can be thrown at a node -----------------------------------------------------------------

numbers = st.one_of(st.floats(), st.floats(-3.0, 3.0))
texts = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=8)
near = st.builds(
    lambda cycles, rest: FIRST + cycles * PERIOD + rest,
    st.integers(-5, 2000),
    st.sampled_from((0, 0, 7)),
)
stamps = st.one_of(
    near.map(lambda stamp: Time(sec=stamp // 10**9, nanosec=stamp % 10**9)),
    st.builds(
        lambda sec, nanosec: Time(sec=sec, nanosec=nanosec),
        st.integers(-(2**31), 2**31 - 1),
        st.integers(0, 2**32 - 1),
    ),
)
names = st.one_of(
    st.just(list(NAMES)),
    st.permutations(NAMES),
    st.lists(texts, max_size=9),
    st.lists(st.sampled_from(NAMES), max_size=9),
)
positions = st.one_of(
    st.just(START.tolist()),
    st.lists(numbers, min_size=7, max_size=7),
    st.lists(numbers, max_size=9),
)


@st.composite
def joint_states(draw: st.DrawFn) -> JointState:
    message = JointState(name=draw(names), position=draw(positions), velocity=draw(positions))
    message.header.stamp = draw(stamps)
    message.header.frame_id = draw(texts)
    return message


@st.composite
def twists(draw: st.DrawFn) -> TwistStamped:
    message = TwistStamped()
    message.header.stamp = draw(stamps)
    message.header.frame_id = draw(st.one_of(st.just('world'), texts))
    for vector in (message.twist.linear, message.twist.angular):
        vector.x = draw(numbers)
        vector.y = draw(numbers)
        vector.z = draw(numbers)
    return message


words = st.one_of(st.sampled_from(('MON', 'CMD', 'COMMANDING_ACTIVE')), texts).map(
    lambda text: String(data=text)
)
VALUES = (
    *(math.nan, math.inf, -math.inf, -1.0, 0.0, 1e-300, 0.1, 5.0, 1e300),
    *(-(2**63), -1, 0, 1, 2**63 - 1, True, False),
    *('', 'none', 'x', '\n', 'position', 'minimum_torque', 'command', 'base'),
    *([math.nan], [1.0], [0.0] * 3, [1e9] * 3, [-1.0] * 6, [1.0] * 7, [0.1] * 100, [1], [True]),
    *(['none'], ['x'], ['position', 'position'], ['velocity', 'acceleration', 'torque']),
)


class Recorder:
    """In the place of a publisher: keeps the numbers of everything that is published."""

    def __init__(self, owner: Any, attribute: str) -> None:
        assert hasattr(owner, attribute)
        self.sent: list[tuple[int, list[float]]] = []
        setattr(owner, attribute, self)

    def publish(self, message: JointState | TwistStamped) -> None:
        if isinstance(message, JointState):
            content = [*message.position, *message.velocity]
        else:
            content = [
                getattr(part, axis)
                for part in (message.twist.linear, message.twist.angular)
                for axis in 'xyz'
            ]
        self.sent.append((to_nanoseconds(message.header.stamp), content))


@pytest.fixture(scope='class')
def lockstep() -> Iterator[None]:
    """A context for nodes in this process."""
    with ros('--log-level', 'fatal', '-p', 'planner:lockstep:=true'):
        yield


@pytest.fixture(scope='class')
def controller(lockstep: None) -> ControllerNode:
    return ControllerNode()


@pytest.fixture(scope='class')
def planner(lockstep: None) -> PlannerNode:
    return PlannerNode()


@pytest.fixture(scope='class')
def sim(lockstep: None) -> SimNode:
    return SimNode()


def numbered(stamp: int, q: np.ndarray = START) -> JointState:
    return to_joint_state(stamp, NAMES, np.asarray(q), np.zeros(7))


def later(newest: int) -> int:
    """A stamp [ns] ten seconds after the newest one, or after the end of time the first one."""
    stamp = max(newest, FIRST) + 10 * 10**9
    return stamp if stamp < END else FIRST


# --- into the callbacks ---------------------------------------------------------------------------


class TestCallbacks:
    """Nodes in this process, whose callbacks are called by the test."""

    @few
    @given(st.lists(st.one_of(joint_states(), twists(), words, st.booleans()), max_size=12))
    def test_whatever_the_controller_receives_its_commands_are_finite_and_it_goes_on(
        self, controller, events
    ):
        recorder = Recorder(controller, '_command_publisher')
        for event in events:
            match event:
                case JointState():
                    controller._on_state(event)
                case TwistStamped():
                    controller._respond('cartesian_velocity', controller._enter_twist, event)
                case String():
                    controller._on_session(event)
                case bool():
                    controller._on_hold(SetBool.Request(data=event), SetBool.Response())
        assert all(
            map(math.isfinite, (number for _, content in recorder.sent for number in content))
        )
        controller._on_hold(SetBool.Request(data=False), SetBool.Response())
        newest = controller._loop._cycles.newest
        last = later(newest)  # any clock may begin anew
        controller._on_state(numbered(last))
        controller._on_state(numbered(last))  # without a silence before, the first proves nothing
        assert recorder.sent[-1][0] == last
        assert recorder.sent[-1][1][:7] == pytest.approx(START.tolist(), abs=1e-2)

    @few
    @given(st.lists(st.one_of(joint_states(), st.booleans()), max_size=12))
    def test_whatever_the_planner_receives_its_task_velocities_are_finite_and_bounded(
        self, planner, events
    ):
        recorder = Recorder(planner, '_twist_publisher')
        for event in events:
            match event:
                case JointState():
                    planner._on_state(event)
                case True:
                    planner._on_start(Trigger.Request(), Trigger.Response())
                case False:
                    planner._on_stop(Trigger.Request(), Trigger.Response())
        # The rectangle's sides are at most 0.5 m long and take 3 s: 15/8 of the mean speed, and the
        # feedback's limit.
        assert all(np.linalg.norm(content) < 2.0 for _, content in recorder.sent)
        last = later(planner._run._cycles.newest)
        planner._on_state(numbered(last))
        planner._on_state(numbered(last))  # without a silence before, the first proves nothing
        # Now, as what was asked for before another clock began would be given up.
        planner._on_start(Trigger.Request(), Trigger.Response())
        last += PERIOD
        planner._on_state(numbered(last))
        assert recorder.sent[-1][0] == last

    @few
    @given(
        st.lists(
            st.one_of(joint_states(), st.sampled_from(('command', 'command', 'command', 'reset'))),
            max_size=30,
        )
    )
    def test_whatever_the_sim_receives_its_arm_keeps_the_limits(self, sim, events):
        recorder = Recorder(sim, '_state_publisher')
        robot = sim._robot
        before = robot.reference
        for event in events:
            commands = sim._receiver.take()
            sim._publish_state()
            if event == 'reset':
                robot.session.reset()
            elif event == 'command':
                sim._on_command(numbered(recorder.sent[-1][0], robot.reference))
            else:
                sim._on_command(event)
            robot.advance(*commands)
            after = robot.reference
            assert (
                np.abs(after - before) <= LIMITS.velocity * robot.plant.period * (1.0 + 1e-9)
            ).all()
            assert ((LIMITS.lower <= after) & (after <= LIMITS.upper)).all()
            before = after
        assert all(
            map(math.isfinite, (number for _, content in recorder.sent for number in content))
        )
        sim._health()

    @pytest.mark.parametrize('of', ['controller', 'planner', 'sim'])
    def test_each_parameter_is_either_set_to_an_allowed_value_or_refused_with_a_reason(
        self, of, request
    ):
        node = request.getfixturevalue(of)
        for name, kept in sorted(node._parameters.items()):
            for value in VALUES:
                if self._is_set(node, Parameter(name, value=value)):
                    assert node.set_parameters([kept])[0].successful

    @staticmethod
    def _is_set(node: Node, parameter: Parameter) -> bool:
        """Whether a node takes a value, which then is allowed; or refuses it with a reason."""
        name = parameter.name
        value = parameter.value
        before = node._parameters[name]
        [result] = node.set_parameters([parameter])
        if not result.successful:
            assert result.reason
            assert node._parameters[name] == before
            return False
        descriptor = node.describe_parameter(name)
        assert not descriptor.read_only
        for limits in (*descriptor.floating_point_range, *descriptor.integer_range):
            assert limits.from_value <= value <= limits.to_value
        if descriptor.additional_constraints:
            words = [value] if isinstance(value, str) else value
            assert all(word in descriptor.additional_constraints for word in words)
        return True
