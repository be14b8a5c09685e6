"""Ideal pinhole camera: projection, path-traced RGB, and label images from exact rays."""

from __future__ import annotations

from .labels import LabelImages, render_labels
from .projection import pixel_centres, pixel_rays, project, unproject
from .render import render_radiance, render_rgb
from .sensor import Camera
from .tone import linear_to_srgb8, srgb8_to_linear

__all__ = [
    "Camera",
    "LabelImages",
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
