"""A claim of the paper, and the measured result."""

import csv
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from redres_ros.files.text import writing
from redres_ros.paper.runs import Runs

PAPER = 'the paper'
ASSUMPTION = 'our reading of the paper'

_WIDTH = 118
_INDENT = ' ' * 20


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


def table(findings: Mapping[Claim, Finding]) -> str:
    """Text for the terminal: section, verdict and claim on a line, figures and remark below."""
    lines = []
    held: dict[str, list[bool]] = {}
    for claim, finding in findings.items():
        if claim.source not in held:
            lines.append(f'{claim.source}:')
        held.setdefault(claim.source, []).append(finding.held)
        verdict = 'held' if finding.held else 'NOT HELD'
        heading = f'{claim.section:<10}{verdict:<10}{claim.says}'
        lines += textwrap.wrap(heading, _WIDTH, subsequent_indent=_INDENT)
        for text in (finding.measured, finding.remark):
            lines += textwrap.wrap(text, _WIDTH, initial_indent=_INDENT, subsequent_indent=_INDENT)
    lines += [f'{source}: {sum(all_)} of {len(all_)} claims held' for source, all_ in held.items()]
    return '\n'.join(lines)


def write_csv(findings: Mapping[Claim, Finding], path: Path) -> None:
    """Write findings as CSV. Raises FileError."""
    with writing(path), path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(('section', 'claim', 'held', 'measured', 'remark'))
        for claim, finding in findings.items():
            held = 'yes' if finding.held else 'no'
            writer.writerow((claim.section, claim.says, held, finding.measured, finding.remark))
