"""Figures 1 and 2: the two levels of control, and what redundancy resolution does."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from redres_ros.paper.runs import Runs
from redres_ros.resolution import resolve

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


# of Figure 2
_J = np.array([[0.5, 1.0]])
_DX = np.array([1.6])  # a task of one dimension
_DQ_N = np.array([1.9, 1.5])  # the bias [rad/s]

_LENGTH = 4.0  # [rad/s] half length of the lines


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


def figure_2(runs: Runs) -> Figure:
    """Solution (2): the velocity on the task's line that is nearest to dq_N."""
    minimum = resolve(_J, _DX, np.zeros(2))
    dq = resolve(_J, _DX, _DQ_N)
    null = resolve(_J, np.zeros(len(_J)), _DQ_N)
    figure = Figure(figsize=(8.4, 7.0), layout='constrained')
    ax = figure.add_subplot()
    _draw_line(ax, minimum, r'task: $J\dot q=\dot x$', color='black', lw=1.8)
    _draw_line(ax, np.zeros(2), r'null space: $J\dot q=0$', color='0.6', lw=1.2, ls='--')
    _draw_circle(ax, _DQ_N, float(np.linalg.norm(dq - _DQ_N)), r'least $\Vert\dot q-\dot q_N\Vert$')
    _draw_vector(ax, _DQ_N, r'bias $\dot q_N$', 'tab:green', (0.06, 0.05))
    _draw_vector(ax, null, r'its projection $P\,\dot q_N$', 'tab:orange', (0.16, -0.02))
    _draw_vector(ax, minimum, r'least norm $J^{\#}\dot x$', 'tab:blue', (-0.95, 0.0))
    _draw_vector(ax, dq, r'solution $\dot q=J^{\#}\dot x+P\,\dot q_N$', 'tab:red', (0.14, 0.06))
    for start in (_DQ_N, null):
        ax.plot(*np.transpose((start, dq)), ls=':', color='0.4', lw=1.4)
    ax.axhline(0.0, color='0.8', lw=0.8, zorder=0)
    ax.axvline(0.0, color='0.8', lw=0.8, zorder=0)
    ax.set(
        xlabel=r'velocity of joint 1, $\dot q_1$ [rad/s]',
        ylabel=r'velocity of joint 2, $\dot q_2$ [rad/s]',
        xlim=(-0.8, 3.0),
        ylim=(-1.0, 2.4),
        title='Figure 2. Of all joint velocities that execute the task, '
        'the one nearest to $\\dot q_N$:\n'
        'solution (2) for a robot with two joints and a task of one dimension',
    )
    ax.set_aspect('equal')
    ax.legend(loc='lower left')
    return figure


def _draw_line(ax: Axes, point: np.ndarray, label: str, **style: Any) -> None:
    """The line through a point on which J dq stays the same."""
    direction = np.array((-_J[0, 1], _J[0, 0])) / np.linalg.norm(_J)
    ax.plot(
        *np.transpose((point - _LENGTH * direction, point + _LENGTH * direction)),
        label=label,
        **style,
    )


def _draw_circle(ax: Axes, centre: np.ndarray, radius: float, label: str) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 200)
    x, y = centre[:, None] + radius * np.array((np.cos(angles), np.sin(angles)))
    ax.plot(x, y, color='tab:green', lw=1.0, ls=':', label=label)


def _draw_vector(
    ax: Axes, end: np.ndarray, label: str, color: str, beside: tuple[float, float]
) -> None:
    """A vector from the origin with its name beside the tip."""
    style: dict[str, Any] = {
        'arrowstyle': '-|>',
        'color': color,
        'lw': 2.2,
        'shrinkA': 0.0,
        'shrinkB': 0.0,
        'mutation_scale': 18,
    }
    x, y = end
    ax.annotate('', (x, y), (0.0, 0.0), arrowprops=style)
    ax.text(x + beside[0], y + beside[1], label, color=color, fontsize='large')
