"""Camera: lenses, path-traced RGB with sensor noise and motion blur, and label images from exact rays."""

from __future__ import annotations

from .denoise import denoise
from .develop import develop
from .labels import LabelImages, render_labels
from .projection import pixel_centres, pixel_rays, project, unproject
from .render import render_radiance, render_rgb
from .sensor import Camera
from .tone import linear_to_srgb8, srgb8_to_linear

__all__ = [
    "Camera",
    "LabelImages",
    "denoise",
    "develop",
    "linear_to_srgb8",
    "pixel_centres",
    "pixel_rays",
    "project",
    "render_labels",
    "render_radiance",
    "render_rgb",
    "srgb8_to_linear",
    "unproject",
]
