"""Writers and readers of datasets, and pictures of frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from scarl_sionna.core.prompt.frames import plot_frames_with
from scarl_sionna.core.results import Frame

from .encoding import StoreOptions
from .readers.reader import Dataset, Scene, StoredFrame, open_dataset
from .write import write_dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "Dataset",
    "Scene",
    "StoreOptions",
    "StoredFrame",
    "open_dataset",
    "write_dataset",
]


def _contact_sheet(frame: Frame, **options: object) -> Figure:
    from .contact_sheet import contact_sheet  # imports Matplotlib

    return contact_sheet(frame, **cast("dict[str, Any]", options))


plot_frames_with(_contact_sheet)
