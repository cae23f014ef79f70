"""The measurement of an arm: encoders, a network, and a start at any time."""

from dataclasses import dataclass, field

import numpy as np

from redres_ros.fake_robot.faults import Faults


@dataclass(frozen=True)
class Sensing:
    """How an experiment sees its arm. By default it sees every position exactly and at once.

    Attributes:
        faults: Of the encoders, which act on the controller too.
        recorded_late: Chance of a joint's position to be that before, in the recording alone: the
            robot's own cycle is not disturbed by its recorder.
        phase: From the first state to the start of the task [cycles].
        seed: Of everything random.
    """

    faults: Faults = field(default_factory=Faults)
    recorded_late: float = 0.0
    phase: float = 0.0
    seed: int = 0


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
    return Sensing(Faults(encoder_step=_STEP, encoder_noise=_NOISE), _LATE, phase, seed)


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
