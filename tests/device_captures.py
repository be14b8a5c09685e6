"""Captures of corner reflectors by a planted device, simulated through the whole front end."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import scarl_sionna as ss
from scarl_sionna.calibration.device import DeviceFit, DeviceFitSettings, ReflectorCapture

STATED = ss.RadarSpec.preset("awr1642").with_(
    front_end=ss.FrontEnd(
        tx_power_dbm=12.0, noise_figure_db=12.0, filters=ss.RadarSpec.preset("awr1642").front_end.filters
    ),
    adc=ss.Adc(),
    num_chirps=16,
    num_samples=128,
)
"""What the data sheet says: 2 x 4 antennas, high passes, a low pass."""
ANTENNA_STD, SURVEY_STD, RCS_STD_DB = 2e-4, 5e-3, 0.5
SETTINGS = DeviceFitSettings(antenna_std=ANTENNA_STD, pattern_std_db=0.0)


@dataclass(frozen=True)
class Planted:
    """A device, what it truly is, and what it recorded."""

    stated: ss.RadarSpec
    true: ss.RadarSpec
    range_bias: float
    captures: list[ReflectorCapture]

    @property
    def truth(self) -> dict[str, float]:
        """The fit's parameters as planted (of a leakage the length; its field is in units of the noise)."""
        front, gain = self.true.front_end, self.true.front_end.tx_power_dbm - self.stated.front_end.tx_power_dbm
        out = {"gain_db": gain, "range_bias": self.range_bias}
        assert front.channels is not None and front.mixer is not None
        for end in ("tx", "rx"):
            for kind in ("gain_db", "phase_deg"):
                row = getattr(front.channels, f"{end}_{kind}")
                out |= {f"{end}_{kind}[{number}]": value for number, value in enumerate(row)}
            for row, values in enumerate(getattr(front.channels, f"{end}_coupling")):
                for column, parts in enumerate(values):
                    names = (f"{end}_coupling_{part}[{row},{column}]" for part in "iq")
                    out |= dict(zip(names, parts, strict=True)) if row != column else {}
            moved = getattr(self.true, f"{end}_array") - getattr(self.stated, f"{end}_array")
            for number, (_, y, z) in enumerate(moved):
                out |= {f"{end}_y[{number}]": float(y), f"{end}_z[{number}]": float(z)}
        out |= {"iq_gain_db": front.mixer.iq_gain_db, "iq_phase_deg": front.mixer.iq_phase_deg}
        for way in front.leakage:
            out["leakage_length"] = way.length
        return out


def planted(
    seed: int,
    count: int = 12,
    stated: ss.RadarSpec = STATED,
    has_leakage: bool = True,
    coupling_std: float = 0.0,
    antenna_std: float = ANTENNA_STD,
) -> Planted:
    """Return captures of reflectors of 10 dBsm, 3 to 10 m away, up to 45 deg aside; the last two are held out."""
    rng = np.random.default_rng(seed)

    def errors(number: int, spread: float) -> tuple[float, ...]:
        return (0.0, *rng.normal(0.0, spread, number - 1))

    def moved(places: np.ndarray) -> tuple[tuple[float, ...], ...]:
        shift = rng.normal(0.0, antenna_std, (len(places), 2))
        return tuple(map(tuple, places + np.c_[np.zeros(len(places)), shift]))

    way = ss.Leakage(
        length=rng.uniform(0.1, 0.5), level_db=rng.uniform(-60.0, -50.0), phase_deg=rng.uniform(-180.0, 180.0)
    )
    true = stated.with_(
        tx_power_dbm=12.0 + rng.normal(0.0, 1.5),
        noise_figure_db=rng.uniform(10.0, 15.0),
        channels=ss.ChannelErrors(
            tx_gain_db=errors(stated.num_tx, 1.0),
            tx_phase_deg=errors(stated.num_tx, 40.0),
            rx_gain_db=errors(stated.num_rx, 1.0),
            rx_phase_deg=errors(stated.num_rx, 40.0),
        ),
        mixer=ss.Mixer(iq_gain_db=rng.normal(0.0, 0.3), iq_phase_deg=rng.normal(0.0, 2.0)),
        leakage=(way,) if has_leakage else (),
        dc_offset_dbm=rng.uniform(-85.0, -65.0),
        tx_positions=moved(stated.tx_array),
        rx_positions=moved(stated.rx_array),
    )
    if coupling_std:
        draw = np.random.default_rng((seed, 1))
        matrices = {
            f"{end}_coupling": tuple(
                tuple((1.0, 0.0) if i == j else tuple(draw.normal(0.0, coupling_std, 2)) for j in range(number))
                for i in range(number)
            )
            for end, number in (("tx", stated.num_tx), ("rx", stated.num_rx))
        }
        true = true.with_(channels=true.front_end.channels.with_(**matrices))
    bias, captures = rng.normal(0.0, 0.05), []
    for number in range(count):
        distance, azimuth, elevation = rng.uniform(3.0, 10.0), *np.radians(rng.uniform((-45.0, -10.0), (45.0, 10.0)))
        flat = np.cos(elevation)
        survey = distance * np.array([np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)])
        place = survey + rng.normal(0.0, SURVEY_STD, 3)
        rcs = 10.0 ** (1.0 + rng.normal(0.0, RCS_STD_DB) / 10.0)
        paths = replace(
            ss.point_targets([place], [[0.0, 0.0, 0.0]], rcs, true, ss.Pose()), inner_length=np.array([2.0 * bias])
        )
        captures.append(
            ReflectorCapture(
                ss.synthesize(paths, true, rng=rng, method="direct"),  # exact: fits see errors of -80 dB
                survey,
                10.0,
                position_std=SURVEY_STD,
                rcs_std_db=RCS_STD_DB,
                held_out=number >= count - 2,
                name=f"corner {number}",
            )
        )
    return Planted(stated, true, float(bias), captures)


def errors_over_std(fit: DeviceFit, device: Planted) -> dict[str, float]:
    """Return the error of each parameter of known truth over its standard deviation; phases modulo a turn."""
    out, truth = {}, device.truth
    for name, unit, value, std in zip(fit.names, fit.units, fit.values, fit.std, strict=True):
        if name in truth:
            error = value - truth[name]
            out[name] = ((error + 180.0) % 360.0 - 180.0 if unit == "deg" else error) / std
    out["noise_figure_db"] = (fit.noise_figure_db - device.true.front_end.noise_figure_db) / fit.noise_figure_std_db
    return {name: float(value) for name, value in out.items()}
