"""Faults to inject into the fake robot: on the way of messages, in the encoders, at the arm, in its
force sensor.
"""

from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from redres_ros.fake_robot.network_model import Link
from redres_ros.parameter import check_parameters, param

LONGEST = 1000  # cycles
PUSHES = ('push_force_x', 'push_force_y', 'push_force_z')
_live = partial(param, live=True)
_fraction = partial(_live, 0.0, lower=0.0, upper=1.0)
_cycles = partial(_live, 0, lower=0, upper=LONGEST)
_burst = partial(_live, 1, lower=1, upper=10000)
_force = partial(_live, 0.0, lower=-500.0, upper=500.0)
_NOISE = np.repeat((1.0, 0.1), 3)  # of forces and moments


@dataclass(frozen=True)
class Faults:
    """Every fault as a parameter that can be set while it runs. By default all is well."""

    state_delay: int = _cycles('delay of states to the client [cycles]')
    state_delay_spread: int = _cycles('random delay of states, at most [cycles]')
    state_loss: float = _fraction('fraction of the states that are lost')
    state_loss_burst: int = _burst('states lost in a row each time')
    state_duplication: float = _fraction('fraction of the states that arrive twice')
    state_reordering: float = _fraction('probability that a state arrives after the next one')
    command_delay: int = _cycles('delay of commands to the robot [cycles]')
    command_delay_spread: int = _cycles('random delay of commands, at most [cycles]')
    command_loss: float = _fraction('fraction of the commands that are lost')
    command_loss_burst: int = _burst('commands lost in a row each time')
    command_duplication: float = _fraction('fraction of the commands that arrive twice')
    command_reordering: float = _fraction('probability that a command arrives after the next one')
    encoder_step: float = _live(0.0, 'resolution of measured positions; 0: exact [rad]', 0.0, 0.1)
    encoder_noise: float = _live(0.0, 'standard deviation of measured positions [rad]', 0.0, 0.1)
    frozen_joint: int = _live(
        0, 'joint whose encoder is frozen, 1 next to the base; 0: none', 0, 100
    )
    push_force_x: float = _force('force on the tip along x of the base [N]')
    push_force_y: float = _force('force on the tip along y of the base [N]')
    push_force_z: float = _force('force on the tip along z of the base [N]')
    push_link: str = _live('', 'link on whose origin these forces act; empty: the tip')
    push_time: float = _live(
        0.0, 'how long a push lasts unless it is set again; 0: until it is set to 0 [s]', 0.0, 1e3
    )
    wrench_delay: int = _cycles('delay of the measured wrench [cycles]')
    wrench_loss: float = _fraction('fraction of the wrenches that are lost')
    wrench_noise: float = _live(
        0.0, 'standard deviation of measured forces [N]; of moments a tenth of it [Nm]', 0.0, 100.0
    )
    wrench_bias: float = _force("offset of measured forces along the tip's z [N]")
    wrench_range: float = _live(
        0.0, 'largest force and moment that the sensor measures; 0: no bound [N], [Nm]', 0.0, 1e4
    )
    wrench_not_finite: bool = _live(False, 'measured forces are NaN')
    paused_physics: bool = _live(False, 'the arm ignores every command')

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def states(self) -> Link:
        """Faults of the link that carries states to the client."""
        return self._link('state')

    @property
    def commands(self) -> Link:
        """Faults of the link that carries commands to the robot."""
        return self._link('command')

    @property
    def wrenches(self) -> Link:
        """Faults of the link that carries measured wrenches."""
        return Link(delay=self.wrench_delay, loss=self.wrench_loss)

    def measured(self, wrench: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """What a sensor with these faults shows of force and moment on the tip, (6,).

        Args:
            wrench: (6,) [N], [Nm].
            random: Random generator of the noise.
        """
        if self.wrench_not_finite:
            return np.full(6, np.nan)
        shown = wrench.copy()
        shown[2] += self.wrench_bias
        if self.wrench_noise:
            shown += self.wrench_noise * random.normal(size=6) * _NOISE
        if self.wrench_range:
            shown = np.clip(shown, -self.wrench_range, self.wrench_range)
        return shown

    @property
    def push_force(self) -> np.ndarray:
        """Force on `push_link`, (3,) [N], in the base frame."""
        return np.array([getattr(self, name) for name in PUSHES])

    def _link(self, of: str) -> Link:
        return Link(**{field.name: getattr(self, f'{of}_{field.name}') for field in fields(Link)})
