"""The table of modes leads nowhere by surprise."""

from itertools import product

import pytest

from redres_ros.loop.modes import Conditions, Mode, next_mode

ALL = [
    Conditions(active, commandable, allowed, asked, at_rest)
    for active, commandable, allowed, asked, at_rest in product((True, False), repeat=5)
    if allowed <= active and asked <= allowed and not (asked and at_rest)
]


@pytest.mark.parametrize('mode', Mode)
def test_the_next_mode_is_a_mode_in_which_the_conditions_let_it_stay(mode: Mode) -> None:
    for conditions in ALL:
        following = next_mode(mode, conditions)
        assert next_mode(following, conditions) is following


@pytest.mark.parametrize('mode', Mode)
def test_no_motion_begins_that_nobody_asks_for(mode: Mode) -> None:
    for conditions in ALL:
        if mode is not Mode.MOVING and not conditions.motion_asked:
            assert next_mode(mode, conditions) is not Mode.MOVING


@pytest.mark.parametrize('mode', Mode)
def test_an_inactive_controller_at_rest_is_silent(mode: Mode) -> None:
    inactive = Conditions(False, True, False, False, at_rest=True)
    assert next_mode(mode, inactive) is Mode.INACTIVE
