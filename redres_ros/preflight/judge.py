"""All verdicts on a graph, from what was seen of it."""

from redres_ros.preflight.arm import judge_arm
from redres_ros.preflight.graph import (
    judge_commands,
    judge_controller,
    judge_session,
    judge_states,
    judge_twists,
)
from redres_ros.preflight.graph_snapshot import GraphSnapshot
from redres_ros.preflight.stamps import judge_stamps
from redres_ros.preflight.verdict import ExpectedArm, Level, Verdict


def judge(seen: GraphSnapshot, expected: ExpectedArm | None) -> list[Verdict]:
    """All verdicts, the robot's first.

    Args:
        seen: Of the graph.
        expected: What is expected where no controller runs; None: not known.
    """
    if seen.controller:
        parameters = seen.controller
        expected = ExpectedArm(parameters['robot'], parameters['tip_frame'], parameters['rate'])
    verdicts = [*judge_states(seen), *judge_session(seen)]
    if expected is None:
        text = 'no controller runs and no --robot is named: joints and limits are not known'
        verdicts.append(Verdict(Level.FAULT, 'arm', text))
    else:
        verdicts += judge_stamps(seen.states, expected.rate)
        verdicts += judge_arm(seen, expected)
    return [*verdicts, *judge_controller(seen), *judge_commands(seen), *judge_twists(seen)]
