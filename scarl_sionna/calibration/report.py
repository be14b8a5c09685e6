"""A report of a calibration: one HTML file with its figures inside, and the numbers as JSON."""

from __future__ import annotations

import base64
import io
import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scarl_sionna.core.errors import OutputError

from .estimate import INTERVAL, CalibrationResult
from .forward import Channel
from .material_file import calibrated_materials, save_materials
from .spec import MeasurementBase, RcsPattern, ScenePowers, SlabMeasurement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNITS = {"power_db": "dB", "power": "power", "amplitude": "amplitude", "complex": "real, then imaginary part"}
_STYLE = """body{font:15px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{border-bottom:1px solid #ccc;padding:.25em .8em;text-align:right}
td:first-child,th:first-child{text-align:left}img{max-width:100%}.bad{color:#a40000;font-weight:bold}"""


def summary(result: CalibrationResult) -> dict[str, Any]:
    """Return the numbers of a result as plain data."""
    start = result.model.start
    return {
        "title": result.problem.title,
        "converged": result.converged,
        "reason": result.reason,
        "chi_square": result.chi_square,
        "degrees_of_freedom": result.degrees_of_freedom,
        "p_value": result.p_value,
        "misfit": result.misfit,
        "parameters": {
            name: {
                "value": float(value),
                "std": _finite(std),
                "interval_95": [_finite(low), _finite(high)],
                "start": float(first),
                "at_bound": name in result.at_bound,
            }
            for name, value, std, (low, high), first in zip(
                result.names, result.values, result.std, result.interval, start, strict=True
            )
        },
        "not_identified": [{"weights": item.weights, "std_of_range": _finite(item.std)} for item in result.weak],
        "correlated": [list(item) for item in result.correlated],
        "other_minima": [dict(zip(result.names, point.tolist(), strict=True)) for point in result.other_minima],
        "measurements": {
            item.spec.name: {
                "held_out": item.spec.held_out,
                "num_values": len(item.data),
                "rms_before": result.rms(item, start),
                "rms_after": result.rms(item),
                "unit": _UNITS[item.form],
            }
            for item in result.model.channels
        },
        "num_evaluations": result.num_evaluations,
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_report(result: CalibrationResult, folder: str | Path) -> Path:
    """Write ``report.html``, ``estimate.json`` and, if a material was free, ``materials.toml``; return the HTML file.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "estimate.json").write_text(json.dumps(summary(result), indent=1), encoding="utf-8")
        page = folder / "report.html"
        page.write_text(_page(result), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write {folder}: {error.strerror}; choose a folder that you may write to") from error
    if calibrated_materials(result):
        save_materials(result, folder / "materials.toml")
    return page


def measurement_figure(result: CalibrationResult, channel: Channel) -> Figure:
    """Return data, model before and after, and residuals in units of the noise."""
    from matplotlib.figure import Figure

    axis, label = _axis(channel)
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    upper.errorbar(axis, channel.data, INTERVAL * channel.sigma, fmt="k.", ms=4, lw=0.8, label="measured, 95 %")
    style = "-" if np.all(np.diff(axis) > 0) and len(axis) > 1 else "x"
    fitted = result.model.predict(channel, result.values)
    upper.plot(axis, result.model.predict(channel, result.model.start), style, color="tab:orange", label="before")
    upper.plot(axis, fitted, style, color="tab:blue", label="after")
    upper.set_ylabel(_UNITS[channel.form])
    upper.legend()
    upper.set_title(channel.spec.name + (" (held out)" if channel.spec.held_out else ""))
    lower.axhspan(-INTERVAL, INTERVAL, color="0.9")
    lower.plot(axis, (fitted - channel.data) / channel.sigma, "k.", ms=4)
    lower.set_ylabel("residual / noise")
    lower.set_xlabel(label)
    return figure


def _axis(channel: Channel) -> tuple[Any, str]:
    """Return what a measurement is plotted against."""
    spec: MeasurementBase = channel.spec
    count = len(channel.data)
    if channel.form != "complex":
        if isinstance(spec, RcsPattern):
            return np.asarray(spec.aspect_deg), "aspect [deg]"
        if isinstance(spec, ScenePowers):
            return np.asarray(spec.lengths), "length of the path [m]"
        if isinstance(spec, SlabMeasurement) and np.size(spec.angle_deg) == count:
            return np.asarray(spec.angle_deg).reshape(-1), "angle from the normal [deg]"
        if isinstance(spec, SlabMeasurement) and np.size(spec.frequency) == count:
            return np.asarray(spec.frequency).reshape(-1) / 1e9, "frequency [GHz]"
    return np.arange(count), "number of the value"


def _correlation_figure(result: CalibrationResult) -> Figure:
    from matplotlib.figure import Figure

    count = len(result.names)
    figure = Figure(figsize=(5.0 + 0.5 * count, 3.6 + 0.5 * count), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(result.correlation, cmap="RdBu", vmin=-1.0, vmax=1.0)
    axes.set_xticks(range(count), result.names, rotation=60, ha="right")
    axes.set_yticks(range(count), result.names)
    figure.colorbar(image, label="correlation of the estimates")
    return figure


def _embedded(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return f'<img alt="" src="data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}">'


def _table(header: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _page(result: CalibrationResult) -> str:
    """Return the HTML page."""
    numbers = summary(result)
    state = "converged" if result.converged else '<span class="bad">not converged</span>'
    parts = [
        f"<h1>{escape(result.problem.title)}</h1><p>{escape(result.problem.source)}</p>",
        f"<p>The search {state}: {escape(result.reason)} ({result.num_evaluations} evaluations, "
        f"{len(result.starts)} starts).</p>",
        "<h2>Estimates</h2>",
        _table(
            ["parameter", "before", "estimate", "standard deviation", "95 % from", "to"],
            [
                [name, f"{item['start']:.5g}", f"{item['value']:.5g}" + (" (on a bound)" if item["at_bound"] else "")]
                + [
                    "not determined" if number is None else f"{number:.4g}"
                    for number in (item["std"], *item["interval_95"])
                ]
                for name, item in numbers["parameters"].items()
            ],
        ),
        f"<p>Chi-square {result.chi_square:.4g} for {result.degrees_of_freedom} degrees of "
        f"freedom (probability {result.p_value:.2g}). "
        + (
            f"The noise and the priors stated do not explain the misfit: widen the intervals by {result.misfit:.2g}, "
            "which the material entries do.</p>"
            if result.misfit > 1.1
            else "The model explains the data within the noise and the priors stated.</p>"
        ),
        "<h2>What the measurements can tell</h2>",
    ]
    for weak in result.weak:
        combined = " ".join(f"{weight:+.2f} {name}" for name, weight in weak.weights.items())
        left = (
            "nothing" if not np.isfinite(weak.std) else f"a standard deviation of {weak.std:.2g} of the bounds' range"
        )
        parts.append(f'<p class="bad">Not identified: {escape(combined)} (left is {left}).</p>')
    parts += [f"<p>{escape(a)} and {escape(b)} are correlated, {value:+.3f}.</p>" for a, b, value in result.correlated]
    if not result.weak and not result.correlated:
        parts.append("<p>All parameters are identified, and no two are correlated by more than 0.95.</p>")
    for point in result.other_minima:
        parts.append(
            '<p class="bad">As good: '
            f"{escape(', '.join(f'{n} {v:.4g}' for n, v in zip(result.names, point, strict=True)))}</p>"
        )
    if len(result.names) > 1:
        parts.append(_embedded(_correlation_figure(result)))
    parts += [
        "<h2>Measurements</h2>",
        _table(
            ["measurement", "values", "rms before", "rms after", "unit"],
            [
                [
                    name + (" (held out)" if item["held_out"] else ""),
                    str(item["num_values"]),
                    f"{item['rms_before']:.4g}",
                    f"{item['rms_after']:.4g}",
                    item["unit"],
                ]
                for name, item in numbers["measurements"].items()
            ],
        ),
    ]
    parts += [_embedded(measurement_figure(result, channel)) for channel in result.model.channels]
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(result.problem.title)}</title>'
        f"<style>{_STYLE}</style></head><body>{''.join(parts)}</body></html>"
    )
