"""Textures of a user's mesh: the image of the base colour as PNG bytes, of a size that is bounded."""

from __future__ import annotations

import hashlib
import io

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image, UnidentifiedImageError

from scarl_sionna.core.errors import MeshError

Array = npt.NDArray[np.float64]

LONGEST_SIDE = 2048
"""Larger images are made smaller to this [px]."""
MOST_PIXELS = 16384 * 16384
_WHITE = (1.0, 1.0, 1.0)


def texture_of(body: trimesh.Trimesh) -> tuple[Array, bytes] | None:
    """Return the texture coordinates (num_vertices, 2), v from the image's top, and the base colour of a mesh as PNG.

    None where it has no image, or no coordinates for it.

    Raises
    ------
    MeshError
        If the image is damaged or too large.
    """
    visual = body.visual
    coordinates = getattr(visual, "uv", None)
    material = getattr(visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is None or coordinates is None or len(coordinates) != len(body.vertices):
        return None
    uv = np.asarray(coordinates, dtype=np.float64)[:, :2] * [1.0, -1.0] + [0.0, 1.0]
    if not np.isfinite(uv).all():
        return None
    factor = getattr(material, "baseColorFactor", None)
    return uv, png_of(image, _WHITE if factor is None else tuple(np.asarray(factor, float)[:3] / 255.0))


def read_image(data: bytes) -> Image.Image:
    """Return an image of bytes that nobody vouches for.

    Raises
    ------
    MeshError
        If it is none, or has more than `MOST_PIXELS`.
    """
    try:
        image = Image.open(io.BytesIO(data))
    except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
        raise MeshError(
            f"has a texture that cannot be read ({type(error).__name__})", remedy="export it again"
        ) from error
    return image


def png_of(image: Image.Image, factor: tuple[float, ...] = _WHITE) -> bytes:
    """Return an image as PNG without alpha, times a linear RGB `factor`, at most `LONGEST_SIDE` on each side.

    Raises
    ------
    MeshError
        If it is damaged or too large.
    """
    if image.width * image.height > MOST_PIXELS:
        raise MeshError(f"has a texture of {image.width} x {image.height} pixels", remedy="export it smaller")
    try:
        plain = image.convert("RGB")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise MeshError(f"has a damaged texture ({type(error).__name__}: {error})", remedy="export it again") from error
    if max(plain.size) > LONGEST_SIDE:
        plain.thumbnail((LONGEST_SIDE, LONGEST_SIDE))
    if min(factor) < 1.0 - 1e-3:
        srgb = np.asarray(plain, dtype=np.float64) / 255.0
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4) * np.asarray(factor)
        back = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
        plain = Image.fromarray(np.round(255.0 * np.clip(back, 0.0, 1.0)).astype(np.uint8))
    out = io.BytesIO()
    plain.save(out, "PNG")
    return out.getvalue()


def texture_name(image: bytes) -> str:
    """Return the file of an image within its model."""
    return f"textures/{hashlib.sha256(image).hexdigest()[:12]}.png"
