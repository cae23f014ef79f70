"""Figure 1: the two levels of control, with the nodes of this package in them."""

from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from redres_ros.paper.runs import Runs

_OURS = '#dbe9f6'
_THEIRS = '#f3e6d3'
_LINE = '0.25'
_ARROW: dict[str, Any] = {
    'arrowstyle': '-|>',
    'color': _LINE,
    'lw': 1.6,
    'shrinkA': 0,
    'shrinkB': 0,
}


class _Box(NamedTuple):
    """A box around its middle x, y, in the units of the axes, as are width and height."""

    x: float
    y: float
    width: float
    height: float
    name: str
    does: str

    @property
    def left(self) -> float:
        return self.x - self.width / 2.0

    @property
    def right(self) -> float:
        return self.x + self.width / 2.0

    @property
    def bottom(self) -> float:
        return self.y - self.height / 2.0


_PLANNER = _Box(1.5, 3.0, 2.2, 1.5, 'planner', 'or teleoperation,\nvision, a force')
_CONTROLLER = _Box(
    5.5, 3.0, 2.8, 1.5, 'controller', r'inverse kinematics, every $T$:' '\nlaw, tasks, limits'
)
_ROBOT = _Box(10.0, 3.0, 2.6, 1.5, "robot's controller", 'interpolation and\njoint servos')
_ARM = _Box(13.7, 3.0, 1.8, 1.5, 'arm', r'$n$ joints')


def figure_1(_: Runs | None = None) -> Figure:
    """The two-level architecture: ours above, the robot's own below a position interface."""
    figure = Figure(figsize=(13.0, 4.6), layout='constrained')
    ax = figure.add_subplot(xlim=(0.0, 15.0), ylim=(0.2, 5.2))
    ax.set_axis_off()
    ax.set_title('Figure 1. Two levels of control, and the nodes in them')
    _level(ax, 0.15, 7.35, _OURS, 'high level: ROS 2 nodes of this package, 500 Hz')
    _level(ax, 8.3, 14.85, _THEIRS, 'low level: the robot, or the node sim')
    for box in (_PLANNER, _CONTROLLER, _ROBOT, _ARM):
        _draw(ax, box)
    _arrow(ax, _PLANNER, _CONTROLLER, r'$\dot x$', 'cartesian_\nvelocity')
    _arrow(ax, _CONTROLLER, _ROBOT, r'$q_\mathrm{ref}$', 'joint_command')
    _arrow(ax, _ROBOT, _ARM, 'currents', '')
    _feedback(ax)
    return figure


def _level(ax: Axes, left: float, right: float, color: str, name: str) -> None:
    ax.add_patch(
        FancyBboxPatch(
            (left, 0.5),
            right - left,
            4.3,
            boxstyle='round,pad=0,rounding_size=0.2',
            fc=color,
            ec='none',
        )
    )
    ax.text((left + right) / 2.0, 4.45, name, ha='center', va='center', color=_LINE)


def _draw(ax: Axes, box: _Box) -> None:
    corner = (box.left, box.bottom)
    style = 'round,pad=0,rounding_size=0.12'
    ax.add_patch(
        FancyBboxPatch(corner, box.width, box.height, boxstyle=style, fc='white', ec=_LINE, lw=1.4)
    )
    ax.text(box.x, box.y + 0.42, box.name, ha='center', va='center', weight='bold')
    ax.text(box.x, box.y - 0.2, box.does, ha='center', va='center', fontsize='small')


def _arrow(ax: Axes, start: _Box, end: _Box, symbol: str, topic: str) -> None:
    """Draw an arrow to the next box, with its symbol above and its topic below."""
    ax.annotate('', (end.left, end.y), (start.right, start.y), arrowprops=_ARROW)
    middle = (start.right + end.left) / 2.0
    ax.text(middle, start.y + 0.12, symbol, ha='center', va='bottom')
    _topic(ax, middle, start.y - 0.15, topic)


def _topic(ax: Axes, x: float, y: float, name: str) -> None:
    ax.text(x, y, name, ha='center', va='top', family='monospace', fontsize='x-small')


def _feedback(ax: Axes) -> None:
    """The measured positions, from the arm back to controller and planner."""
    low = 1.1
    ax.plot((_ARM.x, _ARM.x, _PLANNER.x), (_ARM.bottom, low, low), color=_LINE, lw=1.6)
    for box in (_CONTROLLER, _PLANNER):
        ax.annotate('', (box.x, box.bottom), (box.x, low), arrowprops=_ARROW)
    ax.text(9.2, low + 0.12, 'measured $q$', ha='center', va='bottom')
    _topic(ax, 9.2, low - 0.12, 'joint_states')
