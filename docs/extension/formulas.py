"""Formulas as MathML, which browsers typeset by themselves: no script, and no internet."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Have Sphinx write formulas by the functions below."""
    app.add_html_math_renderer('mathml', (_write_inline, None), (_write_block, None))
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _write_inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _write_block(self: HTML5Translator, node: nodes.math_block) -> None:
    formula = convert(node.astext(), display='block')
    self.body.append(f'<div class="formula">{formula}</div>\n')  # scrolls where it is too wide
    raise nodes.SkipNode
