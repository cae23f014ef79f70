"""The text that `redres demo` prints before and after a run: what happens, and why it matters."""

from redres_ros.demo.options import DemoOptions
from redres_ros.demo.outcome import Outcome
from redres_ros.robot_model import RobotModel


def before(options: DemoOptions, model: RobotModel) -> str:
    """Two sentences before a run.

    Args:
        options: Of the demo.
        model: Of the arm.
    """
    joints = len(model.joint_names)
    nodes = 'one process of three nodes' if options.composed else 'three ROS 2 nodes'
    matter = 'that choice decides how smoothly the arm moves'
    if options.task == 'rectangle':  # a task of the paper's arm
        matter = 'near the stretched arm, 7 s into the task, that decides whether it gets through'
    return (
        f'A simulated arm of {joints} joints moves its tip along a task, '
        f'led by {nodes} in {options.rate:g} cycles a second. '
        f'Many joint motions would do; the law {options.law} chooses one in every cycle, and '
        f'{matter}.'
    )


def after(outcome: Outcome, options: DemoOptions, robot: str) -> str:
    """Two sentences after a run; none if there is nothing to learn from it.

    Args:
        outcome: What came of the run.
        options: Of the demo.
        robot: That of the task.
    """
    if outcome.motion is None or outcome.interrupted:
        return ''
    if outcome.stop_reason.startswith('timing'):
        return (
            'The robot stopped the arm because commands came too late: this computer was too busy. '
            'Try again, or with --lockstep, which waits for every answer.'
        )
    # What follows was measured with the paper's task and arm.
    is_papers = (options.task, robot) == ('rectangle', 'lwr4_paper')
    within_limits = 'none' not in options.parameters.get('limits', ())
    if outcome.stop_reason:
        text = (
            'The robot stopped the arm, as a real one would: the law asked for more than the '
            'joints have.'
        )
        if not within_limits:
            text += ' Within limits (without --limits none) the arm goes slower there instead.'
        if is_papers and options.law == 'minimum_velocity':
            text += ' --law minimum_acceleration passes smoothly.'
        return text
    if not outcome.succeeded:
        return ''
    acceleration, at = outcome.motion.acceleration
    text = (
        f'The arm came through, at most {1e3 * outcome.motion.path_deviation[0]:.1f} mm '
        'off its path, and '
        f'its joints accelerated most at {at:.1f} s, by {acceleration:.1f} rad/s².'
    )
    if is_papers and options.law != 'minimum_velocity':
        text += (
            ' See what the choice is worth: redres demo --law minimum_velocity --limits none takes '
            'the least velocity in every cycle, and is stopped.'
        )
    return text
