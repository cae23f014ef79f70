"""Other libraries for the same joint velocity: embodik, roboplan's OInK, pink and mink; and
Pinocchio's bare calls.

Beside robot_model.py and the fake robot the one place that calls pinocchio and mujoco: what a peer
costs must not depend on our own wrappers. Peers are imported when asked for, since they are no
requirement of this package.
"""

import atexit
import gc
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from redres_ros.robots import Arm
from redres_ros.robots.joint_limits import JointLimits

# quadratic programs for pink and mink, by the names that qpsolvers has for them
_SOLVERS = ('quadprog', 'daqp', 'proxqp')
# in pink's and mink's cost: small enough for the least velocity, large enough for a definite matrix
DAMPING = 1e-6
# OInK's, for its displacements within a tick, so that its velocities are the least ones
_OINK_DAMPING = 1e-4
_OINK_ACCURACY = 1e-9  # [rad]

_PACKAGES = {
    'embodik': 'embodik',
    'roboplan': 'roboplan',
    'pink': 'pink',
    'mink': 'mink',
    'quadprog': 'quadprog',
    'daqp': 'daqp',
    'proxqp': 'proxsuite',
}

Peer = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(q, x_d, dx) -> dq: the velocity at q (n,) [rad] that moves the tip to x_d (3,) [m] within a
tick, at dx (3,) [m/s]. Each peer uses the one of the two with which it is faster.
"""

Floor = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(q, dq) -> J, (6, n)."""


def missing_peers() -> tuple[str, ...]:
    """Names of peers and solvers that are not installed."""
    return tuple(name for name, package in _PACKAGES.items() if find_spec(package) is None)


def peers(arm: Arm, T: float, acting_scale: float) -> dict[str, Peer]:
    """Every installed peer, pink and mink with every installed solver, each in the fastest way that
    it documents, twice: once with the limits that it has by default, once without, as a law of the
    paper is. By default mink keeps positions, pink and embodik velocities too; embodik gets
    acceleration limits as well, and OInK all three: these two also under limits that act.

    Args:
        arm: That all of them get.
        T: Length of a tick [s].
        acting_scale: The fraction of its velocities and accelerations with which limits act.
    """
    missing = missing_peers()
    made: dict[str, Peer] = {}
    if 'embodik' not in missing:
        made['embodik'] = _embodik(arm, T, 1.0)
        made['embodik, no limits'] = _embodik(arm, T, None)
        made['embodik, limits acting'] = _embodik(arm, T, acting_scale)
    if 'roboplan' not in missing:
        made['roboplan OInK'] = _oink(arm, T, 1.0)
        made['roboplan OInK, no limits'] = _oink(arm, T, None)
        made['roboplan OInK, limits acting'] = _oink(arm, T, acting_scale)
    for library, make in {'pink': _pink, 'mink': _mink}.items():
        for solver in _SOLVERS:
            if not {library, solver} & set(missing):
                made[f'{library}, {solver}'] = make(arm, T, solver, None)
                made[f'{library}, {solver}, no limits'] = make(arm, T, solver, [])
    return made


def _embodik(arm: Arm, T: float, limit_scale: float | None) -> Peer:
    """limit_scale: on velocities and accelerations; None: without limits."""
    import embodik

    solver = _embodik_solver(arm, T, limit_scale)
    task = solver.add_frame_task('tip', arm.tip_frame, embodik.TaskType.FRAME_POSITION)

    def velocity(q: np.ndarray, x_d: np.ndarray, dx: np.ndarray) -> np.ndarray:
        task.set_target_velocity(dx)
        return solver.solve_velocity_dq(q, limit_scale is not None)

    return velocity


def _embodik_solver(arm: Arm, T: float, limit_scale: float | None) -> Any:
    """As for _embodik()."""
    import embodik

    # Its binding complains at the end of whatever the collector has not cleared away.
    atexit.unregister(gc.freeze)
    with tempfile.NamedTemporaryFile('w', suffix='.urdf') as file:
        file.write(arm.description())
        file.flush()
        robot = embodik.RobotModel(file.name)
    solver = embodik.KinematicsSolver(robot)
    solver.dt = T
    if limit_scale is not None:
        limits = JointLimits.of(arm)
        solver.set_acceleration_limits(limit_scale * limits.acceleration)
        solver.enable_acceleration_limits(True)
        for joint, largest in enumerate(limits.velocity):
            solver.set_joint_velocity_limit(joint, limit_scale * float(largest))
    return solver


def _oink(arm: Arm, T: float, limit_scale: float | None) -> Peer:
    """limit_scale: on velocities and accelerations; None: without limits."""
    follow = _oink_solver(arm, T, limit_scale, orientation_cost=0.0, accuracy=_OINK_ACCURACY)
    target = np.eye(4, order='F')
    dq = np.zeros_like(JointLimits.of(arm).velocity)

    def velocity(q: np.ndarray, x_d: np.ndarray, dx: np.ndarray) -> np.ndarray:
        nonlocal dq
        target[:3, 3] = x_d
        dq = follow(q, dq, target)
        return dq

    return velocity


def _oink_solver(
    arm: Arm,
    T: float,
    limit_scale: float | None,
    orientation_cost: float,
    accuracy: float | None = None,
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """(q, dq, target) -> dq: the velocity at q after dq that brings the tip to a pose (4, 4) within
    a tick. Limits as of _oink(); accuracy [rad], None: its default.

    In a few ticks of ten thousand its solver does not come to an end: such a tick goes without the
    acceleration limit.
    """
    from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
    from roboplan.optimal_ik import (
        AccelerationLimit,
        FrameTask,
        FrameTaskOptions,
        Oink,
        OinkSettings,
        PositionLimit,
        VelocityLimit,
    )

    limits = JointLimits.of(arm)
    scene = Scene(arm.tip_frame, loadUrdfSceneDescriptionFromXml(arm.description()))
    settings = OinkSettings()
    if accuracy is not None:
        settings.eps_abs = accuracy
    solver = Oink(scene, settings)
    tip = CartesianConfiguration('', arm.tip_frame, np.eye(4))
    task = FrameTask(solver, scene, tip, FrameTaskOptions(orientation_cost=orientation_cost))
    usual: list[Any] = []
    accelerations: list[Any] = []
    if limit_scale is not None:
        usual = [PositionLimit(solver), VelocityLimit(solver, T, limit_scale * limits.velocity)]
        accelerations = [AccelerationLimit(solver, T, limit_scale * limits.acceleration)]
    kept = [*usual, *accelerations]
    step = np.zeros(solver.num_variables)

    def follow(q: np.ndarray, dq: np.ndarray, target: np.ndarray) -> np.ndarray:
        task.setTargetFrameTransform(target)
        for acceleration in accelerations:
            acceleration.setLastVelocity(dq)
        try:
            solver.solveIk(q, [task], kept, [], step, _OINK_DAMPING)
        except RuntimeError:
            solver.solveIk(q, [task], usual, [], step, _OINK_DAMPING)
        return step / T

    return follow


def _pink(arm: Arm, T: float, solver: str, limits: list[Any] | None) -> Peer:
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.tasks import FrameTask

    model = pin.buildModelFromXML(arm.description())
    configuration = Configuration(model, model.createData(), pin.neutral(model))
    task = FrameTask(arm.tip_frame, position_cost=1.0, orientation_cost=0.0)
    task.set_target(pin.SE3.Identity())

    def velocity(q: np.ndarray, x_d: np.ndarray, dx: np.ndarray) -> np.ndarray:
        configuration.update(q)
        task.transform_target_to_world.translation = x_d
        return solve_ik(
            configuration,
            (task,),
            T,
            solver=solver,
            damping=DAMPING,
            limits=limits,
            safety_break=False,  # no look at the position limits before each call
        )

    return velocity


def _mink(arm: Arm, T: float, solver: str, limits: list[Any] | None) -> Peer:
    from mink import SE3, Configuration, ConfigurationLimit, FrameTask, solve_ik

    configuration = Configuration(_bare_mujoco_model(arm))
    if limits is None:
        limits = [ConfigurationLimit(configuration.model)]  # else it is built in every call
    task = FrameTask(arm.tip_frame, 'body', position_cost=1.0, orientation_cost=0.0)

    def velocity(q: np.ndarray, x_d: np.ndarray, dx: np.ndarray) -> np.ndarray:
        configuration.update(q)
        task.set_target(SE3.from_translation(x_d))
        return solve_ik(configuration, (task,), T, solver=solver, damping=DAMPING, limits=limits)

    return velocity


def _bare_mujoco_model(arm: Arm) -> Any:
    """The arm without shapes, which would cost time."""
    import mujoco

    spec = mujoco.MjSpec.from_string(arm.description())
    for shape in (*spec.geoms, *spec.meshes):
        spec.delete(shape)
    return spec.compile()


def floors(arm: Arm) -> dict[str, Floor]:
    """Pinocchio's calls for a law: kinematics; with M and n; and all terms."""
    import pinocchio as pin

    model = pin.buildModelFromXML(arm.description())
    data = model.createData()
    tip = model.getFrameId(arm.tip_frame)

    def jacobian() -> np.ndarray:
        pin.updateFramePlacement(model, data, tip)
        return pin.getFrameJacobian(model, data, tip, pin.LOCAL_WORLD_ALIGNED)

    def kinematics(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        pin.computeJointJacobians(model, data, q)
        return jacobian()

    def dynamics(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        pin.crba(model, data, q)
        pin.nonLinearEffects(model, data, q, dq)
        return kinematics(q, dq)

    def everything(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        pin.computeAllTerms(model, data, q, dq)
        return jacobian()

    return {
        'kinematics': kinematics,
        'kinematics, M and n': dynamics,
        'computeAllTerms': everything,
    }


TwistPeer = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(q, dq, dx) -> q in the next tick; q and dq (n,) [rad], [rad/s], dx (6,) [m/s], [rad/s]."""


def twist_peers() -> dict[str, Callable[[Arm, float], TwistPeer]]:
    """What makes each installed peer follow twists of a pose, with all limits that it has."""
    missing = missing_peers()
    made: dict[str, Callable[[Arm, float], TwistPeer]] = {}
    if 'embodik' not in missing:
        made['embodik'] = _embodik_twists
    if 'roboplan' not in missing:
        made['roboplan OInK'] = _oink_twists
    if not {'pink', 'quadprog'} & set(missing):
        made['pink'] = _pink_twists
    if not {'mink', 'daqp'} & set(missing):
        made['mink'] = _mink_twists
    return made


def _embodik_twists(arm: Arm, T: float) -> TwistPeer:
    """With least error, which keeps the arm moving where its direction cannot be kept."""
    import embodik

    solver = _embodik_solver(arm, T, 1.0)
    task = solver.add_frame_task('tip', arm.tip_frame, embodik.TaskType.FRAME_POSE)
    task.solve_mode = embodik.TaskSolveMode.MIN_ERROR

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        task.set_target_velocity(dx)
        return q + T * solver.solve_velocity_dq(q, True)

    return follow


def _oink_twists(arm: Arm, T: float) -> TwistPeer:
    """Where limits have no common solution, with what is nearest to them in least squares."""
    import pinocchio as pin

    model = pin.buildModelFromXML(arm.description())
    data = model.createData()
    tip = model.getFrameId(arm.tip_frame)
    velocity = _oink_solver(arm, T, 1.0, orientation_cost=1.0)
    target = np.eye(4, order='F')

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, q)
        target[:3, :3] = pin.exp3(T * dx[3:]) @ data.oMf[tip].rotation
        target[:3, 3] = data.oMf[tip].translation + T * dx[:3]
        return q + T * velocity(q, dq, target)

    return follow


def _pink_twists(arm: Arm, T: float) -> TwistPeer:
    """Beside joint ends its acceleration limit has no common solution with the others (its #206);
    such a tick goes without it.
    """
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.exceptions import NoSolutionFound
    from pink.limits import AccelerationLimit
    from pink.tasks import FrameTask

    model = pin.buildModelFromXML(arm.description())
    configuration = Configuration(model, model.createData(), pin.neutral(model))
    task = FrameTask(arm.tip_frame, position_cost=1.0, orientation_cost=1.0)
    acceleration = AccelerationLimit(model, JointLimits.of(arm).acceleration)
    usual = [model.configuration_limit, model.velocity_limit]
    options = {'solver': 'quadprog', 'damping': DAMPING, 'safety_break': False}

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        configuration.update(q)
        tip = configuration.get_transform_frame_to_world(arm.tip_frame)
        R = pin.exp3(T * dx[3:]) @ tip.rotation
        task.set_target(pin.SE3(R, tip.translation + T * dx[:3]))
        acceleration.set_last_integration(dq, T)
        try:
            v = solve_ik(configuration, (task,), T, limits=[*usual, acceleration], **options)
        except NoSolutionFound:
            v = solve_ik(configuration, (task,), T, limits=usual, **options)
        return q + T * v

    return follow


def _mink_twists(arm: Arm, T: float) -> TwistPeer:
    """Without a limit on accelerations, which it does not have."""
    from mink import SE3, SO3, Configuration, FrameTask, solve_ik
    from mink.limits import ConfigurationLimit, VelocityLimit

    model = _bare_mujoco_model(arm)
    configuration = Configuration(model)
    task = FrameTask(arm.tip_frame, 'body', position_cost=1.0, orientation_cost=1.0)
    limits = JointLimits.of(arm)
    fastest = dict(zip(limits.joint_names, limits.velocity.tolist(), strict=True))
    kept = [ConfigurationLimit(model), VelocityLimit(model, fastest)]

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        configuration.update(q)
        tip = configuration.get_transform_frame_to_world(arm.tip_frame, 'body')
        R = SO3.exp(T * dx[3:]) @ tip.rotation()
        task.set_target(SE3.from_rotation_and_translation(R, tip.translation() + T * dx[:3]))
        return q + T * solve_ik(
            configuration, (task,), T, solver='daqp', damping=DAMPING, limits=kept
        )

    return follow
