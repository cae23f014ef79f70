"""The life cycle of the nodes, by the standard services and from within."""

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from graph_helpers import START, Probe, call, nodes, to_joint_state
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from own_ros import ros
from rclpy.lifecycle import TransitionCallbackReturn
from std_srvs.srv import Trigger

from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.sim import SimNode

DX = np.array([0.0, -0.1, 0.0])  # [m/s]


@pytest.fixture(scope='class')
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Probe]:
    logs = tmp_path_factory.mktemp('lifecycle')
    with nodes(logs, controller={'command_timeout': 5.0}) as (probe, _):
        yield probe


def change(probe: Probe, transition: int) -> bool:
    """Whether the controller accepts a transition."""
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(call(probe, ChangeState, 'controller/change_state', request).success)


def life(probe: Probe) -> str:
    """The state of the controller's life cycle."""
    response = call(probe, GetState, 'controller/get_state', GetState.Request())
    return str(response.current_state.label)


@pytest.mark.slow
class TestByServices:
    """A controller in a process of its own."""

    @pytest.fixture
    def probe(self, started: Probe) -> Probe:
        """An active controller that has commanded an arm at rest, whatever the test before did."""
        if life(started) == 'unconfigured':
            assert change(started, Transition.TRANSITION_CONFIGURE)
        if life(started) == 'active':
            assert change(started, Transition.TRANSITION_DEACTIVATE)
        assert change(started, Transition.TRANSITION_ACTIVATE)
        started.ask(START)
        return started

    def speeds_of_responses(self, probe: Probe, states: int) -> list[float]:
        """Largest joint speeds of the responses to so many states of an arm that follows."""
        speeds = []
        for _ in range(states):
            message = probe.state(self.q)
            if not probe.is_responded_to(message):
                break
            response = probe.responses[probe.stamp]
            self.q = np.array(response.position)
            speeds.append(float(np.abs(response.velocity).max()))
        return speeds

    def come_to_rest(self, probe: Probe) -> None:
        """Deactivate the controller, and send it states until it is silent."""
        self.q = START
        assert change(probe, Transition.TRANSITION_DEACTIVATE)
        assert len(self.speeds_of_responses(probe, 1000)) < 1000

    def test_a_node_is_active_from_the_start_and_shut_down_it_never_responds_again(
        self, tmp_path: Path
    ) -> None:
        with nodes(tmp_path, controller={}) as (probe, _):
            assert life(probe) == 'active'
            assert change(probe, Transition.TRANSITION_ACTIVE_SHUTDOWN)
            assert life(probe) == 'finalized'
            assert not change(probe, Transition.TRANSITION_CONFIGURE)

    def test_deactivated_while_it_moves_it_brings_the_arm_to_rest_and_then_is_silent(
        self, probe: Probe
    ) -> None:
        self.q = START
        probe.steer(DX)
        assert max(self.speeds_of_responses(probe, 300)) > 0.05
        assert change(probe, Transition.TRANSITION_DEACTIVATE)
        speeds = self.speeds_of_responses(probe, 1000)
        assert 10 < len(speeds) < 500  # of braking: 0.2 s and more
        assert np.abs(np.diff(speeds)).max() < 0.05
        assert speeds[-1] < 0.01
        assert life(probe) == 'inactive'

    def test_a_transition_that_does_not_suit_is_refused_and_the_node_goes_on(
        self, probe: Probe
    ) -> None:
        assert not change(probe, Transition.TRANSITION_CONFIGURE)
        assert not change(probe, 77)
        assert life(probe) == 'active'

    def test_cleaned_up_it_has_to_be_configured_before_it_can_act_again(self, probe: Probe) -> None:
        self.come_to_rest(probe)
        assert change(probe, Transition.TRANSITION_CLEANUP)
        assert not change(probe, Transition.TRANSITION_ACTIVATE)
        assert change(probe, Transition.TRANSITION_CONFIGURE)
        assert change(probe, Transition.TRANSITION_ACTIVATE)
        q_ref, _ = probe.ask(START)
        assert q_ref == pytest.approx(START, abs=1e-3)


class TestWithin:
    """Nodes in this process."""

    @pytest.fixture
    def start_inactive(self) -> Iterator[None]:
        with ros('--log-level', 'fatal', '-p', 'initial_state:=inactive'):
            yield

    def test_an_inactive_planner_refuses_to_start_and_to_go_to_a_pose(
        self, start_inactive: None
    ) -> None:
        planner = PlannerNode()
        response = planner._on_start(Trigger.Request(), Trigger.Response())
        assert (response.success, 'inactive' in response.message) == (False, True)
        planner._on_target(PoseStamped())
        assert 'inactive' in planner._inputs.reasons
        assert planner.trigger_activate() is TransitionCallbackReturn.SUCCESS
        response = planner._on_start(Trigger.Request(), Trigger.Response())
        assert 'no joint_states' in response.message  # it would begin with a robot

    def test_an_inactive_sim_neither_sends_nor_receives(self, start_inactive: None) -> None:
        sim = SimNode()
        sent = []
        sim._state_publisher = type('Recorder', (), {'publish': sent.append})
        for active in (False, True):
            assert sim.active is active
            sim._publish_state()
            sim._on_command(to_joint_state(1, sim._plant.joint_names, START, START))
            assert bool(sent) is active
            if not active:
                sim.trigger_activate()
        assert not sim._session.commanding


def test_the_sim_of_a_lockstep_run_waits_for_nobody_while_it_is_inactive() -> None:
    with ros('--log-level', 'fatal', '-p', 'lockstep:=true'):
        sim = SimNode()
        sim.trigger_deactivate()
        stopped = threading.Event()
        naps = []

        class Waiting:
            def sleep(self, seconds: float) -> None:
                naps.append(seconds)
                stopped.set()

        sim.run(stopped, Waiting())
    assert len(naps) == 1
    assert sim._robot.tick == 0
