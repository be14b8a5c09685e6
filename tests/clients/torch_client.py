"""Runs in an environment of its own.

Feeds a dataset to PyTorch's DataLoader with workers, prints shapes and sums as JSON.

Usage: python torch_client.py REPOSITORY DATASET
"""

from __future__ import annotations

import json
import sys

if __name__ == "__main__":
    sys.path.insert(0, sys.argv[1])

import torch
from torch.utils.data import DataLoader

from scarl_sionna.dataset.readers.torch_data import TorchFrames

ITEMS = {
    "adc": "front_center/radar:adc",
    "map": "front_center/radar:range_doppler",
    "rgb": "front_center/camera:rgb",
    "ids": "front_center/camera:instance",
    "points": "front_center/lidar:points",
    "boxes": "boxes",
    "time": "timestamp_ns",
}


def summary(batch: dict) -> dict:
    """Return dtype, shapes and sums of a batch."""
    out = {}
    for key, value in batch.items():
        tensors = value if isinstance(value, list) else [value]
        total = [complex(t.to(torch.complex128).sum()) for t in tensors]
        out[key] = {
            "dtype": str(tensors[0].dtype),
            "shapes": [list(t.shape) for t in tensors],
            "sums": [[t.real, t.imag] for t in total],
        }
    return out


def main(place: str) -> dict:
    """Return what loaders with 0 and 2 workers (forked and spawned) give, and the loss of a training step."""
    frames = TorchFrames(place, ITEMS)
    out: dict = {"length": len(frames), "engine": sorted({"mitsuba", "drjit", "tensorflow"} & set(sys.modules))}
    for workers, start in ((0, None), (2, "fork"), (2, "spawn")):
        loader = DataLoader(
            frames, batch_size=2, num_workers=workers, collate_fn=frames.collate, multiprocessing_context=start
        )
        out[f"{workers}{start or ''}"] = [summary(batch) for batch in loader]
    plain = DataLoader(TorchFrames(place, ["front_center/radar:range_doppler"]), batch_size=5, shuffle=True)
    maps = next(iter(plain))["front_center/radar:range_doppler"][:, None]
    network = torch.nn.Sequential(torch.nn.Conv2d(1, 4, 3), torch.nn.AdaptiveMaxPool2d(1), torch.nn.Flatten())
    network(maps).square().mean().backward()
    out["gradient"] = float(network[0].weight.grad.abs().sum())
    return out


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[2])))
