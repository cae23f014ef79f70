"""What the paper leaves open, how we read it, and what speaks for that."""

import numpy as np

from redres_ros.paper.claims.claim import ASSUMPTION, Finding, claim
from redres_ros.paper.runs import Runs
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm

_AT_START = 1e-3  # [m] up to which q(0) is at x_0


@claim(
    '5',
    'The arm is an LWR IV with a raised base and a tool, whose lengths the paper does not give',
    ASSUMPTION,
)
def _geometry(runs: Runs) -> Finding:
    arm = find_arm(runs.task.robot)
    bare = RobotModel(find_arm(runs.task.robot, base_offset=0.0, tool_offset=0.0))
    miss, bare_miss = (_miss(runs, model) for model in (runs.model, bare))
    shoulder = runs.model.position(runs.task.start, 'link_2')
    needed = float(np.linalg.norm(runs.task.waypoints - shoulder, axis=1).max())
    reach, bare_reach = (_reach(model) for model in (runs.model, bare))
    return Finding(
        miss < _AT_START and bare_reach < needed < reach,
        f'with the base {1e3 * arm.base_offset:g} mm higher and a tool of '
        f'{1e3 * arm.tool_offset:g} mm, q(0) is {1e3 * miss:.2f} mm from x_0, and the shoulder '
        f'reaches {reach:.3f} m of the {needed:.3f} m to the farthest point; with the bare arm '
        f'{1e3 * bare_miss:.0f} mm and {bare_reach:.3f} m',
        'the two lengths are those that fit q(0) and x_0 of the paper',
    )


@claim(
    '5',
    "The next segment begins once this one's time is over and the error is below 1 mm",
    ASSUMPTION,
)
def _switching(runs: Runs) -> Finding:
    rest = runs['simulated_23']
    early = runs['early_23']
    rises = {}
    for rule in ('simulated', 'early'):
        without, damped = (
            runs[f'{rule}_{law}'].peak('joint_acceleration_norm')[0] for law in ('15', '23')
        )
        rises[rule] = (damped, without / damped)
    return Finding(
        rises['simulated'][1] > 10.0 > rises['early'][1],
        f'so the task ends at {rest["t"][-1] + rest.T:.3f} s, largest |ddq| '
        f'{rises["simulated"][0]:.1f} rad/s^2, {rises["simulated"][1]:.0f} times as much without '
        f'damping; with a switch as soon as the error is below 1 mm at '
        f'{early["t"][-1] + early.T:.3f} s, {rises["early"][0]:.0f} rad/s^2 and '
        f'{rises["early"][1]:.1f} times',
        'the paper says only that the error is below 1 mm, and that the peaks rise 40 times, which '
        'a switch before the end of the time would hide: it is a step of the task velocity',
    )


def _miss(runs: Runs, model: RobotModel) -> float:
    """Distance of the tip from x_0 at q(0) [m]."""
    return float(np.linalg.norm(model.tip(runs.task.start)[0] - runs.task.waypoints[0]))


def _reach(model: RobotModel) -> float:
    """Distance of the tip from the shoulder with the arm stretched [m]."""
    stretched = np.zeros(model.n)
    return float(np.linalg.norm(model.tip(stretched)[0] - model.position(stretched, 'link_2')))
