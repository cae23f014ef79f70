"""What the arm is to do: a policy, how it is made from names, and the crossfade to another one."""

from redres_ros.policy.crossfade import Crossfade, advanced
from redres_ros.policy.from_names import make_policy
from redres_ros.policy.policy import SCALING, SPEED_LIMIT, Hold, Motion, Policy

__all__ = [
    'SCALING',
    'SPEED_LIMIT',
    'Crossfade',
    'Hold',
    'Motion',
    'Policy',
    'advanced',
    'make_policy',
]
