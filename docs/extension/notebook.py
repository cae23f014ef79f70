"""Runs a notebook, and shows it as a page: its words, its code, what that prints, and its plots.

`python docs/extension/notebook.py FILE.ipynb` runs it and writes what came of it into the file. A
kernel is not needed: cells are run one after the other in this process.
"""

import base64
import contextlib
import io
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]

_TITLE = re.compile(r'^# .*\n+')


def page(path: str) -> Iterator[str]:
    """The Markdown of a notebook without its title, given by its path in the project."""
    for cell in json.loads((ROOT / path).read_text(encoding='utf-8'))['cells']:
        text = _TITLE.sub('', ''.join(cell['source']))
        if cell['cell_type'] == 'markdown':
            yield from (text, '')
            continue
        yield from ('```python', text, '```', '')
        for output in cell['outputs']:
            yield from _shown(output)


def run(path: Path) -> dict[str, Any]:
    """The notebook with what its code prints and draws now; the file is left alone."""
    import matplotlib as mpl

    mpl.use('Agg')
    notebook: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
    names: dict[str, Any] = {'__name__': '__main__'}
    code = [cell for cell in notebook['cells'] if cell['cell_type'] == 'code']
    for number, cell in enumerate(code, start=1):
        cell['execution_count'] = number
        cell['outputs'] = _outputs(''.join(cell['source']), f'{path.name}, cell {number}', names)
    return notebook


def printed(notebook: dict[str, Any]) -> list[str]:
    """What each cell of code has printed."""
    code = [cell for cell in notebook['cells'] if cell['cell_type'] == 'code']
    return [''.join(''.join(output.get('text', [])) for output in cell['outputs']) for cell in code]


def _outputs(source: str, name: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    from matplotlib import pyplot

    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        exec(compile(source, name, 'exec'), names)
    outputs: list[dict[str, Any]] = []
    if text.getvalue():
        lines = text.getvalue().splitlines(keepends=True)
        outputs.append({'output_type': 'stream', 'name': 'stdout', 'text': lines})
    outputs.extend(_picture(pyplot.figure(number)) for number in pyplot.get_fignums())
    pyplot.close('all')
    return outputs


def _picture(figure: Any) -> dict[str, Any]:
    buffer = io.BytesIO()
    figure.savefig(buffer, format='png', dpi=80, metadata={'Software': None})
    encoded = base64.b64encode(buffer.getvalue()).decode()
    return {'output_type': 'display_data', 'metadata': {}, 'data': {'image/png': encoded}}


def _shown(output: dict[str, Any]) -> Iterator[str]:
    if 'text' in output:
        yield from ('```text', ''.join(output['text']).rstrip(), '```', '')
    else:
        yield f'<img alt="plot" src="data:image/png;base64,{output["data"]["image/png"]}">'
        yield ''


if __name__ == '__main__':
    for file in map(Path, sys.argv[1:]):
        text = json.dumps(run(file), indent=1, ensure_ascii=False)
        file.write_text(text + '\n', encoding='utf-8')
