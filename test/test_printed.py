"""Printed figures are compared as what they are: rounded."""

import pytest
from printed import differences


@pytest.mark.parametrize(
    ('printed', 'other', 'agree'),
    [
        ('74.6 rad/s²', '74.7 rad/s²', True),
        ('for 34% of it', 'for 35% of it', True),
        ('| 244 | 8.67 |', '|  243  | 8.68 |', True),
        ('-0.0', '0.0', True),
        ('8.49', '8.5', True),
        ('s ≥ 0.32', 's ≥ 0.31', True),
        ('74.6 rad/s²', '74.8 rad/s²', False),
        ('74.6 rad/s²', '74.6 rad/s', False),
        ('4 joints', '5 joints', False),
        ('A2 position', 'A3 position', False),
        ('equal', 'equal\n1', False),
    ],
)
def test_figures_agree_that_differ_in_their_last_digit_by_one(
    printed: str, other: str, agree: bool
) -> None:
    assert bool(differences(printed, other)) is not agree
