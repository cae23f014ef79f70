"""A preference that uses a sensor of your own: the elbow keeps away from what comes near it.

The sensor measures the distance of the elbow from a wall at its side. On the nodes, load this file
with the parameter plugins: the controller then listens to the topic `elbow_distance`
(std_msgs/Float64MultiArray) while elbow_clearance is among the preferences.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros import Controller, Preference, RobotModel, RobotState, make_law, param

T = 0.002  # [s]
WALL = -0.02  # [m] at which y of the base; the elbow begins at 0


@dataclass(frozen=True)
class ElbowClearance(Preference):
    """Away from the wall, as if a spring were between: ddq_N = k max(d_0 - d, 0) dy/dq."""

    measurement: ClassVar[str] = 'elbow_distance'
    clearance: float = param(0.1, 'd_0, from which on nothing pushes [m]', 0.0, 1.0)

    def acceleration(self, state: RobotState) -> np.ndarray:
        measured = state.measurements.get(self.measurement)
        if measured is None:  # no fresh value
            return np.zeros(len(state.q))
        slope = state.jacobian(state.model.elbow_frame)[1]  # dy/dq
        return self.gain * max(self.clearance - float(measured[0]), 0.0) * slope


def main() -> None:
    """The tip stays where it is, and the elbow moves away."""
    model = RobotModel.named('fr3')
    law = make_law('minimum_acceleration', damping=10.0)
    controller = Controller(model, law, T, preferences=(ElbowClearance(gain=400.0),))
    q = np.array(model.arm.start)
    x, _ = model.tip(q)
    for _ in range(2000):
        distance = model.position(q, model.elbow_frame)[1] - WALL  # what the sensor measures
        controller.measurements = {'elbow_distance': np.array([distance])}
        q = controller.update(q, np.zeros(3)).q_ref
    moved = np.linalg.norm(model.tip(q)[0] - x)
    print(f'the elbow is {1e3 * distance:.0f} mm from the wall, the tip moved {1e3 * moved:.2f} mm')


if __name__ == '__main__':
    main()
