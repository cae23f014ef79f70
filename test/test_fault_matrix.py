"""Every message between the nodes, with every kind of fault, and what becomes of the arm.

The table is that of docs/fault_matrix.md, which `python test/test_fault_matrix.py` writes. The
kinds of faults are those that PX4 injects into its sensors. All of it runs in virtual time with
the nodes as they are (virtual_graph.py), the robot as strict as a real one.
"""

from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from virtual_graph import Fault, VirtualRun, virtual_run
from wire_faults import CHANNELS, FAULTS, Channel, make_fault

from redres_ros.nodes.conversions import to_pose
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

RATE = 100.0  # [Hz]
DURATION = 0.6  # [s] of a fault
# [rad/s] left of a null-space motion of 0.3 rad/s, which fades with 10 /s once no task moves
DECAYED = 2e-3
PAGE = Path(__file__).parents[1] / 'docs' / 'fault_matrix.md'
LIMITS = JointLimits.of(find_arm('lwr4_paper'))

# --- what becomes of the arm ----------------------------------------------------------------------


class Outcome(Enum):
    """What the arm does under a fault."""

    GOES_ON = 'in command mode, and the arm moves'
    RESTS = 'comes to rest in command mode; goes on by itself'
    STOPS = 'the robot stops; goes on after `sim/reset`'
    HELD = 'the controller stops and holds it; goes on after `controller/hold` with false'
    STAYS = 'stays at rest'
    NONE = 'cannot be'


class Cell(NamedTuple):
    """What is expected: words are on a node's log, or the reason why there can be no such fault."""

    outcome: Outcome
    words: str = ''


GOES_ON = Cell(Outcome.GOES_ON)
RESTS = Cell(Outcome.RESTS)
LATE = Cell(Outcome.STOPS, 'timing')
ONCE = Cell(Outcome.NONE, 'said once a change, on a reliable topic')
STAYS = Cell(Outcome.STAYS)
TWIST_AGE = "behind the robot's clock"
APART = Cell(Outcome.RESTS, 'the arm does not move')
PROTECTED = Cell(Outcome.STOPS, 'protective stop')

EXPECTED: dict[tuple[str, str], tuple[Cell, ...]] = {
    ('joint_states', 'controller'): (
        LATE,
        LATE,
        Cell(Outcome.STOPS, 'joint_states refused'),
        Cell(Outcome.HELD, 'further than it can'),
        LATE,
        LATE,
        LATE,
        Cell(Outcome.GOES_ON, 'before the newest one'),
    ),
    ('joint_states', 'planner'): (
        Cell(Outcome.RESTS, 'no joint_states'),
        Cell(Outcome.RESTS, TWIST_AGE),
        Cell(Outcome.RESTS, 'joint_states refused'),
        GOES_ON,
        GOES_ON,
        Cell(Outcome.RESTS, TWIST_AGE),
        Cell(Outcome.GOES_ON, 'no joint_states'),
        Cell(Outcome.GOES_ON, 'before the newest one'),
    ),
    ('joint_command', 'sim'): (
        LATE,
        LATE,
        Cell(Outcome.STOPS, 'joint_command refused'),
        Cell(Outcome.STOPS, 'position limit'),
        LATE,
        LATE,
        LATE,
        GOES_ON,
    ),
    ('cartesian_velocity', 'controller'): (
        RESTS,
        Cell(Outcome.RESTS, TWIST_AGE),
        Cell(Outcome.RESTS, 'cartesian_velocity refused'),
        Cell(Outcome.GOES_ON, 'max_linear'),
        GOES_ON,
        Cell(Outcome.RESTS, TWIST_AGE),
        GOES_ON,
        GOES_ON,
    ),
    ('target_pose', 'planner'): (
        STAYS,
        GOES_ON,
        Cell(Outcome.STAYS, 'target_pose refused'),
        Cell(Outcome.STAYS, 'target_pose refused'),
        Cell(Outcome.NONE, 'said once; a slow one is late'),
        GOES_ON,
        GOES_ON,
        GOES_ON,
    ),
    ('controller/task_scaling', 'planner'): (
        RESTS,
        GOES_ON,
        RESTS,
        GOES_ON,
        GOES_ON,
        GOES_ON,
        GOES_ON,
        GOES_ON,
    ),
    ('sim/session_state', 'controller'): (
        Cell(Outcome.GOES_ON, 'the arm does not move'),
        STAYS,
        STAYS,
        APART,
        ONCE,
        Cell(Outcome.GOES_ON, 'the arm does not move'),
        ONCE,
        ONCE,
    ),
    ('sim/stop_reason', 'planner'): (
        PROTECTED,
        PROTECTED,
        PROTECTED,
        PROTECTED,
        ONCE,
        PROTECTED,
        ONCE,
        ONCE,
    ),
}


def cells() -> list[Any]:
    """Channel, fault, and what is expected, for each cell that can be."""
    return [
        pytest.param(channel, name, cell, id=f'{channel.topic}-{channel.listener}-{name}')
        for channel in CHANNELS
        for name, cell in zip(FAULTS, EXPECTED[channel.topic, channel.listener], strict=True)
        if cell.outcome is not Outcome.NONE
    ]


class Scene:
    """Three nodes, the arm in motion; keeps every reference of the robot."""

    def __init__(self, run: VirtualRun) -> None:
        self.run = run
        self.references: list[np.ndarray] = []
        robot = run.nodes['sim']._robot
        advance = robot.advance

        def advance_and_keep(*answers: Any) -> None:
            advance(*answers)
            self.references.append(robot.reference)

        robot.advance = advance_and_keep
        run.graph.kept['joint_command'] = []

    @property
    def speed(self) -> float:
        """Of the fastest joint [rad/s]."""
        before, now = self.references[-2:]
        return float(np.abs(now - before).max()) * RATE

    @property
    def stopped(self) -> bool:
        """Whether the robot has stopped and says why."""
        return bool(self.run.nodes['sim']._session.reason)

    def said(self, words: str) -> bool:
        """Whether some node's log has these words."""
        return any(words in line for _, line in self.run.graph.log)

    def suffer(self, channel: Channel, fault: Fault) -> None:
        """Let the fault act for its time, on what it is to act on."""
        graph = self.run.graph
        if channel.topic == 'sim/session_state':
            graph.call('sim/reset')  # so that it says something
            graph.faults[channel.topic, channel.listener] = fault
            self.run.run(0.3)
        self.run.run(0.0)
        graph.faults[channel.topic, channel.listener] = fault
        if channel.topic == 'target_pose':
            self._point()
        elif channel.topic == 'sim/stop_reason':
            self.run.nodes['sim']._session.stop('protective stop: for the test')
        self.run.run(DURATION)
        self.under_fault = self.speed
        graph.faults.clear()

    def _point(self) -> None:
        """Show three targets, one after the other."""
        planner = self.run.nodes['planner']
        x, R = planner._model.tip(planner._q)
        for height in (0.05, 0.06, 0.07):
            self.run.graph.publish(
                'target_pose', to_pose(0, '', x + np.array((0.0, -0.1, height)), R)
            )
            self.run.run(0.05)

    def assert_nothing_jumped(self) -> None:
        """All commands are finite, and the robot's reference keeps the arm's limits."""
        for _, command in self.run.graph.kept['joint_command']:
            assert np.isfinite(command.position).all()
            assert (np.abs(command.velocity) <= LIMITS.velocity).all()
        changes = np.diff(self.references, 2, axis=0) * RATE**2
        assert (np.abs(changes) <= LIMITS.acceleration * (1.0 + 1e-6)).all()


@pytest.mark.slow
@pytest.mark.parametrize(('channel', 'name', 'expected'), cells())
def test_every_fault_of_every_message_ends_as_the_table_says(
    channel: Channel, name: str, expected: Cell
) -> None:
    loop = {'rate': RATE}
    sim = {**loop, 'patience': 0.0, 'plant': 'ideal', 'monitor_time': 0.1}
    moves = channel.topic != 'target_pose'
    with virtual_run(sim=sim, controller=loop, planner={**loop, 'autostart': moves}) as run:
        scene = Scene(run)
        run.run(1.5)
        assert run.commanding
        assert (scene.speed > 0.01) is moves
        scene.suffer(channel, make_fault(channel, name))
        if expected.words:
            assert scene.said(expected.words)
        assert scene.stopped is (expected.outcome is Outcome.STOPS)
        if expected.outcome is Outcome.GOES_ON:
            assert scene.under_fault > 1e-3
        else:
            assert scene.under_fault < DECAYED
        if scene.stopped or channel.topic == 'sim/session_state':
            run.graph.call('sim/reset')
            assert run.run_until(lambda: run.commanding, 2.0)
        if expected.outcome is Outcome.HELD:
            run.graph.call('controller/hold', data=False)
            run.graph.call('planner/start')
        run.run(0.5)
        assert (scene.speed > 1e-3) is (expected.outcome is not Outcome.STAYS or moves)
        assert not scene.stopped
        scene.assert_nothing_jumped()


# --- the page -------------------------------------------------------------------------------------


def page() -> str:
    """The table in Markdown, with what its words mean."""
    lines = [TEXT]
    lines += [f'| message | {" | ".join(FAULTS)} |', '|---' * (len(FAULTS) + 1) + '|']
    for channel in CHANNELS:
        row = EXPECTED[channel.topic, channel.listener]
        shown = ' | '.join(map(_shown, row))
        lines.append(f'| {channel.title} | {shown} |')
    lines += ['', 'Wrong is:', '']
    lines += [f'- {channel.title}: {channel.wrong_words}' for channel in CHANNELS]
    return '\n'.join(lines) + '\n'


def _shown(cell: Cell) -> str:
    word = SHORT[cell.outcome]
    return f'{word}: *{cell.words}*' if cell.words else word


SHORT = {
    Outcome.GOES_ON: 'goes on',
    Outcome.RESTS: 'rests',
    Outcome.STOPS: 'stops',
    Outcome.HELD: 'holds',
    Outcome.STAYS: 'stays',
    Outcome.NONE: 'none',
}

TEXT = f"""\
# Fault matrix

Every message between the nodes, with every kind of fault that PX4 injects into its sensors. Each cell is a test (test_fault_matrix.py) with
the real nodes at {RATE:g} Hz, in virtual time; a fault acts for {DURATION:g} s while the arm moves. In every cell all commands are finite and within the
limits, and the robot's reference never changes faster than the arm's accelerations allow. This page is written by the test's own table.

- *off*: nothing arrives. *stuck*: the same message again and again. *garbage*: NaN, wrong lengths, unknown names, impossible stamps.
  *wrong*: can be read, and is not true. *slow*: one of ten arrives. *delayed*: 0.3 s late. *intermittent*: 0.1 s off, 0.1 s on.
  *reordered*: of two messages the second arrives first.
- **goes on**: {Outcome.GOES_ON.value}. **rests**: {Outcome.RESTS.value}. **stops**: {Outcome.STOPS.value}.
  **holds**: {Outcome.HELD.value}. **stays**: {Outcome.STAYS.value}. **none**: there is no such fault, for the reason given. Words in italics are on a node's log.
"""  # noqa: E501, the page has lines of its own length


def test_the_page_shows_this_table() -> None:
    assert PAGE.read_text() == page(), 'run: python test/test_fault_matrix.py'


if __name__ == '__main__':
    PAGE.write_text(page())
