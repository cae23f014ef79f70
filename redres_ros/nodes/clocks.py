"""Timers by the computer's steady clock, and a report of a missing /clock.

With `use_sim_time` a node's own clock stands still until /clock is published, and with it all
timers on that clock: diagnostics and watchdogs would be silent when they are needed.
"""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

_PATIENCE = 3.0  # [s] for the first message on /clock


def create_steady_timer(node: Node, period: float, callback: Callable[[], object]) -> Timer:
    """A timer that runs whatever the node's clock shows.

    Args:
        node: Owner of the timer.
        period: Between two calls [s].
        callback: Function to call.
    """
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(period, callback, clock=steady)


def warn_without_clock(node: Node) -> None:
    """Have a node report once that use_sim_time is set but /clock is not published."""
    if not node.get_parameter('use_sim_time').value:
        return

    def look() -> None:
        timer.cancel()
        if node.get_clock().now().nanoseconds == 0:
            node.get_logger().warning(
                'use_sim_time is true, but /clock has no publisher: what this node itself stamps '
                'has the time 0; start the simulation, or set use_sim_time to false'
            )

    timer = create_steady_timer(node, _PATIENCE, look)
