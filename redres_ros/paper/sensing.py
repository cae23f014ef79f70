"""The measurement of an arm: encoders, a network, and a start at any time."""

from dataclasses import dataclass

import numpy as np

from redres_ros.fake_robot.faults import Faults
from redres_ros.parameter import check_parameters, param


@dataclass(frozen=True)
class Sensing:
    """How an experiment sees its arm. By default it sees every position exactly and at once.

    The encoders' figures act on the controller too. A position that is recorded late does not: the
    robot's own cycle is not disturbed by its recorder.
    """

    encoder_step: float = param(0.0, 'resolution of measured positions; 0: exact [rad]', 0.0, 0.1)
    encoder_noise: float = param(0.0, 'standard deviation of positions [rad]', 0.0, 0.1)
    recorded_late: float = param(0.0, "chance of a joint's position to be that before", 0.0, 1.0)
    phase: float = param(0.0, 'from the first state to the start of the task [cycles]', 0.0, 1.0)
    seed: int = param(0, 'of everything random', 0, 2**31 - 1)

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def faults(self) -> Faults:
        """What the encoders do to the arm's positions."""
        return Faults(encoder_step=self.encoder_step, encoder_noise=self.encoder_noise)


# An assumption: KUKA publishes neither. FRI sends positions as numbers of 32 bits, whose last digit
# is 2.4e-7 rad beyond 2 rad.
_STEP = 2.4e-7
_NOISE = 1e-5
_LATE = 0.05


def as_in_the_paper(seed: int) -> Sensing:
    """Encoders and a recorder like those of Section 6, and a start between two states.

    The paper names rounding, experiments that are not synchronised, and ROS, which does not
    guarantee that all joint positions are taken at the same time.

    Args:
        seed: Of the noise and of the start; each experiment has one of its own.
    """
    phase = float(np.random.default_rng(seed).uniform())
    return Sensing(_STEP, _NOISE, _LATE, phase, seed)


class Recorder:
    """Records joint positions, one row a cycle, some of them a cycle late.

    Args:
        sensing: Says how many.
    """

    def __init__(self, sensing: Sensing) -> None:
        self._late = sensing.recorded_late
        self._random = np.random.default_rng((sensing.seed, 1))  # not that of the encoders
        self._rows: list[np.ndarray] = []  # (n,) [rad] each
        self._last: np.ndarray | None = None  # (n,) [rad]

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, q: np.ndarray) -> None:
        """Record joint positions q (n,) [rad]."""
        row = q.copy()
        if self._late and self._last is not None:
            late = self._random.random(len(q)) < self._late
            row[late] = self._last[late]
        self._rows.append(row)
        self._last = q.copy()

    @property
    def positions(self) -> np.ndarray:
        """All rows, (N, n) [rad]."""
        return np.array(self._rows)
