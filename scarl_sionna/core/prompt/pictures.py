"""Small pictures in HTML."""

from __future__ import annotations

import base64
import io

import numpy as np
import numpy.typing as npt


def thumbnail(image: npt.NDArray[np.uint8], width: int = 320) -> str:
    """Return an image (height, width, 3), uint8 sRGB, as an HTML element at most `width` pixels wide."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(image))
    picture.thumbnail((width, width))
    stream = io.BytesIO()
    picture.save(stream, "PNG")
    return f'<br><img src="data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}">'
