"""Node `planner`: streams the task velocities of a task, one cartesian_velocity for each
joint_states.
"""

import sys
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int32, String
from std_srvs.srv import Trigger

from redres_ros.errors import RedresError
from redres_ros.nodes.conversions import (
    NANOSECONDS,
    JointOrder,
    to_nanoseconds,
    to_pose,
    to_twist,
)
from redres_ros.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Health, Refusals, Watchdog
from redres_ros.nodes.parameters import declare, declare_robot
from redres_ros.nodes.qos import LATCHED, NEWEST, PUBLISH
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.telemetry import Telemetry
from redres_ros.parameter import param
from redres_ros.planner import Planner, Reference
from redres_ros.waypoints import load_task


@dataclass(frozen=True)
class PlannerParameters:
    """Parameters of the node beside those of the arm."""

    task: str = param('rectangle', 'name of a task in config/tasks, or a path ending in .yaml')
    base_frame: str = param(
        '', "frame of cartesian_velocity; empty: the root link of the arm's URDF"
    )
    autostart: bool = param(
        False, 'begin with the first state instead of waiting for planner/start'
    )
    feedback_limit: float = param(0.2, 'largest speed that the feedback may add [m/s]', 0.001, 10.0)
    state_timeout: float = param(0.1, 'silence of joint_states that is reported [s]', 0.01, 10.0)


class PlannerNode(Node):
    """Knows time only from the stamps of the states: when the robot's clock stands, so does the
    task.
    """

    def __init__(self) -> None:
        super().__init__('planner')
        self._robot = declare_robot(self)
        self._settings = declare(self, PlannerParameters())
        self._model = self._robot.model
        self._task = load_task(self._settings.task)
        self._frame = self._settings.base_frame or self._model.base_frame
        self._joints = JointOrder(self._model.joint_names)
        self._planner: Planner | None = None
        self._wanted = self._settings.autostart
        self._begun = 0  # stamp [ns] with which the task began
        self._stamp = 0
        self._twist = TwistStamped()
        self._twists = self.create_publisher(TwistStamped, 'cartesian_velocity', PUBLISH)
        self._state = self.create_publisher(String, 'planner/state', LATCHED)
        self._state_name = ''
        self._telemetry = Telemetry(
            self, {'desired_pose': PoseStamped, 'task_error': Float64, 'segment': Int32}
        )
        self._refusals = Refusals(self)
        self._watchdog = Watchdog(self, 'joint_states', self._settings.state_timeout)
        self._diagnostics = Diagnostics(self, self._robot.robot, self._health)
        self.create_subscription(JointState, 'joint_states', self._on_state, NEWEST)
        self.create_service(Trigger, 'planner/start', self._on_start)
        self.create_service(Trigger, 'planner/stop', self._on_stop)
        self._tell('idle')

    def _on_state(self, message: JointState) -> None:
        self._watchdog.feed()
        stamp = to_nanoseconds(message.header.stamp)
        if not self._wanted:
            return
        if stamp == self._stamp:
            self._twists.publish(self._twist)  # asked again, as in lock-step: the same answer
            return
        try:
            x, R = self._model.tip(self._joints.positions(message))
        except RedresError as error:
            self._refusals.refuse('joint_states', error)
            return
        self._refusals.accept('joint_states')
        reference = self._reference(stamp, x, R)
        self._stamp, self._twist = stamp, to_twist(stamp, self._frame, reference.dx)
        self._twists.publish(self._twist)
        R_d = R if reference.R_d is None else reference.R_d
        self._telemetry.publish(
            'desired_pose', lambda: to_pose(stamp, self._frame, reference.x_d, R_d)
        )
        self._telemetry.publish('task_error', lambda: float(np.linalg.norm(reference.error)))
        self._telemetry.publish('segment', lambda: reference.segment)
        self._tell('finished' if reference.finished else 'moving')

    def _reference(self, stamp: int, x: np.ndarray, R: np.ndarray) -> Reference:
        if self._planner is None or stamp < self._stamp:
            self._planner = Planner(self._task, x, R, feedback_limit=self._settings.feedback_limit)
            self._begun = stamp
        turned = R if self._robot.task_space == 'pose' else None
        return self._planner.reference(x, (stamp - self._begun) / NANOSECONDS, turned)

    def _on_start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        task = self._settings.task
        if self._state_name == 'moving':  # to begin anew on the way would be a jump of the velocity
            response.message = f'{task}: is under way already; planner/stop ends it'
        else:
            self._planner = None
            self._wanted = True
            response.message = f'{task}: begins with the next joint_states'
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        response.message = 'stopped' if self._wanted else 'was not moving'
        self._planner = None
        self._wanted = False
        self._tell('idle')
        return response

    def _tell(self, state: str) -> None:
        if state != self._state_name:
            self._state_name = state
            self._state.publish(String(data=state))

    def _health(self) -> Health:
        figures = {
            'task': self._settings.task,
            'state': self._state_name,
            'begun at [ns]': self._begun,
            'messages refused': self._refusals.count,
        }
        if self._watchdog.silent:
            return Health(ERROR, 'no joint_states', figures)
        if self._refusals.reasons:
            return Health(WARN, self._refusals.reasons, figures)
        return Health(OK, self._state_name, figures)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_nodes(PlannerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
