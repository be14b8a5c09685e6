"""Axes of plots: made where none are given, with units, colour bars and the same look everywhere.

Matplotlib is imported here, late.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar

DYNAMIC_RANGE_DB = 60.0
"""Powers farther below the peak have the darkest colour [dB]."""
POWER_MAP = "magma"
VELOCITY_MAP = "coolwarm"
DEPTH_MAP = "viridis_r"
DARK = "#15171c"
"""Background of points whose weak ones are dark or pale."""
NOTHING = "#dfe6ee"
"""Colour of pixels without a value."""


def axes_or_new(ax: Axes | None, width: float = 7.0, height: float = 4.6) -> Axes:
    """Return axes: those given, or of a new figure of `width` x `height` inches."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    _, made = plt.subplots(figsize=(width, height), layout="constrained")
    return made


def colour_bar(axis: Axes, image: ScalarMappable, label: str, extend: str = "neither") -> Colorbar:
    """Return a colour bar to the right of axes, as high as they are."""
    bar = axis.figure.colorbar(image, cax=axis.inset_axes((1.02, 0.0, 0.028, 1.0)), extend=extend)
    bar.set_label(label)
    bar.outline.set_linewidth(0.5)
    return bar


def power_limits(power_db: npt.NDArray[Any], dynamic_range_db: float) -> tuple[float, float]:
    """Return the ends of a colour scale: the peak, and the dynamic range below it.

    Raises
    ------
    ParameterRangeError
        If the dynamic range is not positive.
    """
    if not dynamic_range_db > 0.0:
        raise ParameterRangeError("dynamic_range_db", f"{dynamic_range_db} dB", "> 0 dB")
    peak = float(np.max(power_db)) if np.size(power_db) else 0.0
    return peak - dynamic_range_db, peak


def draw_power(
    axis: Axes, x: npt.NDArray[Any], y: npt.NDArray[Any], power_dbm: npt.NDArray[Any], limits: tuple[float, float]
) -> None:
    """Draw a power map [dBm] with its colour bar; `x` and `y` are lines of cell centres, or grids of them."""
    image = axis.pcolormesh(
        x,
        y,
        power_dbm,
        cmap=POWER_MAP,
        vmin=limits[0],
        vmax=limits[1],
        shading="nearest" if x.ndim == 1 else "gouraud",
        rasterized=True,
        antialiased=False,
    )
    axis.set_facecolor(image.get_cmap()(0.0))
    colour_bar(axis, image, "power [dBm]", extend="min")


def sensor_map(axis: Axes, reach: float, aside: float | None = None) -> None:
    """Make axes a map around a sensor: x forward is up, y left is left, metres of the same length both ways."""
    aside = reach if aside is None else aside
    axis.set(xlabel="y, to the left [m]", ylabel="x, forward [m]", xlim=(aside, -aside))
    axis.set_aspect("equal", adjustable="box")


def centred(values: npt.NDArray[Any]) -> tuple[float, float]:
    """Return limits about zero that hold all values but the farthest half per cent, for colours of two directions."""
    known = values[np.isfinite(values)]
    most = float(np.quantile(np.abs(known), 0.995)) if known.size else 0.0
    return -max(most, 0.1), max(most, 0.1)
