"""One motion of a batch as plain data, and all combinations of values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from itertools import product
from typing import Any

from redres_ros.errors import RangeError, RedresError, UnknownNameError, quoted
from redres_ros.table import as_tuple

MOST_SEEDS = 1_000_000

_NAMES = tuple[str, ...]
_EXPECTED: dict[Any, str] = {  # what a field of a case must be, by its type
    str: 'a name',
    float: 'a number',
    int: 'a whole number, at least 0',
    _NAMES: 'a list of names',
    Mapping[str, Any]: 'gains by name, such as {damping: 5.0}',
}


@dataclass(frozen=True)
class Case:
    """One motion of a batch, as plain data.

    Args:
        robot: A name of `redres laws`, or the path of a URDF, whose text is sent to the workers.
        law: A name in LAWS.
        T: Sampling time [s].
        limits: Names in LIMITS; none: the law alone.
        limit_scale: Factor on the arm's velocity and acceleration limits.
        torque_scale: Factor on its torque limits.
        scaling: 'task' or 'components', how limits scale the task velocity.
        preferences: Names in PREFERENCES.
        secondary_tasks: Names in TASKS, in order of priority.
        gains: Values by name, such as {'damping': 5.0, 'posture.gain': 4.0}.
        task: A kind of random task ('random', 'near_singular', 'long'), the name of a task of this
            package, or the path of a task file.
        seed: Seed of a random task.
        tip_frame: Link that carries out the task; empty: the arm's own.
        elbow_frame: Link that counts as the elbow; empty: the arm's own.
        dynamics: 'identified' or 'cylinders'.
        plugins: Python files with laws, preferences, tasks and limits; workers load them, too.

    Raises:
        RedresError: A value of another type than its field's.
    """

    robot: str = 'lwr4_paper'
    law: str = 'minimum_acceleration'
    T: float = 0.002
    limits: tuple[str, ...] = ()
    limit_scale: float = 1.0
    torque_scale: float = 1.0
    scaling: str = 'task'
    preferences: tuple[str, ...] = ()
    secondary_tasks: tuple[str, ...] = ()
    gains: Mapping[str, Any] = field(default_factory=dict)
    task: str = 'random'
    seed: int = 0
    tip_frame: str = ''
    elbow_frame: str = ''
    dynamics: str = 'identified'
    plugins: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.type == _NAMES and isinstance(value, str | list):
                value = as_tuple(value)
                object.__setattr__(self, each.name, value)
            if not _fits(value, each.type):
                expected = _EXPECTED[each.type]
                raise RedresError(f'{each.name} of a case is {quoted(value)}; expected {expected}')
            if each.type is float:
                object.__setattr__(self, each.name, float(value))

    @classmethod
    def of(cls, case: 'Case | Mapping[str, Any]') -> 'Case':
        """A case from a mapping of its fields; a Case is returned as it is.

        Raises:
            UnknownNameError: It has a field that does not exist.
        """
        if isinstance(case, Case):
            return case
        names = [each.name for each in fields(cls)]
        for name in case:
            if name not in names:
                raise UnknownNameError('field of a case', name, names)
        return cls(**case)


def grid(values: Mapping[str, Any]) -> list[Case]:
    """Cases for all combinations of values, by the fields of a case.

    A list stands for one value after the other, of a field that is a list itself a list of lists.
    'seeds': 3 is short for 'seed': [0, 1, 2], and changes last: a batch that is stopped has as many
    tasks of each kind.

    Raises:
        RedresError: A field that does not exist, or a value that is none.
    """
    given = dict(values)
    if 'seeds' in given:
        count = given.pop('seeds')
        if not isinstance(count, int) or not 1 <= count <= MOST_SEEDS:
            raise RangeError('seeds', count, 1, MOST_SEEDS)
        given = {'seed': list(range(count))} | given
    lists = {each.name for each in fields(Case) if each.type == _NAMES}
    choices = [_choices(value, name in lists) for name, value in given.items()]
    return [Case.of(dict(zip(given, chosen, strict=True))) for chosen in product(*choices)]


def _choices(value: Any, is_list: bool) -> list[Any]:
    """The values of a field, of which a single one may be a list itself (is_list)."""
    if not isinstance(value, list):
        return [value]
    if is_list and not any(isinstance(each, list) for each in value):
        return [value]
    return value


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a field's type."""
    if kind == _NAMES:
        return isinstance(value, tuple) and all(isinstance(name, str) for name in value)
    if kind is int:
        return isinstance(value, int) and value >= 0
    if kind is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    return isinstance(value, str if kind is str else Mapping)
