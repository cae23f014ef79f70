"""Directives that stand for a table made from the code, as ```{topics}."""

from collections.abc import Callable, Iterable

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from extension.building_blocks import building_blocks
from extension.commands import commands
from extension.equations import equations
from extension.layout import layout
from extension.notebook import page
from extension.paper import claims
from extension.public import public
from extension.ros import parameters, services, topics


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directives known to Sphinx."""
    makers: dict[str, Callable[..., Iterable[str]]] = {
        'claims': claims,
        'commands': commands,
        'equations': equations,
        'notebook': page,
        'parameters': parameters,
        'public': public,
        'layout': layout,
        'services': services,
        'tables': building_blocks,
        'topics': topics,
    }
    for name, make in makers.items():
        app.add_directive(name, _directive(make))
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _directive(make: Callable[..., Iterable[str]]) -> type[SphinxDirective]:
    """A directive in whose place the Markdown stands that make(*words of its argument) gives."""

    class FromCode(SphinxDirective):
        optional_arguments = 1

        def run(self) -> list[nodes.Node]:
            self.env.note_reread()  # the page cannot know when the code has changed
            words = self.arguments[0].split() if self.arguments else []
            text = '\n'.join(make(*words))
            return self.parse_text_to_nodes(text, allow_section_headings=True)

    return FromCode
