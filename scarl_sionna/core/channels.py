"""Channels between a radio and its stations: what the sensor kind ``radio`` gives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .pose import Pose
from .prompt.describe import Described, Row, field_rows, listed
from .specs.radio import RadioSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INTERACTIONS: Mapping[int, str] = {1: "mirrored", 2: "scattered", 4: "refracted", 8: "diffracted"}
"""What the numbers of `RadioChannels.interaction` mean."""


@dataclass(frozen=True, eq=False, repr=False)
class RadioChannels(
    Described,
    units={
        "tau": "s",
        "doppler": "Hz",
        "theta_t": "rad",
        "phi_t": "rad",
        "theta_r": "rad",
        "phi_r": "rad",
        "station_velocity": "m/s",
    },
):
    """Channels from a radio on the vehicle to its stations at one instant.

    The channel in the other direction is the same with the antennas exchanged. Paths are in order of falling gain;
    beyond `valid` all is zero, so that sums over paths need no mask.

    Attributes
    ----------
    spec : RadioSpec
    world_from_sensor : Pose
        Frame of the radio's array (x forward, y left, z up).
    world_from_station : ndarray of float64, shape (num_stations, 7)
        Position x, y, z [m] and quaternion w, x, y, z of the stations, in the order of ``spec.stations``; NaN of those
        that are not in the scene.
    station_velocity : ndarray of float64, shape (num_stations, 3)
        [m/s], world axes; NaN of those that are not in the scene.
    a : ndarray of complex64, shape (num_stations, num_station_antennas, num_antennas, max_paths)
        Coefficient of the impulse response at the carrier: voltage ratio with the antennas' patterns, the phase of the
        way ``exp(-2j pi f tau)`` in it (worked out in float64).
    tau : ndarray of float64, shape (num_stations, max_paths)
        Delay, not normalised [s].
    doppler : ndarray of float64, shape (num_stations, max_paths)
        Doppler shift, positive where the way becomes shorter [Hz].
    theta_t, phi_t, theta_r, phi_r : ndarray of float32, shape (num_stations, max_paths)
        Zenith and azimuth in world axes of the direction in which a path leaves the radio, and from which the station
        sees it come [rad].
    valid : ndarray of bool, shape (num_stations, max_paths)
    interaction : ndarray of uint8, shape (num_stations, max_paths, depth)
        What happened on the way, from the radio on: see `INTERACTIONS`; 0 beyond the path's depth.
    instance : ndarray of uint16, shape (num_stations, max_paths, depth)
        What it happened at: instance ids as in images, lidar and radar; 0 beyond the path's depth.
    small_mirror : ndarray of bool, shape (num_stations, max_paths), or None
        Whether a path comes over a flat face that is smaller than its first Fresnel zone, a facet of a curved body
        among them: its coefficient is that of an endless mirror, most often too strong. None of datasets that were
        written before it was stored.
    cfr : ndarray of complex64, shape (num_stations, num_station_antennas, num_antennas, num_subcarriers)
        Frequency response of the kept paths at ``spec.subcarrier_frequencies`` about the carrier.
    num_paths : ndarray of int32, shape (num_stations,)
        Paths that were found, those beyond `max_paths` as well.
    gain_left_out : ndarray of float64, shape (num_stations,)
        Sum of abs(a)**2 of the paths that were found and not kept, mean over the pairs of antennas.
    diagnostics : mapping
        Candidates of the solver, materials with values of another frequency, stations whose actor is not there, share
        of the gain of all paths that were found that comes over small mirrors.
    """

    spec: RadioSpec
    world_from_sensor: Pose
    world_from_station: npt.NDArray[np.float64]
    station_velocity: npt.NDArray[np.float64]
    a: npt.NDArray[np.complex64]
    tau: npt.NDArray[np.float64]
    doppler: npt.NDArray[np.float64]
    theta_t: npt.NDArray[np.float32]
    phi_t: npt.NDArray[np.float32]
    theta_r: npt.NDArray[np.float32]
    phi_r: npt.NDArray[np.float32]
    valid: npt.NDArray[np.bool_]
    interaction: npt.NDArray[np.uint8]
    instance: npt.NDArray[np.uint16]
    small_mirror: npt.NDArray[np.bool_] | None
    cfr: npt.NDArray[np.complex64]
    num_paths: npt.NDArray[np.int32]
    gain_left_out: npt.NDArray[np.float64]
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> Iterable[Row]:
        yield "stations", listed(station.name for station in self.spec.stations)
        gains = (f"{gain:.1f}" for gain in 10.0 * np.log10(np.maximum(self.gain, 1e-30)))
        yield "gain", f"{listed(gains)} dB"
        yield from field_rows(self, without=("diagnostics",))
        yield "diagnostics", listed(self.diagnostics)

    @property
    def gain(self) -> npt.NDArray[np.float64]:
        """Power gain of the kept paths of each station, shape (num_stations,).

        The sum over the paths of abs(a)**2, mean over the pairs of antennas: what a band has that tells paths apart.
        """
        power = np.abs(self.a.astype(np.complex128)) ** 2
        return np.asarray(power.sum(axis=-1).mean(axis=(1, 2)))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw gain against delay of every path, in one colour a station.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from .prompt.profiles import plot_profiles

        return plot_profiles(self, ax)
