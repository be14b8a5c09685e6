"""Frames for PyTorch: a map-style dataset that also makes batches of frames of different lengths.

PyTorch is no dependency: it is imported where a tensor is made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scarl_sionna.core.packages import require

from .samples import FrameData, FrameSamples

_AS = {np.dtype(np.uint16): np.int32, np.dtype(np.uint32): np.int64, np.dtype(np.uint64): np.int64}
"""Types that PyTorch computes little with."""


class TorchFrames:
    """Map-style dataset of dictionaries of tensors, for `torch.utils.data.DataLoader`, also with workers.

    Parameters
    ----------
    data, items
        See `FrameSamples`. Unsigned 16-bit items (instance ids) become int32.

    Raises
    ------
    MissingPackageError
        If PyTorch is not installed.
    """

    def __init__(self, data: FrameData, items: Sequence[str] | Mapping[str, str] | None = None) -> None:
        require("torch", "torch")
        self.samples = FrameSamples(data, items)
        self._ragged = {key for key, spec in self.samples.signature().items() if None in spec.shape}

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> dict[str, Any]:
        torch = require("torch", "torch")
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        out = {}
        for key, value in self.samples[index].items():
            array = np.array(value, dtype=_AS.get(value.dtype, value.dtype))  # a copy that PyTorch may write to
            out[key] = torch.from_numpy(array) if array.ndim else torch.tensor(array.item())
        return out

    def collate(self, batch: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Return a batch for ``DataLoader(frames, collate_fn=frames.collate)``.

        Items of one shape are stacked; those whose length differs from frame to frame (lidar, boxes) are lists of
        tensors.
        """
        torch = require("torch", "torch")
        values = {key: [sample[key] for sample in batch] for key in self.samples.items}
        return {key: row if key in self._ragged else torch.stack(row) for key, row in values.items()}
