"""The loop over DDS: the time from a state to its command, beside a node that computes nothing.

    python benchmarks/loop.py [--rates 500,1000] [--seconds S]

This process is the robot: it publishes states at a rate and is where it was commanded to be. What
responds runs in processes of its own: a bare echo, the controller, controller and planner, and both
in one process. Prints a table for docs/real_time.md.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros import RobotModel, load_task
from redres_ros.nodes.runtime import own_domain, run_nodes, spun
from redres_ros.nodes.topics import NEWEST, PUBLISH
from redres_ros.robots.joint_limits import JointLimits

RESPONDERS = {
    'bare echo node': ('echo',),
    'controller, standing still': ('controller',),
    'planner, controller': ('planner', 'controller'),
    'planner and controller in one process': ('composed --no-sim',),
}
PATIENCE = 120.0  # [s] for the first command; the first start compiles
SETTLING = 2.0  # [s] from the first command to the first state that counts: by then the arm moves
NANOSECONDS = 1_000_000_000


class Echo(Node):
    """Subscribes as the controller does, and returns every state as the command."""

    def __init__(self) -> None:
        super().__init__('echo')
        commands = self.create_publisher(JointState, 'joint_command', PUBLISH)
        self.create_subscription(JointState, 'joint_states', commands.publish, NEWEST)


class Robot(Node):
    """Publishes states and notes when each is sent, and when its command comes [s]."""

    def __init__(self, rate: float) -> None:
        super().__init__('robot')
        task = load_task('rectangle')
        self.names = list(JointLimits.of(RobotModel.named(task.robot).arm).joint_names)
        self.q = task.start.tolist()
        self.period = round(NANOSECONDS / rate)  # [ns]
        self.begin = time.time_ns()
        self.sent: dict[int, float] = {}
        self.returned: dict[int, float] = {}
        self.publisher = self.create_publisher(JointState, 'joint_states', PUBLISH)
        self.create_subscription(JointState, 'joint_command', self.on_command, NEWEST)
        self.create_timer(1.0 / rate, self.on_timer)

    def on_timer(self) -> None:
        cycle = round((time.time_ns() - self.begin) / self.period)
        if cycle in self.sent:
            return  # the timer came early
        state = JointState(name=self.names, position=self.q)
        stamp = self.begin + cycle * self.period
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp, NANOSECONDS)
        self.sent[cycle] = time.monotonic()
        self.publisher.publish(state)

    def on_command(self, command: JointState) -> None:
        now = time.monotonic()
        stamp = command.header.stamp.sec * NANOSECONDS + command.header.stamp.nanosec
        self.returned.setdefault(round((stamp - self.begin) / self.period), now)
        self.q = command.position


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rates', default='500,1000', help='[Hz]; default 500,1000')
    parser.add_argument('--seconds', type=float, default=10.0, help='of each; default 10')
    options = parser.parse_args()
    print('| rate | commanded by | median | p99 | in cycle | of a core |')
    print('|---|---|---|---|---|---|')
    for rate in map(float, options.rates.split(',')):
        for name, nodes in RESPONDERS.items():
            print(f'| {rate:g} Hz | {name} | {row(nodes, rate, options.seconds)} |', flush=True)


def row(nodes: tuple[str, ...], rate: float, seconds: float) -> str:
    """The figures of some responders."""
    with own_domain(), spun(lambda: Robot(rate)) as robot:
        processes = {node: start(node, rate) for node in nodes}
        try:
            wait_for_command(robot)
            time.sleep(SETTLING)
            first = time.monotonic()
            before = {node: processor_time(process.pid) for node, process in processes.items()}
            time.sleep(seconds)
            last = time.monotonic()
            used = {
                node: (processor_time(process.pid) - before[node]) / seconds
                for node, process in processes.items()
            }
            time.sleep(0.1)  # for the last commands
        finally:
            for process in processes.values():
                process.send_signal(signal.SIGINT)
                process.wait()
        sent = {k: at for k, at in robot.sent.items() if first <= at < last}
        latencies = np.array([robot.returned.get(k, np.inf) - at for k, at in sent.items()])
    responded = latencies[np.isfinite(latencies)]
    shares = ', '.join(f'{node} {share:.0%}' for node, share in used.items())
    return (
        f'{1e6 * np.median(responded):.0f} µs | {1e6 * np.quantile(responded, 0.99):.0f} µs '
        f'| {np.mean(latencies <= 1.0 / rate):.2%} | {shares}'
    )


def start(node: str, rate: float) -> subprocess.Popen[bytes]:
    """A node in a process of its own."""
    if node == 'echo':
        return subprocess.Popen([sys.executable, __file__, '--echo'])
    arguments = node.split()
    parameters = ['--ros-args', '-p', f'rate:={rate}']
    if node != 'controller':
        parameters += ['-p', 'autostart:=true']
    module = 'redres_ros.nodes.entry'
    return subprocess.Popen([sys.executable, '-m', module, *arguments, *parameters])


def wait_for_command(robot: Robot) -> None:
    """Raises TimeoutError."""
    until = time.monotonic() + PATIENCE
    while not robot.returned:
        if time.monotonic() > until:
            raise TimeoutError(f'no command within {PATIENCE:g} s')
        time.sleep(0.1)


def processor_time(pid: int) -> float:
    """Of a process so far, all its threads, in user space and the kernel [s]; see proc(5)."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


if __name__ == '__main__':
    if '--echo' in sys.argv:
        sys.exit(run_nodes(Echo, arguments=[]))
    main()
