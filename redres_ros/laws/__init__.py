"""The laws of the paper by name. A new law is one small class and one line in this table."""

from redres_ros.files.installed import installed
from redres_ros.files.plugins import register
from redres_ros.laws.law import Law
from redres_ros.laws.laws import (
    DynamicallyConsistent,
    MinimumAcceleration,
    MinimumKineticEnergy,
    MinimumTorque,
    MinimumVelocity,
    MinimumWeightedTorque,
)
from redres_ros.parameter import make, name_of

LAWS: dict[str, type[Law]] = {
    'minimum_velocity': MinimumVelocity,
    'minimum_acceleration': MinimumAcceleration,
    'minimum_kinetic_energy': MinimumKineticEnergy,
    'minimum_weighted_torque': MinimumWeightedTorque,
    'dynamically_consistent': DynamicallyConsistent,
    'minimum_torque': MinimumTorque,
}
LAWS.update(installed('laws'))
register(Law, LAWS)


def make_law(name: str, **gains: float) -> Law:
    """The law of that name with the given gains.

    Args:
        name: In the table LAWS.
        **gains: Those that differ from their defaults, as damping=10.0.

    Raises:
        UnknownNameError: No law has that name.
        RangeError: A gain is outside its range.
    """
    return make('law', LAWS, name, gains)


def law_name(law: Law) -> str:
    """The law's name in the table; the class name for one that is not in it."""
    return name_of(law, LAWS)


__all__ = ['LAWS', 'Law', 'law_name', 'make_law']
