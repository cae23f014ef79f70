"""A fake robot behind its receiver, for tests that play the client."""

import numpy as np

from redres_ros.fake_robot.command_receiver import CommandReceiver
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.robot_clock import NANOSECONDS, RobotClock

EPOCH = 1_700_000_000 * NANOSECONDS  # stamp of the first state [ns]
Q0 = np.radians((28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0))  # the paper's q(0)


class Connection:
    """The robot, what its client sends, and the ticks in between; latencies are not measured."""

    def __init__(self, robot: FakeRobot) -> None:
        self.robot = robot
        self.clock = RobotClock(EPOCH, round(robot.plant.period * NANOSECONDS))
        self.receiver = CommandReceiver(robot, self.clock, timed=False)

    def send(self, tick: int, q: np.ndarray, names: tuple[str, ...] | None = None) -> None:
        """Send q [rad] as the command for the state of a tick."""
        names = self.robot.plant.joint_names if names is None else names
        self.receiver.put(EPOCH + tick * self.clock.period, names, np.asarray(q))

    def advance(self) -> None:
        """Let the robot have what has come, send its next state and move on by a cycle."""
        commands = self.receiver.take()
        self.clock.send(self.robot.tick)
        self.robot.advance(*commands)
