"""The paper's experiment without ROS, and what measured positions show of its motion."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from redres_ros.command import norms
from redres_ros.errors import ArrayError
from redres_ros.fake_robot.faults import Faults
from redres_ros.fake_robot.plant import FaultyPlant, MujocoPlant
from redres_ros.fake_robot.robot import ClientCommand, FakeRobot
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.closed_loop import Client, IdealArm, run
from redres_ros.simulation.recording import Recording
from redres_ros.types import JointPositions

AFTERMATH = 1.0  # [s] for which the arm is still watched after the task or the robot's stop
WINDOW = 400  # W, samples of the filter that differentiates
FINER = 100  # one that shows events of a tenth of a second

_DEGREE = 5
_LEFT_OUT = WINDOW // 2  # samples at either end that get no estimate
# An assumption: KUKA publishes neither. FRI sends positions as numbers of 32 bits, whose last digit
# is 2.4e-7 rad beyond 2 rad.
_STEP = 2.4e-7
_NOISE = 1e-5
_LATE = 0.05
_NO_STOP = 100.0  # factor on the acceleration limits: far beyond what any law commands


class MeasuredMotion(NamedTuple):
    """What measured positions show of a motion: t (N,) [s]; q, dq and ddq (N, n), in rad and s."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray


def differentiate(q: np.ndarray, T: float, window: int = WINDOW) -> MeasuredMotion:
    """The motion of positions q (N, n) [rad] sampled from t = 0 on, by the Savitzky-Golay filter of
    the paper.

    Each sample gets the derivatives of the polynomial of fifth degree that fits it and half a
    window of samples on either side best. That is W + 1 samples: with an even number the estimates
    would belong to instants half a cycle beside the samples. The first and last half window are
    left out.

    Raises ArrayError for fewer than W + 1 samples; the window W is an even number.
    """
    from scipy.signal import savgol_filter  # an extra, which takes a while to load

    if len(q) <= window:
        raise ArrayError(
            f'{len(q)} positions; expected at least {window + 1} for the Savitzky-Golay filter'
        )
    inner = slice(window // 2, len(q) - window // 2)
    dq, ddq = (
        savgol_filter(q, window + 1, _DEGREE, deriv=order, delta=T, axis=0)[inner]
        for order in (1, 2)
    )
    return MeasuredMotion(T * np.arange(len(q))[inner], q[inner], dq, ddq)


@dataclass(frozen=True, kw_only=True)
class Experiment(Recording):
    """A motion that ends at the last point, or where the robot stopped. q and all that follows from
    it alone are measured; dq and the norms are those of the commands.
    """

    stop_reason: str  # in the robot's own words; empty if it did not stop
    q: np.ndarray  # measured from the first tick to AFTERMATH after the last one, (N, n) [rad]

    def motion(self, window: int = WINDOW) -> MeasuredMotion:
        """What a filter over that many samples shows. Raises ArrayError."""
        return differentiate(self.q, self.T, window)


def experiment(
    client: Client, task: WaypointTask, *, seed: int | None = None, stops: bool = True
) -> Experiment:
    """The task with the simulated arm behind the fake robot controller; the same call gives the
    same bits.

    With a seed, encoders and recorder are like those of Section 6, and the start is between two
    states: the paper names rounding, experiments that are not synchronised, and ROS, which does not
    guarantee that all joint positions are taken at the same time. Else all is exact.

    In monitor mode the client mirrors the measured position; the task begins in command mode. What
    is computed from the state of tick k is used from tick k + 1. The robot limits speeds as
    it does for the nodes; if `stops`, it also stops at accelerations beyond its limits.
    """
    faults = Faults()
    late = 0.0
    ahead = 0.0  # [s] of the planner's clock before the first state
    if seed is not None:
        faults = Faults(encoder_step=_STEP, encoder_noise=_NOISE)
        late = _LATE
        ahead = float(np.random.default_rng(seed).uniform()) * client.T
    plant = MujocoPlant(client.model.arm, client.T, task.start)
    limits = JointLimits.of(client.model.arm)
    if not stops:
        limits = replace(limits, acceleration=_NO_STOP * limits.acceleration)
    robot = _Arm(FakeRobot(FaultyPlant(plant, faults, seed or 0), limits), late, seed or 0)
    planner = Planner(task, client.model.tip(robot.q)[0])
    recording = run(client, task, source=planner, plant=robot, lead=ahead)
    for _ in range(round(AFTERMATH / client.T)):
        q_ref = robot.q
        if not robot.stop_reason:
            x, _ = client.model.tip(robot.q)
            t = len(robot.shown) * client.T
            q_ref = client.update(robot.q, planner.reference(x, t + ahead).dx).q_ref
        robot.step(q_ref)
    return Experiment(**vars(recording), stop_reason=robot.stop_reason, q=np.array(robot.shown))


def velocity_difference(law: Recording, scheme: Recording) -> np.ndarray:
    """|dq_I - dq_II| in each tick that both have, (N,) [rad/s]."""
    dq_I = law.vectors('dq1')
    dq_II = scheme.vectors('dq1')
    both = min(len(dq_I), len(dq_II))
    return norms(dq_I[:both] - dq_II[:both])


@dataclass(frozen=True)
class VelocityDifference:
    """Norms of differences of joint velocities, (N,) [rad/s], of a law (I) and a scheme (II)."""

    t: np.ndarray  # (N,) [s]
    dq: np.ndarray  # measured with the law, for scale
    total: np.ndarray  # commanded by the law, measured with the scheme: what the paper plots
    measured: np.ndarray
    commanded: np.ndarray
    filtered: np.ndarray  # commanded by the scheme, before and after the filter
    servo: np.ndarray  # commanded by the scheme and filtered, and measured: lag, limit, encoders

    @classmethod
    def between(cls, law: Experiment, scheme: Experiment) -> 'VelocityDifference':
        """The difference of two experiments, while both were commanded."""
        commands = [each.vectors('dq1') for each in (law, scheme)]
        ticks = min(len(dq) for dq in commands)
        inner = slice(_LEFT_OUT, ticks - _LEFT_OUT)
        dq_I, dq_II = (dq[inner] for dq in commands)
        motion = law.motion()
        measured_I, measured_II = (each.dq[: len(dq_I)] for each in (motion, scheme.motion()))
        smooth_II = _as_measured(scheme, ticks)
        return cls(
            motion.t[: len(dq_I)],
            norms(measured_I),
            total=norms(dq_I - measured_II),
            measured=norms(measured_I - measured_II),
            commanded=norms(dq_I - dq_II),
            filtered=norms(dq_II - smooth_II),
            servo=norms(smooth_II - measured_II),
        )


def _as_measured(tried: Experiment, ticks: int) -> np.ndarray:
    """The commanded velocities as the filter shows them, (N, n) [rad/s]."""
    steps = tried.T * tried.vectors('dq1')[: ticks - 1]  # (ticks - 1, n) [rad]
    q = np.vstack((tried.q[:1], tried.q[0] + np.cumsum(steps, axis=0)))
    return differentiate(q, tried.T).dq


class _Arm(IdealArm):
    """The fake robot as the arm of a loop, in command mode, and a record of its positions."""

    def __init__(self, robot: FakeRobot, late: float, seed: int) -> None:
        self._robot = robot
        self._late = late  # chance of a joint's position to be recorded a cycle late
        self._random = np.random.default_rng((seed, 1))  # not that of the encoders
        self._sent: tuple[ClientCommand, ...] = ()  # for the state of the tick before
        self._last: np.ndarray | None = None  # (n,) [rad] measured in the tick before
        self.shown: list[np.ndarray] = []  # (n,) [rad], some of them a cycle late
        self.q = robot.plant.q
        self.stop_reason = ''
        while not robot.session.commanding and not self.stop_reason:
            self._advance(self.q)

    def step(self, q_ref: JointPositions) -> None:
        shown = self.q.copy()
        if self._last is not None:
            late = self._random.random(len(shown)) < self._late
            shown[late] = self._last[late]
        self.shown.append(shown)
        self._last = self.q
        self._advance(q_ref)

    def _advance(self, q_ref: JointPositions) -> None:
        """A cycle: the robot goes on by the last command; q_ref is that for its present state."""
        commands = self._sent
        self._sent = (ClientCommand(self._robot.tick, q_ref),)
        self._robot.advance(*commands)
        self.q = self._robot.plant.q
        self.stop_reason = self._robot.session.reason
