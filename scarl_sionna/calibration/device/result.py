"""What the fit of a device found: a specification, intervals, what was not identified, residuals."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import yaml

from scarl_sionna.calibration.estimate import INTERVAL
from scarl_sionna.core.errors import OutputError, UnknownNameError
from scarl_sionna.core.prompt.describe import Described, Row
from scarl_sionna.core.specs.radar.impairments import ChannelErrors, Leakage
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import watt_to_dbm

from .model import COUPLING, OF_CAPTURE, PULLED, DeviceModel
from .noise import MeasuredNoise

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

NOT_IDENTIFIED = 0.9
"""A parameter is not identified if the captures leave more than this share of what was not known before; coupling
neither if they alone tell less than was known before."""
SIGNIFICANT = 3.0
"""Imbalance of I and Q and a constant enter the specification from so many standard deviations on."""
LARGE_PULL = 4.0
"""What is fitted more than this many of its stated standard deviations from where it was stated was stated wrongly: of
forty right ones one is in 400 fits."""
_MARGIN = 0.2
"""Part of a figure's height above the highest point."""


@dataclass(frozen=True)
class CaptureResidual:
    """What a capture differs by from the fitted device.

    Attributes
    ----------
    name : str
    held_out : bool
    over_noise : float
        Root mean square over that of the noise, dimensionless: 1 where the device does just what the fit says.
    pulls : tuple of float
        Of x, y, z and level: fitted minus stated over the stated standard deviation; NaN where that is 0.
    """

    name: str
    held_out: bool
    over_noise: float
    pulls: tuple[float, ...]


@dataclass(frozen=True, eq=False, repr=False)
class DeviceFit(Described):
    """A device as captures of reflectors show it.

    Attributes
    ----------
    radar : RadarSpec
        The stated device with the fitted power, noise figure, channels, imbalance, leakage, constant, antenna places.
    names, units : tuple of str
        Of the parameters. Gains and phases are those beside the first transmitter and receiver; ``tx_y[1]`` is how far
        an antenna is from where it was stated; ``gain_db`` is power and gain over those stated; ``dc_i``, ``dc_q`` and
        ``leakage_i``, ``leakage_q`` (the field in the middle of the band) are in units of a sample's noise;
        ``rx_coupling_i[0,1]`` is the real part of what reaches receiver 0 from antenna 1, as in `ChannelErrors`.
    values, std : ndarray of float64, shape (num_parameters,)
        In these units; infinite where nothing is known.
    covariance : ndarray of float64, shape (num_parameters, num_parameters)
        In products of these units.
    not_identified : tuple of str
        Parameters of which the captures told next to nothing beyond what was stated.
    levels_db, level_std_db : ndarray of float64, shape (num_fitted,)
        Of each fitted capture beside what power, RCS and pattern make expect [dB]: over directions, the beam pattern's
        deviation.
    directions_deg : ndarray of float64, shape (num_fitted, 2)
        Azimuth and elevation of each fitted capture [deg].
    noise_figure_db, noise_figure_std_db : float
        [dB]
    noise_floor_db : ndarray of float64, shape (num_samples,)
        Noise over frequency, or range, beside its mean [dB].
    residuals : tuple of CaptureResidual
        Of all captures, held-out ones too, in their order.
    pulls : ndarray of float64, shape (num_parameters,)
        Of antenna places and coupling: fitted minus stated over the stated standard deviation; NaN for the rest.
    """

    radar: RadarSpec
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    std: Array
    covariance: Array
    not_identified: tuple[str, ...]
    levels_db: Array
    level_std_db: Array
    directions_deg: Array
    noise_figure_db: float
    noise_figure_std_db: float
    noise_floor_db: Array
    residuals: tuple[CaptureResidual, ...]
    pulls: Array

    @classmethod
    def of(
        cls,
        model: DeviceModel,
        device: Array,
        own: Array,
        covariances: tuple[Array, Array],
        noise: MeasuredNoise,
        residuals: Sequence[CaptureResidual],
    ) -> DeviceFit:
        """Return the result of a search at its minimum.

        `covariances` are that of all parameters, and the standard deviations (num_device,) that those of the device
        had without what is known of coupling beforehand.
        """
        covariance, alone = covariances
        count = len(device)
        misfit = max([1.0, *(item.over_noise for item in residuals if not item.held_out)])
        pulls = model.pulls(device, own)
        pull = float(np.nanmax(np.abs(np.concatenate([part.ravel() for part in pulls])), initial=0.0))
        misfit = max(misfit, pull if pull > LARGE_PULL else 1.0)
        std = misfit * np.sqrt(np.diag(covariance))
        weak = [
            item.name
            for item, one, by_data in zip(model.device, std[:count], misfit * alone, strict=True)
            if one > (NOT_IDENTIFIED * item.std if np.isfinite(item.std) else 1e3)
            or (COUPLING in item.name and by_data > item.std)
        ]
        levels = count + len(OF_CAPTURE) * np.arange(len(own)) + OF_CAPTURE.index("level_db")
        place = model.places
        flat = np.hypot(place[:, 0], place[:, 1])
        angles = np.degrees([np.arctan2(place[:, 1], place[:, 0]), np.arctan2(place[:, 2], flat)])
        figure, figure_std = noise.figure_db(model.radar, model.mixer(device))
        return cls(
            radar=_specification(model, device, std, figure),
            names=tuple(item.name for item in model.device),
            units=tuple(item.unit for item in model.device),
            values=device,
            std=std[:count],
            covariance=misfit**2 * covariance[:count, :count],
            not_identified=tuple(weak),
            levels_db=own[:, OF_CAPTURE.index("level_db")],
            level_std_db=std[levels],
            directions_deg=angles.T,
            noise_figure_db=figure,
            noise_figure_std_db=figure_std,
            noise_floor_db=noise.floor_db(),
            residuals=tuple(residuals),
            pulls=pulls[0],
        )

    @property
    def intervals(self) -> Array:
        """95 % intervals in the units of the parameters, shape (num_parameters, 2).

        By the noise that was measured and what was stated to be known; widened where a fitted capture's residual is
        above the noise, and by the largest pull of what is fitted, if it is above 4.
        """
        return np.stack([self.values - INTERVAL * self.std, self.values + INTERVAL * self.std], axis=1)

    @property
    def all_pulls(self) -> dict[str, float]:
        """Fitted minus stated over the stated standard deviation, as ``captures[0].x``, ``tx_y[1]``."""
        return {**self._pulls_of_captures(False), **self._pulls_of_captures(True), **self._pulls_of_device()}

    def _pulls_of_device(self) -> dict[str, float]:
        return {name: float(pull) for name, pull in zip(self.names, self.pulls, strict=True) if np.isfinite(pull)}

    def _pulls_of_captures(self, held_out: bool) -> dict[str, float]:
        return {
            f"captures[{number}].{word}": pull
            for number, item in enumerate(self.residuals)
            for word, pull in zip(PULLED, item.pulls, strict=True)
            if item.held_out == held_out and np.isfinite(pull)
        }

    def __getitem__(self, name: str) -> float:
        """Return the estimate of a parameter.

        Raises
        ------
        UnknownNameError
            If it was not fitted.
        """
        if name not in self.names:
            raise UnknownNameError("parameter", name, self.names)
        return float(self.values[self.names.index(name)])

    def _facts(self) -> Iterable[Row]:
        for name, unit, value, std in zip(self.names, self.units, self.values, self.std, strict=True):
            mark = ", not identified" if name in self.not_identified else ""
            if mark and COUPLING in name:
                mark += f": needs at least {self.radar.num_tx if name[:2] == 'tx' else self.radar.num_rx} directions"
            yield name, f"{value:.4g} +- {INTERVAL * std:.2g} {unit}".rstrip() + mark
        yield "noise_figure_db", f"{self.noise_figure_db:.3f} +- {INTERVAL * self.noise_figure_std_db:.2g} dB"
        for kind, held_out in (("fitted", False), ("held out", True)):
            found = [item.over_noise for item in self.residuals if item.held_out == held_out]
            if found:
                yield f"residual over noise, {kind}", f"{min(found):.3f} to {max(found):.3f}"
            pulls = self._pulls_of_captures(held_out) | ({} if held_out else self._pulls_of_device())
            if pulls:
                worst = max(pulls, key=lambda name: abs(pulls[name]))
                yield f"largest pull, {kind}", f"{pulls[worst]:+.3g} ({worst})"

    def summary(self) -> dict[str, Any]:
        """Return the numbers as plain data."""
        return {
            "parameters": {
                name: {
                    "value": float(value),
                    "unit": unit,
                    "std": _finite(std),
                    "interval_95": [*map(_finite, ends)],
                    "pull": _finite(pull),
                }
                for name, unit, value, std, ends, pull in zip(
                    self.names, self.units, self.values, self.std, self.intervals, self.pulls, strict=True
                )
            },
            "not_identified": list(self.not_identified),
            "noise_figure_db": {"value": self.noise_figure_db, "std": self.noise_figure_std_db},
            "noise_floor_db": self.noise_floor_db.tolist(),
            "pattern": [
                {"azimuth_deg": float(az), "elevation_deg": float(el), "level_db": float(level), "std_db": _finite(std)}
                for (az, el), level, std in zip(self.directions_deg, self.levels_db, self.level_std_db, strict=True)
            ],
            "residuals": [
                {
                    "name": item.name,
                    "held_out": item.held_out,
                    "over_noise": item.over_noise,
                    "pulls": dict(zip(PULLED, map(_finite, item.pulls), strict=True)),
                }
                for item in self.residuals
            ],
        }

    def save(self, folder: str | Path) -> Path:
        """Write ``device.yaml``, ``estimate.json`` and ``report.png``; return the folder.

        ``ss.RadarSpec(**yaml.safe_load(text))`` is the radar of the first again.

        Raises
        ------
        OutputError
            If the folder cannot be written.
        """
        out = Path(folder)
        try:
            out.mkdir(parents=True, exist_ok=True)
            text = yaml.safe_dump(self.radar.model_dump(mode="json"), sort_keys=False)
            (out / "device.yaml").write_text(text, encoding="utf-8")
            (out / "estimate.json").write_text(json.dumps(self.summary(), indent=1) + "\n", encoding="utf-8")
            self.plot().savefig(out / "report.png", dpi=110)
        except OSError as error:
            raise OutputError(f"{out} cannot be written: {error}") from error
        return out

    def plot(self) -> Figure:
        """Return a figure: channels, level over direction, noise over range, residuals."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(10.0, 6.5), layout="constrained")
        channels, pattern, floor, left = figure.subplots(2, 2).ravel()
        chosen = [k for k, name in enumerate(self.names) if "_gain_db[" in name or "_phase_deg[" in name]
        for axis, word, unit, color in ((channels, "gain", "dB", "C0"), (channels.twinx(), "phase", "deg", "C1")):
            part = [k for k in chosen if word in self.names[k]]
            labels = [f"{self.names[k][:2]} {self.names[k].split('[')[1][:-1]}" for k in part]
            axis.errorbar(labels, self.values[part], INTERVAL * self.std[part], fmt="o", color=color, capsize=3)
            axis.set_ylabel(f"{word} beside the first [{unit}]", color=color)
        channels.set_title("channels, 95 %")
        pattern.errorbar(self.directions_deg[:, 0], self.levels_db, INTERVAL * self.level_std_db, fmt="o", capsize=3)
        pattern.set(xlabel="azimuth [deg]", ylabel="level beside the expected [dB]", title="pattern and RCS, 95 %")
        ranges = np.arange(len(self.noise_floor_db)) * self.radar.max_range / len(self.noise_floor_db)
        floor.plot(ranges, self.noise_floor_db)
        floor.set(xlabel="range [m]", ylabel="noise beside its mean [dB]", title="noise floor")
        colors = ["C3" if item.held_out else "C0" for item in self.residuals]
        heights = [item.over_noise for item in self.residuals]
        left.bar(range(len(heights)), heights, color=colors)
        left.axhline(1.0, color="0.4", lw=0.8)
        left.set_ylim(0.0, (1.0 + _MARGIN) * max(heights))
        left.set(xlabel="capture", ylabel="residual over noise", title="residuals (red: held out)")
        return figure


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _specification(model: DeviceModel, device: Array, std: Array, noise_figure_db: float) -> RadarSpec:
    """Return the stated radar with what was fitted."""

    def value(name: str) -> float:
        place = model.index(name)
        return 0.0 if place is None else float(device[place])

    def matters(*names: str) -> bool:
        places = [place for place in map(model.index, names) if place is not None]
        return any(abs(device[place]) > SIGNIFICANT * std[place] for place in places)

    radar = model.radar
    ends: dict[str, tuple[Any, ...]] = {
        f"{end}_{kind}": tuple(value(f"{end}_{kind}[{number}]") for number in range(count))
        for end, count in (("tx", radar.num_tx), ("rx", radar.num_rx))
        for kind in ("gain_db", "phase_deg")
    }
    if model.has_coupling:
        for end, count in (("tx", radar.num_tx), ("rx", radar.num_rx)):
            rows = model.coupling(device, end)
            if count > 1:
                ends[f"{end}_coupling"] = tuple(tuple((one.real, one.imag) for one in row) for row in rows.tolist())
    changes: dict[str, Any] = {
        "tx_power_dbm": radar.front_end.tx_power_dbm + value("gain_db"),
        "noise_figure_db": noise_figure_db,
        "channels": ChannelErrors(**ends),
    }
    if matters("iq_gain_db", "iq_phase_deg"):
        changes["mixer"] = model.mixer(device)
    if model.index("leakage_length") is not None:
        length, field = value("leakage_length"), complex(value("leakage_i"), value("leakage_q")) * model.noise
        level = float(watt_to_dbm(abs(field) ** 2)) - changes["tx_power_dbm"]
        phase = np.degrees(np.angle(field)) - model.phase_per_metre * length
        phase = float((phase + 180.0) % 360.0 - 180.0)
        changes["leakage"] = (Leakage(length=max(length, 0.0), level_db=min(level, 0.0), phase_deg=phase),)
    if matters("dc_i", "dc_q"):
        power = (value("dc_i") ** 2 + value("dc_q") ** 2) * model.noise**2
        changes["dc_offset_dbm"] = float(watt_to_dbm(power))
    if model.settings.antenna_std > 0.0:
        tx, rx = model.antennas(device)
        changes["tx_positions"] = tuple(map(tuple, tx.tolist()))
        changes["rx_positions"] = tuple(map(tuple, rx.tolist()))
    return radar.with_(**changes)
