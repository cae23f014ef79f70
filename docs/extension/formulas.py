"""Formulas as MathML, which browsers typeset by themselves: no script, and no internet."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Have Sphinx write formulas by the functions below."""
    app.add_html_math_renderer('mathml', (_write_inline, None), (_write_block, None))
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def typeset(formula: str, display: str) -> str:
    r"""A formula in LaTeX as MathML.

    Args:
        formula: Such as r'\dot q = b'.
        display: 'inline' or 'block'.

    Raises:
        ExtensionError: It has a command that the converter does not know.
    """
    mathml: str = convert(formula, display=display)
    if '\\' in mathml or '>&<' in mathml:
        raise ExtensionError(f'cannot typeset the formula {formula}')
    return mathml


def _write_inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(typeset(node.astext(), 'inline'))
    raise nodes.SkipNode


def _write_block(self: HTML5Translator, node: nodes.math_block) -> None:
    # a formula that is too wide scrolls
    self.body.append(f'<div class="formula">{typeset(node.astext(), "block")}</div>\n')
    raise nodes.SkipNode
