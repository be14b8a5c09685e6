"""Tables of what materials do over the cosine of incidence, on the device."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.face_rays import FaceRays
from scarl_sionna.engine.types import DeviceArray

Array = npt.NDArray[np.float64]


def table_cosines(nodes: int) -> Array:
    """Return the cosines of a table's nodes, even in their square root: fine near grazing, where metal changes fast."""
    return np.asarray(np.linspace(0.0, 1.0, nodes) ** 2)


class CosineTable:
    """Columns of numbers over the cosine of incidence, linear between nodes; use it inside the variant of its rays.

    Parameters
    ----------
    rays : FaceRays
    values : ndarray of float64, shape (num_rows, num_nodes, num_columns)
        At :func:`table_cosines`.
    """

    def __init__(self, rays: FaceRays, values: Array) -> None:
        self._rays, (_, self._nodes, self._width) = rays, values.shape
        self._values = rays.reals(values)

    def at(self, row: DeviceArray, cosine: DeviceArray) -> tuple[DeviceArray, ...]:
        """Return the columns of rows at cosines, which count as 0 to 1."""
        dr, rays, width = self._rays.dr, self._rays, self._width
        place = dr.sqrt(dr.clip(cosine, 0.0, 1.0)) * (self._nodes - 1)
        node = dr.minimum(rays.mi.UInt32(place), self._nodes - 2)
        share = place - rays.Real(node)
        low = width * (row * self._nodes + node)
        return tuple(
            dr.lerp(
                dr.gather(rays.Real, self._values, low + k), dr.gather(rays.Real, self._values, low + width + k), share
            )
            for k in range(width)
        )
