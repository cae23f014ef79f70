"""One colour for each law and one axis for each figure, in plots and on the live page."""

# Titles of the live page's axes by the names of columns, and how far each reaches at least.
AXES = {
    'joint_velocity_norm': ('joint velocity, norm [rad/s]', 1.0),
    'joint_acceleration_norm': ('joint acceleration, norm [rad/s²]', 10.0),
    'null_velocity_norm': ('null-space velocity, norm [rad/s]', 1.0),
    'joint_torque_norm': ('joint torque, norm [Nm]', 50.0),
    'task_scaling': ('task scaling s', 1.1),
    'min_singular_value': ('smallest singular value', 0.5),
    'task_error': ('distance from the goal [m]', 0.1),
}

LIMIT_COLOURS = {  # of limits that act, on the live page
    'position': '#d62728',
    'velocity': '#ff7f0e',
    'acceleration': '#9467bd',
    'torque': '#8c564b',
    'collision': '#2ca02c',
}
OTHER_LIMIT = '#444444'
_LAW_COLOURS = {  # distinct for colour-blind readers too; red is left to limits and stops
    'minimum_velocity': '#e69f00',
    'minimum_acceleration': '#0072b2',
    'minimum_kinetic_energy': '#009e73',
    'minimum_weighted_torque': '#cc79a7',
    'dynamically_consistent': '#6a3d9a',
    'minimum_torque': '#56b4e9',
}
_OTHER_LAW = '#525252'  # of plugins


def law_colour(name: str) -> str:
    """The colour of a law, as '#rrggbb'; what follows a comma in its name makes no difference."""
    return _LAW_COLOURS.get(name.partition(',')[0], _OTHER_LAW)
