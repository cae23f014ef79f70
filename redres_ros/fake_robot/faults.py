"""Faults to be put into the fake robot: on the way of messages, in the encoders, at the arm."""

from dataclasses import dataclass, fields

import numpy as np

from redres_ros.fake_robot.network_model import Link
from redres_ros.parameter import check_parameters, param

LONGEST = 1000  # cycles


@dataclass(frozen=True)
class Faults:
    """Every fault as a parameter that can be set while it runs. By default all is well."""

    state_delay: int = param(
        0, 'delay of states on their way to the client [cycles]', 0, LONGEST, live=True
    )
    state_delay_spread: int = param(
        0, 'random delay of states, at most [cycles]', 0, LONGEST, live=True
    )
    state_loss: float = param(0.0, 'fraction of the states that are lost', 0.0, 1.0, live=True)
    state_loss_burst: int = param(1, 'states lost in a row each time', 1, 10000, live=True)
    state_duplication: float = param(
        0.0, 'fraction of the states that arrive twice', 0.0, 1.0, live=True
    )
    state_reordering: float = param(
        0.0, 'chance of a state to arrive after the next one', 0.0, 1.0, live=True
    )
    command_delay: int = param(
        0, 'delay of commands on their way to the robot [cycles]', 0, LONGEST, live=True
    )
    command_delay_spread: int = param(
        0, 'random delay of commands, at most [cycles]', 0, LONGEST, live=True
    )
    command_loss: float = param(0.0, 'fraction of the commands that are lost', 0.0, 1.0, live=True)
    command_loss_burst: int = param(1, 'commands lost in a row each time', 1, 10000, live=True)
    command_duplication: float = param(
        0.0, 'fraction of the commands that arrive twice', 0.0, 1.0, live=True
    )
    command_reordering: float = param(
        0.0, 'chance of a command to arrive after the next one', 0.0, 1.0, live=True
    )
    encoder_step: float = param(
        0.0, 'resolution of measured positions; 0: exact [rad]', 0.0, 0.1, live=True
    )
    encoder_noise: float = param(
        0.0, 'standard deviation of measured positions [rad]', 0.0, 0.1, live=True
    )
    frozen_joint: int = param(
        0, 'joint whose encoder stands still, 1 next to the base; 0: none', 0, 100, live=True
    )
    push_force_x: float = param(
        0.0, 'force on the tip along x of the base [N]', -500.0, 500.0, live=True
    )
    push_force_y: float = param(
        0.0, 'force on the tip along y of the base [N]', -500.0, 500.0, live=True
    )
    push_force_z: float = param(
        0.0, 'force on the tip along z of the base [N]', -500.0, 500.0, live=True
    )
    paused_physics: bool = param(False, 'the arm ignores every command', live=True)

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def states(self) -> Link:
        """What happens to states on their way to the client."""
        return self._link('state')

    @property
    def commands(self) -> Link:
        """What happens to commands on their way to the robot."""
        return self._link('command')

    @property
    def push_force(self) -> np.ndarray:
        """Force at the tip, (3,) [N], in the base frame."""
        return np.array([self.push_force_x, self.push_force_y, self.push_force_z])

    def _link(self, of: str) -> Link:
        return Link(**{field.name: getattr(self, f'{of}_{field.name}') for field in fields(Link)})
