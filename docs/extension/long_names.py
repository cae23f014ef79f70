"""Lets names in tables break after _ and /, and long ones anywhere, to leave the others room."""

import re

from docutils import nodes
from sphinx.application import Sphinx

LONG = 36  # letters that a column may take without a break
_LONG_WORD = re.compile(rf'(\S{{{LONG + 1},}})')
_WORD_ENDS = re.compile(r'(?<=[_/])(?=\w)')
_CLASS = 'long'  # site.css knows it


def setup(app: Sphinx) -> dict[str, bool]:
    """Have Sphinx call what is below."""
    app.connect('doctree-read', _mark)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _mark(app: Sphinx, doctree: nodes.document) -> None:
    """Give every long name in a table the class."""
    for table in doctree.findall(nodes.table):
        for literal in table.findall(nodes.literal):
            if len(literal.astext()) > LONG:  # code does not break at spaces either
                literal['classes'].append(_CLASS)
            _allow_breaks(literal)
        for text in list(table.findall(nodes.Text)):
            if not isinstance(text.parent, nodes.literal) and _LONG_WORD.search(text):
                text.parent.replace(text, _in_pieces(text))


def _allow_breaks(literal: nodes.literal) -> None:
    """A narrow screen may break the name between its words."""
    first, *others = _WORD_ENDS.split(literal.astext())
    literal.clear()
    literal += nodes.Text(first)
    for other in others:
        literal += nodes.raw('', '<wbr>', format='html')
        literal += nodes.Text(other)


def _in_pieces(text: str) -> list[nodes.Node]:
    """The text, with its long words as elements of their own."""
    return [_piece(piece) for piece in _LONG_WORD.split(text) if piece]


def _piece(text: str) -> nodes.Node:
    if _LONG_WORD.fullmatch(text):
        return nodes.inline(text, text, classes=[_CLASS])
    return nodes.Text(text)
