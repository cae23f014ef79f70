"""The site's formulas: typeset as MathML, without a script and without the internet."""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

DOCS = Path(__file__).resolve().parents[1] / 'docs'
sys.path.append(str(DOCS))

pytest.importorskip('latex2mathml', reason='needs the extra docs')
formulas = pytest.importorskip('extension.formulas', reason='needs the extra docs')

CODE = re.compile(r'```.*?```|`[^`\n]*`', re.DOTALL)
FORMULA = re.compile(r'\$\$(.+?)\$\$|\$([^$\n]+)\$', re.DOTALL)
SHOWN = [  # (page, formula)
    (page.name, found[1] or found[2])
    for page in sorted(DOCS.rglob('*.md'))
    for found in FORMULA.finditer(CODE.sub('', page.read_text(encoding='utf-8')))
]


def test_there_are_formulas() -> None:
    assert {'concepts.md', 'limits.md'} <= {page for page, _ in SHOWN}


@pytest.mark.parametrize(('page', 'formula'), SHOWN)
def test_a_formula_of_a_page_is_typeset_whole(page: str, formula: str) -> None:
    mathml = formulas.typeset(formula, 'block')
    assert ElementTree.fromstring(mathml).tag.endswith('math'), page


@pytest.mark.parametrize('formula', [r'\nosuchcommand x', r'\begin{aligned}a & b\end{aligned}'])
def test_what_cannot_be_typeset_fails_the_build(formula: str) -> None:
    with pytest.raises(formulas.ExtensionError, match='cannot typeset'):
        formulas.typeset(formula, 'inline')
