"""A claim of the paper, and the measured result."""

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from redres_ros.files.text import writing
from redres_ros.paper.runs import Runs
from redres_ros.simulation.report import facts

PAPER = 'the paper'
ASSUMPTION = 'our reading of the paper'


@dataclass(frozen=True)
class Finding:
    """What was found out about a claim."""

    held: bool  # as it stands
    measured: str
    remark: str = ''  # where and why our figures are not the paper's


@dataclass(frozen=True)
class Claim:
    """A sentence of `source` that can be measured."""

    section: str  # of the paper, or an equation
    says: str  # in our words
    measure: Callable[[Runs], Finding]
    source: str = PAPER


def claim(
    section: str, says: str, source: str = PAPER
) -> Callable[[Callable[[Runs], Finding]], Claim]:
    """A decorator that makes a claim of the function that measures it."""
    return lambda measure: Claim(section, says, measure, source)


def tables(findings: Mapping[Claim, Finding]) -> list[Table]:
    """For the terminal, one for each source: section, verdict, and the claim over its figures."""
    rows: dict[str, list[tuple[str, str, str]]] = {}
    for claim, finding in findings.items():
        verdict = 'held' if finding.held else 'NOT HELD'
        texts = filter(None, (claim.says, finding.measured, finding.remark))
        rows.setdefault(claim.source, []).append((claim.section, verdict, '\n'.join(texts)))
    shown = []
    for source, own in rows.items():
        held = sum(verdict == 'held' for _, verdict, _ in own)
        shown.append(facts(own, title=f'{source}: {held} of {len(own)} claims held'))
    return shown


def write_csv(findings: Mapping[Claim, Finding], path: Path) -> None:
    """Write findings as CSV. Raises FileError."""
    with writing(path), path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(('section', 'claim', 'held', 'measured', 'remark'))
        for claim, finding in findings.items():
            held = 'yes' if finding.held else 'no'
            writer.writerow((claim.section, claim.says, held, finding.measured, finding.remark))
