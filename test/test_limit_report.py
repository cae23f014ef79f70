"""What is reported of active limits: which one, the way out, and what is left of the velocity."""

import numpy as np
import pytest

from redres_ros import Controller, RobotModel
from redres_ros.loop.limit_report import LimitReport, read, report

BOX = ('position', 'velocity', 'acceleration')


def at_the_end_of_joint_4(scaling: str):
    """The command of an FR3 that is drawn in along x until its elbow is folded."""
    model = RobotModel.named('fr3')
    limits = {'limits': BOX, 'scaling': scaling}
    controller = Controller(model, 'minimum_velocity', 0.002, task='pose', **limits)
    q = np.array(model.arm.start)
    q[3] = model.q_min[3] + np.radians(0.5)
    dx = model.jacobian(q, model.arm.tip_frame)[:, 3] * -0.2
    return controller.update(q, dx), controller.policy.limits


@pytest.mark.parametrize('scaling', ['task', 'components'])
def test_a_joint_at_its_end_is_named_with_the_axis_that_leads_away(scaling):
    command, limits = at_the_end_of_joint_4(scaling)
    said = report(command, limits)
    assert said.limit == 'fr3_joint4: position'
    upward = np.linalg.pinv(command.J)[3, :3]  # of the joint, for a tip along each axis
    axis = int(np.abs(upward).argmax())
    assert said.away == ('+' if upward[axis] > 0.0 else '-') + 'xyz'[axis]
    assert ('translation' in said.scaling) == (scaling == 'components')


@pytest.mark.parametrize('seed', [2, 8, 48])  # joints would move the tip along z, y and z
def test_a_wall_is_left_along_its_normal_whatever_posture_the_arm_has(seed):
    model = RobotModel.named('fr3')
    arm = model.arm
    q = np.array(arm.start) + np.random.default_rng(seed).uniform(-0.8, 0.8, model.n)
    q = np.clip(q, model.q_min + 0.1, model.q_max - 0.1)
    x, _ = model.tip(q)
    wall = {'workspace.half_spaces': (1.0, 0.0, 0.0, float(x[0]) + 1e-4)}
    limits = {'limits': (*BOX, 'workspace'), 'limit_gains': wall}
    controller = Controller(model, 'minimum_velocity', 0.002, task='pose', **limits)
    command = controller.update(q, np.array((0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    said = report(command, controller.policy.limits)
    assert said.limit.endswith('workspace')
    assert said.away == '-x'


def test_a_text_is_read_as_it_was_written():
    said = LimitReport(
        'fr3_joint4: position',
        '-z',
        {'s': 0.25, 'translation': 0.5, 'rotation': 1.0},
        ('fr3_joint2: velocity', 'a to b: collision'),
    )
    assert said.text == (
        'fr3_joint4: position; away -z; s 0.25; translation 0.50; rotation 1.00; '
        'also fr3_joint2: velocity; also a to b: collision'
    )
    assert read(said.text) == said
    assert said.least == 0.5


@pytest.mark.parametrize('text', ['', ';', 'a; s x; away', 'a; b; c d e', '; s 0.1'])
def test_any_text_can_be_read(text):
    assert 0.0 <= read(text).least <= 1.0


def test_without_an_active_limit_nothing_is_said():
    model = RobotModel.named('fr3')
    controller = Controller(model, 'minimum_velocity', 0.002, limits=BOX)
    command = controller.update(np.array(model.arm.start), np.zeros(3))
    assert report(command, controller.policy.limits).text == ''


def test_every_limit_that_acts_is_reported_beside_the_joint_on_which_it_acts():
    """A motion into several limits; the one that acts most is among those at a bound."""
    model = RobotModel.named('lwr4_paper')
    names = (*BOX, 'torque')
    controller = Controller(model, 'minimum_acceleration', 0.002, limits=names, limit_scale=0.2)
    q = np.array(model.arm.start)
    kinds = set()
    others = 0
    for _ in range(300):
        command = controller.update(q, np.array((0.2, 0.1, -0.3)))
        q = command.q_ref
        said = report(command, controller.policy.limits)
        kinds |= {kind for found in said.by_place.values() for kind in found}
        others += len(said.others)
        for text in said.others:
            joint, _, kind = text.partition(': ')
            index = model.joint_names.index(joint)
            if kind == 'velocity':
                assert abs(command.dq[index]) == pytest.approx(0.2 * model.dq_max[index], abs=1e-5)
    assert {'velocity', 'acceleration'} <= kinds
    assert others
