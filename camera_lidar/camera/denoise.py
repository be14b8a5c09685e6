"""Denoising with Intel Open Image Denoise, led by albedo and normal images."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import EngineError

from .energy import keep_energy, luminance

PASSES = 2
"""Over what the filter left; the first halves the light that the darkest quarter has too much, the second again."""
MOST_RATIO = 8.0
"""Largest ratio of luminances that these passes see; one sample in a glint would lead it over its neighbours."""
QUALITY = "high"
"""Of the filter's network: "high", "balanced" or "fast"; measured in docs/camera.md."""
CLEAN_GUIDES = False
"""Whether the filter is told that albedo and normals have no noise of their own; measured there, too."""
_LEAST = 1e-7
"""Part of the mean luminance that counts as black: no ratio of nothing to nothing."""


def denoise(radiance: npt.NDArray[np.float32], guides: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the denoised radiance.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
        Linear.
    guides : ndarray of float32, shape (height, width, 6)
        Albedo in [0, 1] and unit normal of what is seen first.

    Returns
    -------
    ndarray of float32, shape (height, width, 3)

    Raises
    ------
    EngineError
        If the package `pyoidn` or its library cannot be loaded.

    Notes
    -----
    A trained filter: the result is not unbiased, and detail that neither albedo nor normals show (reflections, thin
    shadows) is smoothed when it is as small as the noise. Measured against samples in docs/camera.md.

    References
    ----------
    .. [1] A. T. Afra, *Intel Open Image Denoise*, https://www.openimagedenoise.org.
    """
    try:
        import pyoidn  # type: ignore[import-untyped]
    except (ImportError, OSError) as error:
        raise EngineError(
            f"Open Image Denoise cannot be loaded ({error}); install the package 'pyoidn', "
            "or set CameraSpec.denoise = False"
        ) from error
    color = np.ascontiguousarray(np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0))
    albedo = np.ascontiguousarray(np.clip(guides[..., :3], 0.0, 1.0))
    normal = np.ascontiguousarray(np.clip(guides[..., 3:], -1.0, 1.0))
    return np.asarray(
        pyoidn.denoise(color, albedo, normal, hdr=True, quality=QUALITY, clean_aux=CLEAN_GUIDES), dtype=np.float32
    )


def denoise_darkness(radiance: npt.NDArray[np.float32], guides: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    r"""Return the denoised radiance of a scene with lamps: dark places keep their darkness, and all its light is kept.

    Parameters
    ----------
    radiance, guides : ndarray of float32
        As for :func:`denoise`; the radiance without what shines itself.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)

    Notes
    -----
    The filter sees brightness as one exposure shows it, so what is a thousand times darker than its neighbourhood is
    black to it and takes light from there. `PASSES` more filter what the last one left: with its luminance Y,
    :math:`x_{k+1} = Y_k F(x / Y_k)`. The ratio is about 1 where the last was right and small where it was too bright,
    so there a fault stands out from the noise, and the filter tells both apart with the same guides. After each pass
    :func:`keep_energy` gives back what was taken. Measured in docs/camera.md.

    References
    ----------
    .. [1] J. W. Tukey, *Exploratory Data Analysis*, 1977, ch. 16: smoothing the rough once more ("twicing").
    """
    image = keep_energy(denoise(radiance, guides), radiance)
    black = _LEAST * float(luminance(radiance).mean())
    if black <= 0.0:
        return image
    for _ in range(PASSES):
        level = luminance(image) + black
        ratio = (radiance + black) / level[..., None]
        ratio *= (MOST_RATIO / np.maximum(luminance(ratio), MOST_RATIO))[..., None]
        image = keep_energy(level[..., None] * denoise(ratio.astype(np.float32), guides), radiance)
    return image
