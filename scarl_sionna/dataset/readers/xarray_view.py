"""A scene of a dataset, and the maps of a radar, as xarray objects with named axes, coordinates and units."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import DatasetError
from scarl_sionna.core.packages import require
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveforms.coded import is_coded, window_start
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .reader import Dataset, Scene, open_dataset
from .stored import StoredRadar

if TYPE_CHECKING:
    import xarray

_COMPONENTS = {
    "pose": ["x", "y", "z", "qw", "qx", "qy", "qz"],
    "velocity": ["vx", "vy", "vz", "wx", "wy", "wz"],
    "xyz": ["x", "y", "z"],
    "iq": ["I", "Q"],
}
"""Names along axes of components."""


def open_xarray(data: Dataset | Scene | str | Path, scene: str | None = None) -> xarray.DataTree:
    """Return a scene as an `xarray.DataTree`: one node a sensor, lazy arrays over all frames.

    Parameters
    ----------
    data : Dataset, Scene, or path or URL of a dataset
    scene : str, optional
        Name of the scene; left out: the only one, or the first.

    Returns
    -------
    xarray.DataTree
        Axes are named as in ``docs/dataset.md``; coordinates are ``time`` [s] along ``frame``, ``fast_time`` [s],
        ``slow_time`` [s] and ``transmitter`` along a radar's ``sample`` and ``chirp``, and the names of components.
        Units are in ``attrs["units"]``; a sensor's node has its specification in ``attrs``. The axis of linear and
        angular velocity is named ``velocity``.

    Raises
    ------
    MissingPackageError
        If xarray is not installed.
    DatasetError, UnknownNameError
        If there is no such dataset or scene, or it has no frames.
    """
    xarray = require("xarray", "xarray")
    if not isinstance(data, Dataset | Scene):
        data = open_dataset(data)
    if isinstance(data, Dataset):
        if not data.scenes:
            raise DatasetError("has no scenes", data.place, "export it first")
        data = data.scene(scene if scene is not None else data.scenes[0])
    if not len(data):
        raise DatasetError(f"scene {data.name} has no frames", data.dataset.place, "export it first")
    with xarray.set_options(keep_attrs=True):
        nodes = xarray.open_groups(data.zarr_place(), engine="zarr", consolidated=False)
    sensors = data.dataset.sensors
    time = data.array("timestamp_ns") * 1e-9
    out = {}
    for path, node in nodes.items():
        name = path.strip("/")
        node = _plain_names(node)
        if "frame" in node.dims:
            node = node.isel(frame=list(data.frames)).assign_coords(
                time=("frame", time, {"units": "s", "long_name": "time of the frame"}), frame=list(data.frames)
            )
        for axis, labels in _COMPONENTS.items():
            if axis in node.dims and node.sizes[axis] == len(labels):
                node = node.assign_coords({axis: labels})
        if sensors.get(name) == "radar":
            node = _radar_axes(node, data.dataset.spec(name))  # type: ignore[arg-type]
        if name in sensors:
            node = node.assign_attrs(kind=sensors[name], spec=data.dataset.spec(name).model_dump_json())
        out[path] = node
    return xarray.DataTree.from_dict(out, name=data.name)


def radar_maps_xarray(radar: RadarFrame | StoredRadar) -> xarray.Dataset:
    """Return the maps of a radar frame, stored or in memory, as an `xarray.Dataset`.

    Returns
    -------
    xarray.Dataset
        ``range_doppler`` (radial_velocity, range): mean power of the channels [W]; ``range_azimuth`` (range, azimuth):
        power of the strongest Doppler bin and elevation [W]; ``channels`` complex (channel, radial_velocity, range)
        [sqrt(W)].

    Raises
    ------
    MissingPackageError
        If xarray is not installed.
    """
    xarray = require("xarray", "xarray")
    cube = virtual_cube(radar.adc, radar.spec)
    rd, rda = range_doppler(cube, radar.spec), range_doppler_angle(cube, radar.spec)
    power = rda.data.max(axis=0)
    power = power if rda.elevation is None else power.max(axis=-1)
    return xarray.Dataset(
        {
            "range_doppler": (("radial_velocity", "range"), rd.power, {"units": "W"}),
            "range_azimuth": (("range", "azimuth"), power, {"units": "W"}),
            "channels": (("channel", "radial_velocity", "range"), rd.data, {"units": "sqrt(W)"}),
        },
        {
            "range": ("range", rd.range, {"units": "m"}),
            "radial_velocity": (
                "radial_velocity",
                rd.radial_velocity,
                {"units": "m/s", "long_name": "positive = opening"},
            ),
            "azimuth": ("azimuth", rda.azimuth, {"units": "rad", "long_name": "positive = left"}),
        },
        {"noise_power": rd.noise_power, "window": list(rd.window)},
    )


def _plain_names(node: xarray.Dataset) -> xarray.Dataset:
    """Return a node in which no variable has the name of one of its axes with several."""
    node = node.reset_coords(drop=False)
    return node.rename_dims({"twist": "velocity"}) if "twist" in node.dims else node


def _radar_axes(node: xarray.Dataset, spec: RadarSpec) -> xarray.Dataset:
    row = np.arange(spec.num_chirps_total)
    transmitter, chirp = row % spec.num_tx, row // spec.num_tx
    if spec.multiplexing.is_coded:
        codes = np.abs(spec.multiplexing.codes(spec.num_chirps, spec.num_tx))
        transmitter, chirp = np.where((codes > 0.0).sum(axis=1) == 1, codes.argmax(axis=1), -1), row
        sent = row * spec.doppler_interval
    else:
        delay = np.array([spec.tx_delay(tx) for tx in range(spec.num_tx)])
        sent = chirp * spec.doppler_interval + delay[transmitter]
    waveform = spec.waveform
    if waveform.chirp_delays is not None:
        sent = sent + np.asarray(waveform.chirp_delays)[chirp]
    first = window_start(waveform) if is_coded(waveform) else waveform.sweep.first
    return node.assign_coords(
        fast_time=("sample", first + np.arange(spec.num_samples) / spec.sample_rate, {"units": "s"}),
        slow_time=("chirp", sent, {"units": "s", "long_name": "start of the ramp"}),
        transmitter=("chirp", transmitter),  # -1: all, each with its code
    )
