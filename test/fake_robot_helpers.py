"""A fake robot behind its inbox, for tests that play the client."""

import numpy as np

from redres_ros.fake_robot.command_receiver import CommandReceiver
from redres_ros.fake_robot.network_model import Link
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.robot_clock import NANOSECONDS, RobotClock

EPOCH = 1_700_000_000 * NANOSECONDS  # stamp of the first state [ns]


class Door:
    """The robot, what its client sends, and the ticks in between; latencies are not measured."""

    def __init__(self, robot: FakeRobot, link: Link | None = None, seed: int = 0) -> None:
        self.robot = robot
        self.clock = RobotClock(EPOCH, round(robot.period * NANOSECONDS))
        self.receiver = CommandReceiver(
            robot.joint_names, self.clock, robot.session, link=link, seed=seed, timed=False
        )

    def send(self, tick: int, q: np.ndarray, names: tuple[str, ...] | None = None) -> None:
        """Send q [rad] as the command to the state of a tick."""
        names = self.robot.joint_names if names is None else names
        self.receiver.put(self.clock.stamp(tick), names, np.asarray(q))

    def advance(self) -> None:
        """Let the robot have what has come, send its next state and move on by a cycle."""
        commands = self.receiver.take(self.robot.tick)
        self.clock.send(self.robot.tick)
        self.robot.advance(*commands)
