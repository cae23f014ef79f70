"""Judges the joint references that a controller publishes, knowing nothing of how it works.

With r the references, one for each robot cycle at most, m the cycles since the last one, p where
the robot's interface is by then, v its velocity there, and T the robot's period:

    finite, q_min <= r <= q_max (outside: only towards the range),
    |r - p| <= V T,   |(r - p)/T - v| <= A T,
    holding: r is the last one to the bit, or where an arm is that others have moved (behind
    ros2_control: whose commands a robot that holds gets),   inactive: nothing is published,
    mirroring: only finite, and in the range or where the arm is.

A robot that holds stays at its last reference: p = r, v = 0 if m > 1. One that extrapolates goes
on: p = r + (m - 1) T v, up to the ends of its range. A joint that it has moved so near to an end
that no braking keeps it in its range has to brake with all of A.
"""

from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from virtual_graph import Graph

from redres_ros.loop.modes import COMMANDING
from redres_ros.nodes.conversions import to_nanoseconds
from redres_ros.robots.joint_limits import JointLimits

MODES = ('inactive', 'mirroring', 'holding', 'moving', 'stopping')
ROUNDING = 1e-9  # [rad] of positions and of their second differences
NANOSECONDS = 1_000_000_000
NEW_CLOCK = NANOSECONDS  # [ns] a step of the stamps by which a robot has been started again
REMEMBERED = 64  # states
JITTER = 0.25  # of a period, by which a stamp may be off
BURST = 2 * JITTER  # of a period: references that come sooner are for one cycle


class Violation(NamedTuple):
    """A reference that should not have been published."""

    stamp: int  # of the state that it is for [ns]
    mode: str  # of the controller; empty if it has published none
    rule: str  # that it breaks
    joint: int
    excess: float  # [rad]
    cycles: int  # since the reference before


class ReferenceJudge:
    """Judges the references of one controller.

    Args:
        limits: Of the arm, n joints.
        period: The robot's cycle T [s].
        bridging: What the robot does in a cycle without a reference: 'hold' or 'extrapolate'.
    """

    def __init__(self, limits: JointLimits, period: float, bridging: str) -> None:
        self.violations: list[Violation] = []
        self.judged = 0  # references
        self.mode = ''
        self.commanding = True  # False: the robot itself takes no commands, and has stopped
        self.modes: list[str] = []  # one after the other
        self.references: list[tuple[int, np.ndarray]] = []  # stamp [ns], (n,) [rad]
        self._names = limits.joint_names
        self._limits = limits
        self._period = period
        self._holds = bridging == 'hold'
        self._step = limits.velocity * period  # (n,) [rad], V T
        self._change = limits.acceleration * period**2  # (n,) [rad], A T^2
        self._measured: dict[int, np.ndarray] = {}  # by stamp
        self._last: np.ndarray | None = None  # r_{k-1}
        self._last_stamp = 0
        self._last_mode = ''
        self._v_T = np.zeros(len(self._names))  # (n,) [rad], v T of the robot at r_{k-1}
        # Joints that the robot itself has moved too near to an end, (n,).
        self._overshoots = np.zeros(len(self._names), dtype=bool)
        self._before = (self._last, self._last_stamp, self._last_mode, self._v_T)

    def enter_mode(self, word: str) -> None:
        """The references from here on are of this mode."""
        if word not in MODES:
            self._note('mode', self._last_stamp, 0)
        self.mode = word
        self.modes.append(word)

    def enter_state(self, stamp: int, q: np.ndarray) -> None:
        """A state of the robot: where a first reference may begin, and what is mirrored."""
        self._measured[stamp] = q
        if len(self._measured) > REMEMBERED:
            del self._measured[next(iter(self._measured))]

    def enter_reference(self, stamp: int, r: np.ndarray) -> None:
        self.judged += 1
        self.references.append((stamp, r))
        if self.mode == 'inactive':
            self._note('silent while inactive', stamp, 0)
        if not np.isfinite(r).all():
            self._note('finite', stamp, 0, np.flatnonzero(~np.isfinite(r)))
            return
        if self._holds and 0 < stamp - self._last_stamp < BURST * self._period * NANOSECONDS:
            # Of two references in one cycle the robot executes the second alone.
            self._last, self._last_stamp, self._last_mode, self._v_T = self._before
        self._before = (self._last, self._last_stamp, self._last_mode, self._v_T)
        cycles = self._cycles_to(stamp)
        measured = self._measured.get(stamp, np.full_like(r, np.inf))
        if self._holds and self.mode == 'holding' and np.abs(r - measured).max() <= ROUNDING:
            self.forget()
        if self.mode == 'mirroring':
            self._judge_mirrored(stamp, r)
            self._v_T = np.zeros_like(r) if self._last is None else r - self._last
        elif not cycles:
            if self._last is not None and not np.array_equal(r, self._last):
                self._judge_excess('repeated for the same state', stamp, 0, np.abs(r - self._last))
        else:
            self._judge(stamp, r, cycles)
        self._last = r
        self._last_stamp = stamp
        self._last_mode = self.mode

    def forget(self) -> None:
        """The next reference is that of another robot."""
        self._last = None
        self._v_T = np.zeros(len(self._names))

    def assert_followable(self) -> None:
        """Fail if there was a violation, with the first ones and the largest."""
        broken = self.violations
        largest = max(broken, key=lambda violation: violation.excess, default=None)
        assert not broken, f'{len(broken)} of {self.judged}: {broken[:3]}, largest {largest}'

    def _cycles_to(self, stamp: int) -> tuple[int, ...]:
        """Robot cycles since the last reference, all that may be meant where a stamp jitters; none
        for the same state again.
        """
        since = stamp - self._last_stamp
        if self._last is None:
            return (1,)
        if -NEW_CLOCK < since < 0:
            self._note('in the order of stamps', stamp, 0)
            return (1,)
        stays = self._holds or self._last_mode == 'holding'
        if abs(since) > NEW_CLOCK and (since < 0 or not stays):
            self.forget()
            return (1,)
        cycles = since / NANOSECONDS / self._period
        nearest = {round(cycles - JITTER), round(cycles + JITTER)}
        return tuple(sorted({max(count, 1) for count in nearest})) if since else ()

    def _judge(self, stamp: int, r: np.ndarray, counts: tuple[int, ...]) -> None:
        first, *others = counts
        before = len(self.violations)
        v_T = self._v_T
        self._judge_after(stamp, r, first)
        for cycles in others:
            found = self.violations[before:]
            if not found:
                break
            del self.violations[before:]
            self._v_T = v_T
            self._judge_after(stamp, r, cycles)
            if self.violations[before:]:
                self.violations[before:] = found
        if self.violations[before:] and not self.commanding and self._is_at(stamp, r):
            del self.violations[before:]
            self._v_T = np.zeros_like(r)

    def _is_at(self, stamp: int, r: np.ndarray) -> bool:
        """Whether a reference r (n,) [rad] is where the arm of a state is at rest."""
        measured = self._measured.get(stamp)
        return measured is not None and bool((np.abs(r - measured) <= self._change).all())

    def _judge_after(self, stamp: int, r: np.ndarray, cycles: int) -> None:
        """Judge a reference so many cycles after the last one."""
        last = self._last
        if last is None:
            last = self._measured.get(stamp, r)
            self._v_T = np.zeros_like(r)
        if self.mode == self._last_mode == 'holding' and self._last is not None:
            self._judge_excess('constant while holding', stamp, cycles, np.abs(r - last), 0.0)
        limits = self._limits
        lowest = np.minimum(limits.lower, last)
        highest = np.maximum(limits.upper, last)
        outside = np.maximum(r - highest, lowest - r)
        slow, fast, p = self._robot_at(last, cycles)
        step = r - p
        if cycles > 1:
            self._overshoots |= (slow == fast) & self._must_leave(p, fast)
        brakes = np.abs(step) <= np.maximum(np.abs(fast) - self._change, 0.0) + ROUNDING
        outside[self._overshoots & brakes] = 0.0
        self._judge_excess('range', stamp, cycles, outside)
        self._overshoots &= self._must_leave(r, step)
        self._judge_excess('velocity', stamp, cycles, np.abs(step) - self._step)
        change = np.maximum(step - fast, slow - step) - self._change
        self._judge_excess('acceleration', stamp, cycles, change)
        self._v_T = step

    def _robot_at(self, last: np.ndarray, cycles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the robot has done by itself since its last reference.

        Args:
            last: Reference, (n,) [rad].
            cycles: Since then.

        Returns:
            Least and largest v T, and p: (n,) [rad] each. They differ for a joint that may have
            been stopped at the end of its range.
        """
        v_T = self._v_T
        if self._last_mode == 'mirroring':
            return np.minimum(v_T, 0.0), np.maximum(v_T, 0.0), last  # pushed by hand, or let go
        if cycles == 1:
            return v_T, v_T, last
        if self._holds:
            rest = np.zeros_like(last)
            return rest, rest, last
        going = last + (cycles - 1) * v_T
        lower = np.minimum(self._limits.lower, last)
        p = np.clip(going, lower, np.maximum(self._limits.upper, last))
        at_end = p != going
        slow = np.where(at_end, np.minimum(v_T, 0.0), v_T)
        fast = np.where(at_end, np.maximum(v_T, 0.0), v_T)
        return slow, fast, p

    def _must_leave(self, p: np.ndarray, v_T: np.ndarray) -> np.ndarray:
        """Which joints leave their range even if they brake with all of A, (n,)."""
        cycles = np.floor(np.abs(v_T) / self._change)
        way = cycles * np.abs(v_T) - self._change * cycles * (cycles + 1.0) / 2.0
        stop = p + np.copysign(way, v_T)
        limits = self._limits
        return (stop > limits.upper + ROUNDING) | (stop < limits.lower - ROUNDING)

    def _judge_mirrored(self, stamp: int, r: np.ndarray) -> None:
        measured = self._measured.get(stamp, r)
        outside = np.maximum(r - self._limits.upper, self._limits.lower - r)
        self._judge_excess('mirrored', stamp, 0, np.minimum(outside, np.abs(r - measured)))

    def _judge_excess(
        self, rule: str, stamp: int, cycles: int, excess: np.ndarray, allowed: float = ROUNDING
    ) -> None:
        """Note the joint whose excess (n,) [rad] over a rule is the largest, if it is too large."""
        joint = int(excess.argmax())
        if not excess[joint] <= allowed:
            self._note(rule, stamp, cycles, np.array((joint,)), float(excess[joint]))

    def _note(
        self,
        rule: str,
        stamp: int,
        cycles: int,
        joints: np.ndarray | None = None,
        excess: float = 0.0,
    ) -> None:
        joint = -1 if joints is None else int(joints[0])
        self.violations.append(Violation(stamp, self.mode, rule, joint, excess, cycles))


def judge_graph(graph: Graph, limits: JointLimits, rate: float, bridging: str) -> ReferenceJudge:
    """A judge of what is published in a graph from now on."""
    judge = ReferenceJudge(limits, 1.0 / rate, bridging)

    def in_order(message: JointState) -> np.ndarray:
        positions = dict(zip(message.name, message.position, strict=False))
        return np.array([positions.get(name, np.nan) for name in limits.joint_names])

    def on_state(message: JointState) -> None:
        judge.enter_state(to_nanoseconds(message.header.stamp), in_order(message))

    def on_reference(message: JointState) -> None:
        judge.enter_reference(to_nanoseconds(message.header.stamp), in_order(message))

    def on_mode(message: String) -> None:
        judge.enter_mode(message.data)

    def on_session(message: String) -> None:
        judge.commanding = message.data in COMMANDING

    # What the controller receives, faults and all, before it does.
    graph.taps['joint_states', 'controller'] = on_state
    graph.listen('controller/mode', 'judge', on_mode)
    graph.listen('joint_command', 'judge', on_reference)
    graph.listen('sim/session_state', 'judge', on_session)
    return judge
