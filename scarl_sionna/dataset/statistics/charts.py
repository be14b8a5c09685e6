"""Charts of a dataset's statistics, all in one figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .counted import Counted, CountedPoints, Rows
from .groups import GROUP_NAMES, NO_GROUP

COLOURS = {"car": "#2166ac", "large vehicle": "#7b3294", "two-wheeler": "#d95f02", "pedestrian": "#1b9e77"}
NONE_COLOUR = "#8a8f98"
RANGE_EDGES = np.arange(0.0, 101.0, 10.0)
"""Classes of range [m]."""
SNR_EDGES = np.arange(0.0, 81.0, 4.0)
RCS_EDGES = np.arange(-50.0, 51.0, 4.0)
"""Classes of SNR [dB] and RCS [dBsm]; what lies beyond counts to the outermost."""
SHARE_EDGES = np.linspace(0.0, 1.0, 11)
LOOK = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e6ea",
    "axes.axisbelow": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "scarl",
}
MOST_BARS = 12


def charts(found: Counted) -> Figure:
    """Return the charts as one figure."""
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(10.5, 13.5), layout="constrained")
        panels: tuple[Callable[[Counted, Axes], None], ...] = (
            _points_against_range, _looks_without_points, _rcs, _snr, _classes, _labels_against_range, _occlusion,
            _weather,
        )  # fmt: skip # a table
        for draw, axes in zip(panels, figure.subplots(4, 2).ravel(), strict=True):
            draw(found, axes)
        return figure


def point_charts(found: CountedPoints) -> Figure:
    """Return points of objects against range, and the distribution of RCS, as one figure."""
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        _points_against_range(found, left)
        _rcs(found, right)
        return figure


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG without its XML head, to stand in a page; the same figure gives the same text."""
    with mpl.rc_context(LOOK):
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]


def _groups(rows: Rows) -> Iterator[tuple[str, str, Rows]]:
    """Yield the name, colour and rows of every group that there is."""
    for number, name in enumerate(GROUP_NAMES):
        own = rows[rows["group"] == number]
        if len(own):
            yield name, COLOURS[name], own


def by_range(values: npt.ArrayLike, ranges: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return the mean of values in each class of range (nan where there are none), and how many there are."""
    step = np.digitize(np.asarray(ranges), RANGE_EDGES) - 1
    inside = (step >= 0) & (step < len(RANGE_EDGES) - 1)
    count = np.bincount(step[inside], minlength=len(RANGE_EDGES) - 1)
    total = np.bincount(step[inside], np.asarray(values, np.float64)[inside], len(RANGE_EDGES) - 1)
    with np.errstate(invalid="ignore"):
        return total / count, count


def _range_axis(axes: Axes, of: str) -> None:
    axes.set(xlabel=f"range from the {of} [m]", xlim=(0.0, RANGE_EDGES[-1]))
    axes.set_ylim(bottom=0.0)


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8)
    else:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=NONE_COLOUR)


def _points_against_range(found: CountedPoints, axes: Axes) -> None:
    seen = found.scans[found.scans["points"] > 0]
    middle = (RANGE_EDGES[1:] + RANGE_EDGES[:-1]) / 2.0
    for name, colour, rows in _groups(seen):
        axes.plot(middle, by_range(rows["points"], rows["range"])[0], "o-", color=colour, label=name, markersize=4)
    axes.set(title="Radar points of an object in a scan, if any", ylabel="points, mean")
    _range_axis(axes, "radar")
    _legend(axes)


def _looks_without_points(found: Counted, axes: Axes) -> None:
    middle = (RANGE_EDGES[1:] + RANGE_EDGES[:-1]) / 2.0
    for name, colour, rows in _groups(found.scans):
        share, _ = by_range(100.0 * (rows["points"] == 0), rows["range"])
        axes.plot(middle, share, "o-", color=colour, label=name, markersize=4)
    axes.set(title="Objects in a radar's field of view without a point", ylabel="share of looks [%]")
    _range_axis(axes, "radar")
    axes.set_ylim(0.0, 105.0)
    _legend(axes)


def _rcs(found: CountedPoints, axes: Axes) -> None:
    _densities(found, "rcs_dbsm", RCS_EDGES, axes)
    axes.set(title="Radar cross section of points", xlabel="RCS [dBsm]", ylabel="share of the points [%]")


def _snr(found: CountedPoints, axes: Axes) -> None:
    _densities(found, "snr_db", SNR_EDGES, axes)
    axes.set(title="Signal-to-noise ratio of points", xlabel="SNR [dB]", ylabel="share of the points [%]")


def _densities(found: CountedPoints, column: str, edges: npt.NDArray[np.float64], axes: Axes) -> None:
    others = found.points[found.points["group"] == NO_GROUP]
    drawn = [*_groups(found.points), *([("of none of them", NONE_COLOUR, others)] if len(others) else [])]
    for name, colour, rows in drawn:
        known = rows[column][~np.isnan(rows[column])]
        count, _ = np.histogram(np.clip(known, edges[0], edges[-1]), edges)
        axes.stairs(
            100.0 * count / max(len(known), 1), edges, color=colour, label=f"{name} ({len(known)})", linewidth=1.5
        )
    _legend(axes)


def _bars(axes: Axes, counts: dict[str, int]) -> None:
    names = list(counts)[:MOST_BARS][::-1]
    bars = axes.barh(names, [counts[name] for name in names], height=min(0.8, 0.2 * len(names)), color="#5b7fa8")
    axes.bar_label(bars, padding=3, fontsize=8)
    axes.margins(x=0.12)
    axes.set_ylim(-0.7, max(len(names), 3) - 0.3)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.grid(visible=False, axis="y")


def _classes(found: Counted, axes: Axes) -> None:
    _bars(axes, {name: labels for name, (labels, _) in found.class_balance().items()})
    axes.set(title="Class balance", xlabel="labels: objects in frames")


def _labels_against_range(found: Counted, axes: Axes) -> None:
    drawn = list(_groups(found.objects))
    if drawn:
        values = [np.clip(rows["range"], 0.0, RANGE_EDGES[-1] - 0.01) for _, _, rows in drawn]
        axes.hist(
            values,
            RANGE_EDGES.tolist(),
            stacked=True,
            color=[colour for _, colour, _ in drawn],
            label=[name for name, _, _ in drawn],
        )
    axes.set(title="Labels against range (last bar: all beyond)", ylabel="labels")
    _range_axis(axes, "vehicle")
    _legend(axes)


def _occlusion(found: Counted, axes: Axes) -> None:
    for name, colour, rows in _groups(found.objects[np.isfinite(found.objects["occlusion"])]):
        count, _ = np.histogram(rows["occlusion"], SHARE_EDGES)
        label = f"{name} ({len(rows)})"
        axes.stairs(100.0 * count / len(rows), 100.0 * SHARE_EDGES, color=colour, label=label, linewidth=1.5)
    axes.set(title="Occlusion in the camera that sees most", xlabel="hidden [%]", ylabel="share of labels in view [%]")
    axes.set_xlim(0.0, 100.0)
    _legend(axes)


def _weather(found: Counted, axes: Axes) -> None:
    _bars(axes, found.frames_by("weather"))
    axes.set(title="Weather", xlabel="frames")
