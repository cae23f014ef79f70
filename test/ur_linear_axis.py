"""The URDF of a UR10e on a linear axis, as a workcell would publish it; inertias are rough."""

import math

_TURN = math.tau
_HALF = math.pi / 2.0
# joint, kind, axis, origin [m], roll pitch yaw, range [rad], velocity, effort, mass of link [kg]
_JOINTS = (
    ('linear_axis_joint', 'prismatic', '0 1 0', '0 0 0.5', '0 0 0', 1.5, 0.5, 5000.0, 40.0),
    ('shoulder_pan_joint', 'revolute', '0 0 1', '0 0 0.1807', '0 0 0', _TURN, 2.094, 330.0, 7.8),
    ('shoulder_lift_joint', 'revolute', '0 0 1', '0 0 0', f'{_HALF} 0 0', _TURN, 2.094, 330.0, 13),
    ('elbow_joint', 'revolute', '0 0 1', '-0.6127 0 0', '0 0 0', math.pi, 3.142, 150.0, 4.0),
    ('wrist_1_joint', 'revolute', '0 0 1', '-0.5716 0 0.1742', '0 0 0', _TURN, 3.142, 56.0, 2.1),
    ('wrist_2_joint', 'revolute', '0 0 1', '0 -0.1199 0', f'{_HALF} 0 0', _TURN, 3.142, 56.0, 2.0),
    ('wrist_3_joint', 'revolute', '0 0 1', '0 0.1166 0', f'-{_HALF} 0 0', _TURN, 3.142, 56.0, 0.6),
)


def ur_linear_axis() -> str:
    """The URDF."""
    parts = ['<robot name="ur10e_on_axis"><link name="world"/>']
    parent = 'world'
    for name, kind, axis, xyz, rpy, end, velocity, effort, mass in _JOINTS:
        child = 'tool0' if name == 'wrist_3_joint' else name.replace('_joint', '_link')
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<limit lower="{-end}" upper="{end}" velocity="{velocity}" effort="{effort}"/></joint>'
            f'<link name="{child}"><inertial><mass value="{mass}"/>'
            '<inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        parent = child
    return ''.join([*parts, '</robot>'])
