"""Every sentence of the paper that can be measured, measured, and our readings of what it leaves
open.
"""

from redres_ros.paper.claims import assumptions, damping, experimental, numerical, theoretical
from redres_ros.paper.claims.claim import Claim, Finding, check_all, table, write_csv

CLAIMS: tuple[Claim, ...] = tuple(
    value
    for module in (theoretical, damping, numerical, experimental, assumptions)
    for value in vars(module).values()
    if isinstance(value, Claim)
)

__all__ = ['CLAIMS', 'Claim', 'Finding', 'check_all', 'table', 'write_csv']
