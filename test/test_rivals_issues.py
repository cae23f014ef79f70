"""What went wrong elsewhere must not go wrong here. Each test is named after the thread that
reports the failure; docs/background.md lists them.
"""

from collections.abc import Callable

import numpy as np
import pytest
from test_command_loop import JOINT_LIMITS, Robot, T

from redres_ros import LAWS, Command, Controller, RobotModel, load_task, make_law, run
from redres_ros.kernels.tick import rotation_error
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.robots import ARMS

# tick, tip position (3,) [m] -> task velocity (3,) [m/s]
Source = Callable[[int, np.ndarray], np.ndarray]


def follow(
    arm: str, q: np.ndarray, source: Source, ticks: int, law='minimum_velocity', limits=JOINT_LIMITS
) -> list[Command]:
    model = RobotModel.named(arm)
    controller = Controller(model, law, T, limits=limits)
    commands = []
    for tick in range(ticks):
        command = controller.update(q, source(tick, model.tip(q)[0]))
        commands.append(command)
        q = command.q_ref
    return commands


def steady(*dx: float) -> Source:
    return lambda tick, x: np.array(dx)


def start_of(arm: str) -> np.ndarray:
    return np.array(ARMS[arm].start)


def beyond_the_range(arm: str, joint: int, excess: float) -> np.ndarray:
    """The start, but one joint [rad] beyond its upper end."""
    q = start_of(arm)
    q[joint] = RobotModel.named(arm).q_max[joint] + excess
    return q


@pytest.mark.parametrize(
    ('arm', 'excess', 'dx'),
    [
        pytest.param('iiwa7', 1.3e-4, (0.0, 0.05, 0.0), id='pink_163_beyond_by_rounding'),
        pytest.param('planar4r', None, (0.02, 0.0, 0.02), id='moveit2_3411_lacks_a_direction'),
    ],
)
def test_an_arm_beside_its_end_or_without_a_direction_moves_as_it_should(
    arm: str, excess: float | None, dx: tuple[float, ...]
) -> None:
    """There, 0.13 mrad beyond the range raised an exception, and an arm of four joints was in an
    emergency stop from the first twist on.
    """
    q = start_of(arm) if excess is None else beyond_the_range(arm, 1, excess)
    commands = follow(arm, q, steady(*dx), 100)
    assert commands[-1].J @ commands[-1].dq == pytest.approx(dx, abs=1e-9)


@pytest.mark.parametrize('arm', ['lwr4', 'iiwa7'])
def test_moveit2_3573_an_arm_that_starts_stretched_moves_at_once(arm: str) -> None:
    """There, joints at zero were a singularity in which nothing moves."""
    commands = follow(arm, np.zeros(7), steady(0.05, 0.0, 0.0), 100)
    assert np.abs(commands[2].dq).max() > 0.0
    assert commands[-1].J @ commands[-1].dq == pytest.approx([0.05, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize('law', LAWS)
def test_moveit_1616_out_of_a_singularity_one_gets_by_the_way_one_came(law: str) -> None:
    """There, an arm that had been steered into one could not be steered out again."""
    model = RobotModel.named('iiwa7')
    x, _ = model.tip(np.zeros(7))
    bent = follow('iiwa7', np.zeros(7), steady(0.0, 0.0, -0.05), 400, law)[-1].q_ref
    stretched = follow('iiwa7', bent, steady(0.0, 0.0, 0.05), 600, law)[-1].q_ref
    out = follow('iiwa7', stretched, steady(0.0, 0.0, -0.05), 400, law)[-1].q_ref
    assert x[2] - model.tip(out)[0][2] > 0.7 * 400 * T * 0.05


def test_pink_59_a_path_by_a_singularity_is_finished_though_velocity_limits_act() -> None:
    """There, the arm got stuck with its joints at their velocity limits."""
    task = load_task('rectangle')
    model = RobotModel.named(task.robot)
    law = make_law('minimum_velocity')
    recording = run(Controller(model, law, 0.01, limits=JOINT_LIMITS), task)
    assert recording.ending.startswith('reached the last point')
    assert recording['task_scaling'].min() < 1.0


def test_isaaclab_7862_no_pose_ends_with_joints_pinned_at_their_ends() -> None:
    """There, two of sixteen arms came to rest with two joints at their ends, 0.25 rad away."""
    model = RobotModel.named('fr3')
    random = np.random.default_rng(0)
    period = 0.004  # [s]
    for _ in range(16):
        x_d, R_d = model.tip(start_of('fr3') + random.uniform(-0.5, 0.5, model.n))
        controller = Controller(
            model, 'minimum_acceleration', period, task='pose', limits=JOINT_LIMITS
        )
        q = start_of('fr3')
        for _ in range(750):
            x, R = model.tip(q)
            q = controller.update(q, 3.0 * np.append(x_d - x, rotation_error(R, R_d))).q_ref
        x, R = model.tip(q)
        assert np.linalg.norm(rotation_error(R, R_d)) < 0.01
        assert np.linalg.norm(x_d - x) < 0.01


def sometimes(fraction: float) -> Callable[[int], bool]:
    """True for that fraction of cycles, at random."""
    came = np.random.default_rng(0).random(1000) < fraction
    return lambda cycle: bool(came[cycle])


def speeds_of(sent: Callable[[int], bool], arrives: Callable[[int], bool]) -> np.ndarray:
    """Tip speeds [m/s] while 0.1 m/s is asked for, by twists that come in some of the cycles.

    The robot's state arrives in some of them, too.
    """
    model = RobotModel.named('iiwa7')
    loop = CommandLoop(Controller(model, 'minimum_velocity', T, limits=JOINT_LIMITS))
    robot = Robot(loop, start_of('iiwa7'))
    commands = []
    for cycle in range(1, 1000):
        responses = [robot.ask()] if arrives(cycle) else []
        robot.cycle = cycle
        if sent(cycle):
            responses.append(robot.steer(np.array((0.0, 0.1, 0.0))))
        commands += [response.command for response in responses if response]
    return np.array([np.linalg.norm(command.J @ command.dq) for command in commands])


@pytest.mark.parametrize(
    ('sent', 'arrives'),
    [
        pytest.param(sometimes(0.7), sometimes(1.0), id='moveit2_2136_some_twists_do_not_come'),
        pytest.param(lambda k: k % 8 == 0, sometimes(1.0), id='ros2_kortex_412_policy_of_60_Hz'),
        pytest.param(sometimes(1.0), sometimes(0.95), id='kuka_drivers_35_some_states_do_not_come'),
    ],
)
def test_a_message_that_does_not_come_now_and_then_stops_no_motion(
    sent: Callable[[int], bool], arrives: Callable[[int], bool]
) -> None:
    """There, the velocity dropped to zero, the arm stopped and started with every message, or the
    robot's command mode ended.
    """
    assert speeds_of(sent, arrives)[500:] == pytest.approx(0.1, abs=1e-6)
