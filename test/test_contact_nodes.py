"""Contact through the nodes in virtual time: parameters, force at 500 Hz."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from virtual_graph import VirtualRun, virtual_run
from wire_faults import changed, off

from redres_ros import RobotModel
from redres_ros.loop.modes import Mode
from redres_ros.nodes.conversions import to_twist

pytestmark = pytest.mark.slow

MODEL = RobotModel.named('fr3')
X0, R0 = MODEL.tip(np.array(MODEL.arm.start))
FORCE = 20.0  # [N]
ON = {'admittance.enabled': True}


@contextmanager
def table_below(rate: float, **parameters: Any) -> Iterator[VirtualRun]:
    """The nodes with an FR3, 5 mm above a table of 10 kN/m, in command mode; admittance is off."""
    sim = {
        'robot': 'fr3',
        'rate': rate,
        'patience': 0.0,
        'monitor_time': 0.1,
        'contact_shape': 'table',
        'contact_position': (X0 - np.array((0.0, 0.0, 0.005))).tolist(),
    }
    own = {
        'robot': 'fr3',
        'rate': rate,
        'admittance.damping': [1e6, 1e6, 1000.0],
        'admittance.force': [0.0, 0.0, FORCE],
        **parameters,
    }
    with virtual_run(sim=sim, controller=own, planner={'robot': 'fr3', 'rate': rate}) as run:
        run.graph.kept['wrench'] = []
        run.graph.kept['/diagnostics'] = []
        assert run.run_until(lambda: run.commanding, 5.0)
        yield run


def mode(run: VirtualRun) -> Mode:
    return run.nodes['controller']._loop.mode


def force(run: VirtualRun, seconds: float) -> np.ndarray:
    """Size of the force on the tip in the last seconds (N,) [N]."""
    since = run.graph.clock.now - seconds
    wrenches = [message.wrench.force for time, message in run.graph.kept['wrench'] if time > since]
    return np.linalg.norm([(each.x, each.y, each.z) for each in wrenches], axis=1)


def test_pressing_and_sliding_at_500_Hz_keeps_the_force() -> None:
    with table_below(500.0) as run:
        assert run.set('controller', **ON)
        run.run(1.0)
        for _ in range(100):  # 0.1 m at 50 mm/s, said anew every 20 ms
            velocity = to_twist(0, MODEL.base_frame, np.array((0.0, 0.05, 0.0)))
            run.graph.publish('cartesian_velocity', velocity)
            run.run(0.02)
        pressed = force(run, 2.0)
        x, _ = MODEL.tip(run.nodes['sim']._plant.q)
        safety_filter = run.nodes['controller']._loop.safety_filter
    # with friction 0.3 the whole force is sqrt(1 + 0.3^2) times that along the normal
    assert np.sqrt(np.mean((pressed / np.sqrt(1.09) - FORCE) ** 2)) < 0.5
    assert (x - X0)[1] == pytest.approx(0.1, abs=0.01)
    assert safety_filter.count == 0


def test_force_control_that_is_switched_off_in_motion_fades_out_and_the_arm_holds() -> None:
    with table_below(100.0) as run:
        assert run.set('controller', **ON)
        run.run(0.4)
        assert mode(run) is Mode.MOVING  # it searches
        assert run.set('controller', **{'admittance.enabled': False})
        run.run(1.5)
        assert mode(run) is Mode.HOLDING
        held = run.references[-1]
        run.run(0.5)
        np.testing.assert_array_equal(run.references[-1], held)
        steps = np.diff(run.references, 2, axis=0) * 100.0**2
        assert (np.abs(steps) <= np.array(MODEL.arm.acceleration_limit) * (1.0 + 1e-6)).all()
        assert run.nodes['controller']._loop.safety_filter.count == 0


def test_a_tare_takes_off_what_the_sensor_shows_of_itself() -> None:
    with table_below(100.0) as run:
        assert run.set('sim', wrench_fault='bias')
        assert not run.graph.call('controller/tare').success  # nothing has come yet
        run.run(0.5)
        assert run.graph.call('controller/tare').success
        assert run.set('controller', **{**ON, 'admittance.force': [0.0, 0.0, 0.0]})
        run.run(0.5)
        assert mode(run) is Mode.HOLDING
        assert np.abs(run.nodes['controller']._loop.measurements.contact.force).max() < 1e-9


@pytest.mark.parametrize('source', ['topic', 'effort'])
def test_the_elbow_yields_to_torques_of_the_robot(source: str) -> None:
    with table_below(100.0, preferences=['compliance']) as run:
        if source == 'effort':
            run.graph.faults['external_torques', 'controller'] = off()
        run.run(0.5)
        before = run.nodes['sim']._plant.q
        assert run.set('sim', push_link=MODEL.elbow_frame, push_force=[0.0, 30.0, 0.0])
        run.run(1.0)
        after = run.nodes['sim']._plant.q
        assert mode(run) is Mode.MOVING
        run.set('sim', push_force=[0.0, 0.0, 0.0])
        run.run(0.1)
    elbows = [MODEL.position(q, MODEL.elbow_frame) for q in (before, after)]
    assert (elbows[1] - elbows[0])[1] > 0.03
    # at 100 Hz and 100 rad/s the servos give way by some tenths of a millimetre
    assert MODEL.tip(after)[0] == pytest.approx(MODEL.tip(before)[0], abs=2e-3)


def test_a_robot_without_efforts_is_refused_in_words() -> None:
    def without_efforts(message: Any) -> None:
        message.effort = []

    with table_below(100.0, preferences=['compliance']) as run:
        run.graph.faults['external_torques', 'controller'] = off()
        run.graph.faults['joint_states', 'controller'] = changed(without_efforts)
        run.run(0.3)
        said = [line for node, line in run.graph.log if node == 'controller']
        assert run.commanding
    assert any('external_torques refused' in line and '0 values of effort' in line for line in said)
