"""One frame as a network sees it, with what is there and what it finds, and precision against the number of frames."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from .data import GRID, Samples
from .grid import CLASSES, Objects
from .tables import Results

COLORS = ("tab:orange", "tab:red", "tab:cyan", "white")
SHOWN_SCORE = 0.25
"""Detections below are not drawn."""


def draw(samples: Samples, results: Results, path: str | Path) -> None:
    """Write the figure of docs/baseline.md: the test frame in clear weather with most road users."""
    clear = np.flatnonzero(results.weather == "clear")
    number = int(clear[np.argmax([len(results.there[row]) for row in clear])])
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), width_ratios=(1.35, 1.25, 1.0))
    left.imshow(samples.images[results.rows[number]])
    left.set_axis_off()
    left.set_title("camera")
    runs = results.runs("map", results.best, "all")
    found = results.outcomes[runs[0]].found[number] if runs else None
    _from_above(middle, samples, results, number, found)
    _against_frames(right, results)
    figure.tight_layout()
    figure.savefig(path, dpi=75)
    plt.close(figure)


def _from_above(axes: plt.Axes, samples: Samples, results: Results, number: int, found: Objects | None) -> None:
    """Draw the radar map of a frame, its road users as circles and the detections as crosses."""
    strongest = samples.maps[results.best][results.rows[number]].max(axis=-1).astype(np.float32)
    along, across = np.meshgrid(np.arange(GRID.num_range + 1), np.arange(GRID.num_sine + 1), indexing="ij")
    edges = GRID.places(np.stack([along.ravel(), across.ravel()], axis=1)).reshape(*along.shape, 2)
    axes.pcolormesh(-edges[..., 1], edges[..., 0], strongest, cmap="viridis", rasterized=True)
    for kind, name in enumerate(CLASSES):
        there = results.there[number]
        place = there.places[there.kinds == kind]
        axes.plot(-place[:, 1], place[:, 0], "o", mfc="none", color=COLORS[kind], label=name)
        if found is not None:
            place = found.places[(found.kinds == kind) & (found.scores >= SHOWN_SCORE)]
            axes.plot(-place[:, 1], place[:, 0], "x", color=COLORS[kind])
    axes.set(xlim=(-25, 25), ylim=(0, 60), xlabel="to the right [m]", ylabel="forward [m]")
    axes.set_facecolor("black")
    axes.set_title("labels (o), found on the map (x)")
    axes.legend(fontsize=6, facecolor="gray", loc="lower right")


def _against_frames(axes: plt.Axes, results: Results) -> None:
    """Draw the mean precision against the number of frames in training."""
    for inputs, color in (("map", "tab:blue"), ("camera and map", "tab:green")):
        for frames, mark in (("one seed", "s"), ("three seeds, thinned", "^"), ("three seeds", "o"), ("all", "o")):
            runs = results.runs(inputs, results.best, frames)
            if runs:
                mean, low, high = (100.0 * part for part in results.value(runs))
                count = float(np.mean([results.outcomes[run].num_frames for run in runs]))
                bars = [[max(mean - low, 0.0)], [max(high - mean, 0.0)]]
                shift = {"one seed": 0.96, "three seeds, thinned": 1.04}.get(frames, 1.0)
                axes.errorbar(count * shift, mean, bars, fmt=mark, color=color, capsize=2, label=f"{inputs}, {frames}")
    axes.set(xscale="log", xlabel="frames in training", ylabel="mean AP [%]", ylim=(0, None))
    axes.legend(fontsize=5)
