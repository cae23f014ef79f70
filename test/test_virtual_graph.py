"""How the arm moves when messages are late or missing: the real nodes, in virtual time."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from virtual_graph import Fault, virtual_run

pytestmark = pytest.mark.slow

RATE = 500.0  # [Hz]
SECONDS = 4.5


def late(*, most: int, share: float, seed: int = 0) -> Fault:
    """A share of the messages comes so many cycles late, at most."""
    chance = np.random.default_rng(seed)

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        cycles = chance.uniform(0.0, most) if chance.random() < share else 0.0
        return [(cycles / RATE, message)]

    return fault


def held_up(*, every: float, length: float) -> Fault:
    """Now and then nothing comes for a time [s], and then all of it at once."""

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        into = now % every
        return [(max(length - into, 0.0), message)]

    return fault


def accelerations(limits: str, **faults: Fault) -> np.ndarray:
    """Of the robot's reference over the first side of the rectangle and a half, (N, 7) [rad/s^2].

    Args:
        limits: Of the controller.
        faults: On cartesian_velocity, by the name twist, and on joint_states, by the name state.
    """
    loop = {'rate': RATE}
    sim = {**loop, 'patience': 0.0, 'plant': 'ideal', 'monitor_time': 0.1}
    controller = {**loop, 'limits': limits}
    with virtual_run(sim=sim, controller=controller, planner={**loop, 'autostart': True}) as run:
        for name, fault in faults.items():
            topic = {'twist': 'cartesian_velocity', 'state': 'joint_states'}[name]
            run.graph.faults[topic, 'controller'] = fault
        robot = run.nodes['sim']._robot
        advance = robot.advance
        references = []

        def advance_and_keep(*answers: Any) -> None:
            advance(*answers)
            references.append(robot.reference)

        robot.advance = advance_and_keep
        run.run(SECONDS)
        assert run.commanding
        assert run.nodes['sim']._session.reason == ''
    return np.diff(references, 2, axis=0) * RATE**2


def peak(changes: np.ndarray) -> float:
    """The largest norm."""
    return float(np.linalg.norm(changes, axis=1).max())


@pytest.fixture(scope='module')
def undisturbed() -> float:
    """The peak without faults."""
    return peak(accelerations('none'))


@pytest.mark.parametrize(
    'fault',
    [
        late(most=6, share=1.0),
        late(most=12, share=0.2),
        held_up(every=0.5, length=0.04),
        held_up(every=0.9, length=0.08),
    ],
    ids=['all up to 6 cycles', 'a fifth up to 12', '20 cycles', '40 cycles'],
)
def test_late_task_velocities_hardly_show_without_patience(
    undisturbed: float, fault: Fault
) -> None:
    assert peak(accelerations('none', twist=fault)) < 1.3 * undisturbed


@pytest.mark.parametrize('missed', [1, 4])
def test_after_missed_states_the_velocity_makes_up_for_those_cycles_and_for_nothing_else(
    undisturbed: float, missed: int
) -> None:
    count = 0

    def lost(message: Any, now: float) -> list[tuple[float, Any]]:
        nonlocal count
        count += 1
        return [] if count % 250 < missed else [(0.0, message)]

    # The robot extrapolates, and the next reference lies on that line: only the change of velocity
    # of the missed cycles and of this one comes at once. A step by the gap would be 100 times that.
    assert peak(accelerations('none', state=lost)) < 1.1 * (missed + 1) * undisturbed
