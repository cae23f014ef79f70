"""Causes for which a robot controller ends command mode."""

from collections.abc import Mapping
from enum import Enum


class Reflex(Enum):
    """Causes of a stop. Each profile has its own names for them; a stop reason begins with one."""

    TIMING = 'commands are missing or come too late'
    START_POSE = 'the first command is not where the arm is'
    POSITION = 'a commanded position is outside its limits'
    BRAKING = 'at the commanded velocity the joint can no longer stop before its limit'
    VELOCITY = 'a commanded velocity is above its limit'
    ACCELERATION = 'the commanded velocity changes too fast'
    JERK = 'the commanded acceleration changes too fast'


# Words of ours, as KUKA's are not public.
KUKA_NAMES: Mapping[Reflex, str] = {
    Reflex.TIMING: 'timing',
    Reflex.START_POSE: 'interpolation error',
    Reflex.POSITION: 'position limit',
    Reflex.BRAKING: 'position limit',
    Reflex.VELOCITY: 'velocity limit',
    Reflex.ACCELERATION: 'protective stop',
    Reflex.JERK: 'protective stop',
}
