"""The claims of the paper that are measured."""

from collections.abc import Iterator

from extension.markdown import plain, table
from redres_ros.paper.claims import CLAIMS


def claims() -> Iterator[str]:
    """The table of claims, in our words."""
    rows = [(plain(claim.section), plain(claim.says)) for claim in CLAIMS]
    yield from table(('in the paper', 'claim'), rows)
