"""Validator, joint limits and interpolator: what stops the arm, what only slows it, and how its
reference moves meanwhile.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.profile import PROFILES
from redres_ros.fake_robot.robot import _ReferenceInterpolator as ReferenceInterpolator
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
LWR = PROFILES['lwr_fri1']
LIMITS = JointLimits.of(find_arm('lwr4'))
ZERO = np.zeros(7)
ROUNDING = 1e-12  # of sums of a few hundred terms of size 1


def violation_on_the_way(validator: CommandValidator, positions: np.ndarray) -> str:
    """The first reason that the validator has to stop a stream (N, 7) that starts from rest at its
    first position.
    """
    validator.begin()
    for last, position in pairwise(positions):
        if reason := validator.violation(position, (position - last) / T):
            return reason
    return ''


def accelerated(acceleration: float, joint: int, cycles: int) -> np.ndarray:
    """Positions (cycles, 7) whose velocity grows by acceleration * T a cycle from rest at zero."""
    positions = np.zeros((cycles, 7))
    positions[:, joint] = acceleration * T * T * np.cumsum(np.arange(cycles))
    return positions


@pytest.mark.parametrize('joint', [0, 5])
@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_position_is_limited_at_the_margin(joint, sign):
    command = ZERO.copy()
    for within in (-1e-9, -4e-15, 4e-15):  # the last digits do not stop the arm
        command[joint] = sign * (LIMITS.upper[joint] - LWR.position_margin + within)
        assert CommandValidator(LIMITS, T, LWR).violation(command, ZERO) == ''
    command[joint] += sign * 1e-9
    assert LIMITS.joint_names[joint] in CommandValidator(LIMITS, T, LWR).violation(command, ZERO)


@pytest.mark.parametrize('joint', [0, 6])
def test_acceleration_is_limited_at_the_limit(joint):
    validator = CommandValidator(LIMITS, T, LWR)
    limit = LIMITS.acceleration[joint]
    assert violation_on_the_way(validator, accelerated(0.999 * limit, joint, 40)) == ''
    reason = violation_on_the_way(validator, accelerated(1.01 * limit, joint, 40))
    assert LIMITS.joint_names[joint] in reason


@pytest.mark.parametrize(('excess', 'milliseconds'), [(1.001, 0.2), (0.2001, 1.0), (0.01251, 16.0)])
@pytest.mark.parametrize('period', [0.0005, 0.004])
def test_an_excess_is_tolerated_for_a_time_that_shortens_as_it_grows(excess, milliseconds, period):
    validator = CommandValidator(LIMITS, period, LWR)
    velocity = 0.020 * (1.0 + excess) * LIMITS.acceleration[3] * np.eye(7)[3]
    stops = [
        bool(validator.violation(ZERO, velocity))
        for _ in range(math.ceil(0.001 * milliseconds / period))
    ]
    assert stops.index(True) == len(stops) - 1


def test_an_excess_is_forgotten_as_it_is_made_up_for():
    validator = CommandValidator(LIMITS, T, replace(LWR, acceleration_window=T))
    limit = LIMITS.acceleration[2] * T * np.eye(7)[2]
    velocity = ZERO
    for share in (1.08, 0.9) * 100:
        velocity = velocity + share * limit
        assert validator.violation(ZERO, velocity) == ''


def test_the_window_is_that_of_the_profile_and_at_least_a_cycle():
    wide = CommandValidator(LIMITS, T, replace(LWR, acceleration_window=0.05))
    twice = accelerated(1.8 * LIMITS.acceleration[0], 0, 40)
    assert 'over 50 ms' in violation_on_the_way(wide, twice)
    short = CommandValidator(LIMITS, 0.005, PROFILES['fci'])
    assert 'over 5 ms' in short.violation(ZERO, ZERO + 1.0)


def test_no_acceleration_limit_never_stops():
    limits = JointLimits.of(replace(find_arm('lwr4'), acceleration_limit=()))
    unlimited = CommandValidator(limits, T, LWR)
    assert violation_on_the_way(unlimited, accelerated(1e3, 0, 20)) == ''


def test_begin_forgets_the_velocity_and_the_excess():
    validator = CommandValidator(LIMITS, T, LWR)
    jump = 1.09 * 0.020 * LIMITS.acceleration * np.eye(7)[0]
    for sign in (1.0, -1.0, -1.0):  # a second one would be too much
        assert validator.violation(ZERO, sign * jump) == ''
        validator.begin()


@pytest.mark.parametrize('joint', [0, 6])
@pytest.mark.parametrize('which', ['position', 'velocity'])
def test_nan_never_passes(joint, which):
    values = {'position': ZERO.copy(), 'velocity': ZERO.copy()}
    values[which][joint] = np.nan
    assert CommandValidator(LIMITS, T, LWR).violation(**values) != ''


def follow(interpolator: ReferenceInterpolator, positions: np.ndarray) -> np.ndarray:
    """References (N - 1, 7) while the stream (N, 7) is followed from its first position."""
    references = []
    for position in positions[1:]:
        interpolator.follow(position)
        references.append(interpolator.reference)
    return np.array(references)


def brake(interpolator: ReferenceInterpolator) -> np.ndarray:
    """References (N, 7) from the one in force until the interpolator is at rest."""
    references = [interpolator.reference]
    while interpolator.step.any():
        interpolator.brake(interpolator.reference)
        references.append(interpolator.reference)
        assert len(references) < 1000
    return np.array(references)


def test_a_command_within_the_velocity_limits_is_the_reference_bit_for_bit():
    shares = np.random.default_rng(1).uniform(-0.999, 0.999, (399, 7))
    stream = np.cumsum(np.vstack((ZERO, shares * LIMITS.velocity * T)), axis=0)
    assert (follow(ReferenceInterpolator(LIMITS, T, ZERO), stream) == stream[1:]).all()


def too_fast_for_a_while() -> np.ndarray:
    """Positions (N, 7): up to 1.2 of the velocity limits with half the acceleration limits, and
    back to rest.
    """
    ramp_cycles = np.ceil(1.2 * LIMITS.velocity / (0.5 * LIMITS.acceleration * T)).max()
    ramp = np.arange(ramp_cycles) / ramp_cycles
    profile = np.concatenate((ramp, np.ones(60), ramp[::-1], np.zeros(300)))
    return np.cumsum(profile[:, None] * 1.2 * LIMITS.velocity * T, axis=0)


def test_a_lag_is_closed_without_overshoot_and_within_the_acceleration_limits():
    stream = too_fast_for_a_while()
    references = np.vstack((stream[0], follow(ReferenceInterpolator(LIMITS, T, stream[0]), stream)))
    lag = stream - references
    assert lag.max() > 0.01  # the stream was too fast ...
    assert lag.min() > -ROUNDING  # ... is never overtaken ...
    assert (references[-1] == stream[-1]).all()  # ... and is caught up with
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T * 1.001).all()


def test_braking_keeps_the_acceleration_limits_and_uses_them():
    interpolator = ReferenceInterpolator(LIMITS, T, ZERO)
    at_speed = follow(interpolator, np.arange(100)[:, None] * (0.9 * T) * LIMITS.velocity)
    references = np.vstack((at_speed[-2], brake(interpolator)))
    changes = np.abs(np.diff(references, 2, axis=0)) / (LIMITS.acceleration * T * T)
    assert changes.max(axis=0) == pytest.approx(np.ones(7), abs=1e-9)


def test_braking_without_acceleration_limits_ends_at_once():
    interpolator = ReferenceInterpolator(replace(LIMITS, acceleration=np.full(7, np.inf)), T, ZERO)
    at_speed = follow(interpolator, np.arange(10)[:, None] * (0.9 * T) * LIMITS.velocity)
    assert (brake(interpolator)[-1] == at_speed[-1]).all()


def test_an_arm_beyond_a_limit_does_not_jump_and_can_come_back():
    q = LIMITS.upper + 0.1
    interpolator = ReferenceInterpolator(LIMITS, T, q)
    inwards = q - np.arange(200)[:, None] * 0.001
    assert (follow(interpolator, inwards) == inwards[1:]).all()
    follow(interpolator, interpolator.reference + np.arange(400)[:, None] * 0.001)
    assert (interpolator.reference == LIMITS.upper).all()


@pytest.mark.parametrize('joint', [1, 6])
@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_an_arm_at_speed_is_stopped_in_time_to_brake_before_a_limit(joint, sign):
    speed = sign * 0.8 * LIMITS.velocity * np.eye(7)[joint]
    validator = CommandValidator(LIMITS, T, replace(LWR, acceleration_window=1.0))
    interpolator = ReferenceInterpolator(LIMITS, T, ZERO)
    position = ZERO
    while not (reason := validator.violation(position + T * speed, speed)):
        interpolator.follow(position + T * speed)
        position = position + T * speed
    references = brake(interpolator)
    assert reason.startswith(f'position limit: {LIMITS.joint_names[joint]}')
    assert 0.0 <= LIMITS.upper[joint] - np.abs(references).max() < np.radians(1.0)
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T + ROUNDING).all()


@settings(max_examples=40)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30), st.integers(5, 40))
def test_from_whatever_the_guard_lets_pass_the_arm_can_brake_within_all_limits(accelerations, hold):
    validator = CommandValidator(LIMITS, T, LWR)
    interpolator = ReferenceInterpolator(LIMITS, T, ZERO)
    position = ZERO
    velocity = ZERO
    references = [ZERO, ZERO]
    for share in np.repeat(accelerations, hold):
        velocity = np.clip(
            velocity + 0.999 * share * LIMITS.acceleration * T, -LIMITS.velocity, LIMITS.velocity
        )
        step = T * velocity
        if validator.violation(position + step, velocity):
            break
        interpolator.follow(position + step)
        position = position + step
        references.append(interpolator.reference)
    references = np.vstack((references, brake(interpolator)[1:]))
    assert (np.abs(references) <= LIMITS.upper).all()
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T + ROUNDING).all()


def test_the_last_digits_of_a_velocity_do_not_stop_the_arm():
    anything = replace(LIMITS, acceleration=1e6 * LIMITS.acceleration)
    profile = replace(LWR, velocity_stops=True)
    for excess, stops in ((1e-12, False), (1e-9, True)):
        validator = CommandValidator(anything, T, profile)
        assert bool(validator.violation(ZERO, LIMITS.velocity * (1.0 + excess))) is stops
