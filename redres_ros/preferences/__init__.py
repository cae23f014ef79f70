"""The preferences by name. A new preference is one small class and one line in this table."""

from redres_ros.files.installed import installed
from redres_ros.files.plugins import register
from redres_ros.parameter import make
from redres_ros.preferences.preference import Preference
from redres_ros.preferences.preferences import (
    Compliance,
    ElbowHeight,
    JointCentering,
    JointLimitAvoidance,
    Manipulability,
    Posture,
)

PREFERENCES: dict[str, type[Preference]] = {
    'joint_centering': JointCentering,
    'joint_limit_avoidance': JointLimitAvoidance,
    'posture': Posture,
    'manipulability': Manipulability,
    'elbow_height': ElbowHeight,
    'compliance': Compliance,
}
PREFERENCES.update(installed('preferences'))
register(Preference, PREFERENCES)


def make_preference(name: str, **gains: object) -> Preference:
    """The preference of that name with the given gains.

    Args:
        name: In the table PREFERENCES.
        **gains: Those that differ from their defaults, as gain=4.0.

    Raises:
        UnknownNameError: No preference has that name.
        RangeError: A gain is outside its range.
        ArrayError: A gain is no vector of finite numbers, where one is expected.
    """
    return make('preference', PREFERENCES, name, gains)


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
