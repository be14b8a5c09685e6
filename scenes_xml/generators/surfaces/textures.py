"""Procedural textures: periodic noise shaped into asphalt, grass, gravel, bark, facade and sign faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..geometry.mesh import Array

PNG_LEVEL = 4
"""Effort of compression: a tenth of the time that the most takes, which was half of that of building a scene, and
these files are no larger than with Pillow's `optimize`."""


def periodic_noise(size: int, seed: int, exponent: float, low: float = 1.0, high: float | None = None) -> Array:
    """Return tileable noise, shape (size, size), zero mean, unit variance, with amplitude ~ frequency^-exponent.

    `low` and `high` bound the band in cycles per tile.
    """
    generator = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(generator.standard_normal((size, size)))
    fy, fx = np.fft.fftfreq(size)[:, None] * size, np.fft.rfftfreq(size)[None, :] * size
    f = np.hypot(fx, fy)
    band = (f >= low) & (f <= (high if high is not None else size))
    shaped = np.fft.irfft2(spectrum * np.where(band, np.maximum(f, 1.0) ** -exponent, 0.0), s=(size, size))
    return (shaped - shaped.mean()) / shaped.std()


def resized(image: Array, size: int) -> Array:
    """Return a square tile in fewer pixels, (size, size[, 3]): all that they can hold of it, and tileable again."""
    half, scale = size // 2, (size / len(image)) ** 2
    spectrum = np.fft.rfft2(image, axes=(0, 1))
    kept = np.concatenate([spectrum[:half], spectrum[-half:]])[:, : half + 1]
    kept[half] = kept[:, half] = 0.0  # the highest frequency has no phase
    return scale * np.fft.irfft2(kept, s=(size, size), axes=(0, 1))


def save(path: Path, srgb: Array, levels: int = 256) -> None:
    """Write an image, shape (h, w) or (h, w, 3), sRGB values 0 to 1, rounded to `levels` steps (small files)."""
    steps = np.round(np.clip(srgb, 0, 1) * (levels - 1)) / (levels - 1)
    Image.fromarray(np.round(255 * steps).astype(np.uint8)).save(path, compress_level=PNG_LEVEL)


def tinted(value: Array, dark: tuple[float, ...], light: tuple[float, ...]) -> Array:
    """Return colours between `dark` and `light` (sRGB), shape value.shape + (3,), for a value of 0 to 1."""
    v = np.clip(value, 0, 1)[..., None]
    return (1 - v) * np.array(dark) + v * np.array(light)


def asphalt(size: int, seed: int, tracks: tuple[float, ...], span: float) -> Array:
    """Return asphalt, shape (size, size, 3): grain, patches, polished wheel tracks.

    `tracks` are the wheel positions across the road [m] from the right edge, `span` the road's width [m]; the image's
    horizontal axis runs across the road.
    """
    grain = periodic_noise(size, seed, 0.15, 60.0)
    patches = periodic_noise(size, seed + 1, 1.3, 1.0, 40.0)
    across = (np.arange(size) + 0.5) / size * span
    wear = sum(np.exp(-(((across - t) / 0.28) ** 2)) for t in tracks)
    edge = np.exp(-across / 0.35) + np.exp(-(span - across) / 0.35)
    value = 0.40 + 0.085 * grain + 0.035 * patches + (0.05 * wear - 0.05 * edge)[None, :]
    stones = periodic_noise(size, seed + 2, 0.0, 200.0) > 2.1
    value = np.where(stones, value + 0.16, value)
    return tinted(value, (0.20, 0.20, 0.205), (0.66, 0.65, 0.63))


def puddles(size: int, seed: int, tracks: tuple[float, ...], span: float) -> Array:
    """Return where water stands on a road, shape (size, size), 0 dry to 1 deep: worn wheel tracks and dips.

    See `asphalt`.
    """
    across = (np.arange(size) + 0.5) / size * span
    ruts = sum(np.exp(-(((across - t) / 0.22) ** 2)) for t in tracks)
    dips = periodic_noise(size, seed, 1.5, 1.0, 60.0)
    fine = periodic_noise(size, seed + 1, 0.5, 40.0)
    return np.clip(0.22 + 0.26 * ruts[None, :] + 0.20 * dips + 0.04 * fine, 0.0, 1.0)


def crack_lines(size: int, seed: int) -> Array:
    """Return a mask, shape (size, size), of sealed cracks.

    Thin level sets of smooth noise where a second noise is high.
    """
    field = periodic_noise(size, seed, 1.6, 1.0, 60.0)
    where = periodic_noise(size, seed + 1, 1.5, 1.0, 6.0)
    return (np.abs(field) < 0.012) & (where > 0.9)


def grass(size: int, seed: int) -> Array:
    """Return a meadow seen from above, shape (size, size, 3)."""
    fine = periodic_noise(size, seed, 0.35, 30.0)
    clumps = periodic_noise(size, seed + 1, 1.2, 2.0, 60.0)
    dry = periodic_noise(size, seed + 2, 1.4, 1.0, 30.0)
    base = tinted(0.45 + 0.16 * fine + 0.10 * clumps, (0.13, 0.19, 0.05), (0.50, 0.56, 0.24))
    straw = tinted(0.45 + 0.16 * fine, (0.30, 0.26, 0.12), (0.66, 0.60, 0.36))
    mix = np.clip(0.16 + 0.13 * dry, 0, 0.6)[..., None]
    return (1 - mix) * base + mix * straw


def gravel(size: int, seed: int) -> Array:
    """Return fine gravel, shape (size, size, 3)."""
    value = (
        0.5
        + 0.17 * periodic_noise(size, seed, 0.2, 40.0, 200.0)
        + 0.05 * periodic_noise(size, seed + 1, 1.0, 1.0, 20.0)
    )
    return tinted(value, (0.26, 0.24, 0.21), (0.74, 0.71, 0.66))


def bark(size: int, seed: int) -> Array:
    """Return bark, shape (size, size, 3), furrowed along the vertical axis."""
    furrows = periodic_noise(size, seed, 0.9, 4.0, 60.0)
    stretched = np.repeat(furrows[: size // 4], 4, axis=0)
    value = 0.45 + 0.17 * stretched + 0.07 * periodic_noise(size, seed + 1, 0.3, 20.0)
    return tinted(value, (0.12, 0.09, 0.07), (0.55, 0.47, 0.38))


def plaster(size: int, seed: int) -> Array:
    """Return weathered plaster, shape (size, size, 3)."""
    value = 0.6 + 0.05 * periodic_noise(size, seed, 0.4, 20.0) + 0.07 * periodic_noise(size, seed + 1, 1.5, 1.0, 12.0)
    return tinted(value, (0.62, 0.57, 0.48), (0.95, 0.91, 0.83))


def bricks(size: int, seed: int, rows: int = 16, columns: int = 8) -> Array:
    """Return a brick wall in stretcher bond, shape (size, size, 3); tileable for even `rows`."""
    generator = np.random.default_rng(seed)
    v, u = np.meshgrid((np.arange(size) + 0.5) / size * rows, (np.arange(size) + 0.5) / size * columns, indexing="ij")
    row = np.floor(v).astype(int)
    u = (u + 0.5 * (row % 2)) % columns
    tone = generator.uniform(-1, 1, (rows, columns))[row, np.floor(u).astype(int)]
    joint = (v % 1 < 0.12) | (u % 1 < 0.05)
    value = 0.5 + 0.22 * tone + 0.07 * periodic_noise(size, seed + 1, 0.3, 10.0)
    return np.where(joint[..., None], 0.62, tinted(value, (0.36, 0.17, 0.12), (0.70, 0.38, 0.28)))


def roof_tiles(size: int, seed: int, rows: int = 10, columns: int = 12) -> Array:
    """Return roof tiles, shape (size, size, 3): rounded rows with a shadow at the lower edge."""
    generator = np.random.default_rng(seed)
    v, u = np.meshgrid((np.arange(size) + 0.5) / size * rows, (np.arange(size) + 0.5) / size * columns, indexing="ij")
    tone = generator.uniform(-1, 1, (rows, columns))[np.floor(v).astype(int), np.floor(u).astype(int)]
    value = 0.45 + 0.14 * tone + 0.20 * np.sin(np.pi * (u % 1)) - 0.35 * np.exp(-(((v % 1) / 0.12) ** 2))
    return tinted(value, (0.20, 0.10, 0.08), (0.66, 0.36, 0.27))


def sign_speed(size: int, text: str = "80") -> Image.Image:
    """Return a round speed-limit sign face with the digits drawn as seven-segment-like strokes."""
    image = Image.new("RGB", (4 * size, 4 * size), (196, 18, 28))
    draw, s = ImageDraw.Draw(image), 4 * size
    draw.ellipse([0.115 * s, 0.115 * s, 0.885 * s, 0.885 * s], fill=(240, 240, 238))
    for k, digit in enumerate(text):
        _digit(draw, digit, (0.27 + 0.25 * k) * s, 0.32 * s, 0.19 * s, 0.36 * s, 0.055 * s)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def _digit(draw: ImageDraw.ImageDraw, digit: str, x: float, y: float, w: float, h: float, t: float) -> None:
    """Draw one digit from rounded rings and bars."""
    ink = (20, 20, 22)
    if digit == "8":
        draw.rounded_rectangle([x + 0.04 * w, y, x + 0.96 * w, y + 0.52 * h], 0.42 * w, outline=ink, width=int(t))
        draw.rounded_rectangle([x, y + 0.42 * h, x + w, y + h], 0.46 * w, outline=ink, width=int(t))
    elif digit == "0":
        draw.rounded_rectangle([x, y, x + w, y + h], 0.5 * w, outline=ink, width=int(t))
    elif digit == "3":
        for top, bottom in ((0.0, 0.54), (0.44, 1.0)):
            draw.arc([x - 0.1 * w, y + top * h, x + 0.98 * w, y + bottom * h], 215, 505, fill=ink, width=int(t))
    elif digit == "5":
        draw.line(
            [(x + 0.92 * w, y + t / 2), (x + 0.16 * w, y + t / 2), (x + 0.1 * w, y + 0.48 * h)],
            fill=ink,
            width=int(t),
            joint="curve",
        )
        draw.arc([x - 0.1 * w, y + 0.38 * h, x + w, y + h], 220, 505, fill=ink, width=int(t))
    else:
        raise ValueError(f"sign_speed draws only the digits 0, 3, 5 and 8, got {digit!r}")


def sign_bend(size: int) -> Image.Image:
    """Return a triangular bend warning (bend to the left): red rim, white field, black arrow; square image."""
    s = 4 * size
    image = Image.new("RGB", (s, s), (196, 18, 28))
    draw = ImageDraw.Draw(image)
    draw.polygon([(0.5 * s, 0.20 * s), (0.155 * s, 0.875 * s), (0.845 * s, 0.875 * s)], fill=(240, 240, 238))
    path = [(0.56, 0.82), (0.56, 0.70), (0.545, 0.62), (0.50, 0.56), (0.45, 0.51)]
    points = [(x * s, y * s) for x, y in path]
    draw.line(points, fill=(20, 20, 22), width=int(0.06 * s), joint="curve")
    draw.polygon([(0.40 * s, 0.46 * s), (0.50 * s, 0.465 * s), (0.425 * s, 0.56 * s)], fill=(20, 20, 22))
    return image.resize((size, size), Image.Resampling.LANCZOS)


def chevrons(width: int, height: int) -> Image.Image:
    """Return a bend board: red arrows to the left on white."""
    w, h = 4 * width, 4 * height
    image = Image.new("RGB", (w, h), (240, 240, 238))
    draw = ImageDraw.Draw(image)
    for k in range(4):
        x = (0.04 + 0.25 * k) * w
        a = 0.125 * w
        draw.polygon(
            [(x, h / 2), (x + a, 0), (x + 2 * a * 0.95, 0), (x + 0.95 * a, h / 2), (x + 2 * a * 0.95, h), (x + a, h)],
            fill=(196, 18, 28),
        )
    return image.resize((width, height), Image.Resampling.LANCZOS)


def plate(width: int, height: int, seed: int) -> Image.Image:
    """Return a number plate with a blue band and illegible dark characters."""
    generator = np.random.default_rng(seed)
    image = Image.new("RGB", (width, height), (235, 235, 230))
    draw = ImageDraw.Draw(image)
    draw.rectangle([0, 0, int(0.08 * width), height], fill=(20, 50, 150))
    for k in range(7):
        if k == 2:
            continue
        x = int((0.14 + 0.12 * k) * width)
        for y in (0.2, 0.5, 0.76):
            draw.rectangle([x, int(y * height), x + int(0.07 * width), int((y + 0.09) * height)], fill=(20, 20, 22))
        left = x if generator.uniform() < 0.5 else x + int(0.05 * width)
        draw.rectangle([left, int(0.2 * height), left + int(0.022 * width), int(0.85 * height)], fill=(20, 20, 22))
    return image


def headlamp(width: int, height: int) -> Image.Image:
    """Return a head lamp behind clear glass: two reflectors in a dark housing, a bright strip along the top."""
    w, h = 4 * width, 4 * height
    image = Image.new("RGB", (w, h), (46, 48, 52))
    draw = ImageDraw.Draw(image)
    for x, radius in ((0.30, 0.36), (0.62, 0.30)):
        for k, tone in enumerate((120, 205, 90, 225, 160, 245)):
            r = radius * h * (1.0 - 0.16 * k)
            draw.ellipse([x * w - r, 0.56 * h - r, x * w + r, 0.56 * h + r], fill=(tone, tone, min(tone + 6, 255)))
    draw.rectangle([0, 0.02 * h, w, 0.14 * h], fill=(224, 228, 234))
    draw.polygon(
        [(0.80 * w, 0.30 * h), (0.98 * w, 0.24 * h), (0.97 * w, 0.86 * h), (0.83 * w, 0.90 * h)], fill=(222, 128, 36)
    )
    return image.resize((width, height), Image.Resampling.LANCZOS)


def taillamp(width: int, height: int) -> Image.Image:
    """Return a tail lamp: red glass with bright bars, a white reversing lamp and an amber turn signal."""
    w, h = 4 * width, 4 * height
    image = Image.new("RGB", (w, h), (138, 8, 12))
    draw = ImageDraw.Draw(image)
    for k in range(7):
        y = (0.06 + 0.055 * k) * h
        draw.rectangle([0.06 * w, y, 0.94 * w, y + 0.03 * h], fill=(205, 22, 24))
    draw.rectangle([0.06 * w, 0.50 * h, 0.94 * w, 0.66 * h], fill=(206, 98, 30))
    draw.rectangle([0.06 * w, 0.70 * h, 0.94 * w, 0.84 * h], fill=(214, 214, 216))
    for k in range(9):
        draw.line([((0.06 + 0.11 * k) * w, 0.50 * h), ((0.06 + 0.11 * k) * w, 0.84 * h)], fill=(120, 60, 50), width=6)
    draw.rectangle([0.06 * w, 0.88 * h, 0.94 * w, 0.97 * h], fill=(176, 14, 16))
    return image.resize((width, height), Image.Resampling.LANCZOS)
