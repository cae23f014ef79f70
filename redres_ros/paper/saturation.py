"""Motions that others published for their method of the same kind, Saturation in the Null Space.

The tip goes from corner to corner, straight at the next one, at the speed k_P d - k_D v for a
distance d and its last speed v. A corner counts as reached within 5 mm. The figures are those of
github.com/ValerioSpagnoli/Multi-task-SNS-at-velocity-and-acceleration-level, at accelerations and
at 1 ms; here the laws do the same at velocities. We brake before a corner, where they turn at 10
mm/s: no joint can do that in one tick, so their tip leaves the straight line. Their LWR without
damping is the faster one because joint 6 leaves its limit after the corner, by a factor of 2.2.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import DivergedError
from redres_ros.laws import make_law
from redres_ros.robot_model import RobotModel
from redres_ros.robots.table import radians

T = 0.001  # [s]
_K_P = 2.0  # [1/s]
K_D = 0.05
_REACHED = 0.005  # [m]
LONGEST = 60.0  # [s]

_MARGIN = 1e-6  # [m] by which a corner is surely reached when the tip has stopped
_SLOW = 1e-6  # [m/s] below which a velocity has no direction to speak of


@dataclass(frozen=True)
class Benchmark:
    """A motion, and what was published of it.

    Args:
        robot: The arm, in the table ARMS.
        velocity: Limits of its joints, (n,) [rad/s].
        acceleration: The same, (n,) [rad/s^2].
        start: Where it begins, at rest, (n,) [rad].
        corners: Where the tip goes, (N, 3) [m].
        is_relative: Whether they are beside the tip's start.
        braking: Deceleration before a corner [m/s^2], which the joints can do.
        law: Law of the motion in the null space.
        damping: Damping of that law [1/s].
        seconds: That the others' motion took.
        heading_error: Theirs, the mean angle between the tip's velocity and the line to the corner
            [rad].
    """

    robot: str
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    start: tuple[float, ...]
    corners: tuple[tuple[float, float, float], ...]
    is_relative: bool
    braking: float
    law: str
    damping: float
    seconds: float
    heading_error: float


@dataclass(frozen=True)
class SaturatedMotion:
    """Our motion.

    Args:
        seconds: That it took.
        heading_error: Mean angle between the tip's velocity and the line to the corner [rad].
        limit_usage: The largest velocity or acceleration of a joint, over its limit.
    """

    seconds: float
    heading_error: float
    limit_usage: float


def _hexagon(rounds: int) -> tuple[tuple[float, float, float], ...]:
    """Corners at 0.2 m from a point 0.7 m in front of the base, from the top back to it."""
    angles = np.radians(90.0 - 60.0 * np.arange(6 * rounds + 1))
    return tuple((0.7 + 0.2 * math.cos(a), 0.0, 0.2 * math.sin(a)) for a in angles.tolist())


LWR = Benchmark(
    robot='lwr4',
    velocity=radians(100.0, 110.0, 100.0, 130.0, 130.0, 180.0, 180.0),
    acceleration=radians(*(300.0,) * 7),
    start=radians(0.0, 45.0, 45.0, 45.0, 0.0, 0.0, 0.0),
    corners=((0.1, 0.3, -0.2), (0.0, 0.0, 0.0)),
    is_relative=True,
    braking=1.0,
    law='minimum_acceleration',
    damping=0.0,
    seconds=4.640,
    heading_error=0.0012,
)

LWR_DAMPED = replace(LWR, law='minimum_velocity', seconds=4.706, heading_error=0.0017)
PLANAR = Benchmark(
    robot='planar4r',
    velocity=(2.0, 2.0, 4.0, 4.0),
    acceleration=(2.0, 2.0, 4.0, 4.0),
    start=radians(0.0, 90.0, -90.0, 90.0),
    corners=_hexagon(2),
    is_relative=False,
    braking=0.4,
    law='minimum_acceleration',
    damping=10.0,
    seconds=27.211,
    heading_error=0.0073,
)

# The same with other choices of ours, to see how much the outcome depends on them
PLANAR_CHOICES = {
    'softer': replace(PLANAR, braking=0.2),
    'harder': replace(PLANAR, braking=0.8),
    'undamped': replace(PLANAR, braking=0.2, damping=0.0),
}


def run_benchmark(benchmark: Benchmark) -> SaturatedMotion:
    """The motion under a law of ours, within the same limits.

    Raises DivergedError if it does not get to its end.
    """
    model = RobotModel.named(benchmark.robot)
    model.dq_max = np.array(benchmark.velocity)
    A = np.array(benchmark.acceleration)
    controller = _controller(model, benchmark)
    q = np.array(benchmark.start)
    corners = np.array(benchmark.corners)
    if benchmark.is_relative:
        corners = corners + model.tip(q)[0]
    next_corner = 0
    speed = 0.0
    angles: list[float] = []
    usage = 0.0
    for k in range(round(LONGEST / T)):
        x, _ = model.tip(q)
        if np.linalg.norm(corners[next_corner] - x) < _REACHED:
            next_corner += 1
        if next_corner == len(corners):
            return SaturatedMotion(k * T, float(np.mean(angles)), usage)
        path = corners[next_corner] - x
        command = controller.update(q, _velocity(path, speed, benchmark.braking))
        velocity = command.J @ command.dq  # (3,)
        speed = float(np.linalg.norm(velocity))
        if speed > _SLOW:
            angles.append(angle_between(velocity, path))
        usage = max(usage, _usage(command.ddq, A), _usage(command.dq, model.dq_max))
        q = command.q_ref
    raise DivergedError(speed, LONGEST, 'the corners, which were not reached')


def _controller(model: RobotModel, benchmark: Benchmark) -> Controller:
    # Loading the limits may compile them: only those who run this should wait for that.
    from redres_ros.limits.joint import AccelerationLimit, PositionLimit, VelocityLimit

    gains = {} if benchmark.law == 'minimum_velocity' else {'damping': benchmark.damping}
    limits = (
        AccelerationLimit(model, acceleration=benchmark.acceleration),
        VelocityLimit(model),
        PositionLimit(model, acceleration=benchmark.acceleration, margin=0.0),
    )
    return Controller(model, make_law(benchmark.law, **gains), T, limits=limits)


def _usage(values: np.ndarray, allowed: np.ndarray) -> float:
    """The largest of |value| / allowed, both (n,)."""
    return float((np.abs(values) / allowed).max())


def _velocity(path: np.ndarray, speed: float, braking: float) -> np.ndarray:
    """Task velocity (3,) [m/s] along the straight path (3,) [m] to a corner, in time to stop."""
    distance = float(np.linalg.norm(path))
    rest = max(distance - _REACHED + _MARGIN, 0.0)
    desired = min(_K_P * distance - K_D * speed, math.sqrt(2.0 * braking * rest))
    return path * (desired / distance)


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """The angle between two vectors [rad], exact for small ones too.

    Args:
        a: (n,).
        b: (n,).
    """
    half = np.linalg.norm(a / np.linalg.norm(a) - b / np.linalg.norm(b)) / 2.0
    return 2.0 * math.asin(min(float(half), 1.0))
