"""Every sentence of the paper that can be measured, measured, and our readings of what it leaves
open.
"""

from itertools import chain

from redres_ros.paper.claims import assumptions, damping, experimental, numerical, theoretical
from redres_ros.paper.claims.claim import Claim, Finding, check_all, table, write_csv

_MODULES = (theoretical, damping, numerical, experimental, assumptions)
CLAIMS: tuple[Claim, ...] = tuple(
    each for each in chain(*(vars(module).values() for module in _MODULES)) if type(each) is Claim
)

__all__ = ['CLAIMS', 'Claim', 'Finding', 'check_all', 'table', 'write_csv']
