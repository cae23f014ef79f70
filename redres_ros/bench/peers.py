"""Others' ways to the same joint velocity: pink and mink; and Pinocchio's bare calls, below which
none can get.

The one place besides robot_model.py and fri/plant.py that uses pinocchio and mujoco: what a peer
costs must not depend on our own wrappers. Peers are imported when asked for, since they are no
requirement of this package.
"""

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import numpy as np

from redres_ros.robots import Arm

REMEDY = "pip install 'redres_ros[bench]'"
SOLVERS = (
    'quadprog',
    'daqp',
    'proxqp',
)  # quadratic programs, by the names that qpsolvers has for them
# of the peers' cost: small enough for the least velocity, large enough for a definite problem
DAMPING = 1e-6

_PACKAGES = {
    'pink': 'pink',
    'mink': 'mink',
    'quadprog': 'quadprog',
    'daqp': 'daqp',
    'proxqp': 'proxsuite',
}

Peer = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(q, x_d) -> dq, all in SI units: the velocity at q (n,) that leads the tip to x_d (3,) within one tick."""


def missing_peers() -> tuple[str, ...]:
    """Names of peers and solvers that are not installed."""
    return tuple(name for name, package in _PACKAGES.items() if find_spec(package) is None)


def peers(arm: Arm, T: float) -> dict[str, Peer]:
    """Every installed peer with every installed solver, twice.

    As its documentation has it, which includes the joint limits (both libraries then make them anew
    in every call), and without limits, which is faster, and all that our laws do.
    """
    missing = missing_peers()
    made = {}
    for solver in (solver for solver in SOLVERS if solver not in missing):
        for library, make in (('pink', _pink), ('mink', _mink)):
            if library not in missing:
                made[f'{library}, {solver}'] = make(arm, T, solver, None)
                made[f'{library}, {solver}, no limits'] = make(arm, T, solver, [])
    return made


def _pink(arm: Arm, T: float, solver: str, limits: list | None) -> Peer:
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.tasks import FrameTask

    model = pin.buildModelFromXML(arm.description())
    configuration = Configuration(model, model.createData(), pin.neutral(model))
    task = FrameTask(arm.tip_frame, position_cost=1.0, orientation_cost=0.0)
    task.set_target(pin.SE3.Identity())

    def velocity(q: np.ndarray, x_d: np.ndarray) -> np.ndarray:
        configuration.update(q)
        task.transform_target_to_world.translation = x_d
        return solve_ik(configuration, (task,), T, solver=solver, damping=DAMPING, limits=limits)

    return velocity


def _mink(arm: Arm, T: float, solver: str, limits: list | None) -> Peer:
    from mink import SE3, Configuration, FrameTask, solve_ik

    configuration = Configuration(_bare_mujoco_model(arm))
    task = FrameTask(arm.tip_frame, 'body', position_cost=1.0, orientation_cost=0.0)

    def velocity(q: np.ndarray, x_d: np.ndarray) -> np.ndarray:
        configuration.update(q)
        task.set_target(SE3.from_translation(x_d))
        return solve_ik(configuration, (task,), T, solver=solver, damping=DAMPING, limits=limits)

    return velocity


def _bare_mujoco_model(arm: Arm) -> object:
    """The arm without shapes, which would only cost time."""
    import mujoco

    spec = mujoco.MjSpec.from_string(arm.description())
    for shape in (*spec.geoms, *spec.meshes):
        spec.delete(shape)
    return spec.compile()


def floors(arm: Arm) -> Iterator[tuple[str, Callable[[np.ndarray, np.ndarray], object]]]:
    """Pinocchio's calls (q, dq) -> J for what a law needs: kinematics; M and n besides; and all
    that it knows.
    """
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

    yield 'kinematics', kinematics
    yield 'kinematics, M and n', dynamics
    yield 'computeAllTerms', everything
