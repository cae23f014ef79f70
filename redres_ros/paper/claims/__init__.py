"""Every sentence of the paper that can be measured, measured; and what others published."""

from itertools import chain
from types import ModuleType

from redres_ros.paper.claims import (
    assumptions,
    damping,
    experimental,
    numerical,
    published,
    theoretical,
)
from redres_ros.paper.claims.claim import Claim, Finding, check_all, table, write_csv


def _claims_of(module: ModuleType) -> list[Claim]:
    """The claims in the order of the module."""
    return [each for each in vars(module).values() if isinstance(each, Claim)]


_MODULES = (theoretical, damping, numerical, experimental, assumptions, published)
CLAIMS: tuple[Claim, ...] = tuple(chain.from_iterable(map(_claims_of, _MODULES)))

__all__ = ['CLAIMS', 'Claim', 'Finding', 'check_all', 'table', 'write_csv']
