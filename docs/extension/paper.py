"""The claims that are measured, and what came of the latest run."""

import csv
from collections.abc import Iterator
from pathlib import Path

from sphinx.errors import ExtensionError

from extension.markdown import plain, table
from redres_ros.paper.claim import ASSUMPTION, PAPER
from redres_ros.paper.claims import CLAIMS

DOCS = Path(__file__).resolve().parents[1]
SOURCES = {'paper': PAPER, 'assumption': ASSUMPTION}


def claims(source: str) -> Iterator[str]:
    """The table of the paper's claims, of our readings of it, or of those on contact."""
    if source == 'contact':  # written by docs/make_contact.py
        rows = _rows(DOCS / 'contact.csv')
    else:  # copied from the output of `redres reproduce`
        says = {(claim.section, claim.says): claim.source for claim in CLAIMS}
        every = _rows(DOCS / 'claims.csv')
        stale = {(row['section'], row['claim']) for row in every} - set(says)
        if stale:
            raise ExtensionError(f'docs/claims.csv is of an older run; no such claims: {stale}')
        rows = [row for row in every if says[row['section'], row['claim']] == SOURCES[source]]
    yield f'{sum(row["held"] == "yes" for row in rows)} of {len(rows)} held.'
    yield ''
    yield from table(('section', 'claim', 'held?', 'measured'), list(map(_cells, rows)))


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def _cells(row: dict[str, str]) -> tuple[str, ...]:
    held = 'held' if row['held'] == 'yes' else '**not held**'
    measured = '; '.join(filter(None, (row['measured'], row['remark'])))
    return plain(row['section']), plain(row['claim']), held, plain(measured)
