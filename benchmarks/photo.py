"""Writes renders for the documentation."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

QUALITY = 80
"""Of WebP, at half the size of a JPEG; what is lost drowns in the noise of a render."""


def save_photo(image: Image.Image, path: Path, quality: int = QUALITY) -> None:
    """Write a render as a WebP file."""
    image.convert("RGB").save(path, "WEBP", quality=quality, method=6)
