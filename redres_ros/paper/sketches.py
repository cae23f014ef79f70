"""Figures 1 and 2: the two levels of control, and what redundancy resolution does."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from redres_ros.paper.runs import Runs
from redres_ros.resolution import resolve

_LINE = '0.25'
_ARROW: dict[str, Any] = {'arrowstyle': '-|>', 'color': _LINE, 'lw': 1.6}
_ARROW |= {'shrinkA': 0, 'shrinkB': 0}
_ROW = 3.0  # height of the boxes' middles, in the units of the axes
_HALF = 0.75  # of a box's height
_RETURN = 1.1  # height of the line of measured positions

_BOXES = {  # left and right end, and what it does
    'planner': (0.4, 2.6, 'or teleoperation,\nvision, a force'),
    'controller': (4.1, 6.9, 'inverse kinematics, every $T$:\nlaw, tasks, limits'),
    "robot's controller": (8.7, 11.3, 'interpolation and\njoint servos'),
    'arm': (12.8, 14.6, '$n$ joints'),
}
_ARROWS = {  # from right end to left end, symbol above and topic below
    (2.6, 4.1): (r'$\dot x$', 'cartesian_\nvelocity'),
    (6.9, 8.7): (r'$q_\mathrm{ref}$', 'joint_command'),
    (11.3, 12.8): ('currents', ''),
}

# of Figure 2
_J = np.array([[0.5, 1.0]])
_DX = np.array([1.6])  # a task of one dimension
_DQ_N = np.array([1.9, 1.5])  # the bias [rad/s]


def figure_1(runs: Runs | None = None) -> Figure:
    """The two-level architecture: ours above, the robot's own below a position interface."""
    figure = Figure(figsize=(13.0, 4.6), layout='constrained')
    ax = figure.add_subplot(xlim=(0.0, 15.0), ylim=(0.2, 5.2))
    ax.set_axis_off()
    ax.set_title('Figure 1. Two levels of control, and the nodes in them')
    centred: dict[str, Any] = {'ha': 'center', 'va': 'center'}
    ours = 'high level: ROS 2 nodes of this package, 500 Hz'
    theirs = 'low level: the robot, or the node sim'
    for left, right, color, name in (
        (0.15, 7.35, '#dbe9f6', ours),
        (8.3, 14.85, '#f3e6d3', theirs),
    ):
        _draw_box(ax, left, right, (0.5, 4.8), fc=color, ec='none')
        ax.text((left + right) / 2.0, 4.45, name, color=_LINE, **centred)
    low = _ROW - _HALF
    for name, (left, right, does) in _BOXES.items():
        _draw_box(ax, left, right, (low, _ROW + _HALF), fc='white', ec=_LINE, lw=1.4)
        middle = (left + right) / 2.0
        ax.text(middle, _ROW + 0.42, name, weight='bold', **centred)
        ax.text(middle, _ROW - 0.2, does, fontsize='small', **centred)
    for (start, end), (symbol, topic) in _ARROWS.items():
        ax.annotate('', (end, _ROW), (start, _ROW), arrowprops=_ARROW)
        _label(ax, (start + end) / 2.0, _ROW, symbol, topic)
    planner, controller, _, arm = ((left + right) / 2.0 for left, right, _ in _BOXES.values())
    ax.plot((arm, arm, planner), (low, _RETURN, _RETURN), c=_LINE, lw=1.6)
    for middle in (planner, controller):
        ax.annotate('', (middle, low), (middle, _RETURN), arrowprops=_ARROW)
    _label(ax, 9.2, _RETURN, 'measured $q$', 'joint_states')
    return figure


def _draw_box(ax: Axes, left: float, right: float, y: tuple[float, float], **style: Any) -> None:
    shape = 'round,pad=0,rounding_size=0.15'
    ax.add_patch(FancyBboxPatch((left, y[0]), right - left, y[1] - y[0], boxstyle=shape, **style))


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
    least = r'least $\Vert\dot q-\dot q_N\Vert$'
    radius = float(np.linalg.norm(dq - _DQ_N))
    circle = Circle((_DQ_N[0], _DQ_N[1]), radius, fill=False, ec='tab:green', ls=':', label=least)
    ax.add_patch(circle)
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
    ax.axline((point[0], point[1]), slope=-_J[0, 0] / _J[0, 1], label=label, **style)


def _draw_vector(
    ax: Axes, end: np.ndarray, label: str, color: str, beside: tuple[float, float]
) -> None:
    """A vector from the origin with its name beside the tip."""
    style = _ARROW | {'color': color, 'lw': 2.2, 'mutation_scale': 18}
    x, y = end
    ax.annotate('', (x, y), (0.0, 0.0), arrowprops=style)
    ax.text(x + beside[0], y + beside[1], label, color=color, fontsize='large')
