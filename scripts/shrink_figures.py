"""Shrink the charts of docs/figures: PNGs with at most 256 colours, as small as PNG gets.

python scripts/shrink_figures.py [FILE ...]

Without files: every PNG of docs/figures that has more colours. Run it after a benchmark drew figures anew. Renders are
JPEGs (`benchmarks/photo.py`).
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"


def shrink(path: Path) -> bool:
    """Reduce a PNG to a palette of at most 256 colours, on white where it is transparent.

    Return whether it became smaller.
    """
    image = Image.open(path)
    if image.mode == "P":
        return False
    flat = Image.new("RGBA", image.size, "white")
    flat.alpha_composite(image.convert("RGBA"))
    stream = BytesIO()
    few = flat.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(stream, "PNG", optimize=True)
    if stream.tell() >= path.stat().st_size:
        return False
    path.write_bytes(stream.getvalue())
    return True


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:]) if sys.argv[1:] else sorted(FIGURES.glob("*.png")):
        if shrink(file):
            print(f"{file.name}: {file.stat().st_size // 1000} kB")
