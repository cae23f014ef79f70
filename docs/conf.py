"""How Sphinx builds the site: python -m sphinx -W docs build/docs."""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'docs')]

project = 'redres_ros'
author = 'redres_ros maintainers'
release = ElementTree.parse(ROOT / 'package.xml').findtext('version', '')
version = release

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
    'sphinx_copybutton',
    'extension.formulas',
    'extension.long_names',
    'extension.tables',
]
exclude_patterns = ['Thumbs.db', '.DS_Store']

myst_enable_extensions = ['attrs_block', 'deflist', 'dollarmath']
myst_dmath_double_inline = False
html_math_renderer = 'mathml'
myst_heading_anchors = 3  # headings down to this level can be linked to

smartquotes = False  # options begin with two hyphens

html_theme = 'furo'
html_show_copyright = False  # LICENSE says it
html_title = f'redres_ros {release}'
html_theme_options = {'navigation_with_keys': True}
html_static_path = ['static']
html_css_files = ['site.css']
html_copy_source = False
pygments_style = 'friendly'
pygments_dark_style = 'monokai'

autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented'
autodoc_member_order = 'bysource'
autodoc_default_options = {'members': True, 'show-inheritance': False}
python_use_unqualified_type_names = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # one list of attributes, and no entry for each beside it

# Files beside docs/ that pages link to, and the pages that show them.
_PAGES = {
    '../README.md': 'index.md',
    '../CONTRIBUTING.md': 'contributing.md',
    '../CHANGELOG.md': 'changelog.md',
}
_LINK = re.compile(r'\]\((\.\./[\w./]+\.md)(#[\w-]+)?\)')


def setup(app: Sphinx) -> None:
    """Have Sphinx call what is below."""
    app.connect('source-read', _link_to_pages)
    app.connect('autodoc-process-docstring', _as_plain_text, priority=900)


def _link_to_pages(app: Sphinx, name: str, source: list[str]) -> None:
    """Links that are right in the repository lead to the pages of the site."""
    depth = '../' * name.count('/')

    def page(link: re.Match[str]) -> str:
        target = _PAGES.get(link[1].removeprefix(depth) if depth else link[1])
        return f']({depth}{target}{link[2] or ""})' if target else link[0]

    source[0] = _LINK.sub(page, source[0])


def _as_plain_text(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Docstrings are plain text with formulas: only `code` and sections mean something in them."""
    for number, line in enumerate(lines):
        lines[number] = line if line.lstrip().startswith((':', '.. ')) else _escaped(line)


def _escaped(line: str) -> str:
    words = re.split(r'(``?[^`]+``?)', line)
    return ''.join(
        f'``{word.strip("`")}``' if word.startswith('`') else re.sub(r'([*|_\\])', r'\\\1', word)
        for word in words
    )
