"""Plants: the ideal one is exact; MuJoCo's follows closely, stands still, and knows its limits."""

from dataclasses import replace

import numpy as np
import pytest
from fake_robot_helpers import Q0
from reference_model import ReferenceModel

from redres_ros.errors import ArrayError, RangeError, RedresError, UnknownNameError
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.geometry import quintic
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm, find_arm

T = 0.002  # [s]
MOVE = np.array([1.0, -0.7, -0.8, -1.0, 0.8, 0.7, 1.0])  # away from the joint limits


def move(plant: MujocoPlant, motion: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """References and measured positions, both (N, 7), of a motion from rest to rest."""
    times = np.arange(1, round(duration / T) + 1) * T
    references = [plant.q + quintic(t / duration)[0] * motion for t in times]
    measured = []
    for reference in references:
        plant.step(reference)
        measured.append(plant.q)
    return np.array(references), np.array(measured)


def test_an_ideal_plant_is_where_its_reference_says():
    plant = IdealPlant(('a', 'b'), T, np.zeros(2))
    q = np.zeros(2)
    for reference in np.random.default_rng(0).normal(size=(100, 2)):
        plant.step(reference)
        assert (plant.q == reference).all()
        assert (plant.dq == (reference - q) / T).all()
        q = reference


@pytest.mark.parametrize('q0', [np.zeros(6), np.zeros((7, 1)), np.full(7, np.nan)])
def test_a_start_of_another_shape_or_not_finite_is_refused(q0):
    with pytest.raises(ArrayError):
        MujocoPlant(find_arm('lwr4'), T, q0)
    with pytest.raises(ArrayError):
        IdealPlant(tuple('abcdefg'), T, q0)


def test_a_start_beyond_a_limit_is_refused_by_name():
    with pytest.raises(RangeError, match='lwr_a2_joint'):
        MujocoPlant(find_arm('lwr4'), T, np.array([0.0, 2.2, 0.0, 0.0, 0.0, 0.0, 0.0]))


def test_no_mode_of_the_servos_is_underdamped():
    arm = find_arm('lwr4')
    reference = ReferenceModel(find_arm('lwr4'))
    # With k = D w^2 and d = 2 D w every mode is overdamped or critically damped where D - M is
    # positive semidefinite.
    D = np.diag(MujocoPlant(arm, T, Q0)._model.actuator_gainprm[:7, 0]) / 100.0**2
    for q in np.random.default_rng(6).uniform(-2.0, 2.0, (200, 7)):
        assert np.linalg.eigvalsh(D - reference.dynamics(q, q)[0])[0] >= 0.0


def test_the_tip_lags_less_than_ten_micrometres_at_half_a_metre_per_second():
    arm = find_arm('lwr4')
    reference = ReferenceModel(arm)
    references, measured = move(MujocoPlant(arm, T, Q0), 0.9 * MOVE, duration=3.0)
    desired = np.array([reference.kinematics(q)[0] for q in references])
    reached = np.array([reference.kinematics(q)[0] for q in measured])
    assert np.linalg.norm(np.diff(desired, axis=0), axis=1).max() / T > 0.5
    assert np.linalg.norm(desired - reached, axis=1).max() < 1e-5  # 90 um without feed-forward


def test_no_joint_gets_more_torque_than_its_effort_limit():
    plant = MujocoPlant(find_arm('lwr4'), T, np.zeros(7))
    plant.step(np.eye(7)[6])  # a jump by 1 rad; the servo alone would respond with 4000 Nm
    # 38 Nm on at least the rotor's 0.399 kg m^2, for one cycle
    assert 0.05 < plant.dq[6] <= 38.0 / 0.399 * T


def test_the_arm_stays_within_its_joint_limits():
    plant = MujocoPlant(find_arm('lwr4'), T, np.zeros(7))
    upper = np.radians(120.0)
    for k in range(1000):
        plant.step(min(k / 500, 1.0) * (upper + 0.2) * np.eye(7)[5])
    # MuJoCo's limits yield a little under 38 Nm
    assert plant.q[5] == pytest.approx(upper, abs=np.radians(0.1))


def test_a_cycle_is_a_whole_number_of_plant_steps_or_an_error_that_names_both():
    for rate in (2000.0, 10.0):
        MujocoPlant(find_arm('lwr4'), 1.0 / rate, Q0).step(Q0)
    for rate in (300.0, 3000.0):
        with pytest.raises(RedresError, match=rf'rate {rate} Hz .* plant steps of 0\.5 ms'):
            MujocoPlant(find_arm('lwr4'), 1.0 / rate, Q0)


ONE_LINK = """<robot name="one">
  <link name="base"><visual><geometry><mesh filename="package://nowhere/a.dae"/></geometry></visual></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="l"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="1" effort="9"/></joint>
  <link name="l"><inertial><origin xyz="0 0 0.5"/><mass value="2"/>
    <inertia ixx="0.3" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="package://nowhere/b.stl"/></geometry></collision></link>
  <joint name="f" type="fixed"><parent link="l"/><child link="tip"/><origin xyz="0 0 1"/></joint>
  <link name="tip"/>
</robot>"""


def test_holding_its_weight_takes_part_of_a_joints_effort(tmp_path):
    horizontal = np.array([np.pi / 2])  # needs 9.81 Nm
    for effort, falls in (('9', True), ('10', False)):
        (tmp_path / 'one.urdf').write_text(ONE_LINK.replace('effort="9"', f'effort="{effort}"'))
        plant = MujocoPlant(Arm(tmp_path / 'one.urdf', 'tip'), T, horizontal)
        for _ in range(250):
            plant.step(horizontal)
        assert (plant.q[0] > horizontal[0] + 0.01) == falls


def test_a_plant_without_its_tip_frame_is_an_error():
    with pytest.raises(UnknownNameError, match='gripper'):
        MujocoPlant(replace(find_arm('lwr4'), tip_frame='gripper'), T, Q0)


# one without mass, one with its centre of mass elsewhere
@pytest.mark.parametrize('tip_frame', ['tool0', 'link_7'])
def test_a_push_at_the_tip_is_carried_by_the_stiffness_of_the_servos(tip_frame):
    arm = replace(find_arm('lwr4'), tip_frame=tip_frame)
    plant = MujocoPlant(arm, T, Q0)
    force = np.array((5.0, 10.0, 15.0))
    for _ in range(500):
        plant.push(force)
        plant.step(Q0)
    q = plant.q
    J = ReferenceModel(arm).kinematics(q)[2][:3]
    stiffness = plant._model.actuator_gainprm[:7, 0]
    assert np.abs(q - Q0).max() > 1e-5
    # [Nm]: gravity is compensated
    assert stiffness * (q - Q0) == pytest.approx(J.T @ force, abs=1e-6)


def test_the_force_on_the_tip_is_reported_along_the_axes_of_the_tip() -> None:
    arm = find_arm('lwr4')
    plant = MujocoPlant(arm, T, Q0)
    force = np.array([1.0, -2.0, 3.0])
    plant.push(force)
    _, R = RobotModel(arm).tip(Q0)
    assert plant.wrench[:3] == pytest.approx(R.T @ force, abs=1e-9)
    assert plant.wrench[3:] == pytest.approx(np.zeros(3), abs=1e-9)
    assert not IdealPlant(plant.joint_names, T, Q0).wrench.any()
