"""Every sentence of the paper that can be measured, measured; and what others published."""

from redres_ros.paper.claims.assumptions import ASSUMPTIONS
from redres_ros.paper.claims.claim import Claim, Finding, check_all, table, write_csv
from redres_ros.paper.claims.experimental import EXPERIMENTAL
from redres_ros.paper.claims.numerical import NUMERICAL
from redres_ros.paper.claims.published import PUBLISHED_MOTIONS
from redres_ros.paper.claims.theoretical import THEORETICAL

CLAIMS: tuple[Claim, ...] = (
    *THEORETICAL,
    *NUMERICAL,
    *EXPERIMENTAL,
    *ASSUMPTIONS,
    *PUBLISHED_MOTIONS,
)

__all__ = ['CLAIMS', 'Claim', 'Finding', 'check_all', 'table', 'write_csv']
