"""The formulas of the site: what cannot be typeset as MathML fails the build."""

import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / 'docs'))

pytest.importorskip('latex2mathml', reason='needs the extra docs')
formulas = pytest.importorskip('extension.formulas', reason='needs the extra docs')


@pytest.mark.parametrize('formula', [r'\nosuchcommand x', r'\begin{aligned}a & b\end{aligned}'])
def test_what_cannot_be_typeset_fails_the_build(formula: str) -> None:
    assert ElementTree.fromstring(formulas.typeset(r'\dot q', 'inline')).tag.endswith('math')
    with pytest.raises(formulas.ExtensionError, match='cannot typeset'):
        formulas.typeset(formula, 'inline')
