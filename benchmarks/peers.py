"""embodik, roboplan's OInK, pink and mink for the same joint velocity, and Pinocchio's bare calls.

They call Pinocchio and MuJoCo themselves: what a peer costs must not depend on our own wrappers.
Needs the extra bench; a peer that is not installed is left out.
"""

import atexit
import gc
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from redres_ros.robots import Arm
from redres_ros.robots.joint_limits import JointLimits

SOLVER = 'quadprog'  # for pink and mink
# in pink's and mink's cost: small enough for the least velocity, large enough for a definite matrix
DAMPING = 1e-6
OINK_DAMPING = 1e-4  # of the displacement within a tick, so that its velocities are the least ones
OINK_ACCURACY = 1e-9  # [rad]


class Target(NamedTuple):
    """Where the end effector is after one tick. Each peer uses pose or twist, the faster one."""

    x: np.ndarray  # (3,) [m]
    R: np.ndarray  # (3, 3); of no effect in a position task
    dx: np.ndarray  # twist that leads there, (3,) or (6,) [m/s], [rad/s]


Peer = Callable[[np.ndarray, np.ndarray, Target], np.ndarray]
"""(q, dq, target) -> dq: the velocity (n,) [rad/s] at q after dq that reaches the target."""


class Setting(NamedTuple):
    """What a peer is made for."""

    arm: Arm
    T: float  # length of a tick [s]
    is_pose: bool  # whether the orientation counts
    limit_scale: float | None  # on velocities and accelerations, with all limits; None: no limits

    @property
    def limits(self) -> JointLimits:
        """Of the arm, full."""
        return JointLimits.of(self.arm)


def installed() -> dict[str, Callable[[Setting], Peer]]:
    """What makes each installed peer, in the fastest form that it documents."""
    return {name: make for name, make in MAKERS.items() if find_spec(name)}


def embodik(setting: Setting) -> Peer:
    """A pose is followed with least error, which keeps the arm moving at singularities."""
    import embodik

    # Its binding complains at the end of whatever the collector has not cleared away.
    atexit.unregister(gc.freeze)
    with tempfile.NamedTemporaryFile('w', suffix='.urdf') as file:
        file.write(setting.arm.description())
        file.flush()
        robot = embodik.RobotModel(file.name)
    solver = embodik.KinematicsSolver(robot)
    solver.dt = setting.T
    scale = setting.limit_scale
    if scale is not None:
        solver.set_acceleration_limits(scale * setting.limits.acceleration)
        solver.enable_acceleration_limits(True)
        for joint, largest in enumerate(setting.limits.velocity):
            solver.set_joint_velocity_limit(joint, scale * float(largest))
    kind = embodik.TaskType.FRAME_POSE if setting.is_pose else embodik.TaskType.FRAME_POSITION
    task = solver.add_frame_task('tip', setting.arm.tip_frame, kind)
    if setting.is_pose:
        task.solve_mode = embodik.TaskSolveMode.MIN_ERROR

    def velocity(q: np.ndarray, dq: np.ndarray, target: Target) -> np.ndarray:
        task.set_target_velocity(target.dx)
        return solver.solve_velocity_dq(q, scale is not None)

    return velocity


def oink(setting: Setting) -> Peer:
    """In a few ticks of ten thousand its solver does not come to an end: such a tick goes without
    the acceleration limit.
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

    arm = setting.arm
    scene = Scene(arm.tip_frame, loadUrdfSceneDescriptionFromXml(arm.description()))
    settings = OinkSettings()
    if not setting.is_pose:
        settings.eps_abs = OINK_ACCURACY
    solver = Oink(scene, settings)
    tip = CartesianConfiguration('', arm.tip_frame, np.eye(4))
    options = FrameTaskOptions(orientation_cost=float(setting.is_pose))
    task = FrameTask(solver, scene, tip, options)
    usual: list[Any] = []
    accelerations: list[Any] = []
    scale = setting.limit_scale
    if scale is not None:
        limits = setting.limits
        usual = [PositionLimit(solver), VelocityLimit(solver, setting.T, scale * limits.velocity)]
        accelerations = [AccelerationLimit(solver, setting.T, scale * limits.acceleration)]
    step = np.zeros(solver.num_variables)
    pose = np.eye(4, order='F')

    def velocity(q: np.ndarray, dq: np.ndarray, target: Target) -> np.ndarray:
        pose[:3, :3] = target.R
        pose[:3, 3] = target.x
        task.setTargetFrameTransform(pose)
        for acceleration in accelerations:
            acceleration.setLastVelocity(dq)
        try:
            solver.solveIk(q, [task], usual + accelerations, [], step, OINK_DAMPING)
        except RuntimeError:
            solver.solveIk(q, [task], usual, [], step, OINK_DAMPING)
        return step / setting.T

    return velocity


def pink(setting: Setting) -> Peer:
    """Beside joint ends its acceleration limit has no common solution with the others (its #206);
    such a tick goes without it.
    """
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.exceptions import NoSolutionFound
    from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
    from pink.tasks import FrameTask

    model = pin.buildModelFromXML(setting.arm.description())
    scale = setting.limit_scale
    usual: list[Any] = []
    accelerations: list[Any] = []
    if scale is not None:
        model.velocityLimit = scale * model.velocityLimit
        usual = [ConfigurationLimit(model), VelocityLimit(model)]
        accelerations = [AccelerationLimit(model, scale * setting.limits.acceleration)]
    configuration = Configuration(model, model.createData(), pin.neutral(model))
    task = FrameTask(
        setting.arm.tip_frame, position_cost=1.0, orientation_cost=float(setting.is_pose)
    )
    # safety_break would look at the position limits before each call
    options = {'solver': SOLVER, 'damping': DAMPING, 'safety_break': False}

    def velocity(q: np.ndarray, dq: np.ndarray, target: Target) -> np.ndarray:
        configuration.update(q)
        task.set_target(pin.SE3(target.R, target.x))
        for acceleration in accelerations:
            acceleration.set_last_integration(dq, setting.T)
        limits = usual + accelerations
        try:
            return solve_ik(configuration, (task,), setting.T, limits=limits, **options)
        except NoSolutionFound:
            return solve_ik(configuration, (task,), setting.T, limits=usual, **options)

    return velocity


def mink(setting: Setting) -> Peer:
    """It has no limit on accelerations."""
    from mink import SE3, SO3, Configuration, FrameTask, solve_ik
    from mink.limits import ConfigurationLimit, VelocityLimit

    configuration = Configuration(bare_mujoco_model(setting.arm))
    task = FrameTask(
        setting.arm.tip_frame, 'body', position_cost=1.0, orientation_cost=float(setting.is_pose)
    )
    limits: list[Any] = []
    if setting.limit_scale is not None:
        largest = (setting.limit_scale * setting.limits.velocity).tolist()
        by_name = dict(zip(setting.limits.joint_names, largest, strict=True))
        model = configuration.model
        limits = [ConfigurationLimit(model), VelocityLimit(model, by_name)]

    def velocity(q: np.ndarray, dq: np.ndarray, target: Target) -> np.ndarray:
        configuration.update(q)
        R = SO3.from_matrix(target.R) if setting.is_pose else SO3.identity()
        task.set_target(SE3.from_rotation_and_translation(R, target.x))
        return solve_ik(
            configuration, (task,), setting.T, solver=SOLVER, damping=DAMPING, limits=limits
        )

    return velocity


MAKERS = {'embodik': embodik, 'roboplan': oink, 'pink': pink, 'mink': mink}


def bare_mujoco_model(arm: Arm) -> Any:
    """The arm without shapes, which would cost time."""
    import mujoco

    spec = mujoco.MjSpec.from_string(arm.description())
    for shape in (*spec.geoms, *spec.meshes):
        spec.delete(shape)
    return spec.compile()


def pinocchio_calls(arm: Arm) -> dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]:
    """Pinocchio's calls for a law, (q, dq) -> J (6, n): kinematics; with M and n; and all terms."""
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
