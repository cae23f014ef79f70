"""What an operator should know of the limits, as the text of controller/active_limits.

`fr3_joint4: position; away -z; s 0.30; translation 0.31; rotation 1.00` reads: the fourth joint is
at the end of its range, the tip moves away from that along -z, and of the task velocity 30 % can be
executed as a whole, of its components what follows.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:  # who reads a report needs no compiled formulas
    from redres_ros.command import Command

_COMPONENTS = ('translation', 'rotation')
_AXES = ('x', 'y', 'z')
_SEPARATOR = '; '
_AWAY = 'away'
_S = 's'
_SINGULAR = 0.01  # of the largest singular value; along directions below it the tip hardly moves


class LimitReport(NamedTuple):
    """A report on active limits.

    Attributes:
        limit: The most active one as 'joint: limit'; empty if none is active.
        away: The axis along which the tip moves away from that, such as '-z'; empty if unknown.
        scaling: The fraction of the task velocity that is executed, by name: s of the whole, and of
            its components if they are scaled separately.
    """

    limit: str
    away: str
    scaling: dict[str, float]

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
        return _SEPARATOR.join(parts)


def report(command: 'Command') -> LimitReport:
    """The report on a command."""
    scaling = {_S: command.s, **dict(zip(_COMPONENTS, command.component_scaling, strict=False))}
    return LimitReport(command.active_limits, _axis_away(command), scaling)


def read(text: str) -> LimitReport:
    """The report in a text; what is not understood is left out."""
    limit, *parts = text.split(_SEPARATOR)
    away = ''
    scaling = {}
    for part in parts:
        name, _, value = part.partition(' ')
        if name == _AWAY:
            away = value
        elif name in (_S, *_COMPONENTS):
            try:
                scaling[name] = float(value)
            except ValueError:
                continue
    return LimitReport(limit, away, scaling)


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
