"""Writes renders for the documentation."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

QUALITY = 88
"""Of JPEGs; what is lost drowns in the noise of a render."""


def save_photo(image: Image.Image, path: Path) -> None:
    """Write a render as a JPEG."""
    image.convert("RGB").save(path, "JPEG", quality=QUALITY, optimize=True, subsampling=0)
