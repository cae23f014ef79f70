"""The planner's topics: latched ones as they change, and figures for displays."""

from typing import TYPE_CHECKING

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, Int32

from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.telemetry import LatchedWords, Telemetry
from redres_ros.nodes.topics import LATCHED, TASK_BEGUN, TASK_STATE
from redres_ros.nodes.wire import to_time

if TYPE_CHECKING:  # who watches the topics needs no planner
    from redres_ros.planning.task_executor import Step, TaskExecutor


class TaskTopics:
    """Publishes `planner/state` and `planner/begun`, and where the task is.

    Args:
        node: The planner.
        frame: Frame of the poses.
        run: Executor whose state is published.
    """

    def __init__(self, node: Node, frame: str, run: 'TaskExecutor') -> None:
        self._frame = frame
        self._run = run
        self._words = LatchedWords(node, TASK_STATE)
        self._begun_publisher = node.create_publisher(Time, TASK_BEGUN, LATCHED)
        figures = {'task_error': Float64, 'segment': Int32, 'progress': Float64}
        self._telemetry = Telemetry(node, {'desired_pose': PoseStamped, **figures})
        self._published_start = 0
        self.publish()

    def publish(self) -> None:
        """Publish what has changed of the run since the last call."""
        if self._run.start_stamp != self._published_start:
            self._published_start = self._run.start_stamp
            self._begun_publisher.publish(to_time(self._published_start))
        self._words.publish({TASK_STATE: self._run.state.value})

    def show(self, step: 'Step', R: np.ndarray) -> None:
        """Publish the reference of the task.

        Args:
            step: What the task asks for.
            R: Orientation of the tip, (3, 3), which a task of positions leaves as it is.
        """
        if not self._telemetry.subscribed:
            return
        publish = self._telemetry.publish
        publish('progress', lambda: self._run.progress)
        reference = step.reference
        if reference is None:
            return
        R_d = R if reference.R_d is None else reference.R_d
        publish('desired_pose', lambda: to_pose(step.stamp, self._frame, reference.x_d, R_d))
        publish('task_error', lambda: float(np.linalg.norm(reference.error)))
        publish('segment', lambda: reference.segment)
