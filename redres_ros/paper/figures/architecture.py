"""Figure 1: the two levels of control, with the nodes of this package in them."""

from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from redres_ros.paper.runs import Runs

_LINE = '0.25'
_ARROW: dict[str, Any] = {
    'arrowstyle': '-|>',
    'color': _LINE,
    'lw': 1.6,
    'shrinkA': 0,
    'shrinkB': 0,
}
_ROW = 3.0  # height of the boxes' middles, in the units of the axes
_HALF = 0.75  # of a box's height
_RETURN = 1.1  # height of the line of measured positions


class _Box(NamedTuple):
    """A box from left to right, in the units of the axes."""

    left: float
    right: float
    name: str
    does: str

    @property
    def middle(self) -> float:
        return (self.left + self.right) / 2.0


_PLANNER = _Box(0.4, 2.6, 'planner', 'or teleoperation,\nvision, a force')
_CONTROLLER = _Box(4.1, 6.9, 'controller', 'inverse kinematics, every $T$:\nlaw, tasks, limits')
_ROBOT = _Box(8.7, 11.3, "robot's controller", 'interpolation and\njoint servos')
_ARM = _Box(12.8, 14.6, 'arm', r'$n$ joints')


def figure_1(_: Runs | None = None) -> Figure:
    """The two-level architecture: ours above, the robot's own below a position interface."""
    figure = Figure(figsize=(13.0, 4.6), layout='constrained')
    ax = figure.add_subplot(xlim=(0.0, 15.0), ylim=(0.2, 5.2))
    ax.set_axis_off()
    ax.set_title('Figure 1. Two levels of control, and the nodes in them')
    _draw_box(ax, (0.15, 7.35), (0.5, 4.8), 0.2, fc='#dbe9f6', ec='none')
    _draw_box(ax, (8.3, 14.85), (0.5, 4.8), 0.2, fc='#f3e6d3', ec='none')
    centred: dict[str, Any] = {'ha': 'center', 'va': 'center'}
    ours = 'high level: ROS 2 nodes of this package, 500 Hz'
    ax.text(3.75, 4.45, ours, color=_LINE, **centred)
    ax.text(11.575, 4.45, 'low level: the robot, or the node sim', color=_LINE, **centred)
    for box in (_PLANNER, _CONTROLLER, _ROBOT, _ARM):
        span = (_ROW - _HALF, _ROW + _HALF)
        _draw_box(ax, (box.left, box.right), span, 0.12, fc='white', ec=_LINE, lw=1.4)
        ax.text(box.middle, _ROW + 0.42, box.name, weight='bold', **centred)
        ax.text(box.middle, _ROW - 0.2, box.does, fontsize='small', **centred)
    _draw_arrow(ax, _PLANNER, _CONTROLLER, r'$\dot x$', 'cartesian_\nvelocity')
    _draw_arrow(ax, _CONTROLLER, _ROBOT, r'$q_\mathrm{ref}$', 'joint_command')
    _draw_arrow(ax, _ROBOT, _ARM, 'currents', '')
    low = _ROW - _HALF
    ax.plot((_ARM.middle, _ARM.middle, _PLANNER.middle), (low, _RETURN, _RETURN), c=_LINE, lw=1.6)
    for box in (_CONTROLLER, _PLANNER):
        ax.annotate('', (box.middle, low), (box.middle, _RETURN), arrowprops=_ARROW)
    _label(ax, 9.2, _RETURN, 'measured $q$', 'joint_states')
    return figure


def _draw_box(
    ax: Axes, x: tuple[float, float], y: tuple[float, float], rounding: float, **style: Any
) -> None:
    shape = f'round,pad=0,rounding_size={rounding}'
    size = (x[1] - x[0], y[1] - y[0])
    ax.add_patch(FancyBboxPatch((x[0], y[0]), *size, boxstyle=shape, **style))


def _draw_arrow(ax: Axes, start: _Box, end: _Box, symbol: str, topic: str) -> None:
    """An arrow to the next box, with its symbol above and its topic below."""
    ax.annotate('', (end.left, _ROW), (start.right, _ROW), arrowprops=_ARROW)
    _label(ax, (start.right + end.left) / 2.0, _ROW, symbol, topic)


def _label(ax: Axes, x: float, y: float, symbol: str, topic: str) -> None:
    ax.text(x, y + 0.12, symbol, ha='center', va='bottom')
    ax.text(x, y - 0.15, topic, ha='center', va='top', family='monospace', fontsize='x-small')
