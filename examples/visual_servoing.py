"""A camera at 30 Hz steers an arm at 500 Hz: the tip follows a target that goes round a circle.

Start robot and controller first, then this:

    redres_sim
    redres_controller
    python examples/visual_servoing.py

The camera is a fake: it sees where the target is relative to the tip, 30 times a second and a frame
late. Its task velocities act on the 500 states a second smoothly, as the controller goes from each
to the next in a straight line.
"""

import argparse
import contextlib
import math
import signal
import sys
import time
from functools import partial

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String

CAMERA = 1.0 / 30.0  # [s] from one picture to the next
RADIUS = 0.04  # of the target's circle [m]
TURN = 5.0  # [s] for a round
GAIN = 3.0  # [1/s], of what is seen; a camera that is a frame late needs a low one
FASTEST = 0.2  # [m/s]
WORDS = ('controller/mode', 'sim/stop_reason')  # topics


class Servo(Node):
    """Turns pictures into task velocities."""

    def __init__(self) -> None:
        super().__init__('visual_servoing')
        self.pictured = -math.inf  # when the last picture was taken, by the robot's clock [s]
        self.centre: np.ndarray | None = None  # of the circle, (3,) [m]
        self.seen: np.ndarray | None = None  # in the last picture, (3,) [m]
        self.pictures = 0
        self.errors: list[float] = []  # [m]
        self.states: list[tuple[float, np.ndarray]] = []  # stamp [s], q
        self.last_tip = time.monotonic()  # when the last pose of the tip came [s]
        self.words: dict[str, String] = {}  # the newest, by topic
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(PoseStamped, 'controller/tip_pose', self.on_tip, newest)
        self.create_subscription(JointState, 'joint_states', self.on_state, newest)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic in WORDS:
            keep = partial(self.words.__setitem__, topic)
            self.create_subscription(String, topic, keep, latched)
        self.twists = self.create_publisher(TwistStamped, 'cartesian_velocity', 1)

    def on_tip(self, message: PoseStamped) -> None:
        """Take a picture whenever it is time for one."""
        self.last_tip = time.monotonic()
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        if stamp - self.pictured >= CAMERA:
            self.pictured = stamp
            place = message.pose.position
            self.on_picture(np.array((place.x, place.y, place.z)), message.header.frame_id)

    def on_state(self, message: JointState) -> None:
        """Keep the way of the joints."""
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        self.states.append((stamp, np.array(message.position)))

    def on_picture(self, tip: np.ndarray, frame: str) -> None:
        """Command by what the picture before showed, along a frame's axes: looking takes time."""
        if self.centre is None:
            self.centre = tip - (0.0, RADIUS, 0.0)
        before = self.seen
        angle = 2.0 * math.pi * self.pictures * CAMERA / TURN
        target = self.centre + RADIUS * np.array((0.0, math.cos(angle), math.sin(angle)))
        self.seen = target - tip
        self.errors.append(float(np.linalg.norm(self.seen)))
        self.pictures += 1
        if before is not None:
            self.steer(GAIN * before, frame)

    def steer(self, dx: np.ndarray, frame: str) -> None:
        """Send a task velocity (3,) [m/s] along a frame's axes that is to act now."""
        dx = dx * FASTEST / max(float(np.linalg.norm(dx)), FASTEST)
        message = TwistStamped()  # its stamp is zero: now
        message.header.frame_id = frame
        message.twist.linear.x, message.twist.linear.y, message.twist.linear.z = dx.tolist()
        self.twists.publish(message)


def fastest_change(states: list[tuple[float, np.ndarray]]) -> float:
    """The largest joint acceleration, averaged over 20 ms [rad/s^2]."""
    stamps = np.array([stamp for stamp, _ in states])
    q = np.array([positions for _, positions in states])
    times = np.arange(stamps[0], stamps[-1], 0.02)
    even = np.column_stack([np.interp(times, stamps, joint) for joint in q.T])
    return float(np.abs(np.diff(even, 2, axis=0)).max() / 0.02**2)


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--seconds', type=float, default=10.0)
options = parser.parse_args()

rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
servo = Servo()
with contextlib.suppress(KeyboardInterrupt):
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
    while servo.pictures * CAMERA < options.seconds:
        rclpy.spin_once(servo, timeout_sec=0.1)
        if time.monotonic() > servo.last_tip + 30.0:
            sys.exit('no pose of the tip comes: start redres_sim and redres_controller first')
servo.steer(np.zeros(3), '')
mode, reason = (servo.words.get(topic, String()).data for topic in WORDS)
if mode != 'moving':
    sys.exit(f'the tip does not follow: controller/mode {mode}, sim/stop_reason {reason}')
late = servo.errors[len(servo.errors) // 3 :]
behind = 1e3 * float(np.median(late))
most = 1e3 * max(late)
print(f'{servo.pictures} pictures; the tip was {behind:.1f} mm behind, {most:.1f} at most')
print(f'no joint accelerated by more than {fastest_change(servo.states):.2f} rad/s^2')
