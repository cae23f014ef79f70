"""Goals: what was wanted beside what was measured."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """A figure with the bound that it should keep: `at_most` it, or at least it."""

    what: str
    got: float
    bound: float
    at_most: bool = True

    @property
    def held(self) -> bool:
        """Whether the figure keeps the bound; one that could not be measured, NaN, does not."""
        return self.got <= self.bound if self.at_most else self.got >= self.bound

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        return {
            'goal': self.what,
            'got': self.got,
            'at_most' if self.at_most else 'at_least': self.bound,
            'held': self.held,
        }


def goals_table(goals: Sequence[Goal]) -> str:
    """One line a goal."""
    width = max((len(goal.what) for goal in goals), default=0)
    return '\n'.join(
        f'{goal.what:<{width}}  {goal.got:8.3g}, {"at most" if goal.at_most else "at least"} '
        f'{goal.bound:<6g} {"held" if goal.held else "NOT held"}'
        for goal in goals
    )
