"""Shrink the charts of docs/figures: at most 256 colours, as a lossless WebP where the pages show one, else as a PNG.

python scripts/shrink_figures.py [FILE ...]

Without files: every PNG of docs/figures that has more colours, or a WebP of its name beside it, which it replaces. Run
it after a benchmark drew figures anew. Renders are JPEGs (`benchmarks/photo.py`).
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"


def shrink(path: Path) -> bool:
    """Reduce a PNG to a palette of at most 256 colours, on white where it is transparent.

    Return whether it became smaller, or a WebP took its place.
    """
    image, webp = Image.open(path), path.with_suffix(".webp")
    if image.mode == "P" and not webp.exists():
        return False
    flat = Image.new("RGBA", image.size, "white")
    flat.alpha_composite(image.convert("RGBA"))
    stream = BytesIO()
    few = flat.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    if webp.exists():
        few.convert("RGB").save(webp, "WEBP", lossless=True, quality=100, method=6)
        path.unlink()
        return True
    few.save(stream, "PNG", optimize=True)
    if stream.tell() >= path.stat().st_size:
        return False
    path.write_bytes(stream.getvalue())
    return True


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:]) if sys.argv[1:] else sorted(FIGURES.glob("*.png")):
        if shrink(file):
            small = file if file.exists() else file.with_suffix(".webp")
            print(f"{small.name}: {small.stat().st_size // 1000} kB")
