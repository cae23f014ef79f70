"""The laws of the paper by name. A new law is one small class and one line in this table."""

from redres_ros.laws.laws import (
    DynamicallyConsistent,
    Law,
    MinimumAcceleration,
    MinimumKineticEnergy,
    MinimumTorque,
    MinimumVelocity,
    MinimumWeightedTorque,
)
from redres_ros.parameter import Table

LAWS: Table[Law] = Table(
    'law',
    Law,
    minimum_velocity=MinimumVelocity,
    minimum_acceleration=MinimumAcceleration,
    minimum_kinetic_energy=MinimumKineticEnergy,
    minimum_weighted_torque=MinimumWeightedTorque,
    dynamically_consistent=DynamicallyConsistent,
    minimum_torque=MinimumTorque,
)
make_law = LAWS.make
law_name = LAWS.name_of

__all__ = ['LAWS', 'Law', 'law_name', 'make_law']
