"""Why an answer is no valid command."""

from dataclasses import dataclass
from enum import Enum


class Refusal(Enum):
    """Kinds of refusal, to be counted apart. The robot finds the first five, what receives messages
    the others.
    """

    WRONG_LENGTH = 'wrong length'
    NOT_FINITE = 'not finite'
    NO_STATE = 'answers no state'
    OUT_OF_DATE = 'out of date'
    OUT_OF_ORDER = 'out of order'
    WRONG_NAMES = 'wrong joint names'
    SECOND_PUBLISHER = 'second publisher'


@dataclass(frozen=True)
class Refused:
    """An answer that was refused: of what kind, and in words what was got."""

    kind: Refusal
    text: str

    def __str__(self) -> str:
        return self.text
