"""Takes over what `redres reproduce` found: the claims as a table, the figures as small pictures.

Run it with: redres reproduce && python docs/make_paper.py redres_reproduce
"""

import argparse
import shutil
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).parent
QUALITY = 70  # of 100; letters stay sharp


def main() -> None:
    """Copy the claims, and write each figure as docs/paper/figure_NN.webp."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('found', type=Path, help='the folder that redres reproduce wrote')
    found = parser.parse_args().found
    for file in found.glob('*.csv'):
        shutil.copy(file, DOCS / file.name)
    pictures = DOCS / 'paper'
    pictures.mkdir(exist_ok=True)
    for file in sorted(found.glob('figure_*.png')):
        with Image.open(file) as picture:
            small = pictures / f'{file.stem}.webp'
            picture.convert('RGB').save(small, quality=QUALITY, method=6)


if __name__ == '__main__':
    main()
