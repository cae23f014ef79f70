"""The preferences by name. A new preference is one small class and one line in this table."""

from redres_ros.parameter import Table
from redres_ros.preferences.preferences import (
    Compliance,
    ElbowHeight,
    JointCentering,
    JointLimitAvoidance,
    Manipulability,
    Posture,
    Preference,
)

PREFERENCES: Table[Preference] = Table(
    'preference',
    Preference,
    joint_centering=JointCentering,
    joint_limit_avoidance=JointLimitAvoidance,
    posture=Posture,
    manipulability=Manipulability,
    elbow_height=ElbowHeight,
    compliance=Compliance,
)
make_preference = PREFERENCES.make

__all__ = [
    'PREFERENCES',
    'Compliance',
    'ElbowHeight',
    'JointCentering',
    'JointLimitAvoidance',
    'Manipulability',
    'Posture',
    'Preference',
    'make_preference',
]
