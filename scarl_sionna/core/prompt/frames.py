"""How a frame is drawn: by a package above this one, which says so when it is imported."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from scarl_sionna.core.errors import ScarlError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FramePlot = Callable[..., "Figure"]
"""Takes a frame and options, and returns a figure."""


class _Known:
    plot: FramePlot | None = None


def plot_frames_with(plot: FramePlot) -> None:
    """Let `Frame.plot` call a function from now on.

    The radar maps of a contact sheet need packages that `core` does not know.
    """
    _Known.plot = plot


def frame_plot() -> FramePlot:
    """Return the function that draws frames.

    Raises
    ------
    ScarlError
        If no package that can has been imported.
    """
    if _Known.plot is None:
        raise ScarlError("no package that draws frames has been imported; import scarl_sionna.dataset")
    return _Known.plot
