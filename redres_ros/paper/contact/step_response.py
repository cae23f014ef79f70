"""A step of force on a mass, damper and spring: in the ideal loop, and on the plant."""

from typing import NamedTuple

import numpy as np

from redres_ros.contact import Admittance, AdmittanceSettings
from redres_ros.controller import Controller
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.laws import make_law
from redres_ros.robot_model import RobotModel

T = 0.002  # [s]
MASS = 4.0  # [kg]
DAMPING = 40.0  # [N s/m]
STIFFNESS = 400.0  # [N/m]
FORCE = 10.0  # [N] along y
_STEPS = 1000


class PlantResponse(NamedTuple):
    """Largest deviation from the analytic motion, how far the servos give way to the force, and
    the difference from the ideal loop that this does not explain [m].
    """

    error: float
    deflection: float
    unexplained: float


def analytic(t: np.ndarray | None = None) -> np.ndarray:
    """The motion of the mass, (N,) [m].

    Args:
        t: Times, (N,) [s]; None: those of the ticks.
    """
    t = T * np.arange(_STEPS + 1) if t is None else t
    sigma = DAMPING / (2.0 * MASS)
    omega = np.sqrt(STIFFNESS / MASS - sigma**2)
    decay = np.exp(-sigma * t) * (np.cos(omega * t) + sigma / omega * np.sin(omega * t))
    moved: np.ndarray = FORCE / STIFFNESS * (1.0 - decay)
    return moved


def in_the_ideal_loop() -> np.ndarray:
    """What the tip of an ideal arm does, (N,) [m]."""
    arm = RobotModel.named('fr3').arm
    model = RobotModel.named('fr3')
    return _moved(IdealPlant(model.joint_names, T, np.array(arm.start)), FORCE)


def on_plant_after(bandwidth: float) -> PlantResponse:
    """What it does on the plant, the force being a real one.

    The servos give way to the force by what is measured without the admittance. What is left is
    their lag: the wrench acts on the plant in a cycle, and on the reference after it.

    Args:
        bandwidth: Of the servos [rad/s].
    """
    arm = RobotModel.named('fr3').arm
    start = np.array(arm.start)
    settings = MujocoSettings(servo_bandwidth=bandwidth)
    moved = _moved(MujocoPlant(arm, T, start, settings), FORCE)
    deflection = _moved(MujocoPlant(arm, T, start, settings), 0.0)
    unexplained = moved - in_the_ideal_loop() - deflection
    return PlantResponse(
        float(np.abs(moved - analytic()).max()),
        float(np.abs(deflection).max()),
        float(np.abs(unexplained).max()),
    )


def _moved(plant: IdealPlant | MujocoPlant, felt: float) -> np.ndarray:
    """Motion of the tip along the force, (N,) [m], that pushes a plant.

    Args:
        plant: At its start.
        felt: Force that the sensor shows [N].
    """
    model = RobotModel.named('fr3')
    settings = AdmittanceSettings(
        enabled=True, mass=(MASS,) * 3, damping=(DAMPING,) * 3, stiffness=(STIFFNESS,) * 3
    )
    controller = Controller(model, make_law('minimum_acceleration', damping=10.0), T)
    admittance = Admittance(settings, T)
    wrench = np.array((0.0, felt, 0.0, 0.0, 0.0, 0.0))
    push = np.array((0.0, FORCE, 0.0))
    places = [model.tip(plant.q)[0][1]]
    for _ in range(_STEPS):
        state = model.state(plant.q, np.zeros(model.n))
        command = controller.update(plant.q, admittance.velocity(np.zeros(3), wrench, state))
        admittance.record(command, np.zeros(3))
        plant.push(push)
        plant.step(command.q_ref)
        places.append(model.tip(plant.q)[0][1])
    return np.array(places) - places[0]
