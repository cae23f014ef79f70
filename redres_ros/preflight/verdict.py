"""Verdicts of the check, and the arm it expects."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class Level(Enum):
    """How a verdict counts; only a fault makes the check fail."""

    OK = 'ok'
    NOTE = 'note'
    FAULT = 'FAULT'


class Verdict(NamedTuple):
    """A sentence on one subject."""

    level: Level
    subject: str
    text: str

    def __str__(self) -> str:
        return f'{self.level.value:<6} {self.subject:<11} {self.text}'


@dataclass(frozen=True)
class ExpectedArm:
    """The arm and the rate that are expected, from the controller's parameters or from the user.

    Args:
        robot: Name, path, or topic.
        tip_frame: Empty: the arm's own.
        rate: States a second [Hz].
        margin: Kept from the ends of the ranges [rad].
    """

    robot: str
    tip_frame: str = ''
    rate: float = 500.0
    margin: float = 0.0
