"""Figure 2: what redundancy resolution does, in the plane of two joint velocities."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.paper.runs import Runs
from redres_ros.resolution import project, resolve

J = np.array([[0.5, 1.0]])
DX = np.array([1.6])  # a task of one dimension
_DQ_N = np.array([1.9, 1.5])  # the bias [rad/s]

_REACH = 4.0  # [rad/s] half length of the lines


def figure_2(runs: Runs) -> Figure:
    """Solution (2): the velocity on the task's line that is nearest to dq_N."""
    minimum = resolve(J, DX, np.zeros(2))
    dq = resolve(J, DX, _DQ_N)
    null = project(J, _DQ_N)
    figure = Figure(figsize=(8.4, 7.0), layout='constrained')
    ax = figure.add_subplot()
    _line(ax, minimum, r'task: $J\dot q=\dot x$', color='black', lw=1.8)
    _line(ax, np.zeros(2), r'null space: $J\dot q=0$', color='0.6', lw=1.2, ls='--')
    _circle(ax, _DQ_N, float(np.linalg.norm(dq - _DQ_N)), r'least $\Vert\dot q-\dot q_N\Vert$')
    _arrow(ax, _DQ_N, r'bias $\dot q_N$', 'tab:green', (0.06, 0.05))
    _arrow(ax, null, r'its projection $P\,\dot q_N$', 'tab:orange', (0.16, -0.02))
    _arrow(ax, minimum, r'least norm $J^{\#}\dot x$', 'tab:blue', (-0.95, 0.0))
    _arrow(ax, dq, r'solution $\dot q=J^{\#}\dot x+P\,\dot q_N$', 'tab:red', (0.14, 0.06))
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


def _line(ax: Axes, point: np.ndarray, label: str, **style: Any) -> None:
    """The line through a point on which J dq stays the same."""
    direction = np.array((-J[0, 1], J[0, 0])) / np.linalg.norm(J)
    ax.plot(
        *np.transpose((point - _REACH * direction, point + _REACH * direction)),
        label=label,
        **style,
    )


def _circle(ax: Axes, centre: np.ndarray, radius: float, label: str) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 200)
    x, y = centre[:, None] + radius * np.array((np.cos(angles), np.sin(angles)))
    ax.plot(x, y, color='tab:green', lw=1.0, ls=':', label=label)


def _arrow(ax: Axes, end: np.ndarray, label: str, color: str, beside: tuple[float, float]) -> None:
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
