"""Radars of version 0.1, whose specification was flat: what rig files and datasets of that version hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import FieldValue

from .spec import RadarSpec

_PARTS: Mapping[str, Mapping[str, str]] = {
    "waveform": {
        name: name
        for name in (
            "start_frequency",
            "bandwidth",
            "ramp_time",
            "idle_time",
            "num_chirps",
            "num_samples",
            "sampling_frequency",
        )
    },
    "array": {name: name for name in ("tx_positions", "rx_positions", "pattern", "polarization", "max_array_extent")},
    "front_end": {name: name for name in ("tx_power_dbm", "noise_figure_db", "source_temperature")},
    "adc": {"adc_bits": "bits", "adc_full_scale_dbm": "full_scale_dbm"},
}
_LEFT = ("num_rays", "cell_labels")
"""Settings of the simulation that stood among the properties of the radar."""


def split_version_0_1(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the fields of a specification in parts, and what version 0.1 kept beside them.

    Parameters
    ----------
    data : mapping
        Fields of a radar in a file, flat or in parts; what is in parts already stays as it is.

    Returns
    -------
    spec_data : dict
        Fields of :class:`RadarSpec`; a key that version 0.1 did not know stands among them, so that it is refused.
    left : dict
        `num_rays` and `cell_labels`, where they are given.

    Raises
    ------
    ParameterRangeError
        If fields of version 0.1 stand beside a part that they belong to.
    """
    spec_data = dict(data)
    left = {name: spec_data.pop(name) for name in _LEFT if name in spec_data}
    for part, names in _PARTS.items():
        flat = {new: spec_data.pop(old) for old, new in names.items() if old in spec_data}
        if flat and part in spec_data:
            name, value = next(iter(flat.items()))
            raise ParameterRangeError(
                f"RadarSpec.{name}", f"{value!r:.80}", f"in its part `{part}`, which is given, too", "move it there"
            )
        if flat:
            spec_data[part] = {"kind": "fmcw", **flat} if part == "waveform" else flat
    return spec_data, left


def read_radar(data: Mapping[str, Any]) -> RadarSpec:
    """Return the radar that a file holds, in parts or of version 0.1; what that kept of the simulation is left out.

    Raises
    ------
    ParameterRangeError
        If a key is unknown or a value is not allowed.
    """
    return RadarSpec(**split_version_0_1(data)[0])


def lift_version_0_1(spec: Mapping[str, Any], settings: FieldValue = None) -> tuple[dict[str, Any], FieldValue]:
    """Return the fields of :class:`RadarSpec` and of `RadarSettings` of a radar in a file, in parts or of version 0.1.

    Raises
    ------
    ParameterRangeError
        If settings stand among the properties of the radar and beside them.
    """
    spec_data, left = split_version_0_1(spec)
    if not left:
        return spec_data, settings
    if settings is not None:
        name, value = next(iter(left.items()))
        raise ParameterRangeError(f"RadarSpec.{name}", value, "in `settings`, which are given, too", "move it there")
    if "num_rays" not in left:
        return spec_data, left
    rays = left.pop("num_rays")
    effort = {"raycast": {"num_rays": rays}}
    if isinstance(rays, int):  # the budget of `auto` followed the rays; today as many tubes are the default
        effort["accuracy"] = {"tube_budget": rays}
    return spec_data, {**effort, **left}
