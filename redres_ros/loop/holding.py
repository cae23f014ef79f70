"""What holds: the reference of an arm at rest, the approach to where that arm is, and the component
of a twist that an operator does not ask for.
"""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.kernels.tick import largest
from redres_ros.loop.velocity_input import ANGULAR_ACCELERATION, LINEAR_ACCELERATION
from redres_ros.robot_model import Correction, RobotState
from redres_ros.tasks import Pose
from redres_ros.types import Cycles, JointPositions, JointVelocities, Seconds, TaskVelocity

ARRIVED = 1e-6  # [rad] from its end, at which an approach is over
NOTHING = 1e-3  # [m/s], [rad/s]; a velocity with less asks for nothing

_SPEED = 0.1  # of an approach, as a fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_CATCH_UP = 10.0  # [rad/s^2] the same for a reference from which the arm has been moved away
_STILL = 5e-4  # [rad] that an arm at rest moves at most
_REST = 0.1  # [s] for which it has not moved further
_SERVO = 5e-3  # [rad] of a servo's error at rest

_GAIN = 2.0  # [1/s] of the error of what is held
_RADIUS = 0.25  # [m] at which a turn counts as a speed
_HARDLY = 0.05  # of the other component; with less, a component is not asked for
_CONE = float(np.radians(25.0))  # [rad] within which a held component may give way

# Rows of each component; the velocity with which the tip comes back at most, because limits may
# have turned it by half a turn; the acceleration; and how far it may give way.
_COMPONENTS = (
    (slice(0, 3), 0.25, LINEAR_ACCELERATION, _RADIUS * _CONE),  # [m/s], [m/s^2], [m]
    (slice(3, 6), 1.0, ANGULAR_ACCELERATION, _CONE),  # [rad/s], [rad/s^2], [rad]
)


class HeldReference:
    """Keeps the reference of an arm at rest where the arm is, also if others have moved it.

    While the arm is elsewhere, nothing may be published: a robot that holds stays as it is, and one
    that begins to listen does not leap. The reference is placed where the arm comes to rest. If the
    arm then goes on by as much, it follows: it sags, which is explained from then on, as it would
    sink for ever. So is the error of an arm that has followed a motion, if it comes to rest within
    what its lag explains; else others have moved it.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._allowed = controller.robot_interface.following_tolerance  # [rad]
        self.begin(np.zeros(controller.model.n))

    def begin(self, q: JointPositions, lag: JointPositions | None = None) -> None:
        """The reference is held from now on, by an arm at q; after a motion that may lag behind."""
        self._servo = np.zeros(len(q))  # its error, (n,) [rad]
        self._stood = q
        self._still = 0.0  # [s] for which it has stood there
        self.restless = 0.0  # [s] for which it has not come to rest
        self._began = q
        self._explained = _SERVO if lag is None else lag + _SERVO  # from there, (n,) [rad]
        self._follows = lag is not None
        self.wait = 0.0 if self._follows else _REST  # [s] to a motion, while it may sink
        if lag is None:
            self._expected = self._servo  # the error that shows that the arm sags, (n,) [rad]

    def is_left(self, q: JointPositions) -> bool:
        """Whether an arm at rest at q is elsewhere than its servo explains."""
        return largest(self._error(q)) > _SERVO

    def _error(self, q: JointPositions) -> JointPositions:
        """Of an arm at q, beside what its servo explains."""
        return q - self._controller.reference - self._servo

    def update(self, q: JointPositions, cycles: Cycles) -> bool:
        """Whether the reference of an arm, measured at q after so many, may be published."""
        controller = self._controller
        self._look(q, cycles * controller.T)
        self.restless += cycles * controller.T
        error = self._error(q)
        away = largest(error)
        is_same = largest(error - self._expected) <= min(_SERVO, away / 2)
        is_still = self._still >= _REST
        is_beyond = away > self._allowed
        goes_on = (np.abs(q - self._began) > self._explained).any()
        if self._follows and (goes_on or (is_still and is_beyond)):
            self._follows = False
            self._expected = np.zeros(len(q))
            is_same = False
        is_here = is_still or (self._follows and not is_beyond) or away <= _SERVO
        self.wait = max(self.wait - cycles * controller.T, 0.0) if is_here else _REST
        if not is_still:
            return is_here
        self.restless = 0.0
        self._expected = np.zeros(len(q))
        if self._follows or is_same:
            self._servo = self._servo + error
        elif away > _SERVO:
            controller.hold_at(q - self._servo)
            self._expected = error
            self._still = 0.0
            self.wait = _REST
        self._follows = False
        return True

    def _look(self, q: JointPositions, seconds: Seconds) -> None:
        if largest(q - self._stood) > _STILL:
            self._stood = q
            self._still = 0.0
        if self._still < _REST <= self._still + seconds:
            self._stood = q  # where it has come to rest
        self._still += seconds

    def catch_up(self, q: JointPositions) -> JointVelocities:
        """The velocity of the reference to an arm at q that was moved away from it."""
        end = self._stood if self._still >= _REST else q
        return approach_velocity(self._controller, end - self._servo, _CATCH_UP, 1.0)

    def has_caught_up(self, q: JointPositions) -> bool:
        """Whether that reference is where the arm rests."""
        self._look(q, self._controller.T)
        return self._still >= _REST and largest(self._error(self._stood)) <= ARRIVED


def approach_velocity(
    controller: Controller,
    q: JointPositions,
    acceleration: float = _ACCELERATION,
    speed: float = _SPEED,
) -> JointVelocities:
    """The velocity of the reference to q, from which all joints can stop there."""
    rest = q - controller.reference
    distances = np.maximum(np.abs(rest), ARRIVED)  # a joint that is there holds none of the others
    limits = controller.policy.limits
    A = np.full(len(q), acceleration)
    if limits is not None and limits.allowed_acceleration is not None:
        A = np.minimum(A, limits.allowed_acceleration)
    allowed = [
        min(stopping_speed(d, most, controller.T), V)
        for d, most, V in zip(distances, A, controller.model.dq_max * speed, strict=True)
    ]
    return rest * float(np.min(allowed / distances))


class PoseHold:
    """Adds to a twist what holds the component, translation or rotation, that it does not ask for.

    A velocity that is integrated drifts, and beside singularities and limits it is not executed in
    full. A planner closes its own loop; an operator does not, whose translation alone must not turn
    the tip. So a component that is hardly asked for keeps its last commanded pose: through pauses,
    in which nothing moves it, through holding, and changes of the law, until it is asked for again.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._rested = np.zeros(0)  # (n,) [rad]
        self.clear()

    def clear(self) -> None:
        """Hold nothing: something else moves the arm."""
        self._targets: dict[int, Pose] = {}  # by component
        self._added = np.zeros(6)

    def rest(self) -> None:
        """The arm comes to rest; what is held stays the same unless others move it."""
        self._rested = self._controller.reference

    def resume(self) -> None:
        if np.array_equal(self._controller.reference, self._rested):
            self._added = np.zeros(6)
        else:
            self.clear()

    def hold(
        self, dx: TaskVelocity, *, is_open_loop: bool
    ) -> tuple[TaskVelocity, Correction | None]:
        """The twist, and what only holds; that is None if nothing is held."""
        controller = self._controller
        task = controller.policy.task
        begins = is_open_loop and isinstance(task, Pose)
        if not (begins or self._targets or largest(self._added) > 0.0):
            return dx, None
        if not isinstance(task, Pose) or controller.published is None:
            self.clear()
            return dx, None
        q = controller.published.q
        state = RobotState(controller.model, q, np.zeros(len(q)))
        asks = largest(dx) > NOTHING
        speeds = np.linalg.norm(dx[:3]), _RADIUS * np.linalg.norm(dx[3:])
        is_held = np.zeros(6, bool)
        away = np.zeros(6)
        for component, (rows, fastest, acceleration, most) in enumerate(_COMPONENTS):
            is_asked = asks and speeds[component] > _HARDLY * speeds[1 - component]
            added = np.zeros(3)
            if not is_open_loop or is_asked:
                self._targets.pop(component, None)
            elif asks:
                target = self._targets.get(component)
                if target is None or target.frame != task.frame:
                    target = Pose(gain=_GAIN, frame=task.frame).with_initial_targets(state)
                    self._targets[component] = target
                error = target.error(state)[rows]
                is_held[rows] = True
                added = _shortened(_GAIN * error, fastest) - dx[rows]
                away[rows] = _GAIN * (most - np.linalg.norm(error))
            change = added - self._added[rows]
            self._added[rows] += _shortened(change, acceleration * controller.T)
        dx = dx + self._added
        if not (asks and is_held.any()):
            return dx, None
        return dx, Correction(dx * is_held, is_held, away)


def _shortened(vector: np.ndarray, length: float) -> np.ndarray:
    """The vector (3,), or one of that length if it is longer."""
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), length))
