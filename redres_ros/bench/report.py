"""All that was measured in one run, for the terminal and as a file."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from redres_ros.bench.goals import Goal, goals_table
from redres_ros.bench.machine import describe
from redres_ros.errors import FileError


class Result(Protocol):
    """What came of one part of the bench."""

    def table(self) -> str: ...

    def goals(self) -> list[Goal]: ...

    def figures(self) -> dict[str, object]: ...


def table(results: Mapping[str, Result]) -> str:
    """Every part's table, then all goals."""
    goals = [goal for result in results.values() for goal in result.goals()]
    held = sum(goal.held for goal in goals)
    parts = [result.table() for result in results.values()]
    if goals:
        parts.append(f'goals: {held} of {len(goals)} held\n{goals_table(goals)}')
    return '\n\n'.join(parts)


def write_json(results: Mapping[str, Result], path: Path) -> None:
    """Figures of every part with units in their names, goals, and the machine; null for what is no
    number.

    Raises FileError.
    """
    goals = [goal.figures() for result in results.values() for goal in result.goals()]
    content = {
        'machine': describe(),
        **{name: result.figures() for name, result in results.items()},
        'goals': goals,
    }
    try:
        path.write_text(json.dumps(_finite(content), indent=2) + '\n', encoding='utf-8')
    except OSError as error:
        raise FileError(f'cannot write {path}: {error.strerror}') from None


def _finite(value: Any) -> Any:
    """The same with None for NaN and infinity, which JSON does not know."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
