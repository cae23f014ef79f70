"""The speed of a path: braked early where limits act, and resumed slowly."""

FALL = 2.0  # [1/s] at which the speed falls, at most
RESUME = 4.0  # [1/s^2] at which its rate rises once limits no longer act

_ROUNDING = 1e-9  # of the task scaling


class PathSpeed:
    """The speed at which a path is asked for, as a fraction of the nominal one.

    If limits leave a fraction s < 1 of the task velocity, the largest s in every tick uses up the
    null space: joints reverse at full acceleration for the sake of the next moment. A path that is
    asked for at the speed last executed, and gets faster again with a limited acceleration, leaves
    the law a null space in which joints calm down. A sudden s, of a few ticks, changes little.

    Args:
        fraction: To begin with; below 1 it rises at once: no limit has acted.
        greedy: Always the nominal speed.
    """

    def __init__(self, fraction: float = 1.0, greedy: bool = False) -> None:
        self.fraction = 1.0 if greedy else fraction
        self._rate = FALL if self.fraction < 1.0 else 0.0  # [1/s] at which it rises
        self._greedy = greedy

    def advance(self, s: float, seconds: float) -> None:
        """Some time later.

        Args:
            s: Fraction of the task velocity that was executed.
            seconds: [s].
        """
        if self._greedy:
            return
        if s < 1.0 - _ROUNDING:
            self._rate = 0.0
            self.fraction = max(s * self.fraction, self.fraction - FALL * seconds, 0.0)
        else:
            self._rate += RESUME * seconds
            self.fraction = min(self.fraction + self._rate * seconds, 1.0)
        if self.fraction == 1.0:
            self._rate = 0.0
