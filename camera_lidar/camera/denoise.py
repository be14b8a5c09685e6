"""Denoising with Intel Open Image Denoise, led by albedo and normal images."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import EngineError


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
    return np.asarray(pyoidn.denoise(color, albedo, normal, hdr=True), dtype=np.float32)
