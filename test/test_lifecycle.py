"""The life cycle of the nodes: by the services, in virtual time, and from within."""

import threading
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from graph_helpers import START
from lifecycle_msgs.msg import Transition
from own_ros import ros
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import JointState
from virtual_graph import VirtualRun, virtual_run

from redres_ros.nodes.conversions import to_joint_state, to_twist
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.sim import SimNode

DX = np.array([0.0, -0.1, 0.0])  # [m/s]


@pytest.fixture
def commanded() -> Iterator[VirtualRun]:
    """A robot in command mode whose tip moves, and the commands for it."""
    with virtual_run(controller={'command_timeout': 5.0}) as run:
        run.graph.kept['joint_command'] = []
        run.run(0.5)
        assert run.commanding
        run.graph.publish('cartesian_velocity', to_twist(0, 'world', DX))
        run.run(0.5)
        assert speeds(run)[-1] > 0.05
        yield run


def change(run: VirtualRun, transition: str) -> bool:
    """Whether the controller accepts a transition."""
    return run.change_state('controller', getattr(Transition, f'TRANSITION_{transition}'))


def speeds(run: VirtualRun) -> list[float]:
    """Largest joint speeds of the commands since the last call [rad/s]."""
    published = [message for _, message in run.graph.kept['joint_command']]
    run.graph.kept['joint_command'].clear()
    return [float(np.abs(message.velocity).max()) for message in published]


@pytest.mark.slow
def test_deactivated_while_it_moves_it_brings_the_arm_to_rest_and_then_is_silent(
    commanded: VirtualRun,
) -> None:
    assert change(commanded, 'DEACTIVATE')
    assert not change(commanded, 'CLEANUP')  # it still moves
    commanded.run(1.0)
    braking = speeds(commanded)
    assert 3 < len(braking) < 90
    assert np.abs(np.diff(braking)).max() < 0.25
    assert braking[-1] < 0.01
    commanded.run(1.0)
    assert speeds(commanded) == []
    assert commanded.nodes['controller'].life == 'inactive'


@pytest.mark.slow
def test_cleaned_up_it_has_to_be_configured_before_it_can_act_again(commanded: VirtualRun) -> None:
    assert change(commanded, 'DEACTIVATE')
    commanded.run(2.0)
    assert change(commanded, 'CLEANUP')
    assert not change(commanded, 'ACTIVATE')
    commanded.run(0.5)
    speeds(commanded)
    assert change(commanded, 'CONFIGURE')
    assert change(commanded, 'ACTIVATE')
    commanded.run(0.5)
    assert speeds(commanded)


@pytest.mark.slow
def test_a_transition_that_does_not_suit_is_refused_and_shut_down_it_never_acts_again(
    commanded: VirtualRun,
) -> None:
    assert not change(commanded, 'CONFIGURE')
    assert not commanded.change_state('controller', 77)
    assert commanded.nodes['controller'].life == 'active'
    assert change(commanded, 'ACTIVE_SHUTDOWN')
    commanded.run(2.0)
    speeds(commanded)
    assert not change(commanded, 'CONFIGURE')
    commanded.run(0.5)
    assert speeds(commanded) == []
    assert commanded.nodes['controller'].life == 'finalized'


@pytest.fixture
def start_inactive() -> Iterator[None]:
    with ros('--log-level', 'fatal', '-p', 'initial_state:=inactive'):
        yield


def test_an_inactive_planner_refuses_to_start_and_to_go_to_a_pose(start_inactive: None) -> None:
    planner = PlannerNode()
    response = planner._respond('planner/start', planner._start_task)
    assert (response.success, 'inactive' in response.message) == (False, True)
    planner._on_target(PoseStamped())
    assert 'inactive' in planner._diagnostics._bad['target_pose'].problem
    assert planner.trigger_activate() is TransitionCallbackReturn.SUCCESS
    response = planner._respond('planner/start', planner._start_task)
    assert response.success  # it begins with the robot's first state


def test_an_inactive_sim_neither_sends_nor_receives(start_inactive: None) -> None:
    sim = SimNode()
    sent = []
    sim._state_publisher = SimpleNamespace(publish=sent.append)
    for active in (False, True):
        assert sim.active is active
        sim._publish_state()
        sim._on_command(to_joint_state(1, sim._plant.joint_names, START, START))
        assert bool(sent) is active
        if not active:
            sim.trigger_activate()
    assert not sim._session.commanding


@pytest.mark.parametrize('lost', ['state_loss', 'command_loss'])
def test_the_sim_loses_what_its_fault_says(lost: str) -> None:
    with ros('--log-level', 'fatal', '-p', f'{lost}:=1.0'):
        sim = SimNode()
    for network, fault in ((sim._states, 'state_loss'), (sim._receiver.network, 'command_loss')):
        network.send(JointState(), 0)
        assert bool(network.receive(0)) is (fault != lost)


def test_the_sim_of_a_lockstep_run_waits_for_nobody_while_it_is_inactive() -> None:
    with ros('--log-level', 'fatal', '-p', 'lockstep:=true'):
        sim = SimNode()
        sim.trigger_deactivate()
        stopped = threading.Event()
        sim.run(stopped, SimpleNamespace(wait=lambda seconds: stopped.set()))
    assert stopped.is_set()  # it came to sleep
    assert sim._robot.tick == 0
