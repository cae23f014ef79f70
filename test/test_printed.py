"""Printed figures are compared as what they are: rounded."""

import pytest
from printed import differences


@pytest.mark.parametrize(
    ('printed', 'other'),
    [
        ('74.6 rad/s²', '74.7 rad/s²'),
        ('for 34% of it', 'for 35% of it'),
        ('| 244 | 8.67 |', '|  243  | 8.68 |'),
        ('-0.0', '0.0'),
        ('8.49', '8.5'),
        ('s ≥ 0.32', 's ≥ 0.31'),
    ],
)
def test_figures_agree_that_differ_in_their_last_digit_by_one(printed: str, other: str) -> None:
    assert not differences(printed, other)


@pytest.mark.parametrize(
    ('printed', 'other'),
    [
        ('74.6 rad/s²', '74.8 rad/s²'),
        ('74.6 rad/s²', '74.6 rad/s'),
        ('4 joints', '5 joints'),
        ('A2 position', 'A3 position'),
        ('equal', 'equal\n1'),
    ],
)
def test_other_words_counts_and_figures_do_not(printed: str, other: str) -> None:
    assert differences(printed, other)
