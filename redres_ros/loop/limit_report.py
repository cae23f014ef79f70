"""What an operator should know of the limits, as the text of controller/active_limits.

`fr3_joint4: position; away -z; s 0.30; translation 0.31; rotation 1.00; also fr3_joint2: velocity`
reads: the fourth joint is at the end of its range, the tip moves away from that along -z, of the
task velocity 30 % can be executed as a whole, of its components what follows, and the second joint
is at its largest velocity, which limits less.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:  # who reads a report needs no compiled formulas
    from redres_ros.command import Command
    from redres_ros.limits import Limit, Limits

_COMPONENTS = ('translation', 'rotation')
_AXES = ('x', 'y', 'z')
_SEPARATOR = '; '
_AWAY = 'away'
_ALSO = 'also'
_S = 's'
_TOUCHING = 1e-6  # [rad/s] from a bound: what is commanded there, is commanded because of it
_SINGULAR = 0.01  # of the largest singular value; along directions below it the tip hardly moves


class LimitReport(NamedTuple):
    """A report on active limits.

    Attributes:
        limit: The most active one as 'joint: limit'; empty if none is active.
        away: The axis along which the tip moves away from that, such as '-z'; empty if unknown.
        scaling: The fraction of the task velocity that is executed, by name: s of the whole, and of
            its components if they are scaled separately.
        others: The other active limits, as 'joint: limit'.
    """

    limit: str
    away: str
    scaling: dict[str, float]
    others: tuple[str, ...] = ()

    @property
    def by_place(self) -> dict[str, set[str]]:
        """Names of the active limits, by joint or pair of bodies."""
        found: dict[str, set[str]] = {}
        for text in filter(None, (self.limit, *self.others)):
            place, _, limit = text.rpartition(': ')
            found.setdefault(place, set()).add(limit)
        return found

    @property
    def least(self) -> float:
        """The smallest fraction of a component, or s; 1 if no limit acts."""
        components = [value for name, value in self.scaling.items() if name != _S]
        return min(components or self.scaling.values(), default=1.0)

    @property
    def text(self) -> str:
        """As it is published; empty if no limit is active."""
        if not self.limit:
            return ''
        parts = [self.limit]
        if self.away:
            parts.append(f'{_AWAY} {self.away}')
        parts += [f'{name} {value:.2f}' for name, value in self.scaling.items()]
        parts += [f'{_ALSO} {other}' for other in self.others]
        return _SEPARATOR.join(parts)


def report(command: 'Command', limits: 'Limits | None') -> LimitReport:
    """The report on a command.

    Args:
        command: The last one.
        limits: Limits in force; None: none.
    """
    scaling = {_S: command.s, **dict(zip(_COMPONENTS, command.component_scaling, strict=False))}
    most = command.active_limits
    others = tuple(each for each in _touched(command, limits) if each != most) if most else ()
    return LimitReport(most, _axis_away(command), scaling, others)


def read(text: str) -> LimitReport:
    """The report in a text; what is not understood is left out."""
    limit, *parts = text.split(_SEPARATOR)
    away = ''
    scaling = {}
    others = []
    for part in parts:
        name, _, value = part.partition(' ')
        if name == _AWAY:
            away = value
        elif name == _ALSO:
            others.append(value)
        elif name in (_S, *_COMPONENTS):
            try:
                scaling[name] = float(value)
            except ValueError:
                continue
    return LimitReport(limit, away, scaling, tuple(others))


def _touched(command: 'Command', limits: 'Limits | None') -> list[str]:
    """Every limit with a bound at which the velocity is, as 'joint: limit'."""
    if not limits:
        return []
    bounds = limits.at(command.state, command.T)
    touched: list[tuple[Limit, int]] = []
    for box_limit, box in zip(limits.box_limits, bounds.boxes[:-1], strict=True):
        touched += [(box_limit, joint) for joint in _at_a_bound(command.dq, *box)]
    for row_limit, (C, low, high) in zip(limits.row_limits, bounds.rows, strict=True):
        touched += [(row_limit, row) for row in _at_a_bound(C @ command.dq, low, high)]
    return [
        f'{limit.place(command.state, index, command.T)}: {limits.names[limit]}'
        for limit, index in touched
    ]


def _at_a_bound(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> list[int]:
    """Indices of the values at or beyond one of their bounds."""
    margin = np.minimum(values - lower, upper - values)
    return np.flatnonzero(margin < _TOUCHING).tolist()


def _axis_away(command: 'Command') -> str:
    """The axis along which the tip leaves the limit."""
    if command.escape is None or len(command.J) < len(_AXES):
        return ''
    # The velocity v of the tip whose least joint motion J^+ v leaves the limit fastest.
    v, *_ = np.linalg.lstsq(command.J.T, command.escape, _SINGULAR)
    direction = v[: len(_AXES)]
    if not direction.any():
        return ''
    axis = int(np.abs(direction).argmax())
    return ('+' if direction[axis] > 0.0 else '-') + _AXES[axis]
