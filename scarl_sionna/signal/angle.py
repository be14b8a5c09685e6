"""Angle estimation: power over Doppler, range, azimuth and elevation by digital beamforming."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.prompt.describe import Described, Row, array_text, short
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, watt_to_dbm

from .antenna import pair_factors, virtual_positions
from .processing import RangeDoppler, cube_of, range_doppler
from .windows import window_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

POSITION_TOLERANCE = 1e-3
"""Virtual elements nearer than this part of a wavelength count as one place of a uniform line."""

PER_BEAMWIDTH = 4
"""Directions a beamwidth, at least, where their number is left out."""

LARGEST_MAP = 2 * 2**30
"""Bytes that a map may have for the number of elevations to be chosen above the least."""

LEAST_ELEVATIONS = 11


@dataclass(frozen=True, eq=False, repr=False)
class RangeDopplerAngle(Described):
    """Power over Doppler, range and angle.

    Attributes
    ----------
    data : ndarray of float32, shape (num_doppler_bins, num_range_bins, num_azimuth[, num_elevation])
        Its peak at a point is the power that one channel receives from it [W].
    range : ndarray of float64, shape (num_range_bins,)
        Distance at the start of the first ramp [m].
    radial_velocity : ndarray of float64, shape (num_doppler_bins,)
        Rising; positive when the distance opens [m/s].
    azimuth : ndarray of float64, shape (num_azimuth,)
        Rising, left positive, uniform in its sine where it is made here [rad].
    elevation : ndarray of float64, shape (num_elevation,), or None
        Rising, up positive, uniform in its sine where it is made here [rad]; None if the array has no vertical extent.
    radar : RadarSpec
    range_doppler : RangeDoppler or None
        The channels that the angles were made of; None of a recorded map that has powers alone.
    noise_power : float
        Mean thermal noise power of a cell [W].
    """

    data: npt.NDArray[np.float32]
    range: Array
    radial_velocity: Array
    azimuth: Array
    elevation: Array | None
    radar: RadarSpec
    range_doppler: RangeDoppler | None
    noise_power: float

    @property
    def channels(self) -> RangeDoppler:
        """The channels that the angles were made of.

        Raises
        ------
        ParameterRangeError
            If the map has powers alone.
        """
        if self.range_doppler is None:
            raise ParameterRangeError(
                "rda", "a map of powers alone", "a map with the channels that it was made of", "read raw data"
            )
        return self.range_doppler

    def _facts(self) -> Iterable[Row]:
        strongest = np.unravel_index(int(self.data.argmax()), self.data.shape)
        axes = "(num_doppler_bins, num_range_bins, num_azimuth" + (
            ", num_elevation)" if self.elevation is not None else ")"
        )
        yield "data", f"float32 {self.data.shape} = {axes} [W]"
        yield "range", array_text(self.range, "m")
        yield "radial_velocity", array_text(self.radial_velocity, "m/s")
        yield "azimuth", array_text(np.degrees(self.azimuth), "deg")
        if self.elevation is not None:
            yield "elevation", array_text(np.degrees(self.elevation), "deg")
        place = f"{self.range[strongest[1]]:.4g} m, {self.radial_velocity[strongest[0]]:.3g} m/s"
        place += f", {np.degrees(self.azimuth[strongest[2]]):.3g} deg"
        yield "strongest cell", f"{watt_to_dbm(self.data[strongest]):.1f} dBm at {place}"
        yield "noise_power", f"{watt_to_dbm(self.noise_power):.1f} dBm in a cell"
        has = "none: powers alone" if self.range_doppler is None else f"its channels, {self.range_doppler.data.shape}"
        yield "range_doppler", has
        yield "radar", short(self.radar)

    def plot(
        self, view: str = "map", max_range: float | None = None, dynamic_range_db: float = 60.0, ax: Axes | None = None
    ) -> Axes:
        """Draw the strongest power [dBm] over what is not shown.

        Parameters
        ----------
        view : {"map", "range_azimuth", "range_doppler"}
            ``"map"``: from above, in metres, within the radar's field of view; or over range and azimuth, or range and
            velocity.
        max_range : float, optional
            Last range shown [m]; default: all.
        dynamic_range_db : float
            Powers farther below the peak have the darkest colour [dB].
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError
            If there is no such view.
        """
        from .plots import plot_range_doppler_angle

        return plot_range_doppler_angle(self, view, max_range, dynamic_range_db, ax)


@dataclass(frozen=True, eq=False, repr=False)
class UniformLine(Described, units={"spacing": "m"}):
    """The virtual array as a line along y with one spacing: the channels' `order` (num_virtual,), the `spacing` [m]."""

    order: npt.NDArray[np.intp]
    spacing: float


def uniform_line(radar: RadarSpec) -> UniformLine | None:
    """Return the virtual array as a uniform line along y, or None if it is not one."""
    position = virtual_positions(radar)
    slack = POSITION_TOLERANCE * radar.wavelength
    order = np.argsort(position[:, 1], kind="stable")
    line = position[order]
    if len(order) < 2 or np.ptp(line[:, 0]) > slack or np.ptp(line[:, 2]) > slack:
        return None
    spacing = np.diff(line[:, 1])
    if spacing.min() < slack or np.ptp(spacing) > slack:
        return None
    return UniformLine(order, float(spacing.mean()))


def has_elevation(radar: RadarSpec) -> bool:
    """Return whether the virtual array has a vertical extent."""
    return bool(np.ptp(virtual_positions(radar)[:, 2]) > POSITION_TOLERANCE * radar.wavelength)


def beamwidths(radar: RadarSpec) -> Array:
    """Return the beamwidths over azimuth and elevation as sines, shape (2,).

    The wavelength over the virtual array's extent along y and z, with half a wavelength for the elements at its ends.

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 2.
    """
    extent = np.ptp(virtual_positions(radar)[:, 1:], axis=0)
    return np.asarray(radar.wavelength / (extent + radar.wavelength / 2.0))


def directions(azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
    """Return unit vectors (..., 3) of the radar frame towards azimuth and elevation [rad], broadcast.

    Exact geometry.
    """
    azimuth, elevation = np.broadcast_arrays(np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64))
    cosine = np.cos(elevation)
    return np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), np.sin(elevation)], axis=-1)


def steering(radar: RadarSpec, unit_vectors: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Return the far-field beat phasors of every channel, shape (..., num_virtual), for unit vectors (..., 3).

    ``exp(-2j pi f_c (tx + rx) @ n / c)`` at the middle of the sampled ramp: the path shortens towards the target.

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 2.
    """
    length = np.asarray(unit_vectors, dtype=np.float64) @ virtual_positions(radar).T
    return np.exp(-2j * np.pi * radar.center_frequency / SPEED_OF_LIGHT * length)


def fraunhofer_distance(radar: RadarSpec) -> float:
    """Return the distance beyond which waves at the virtual array count as plane [m]: 2 D^2 / wavelength.

    References
    ----------
    .. [1] C. A. Balanis, *Antenna Theory*, 4th ed., 2016, Eq. (2-58).
    """
    extent = np.ptp(virtual_positions(radar), axis=0)
    return float(2.0 * (extent @ extent) / radar.wavelength)


PLANE_FROM = 64.0
"""Fraunhofer distances from which on phasors are those of plane waves. At one of them a plane wave leaves -19 dB of a
point before a line of antennas, which looks like two points beside it, at so many of them -55 dB."""


def near_steering(radar: RadarSpec, unit_vectors: npt.ArrayLike, distance: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Return the beat phasors of every channel for points at some distance, by spherical waves where that matters.

    Parameters
    ----------
    radar : RadarSpec
    unit_vectors : array_like, shape (..., 3)
        Directions of the points in the radar's frame.
    distance : array_like, shape (...)
        Of the points from the radar's origin [m]: below `PLANE_FROM` times :func:`fraunhofer_distance` the lengths to
        every antenna are exact, beyond it this is :func:`steering`.

    Returns
    -------
    ndarray of complex128, shape (..., num_virtual)
        Relative to a channel at the origin; with the phases of antennas that are described one by one.
    """
    unit = np.asarray(unit_vectors, dtype=np.float64)
    out = steering(radar, unit)
    distance = np.broadcast_to(np.asarray(distance, dtype=np.float64), unit.shape[:-1])
    near = distance < PLANE_FROM * fraunhofer_distance(radar)
    if near.any():
        away = distance[near][:, None]
        point = unit[near] * away
        send, receive = (
            away - np.linalg.norm(point[:, None, :] - array, axis=-1) for array in (radar.tx_array, radar.rx_array)
        )
        shorter = (send[:, :, None] + receive[:, None, :]).reshape(len(point), -1)
        out[near] = np.exp(-2j * np.pi * radar.center_frequency / SPEED_OF_LIGHT * shorter)
    if radar.array.is_uniform:
        return out
    factor = pair_factors(radar.array, unit)
    size = np.abs(factor)
    return np.asarray(out * np.where(size > 0.0, np.conj(factor) / np.where(size > 0.0, size, 1.0), 1.0))


def range_doppler_angle(
    cube: npt.NDArray[np.complexfloating] | RadarFrame,
    radar: RadarSpec | None = None,
    window: str | None = "hann",
    doppler_window: str | None = None,
    angle_window: str | None = None,
    num_range_bins: int | None = None,
    num_doppler_bins: int | None = None,
    num_azimuth: int | None = None,
    num_elevation: int | None = None,
    compensate_motion: bool = True,
) -> RangeDopplerAngle:
    """Return power over Doppler, range, azimuth and, where the array has a vertical extent, elevation.

    Parameters
    ----------
    cube : ndarray of complex, shape (num_virtual, num_chirps, num_samples), or RadarFrame
        From :func:`virtual_cube` [sqrt(W)]; or a radar's frame, whose raw data and specification are taken.
    radar : RadarSpec, optional
        Needed with an array.
    window, doppler_window, num_range_bins, num_doppler_bins, compensate_motion
        As in :func:`range_doppler`.
    angle_window : str, optional
        Over the elements of a uniform line; ``"rect"`` if left out. Other arrays are not tapered.
    num_azimuth : int, optional
        Directions, uniform in the sine of azimuth; left out: a power of two, at least four a beamwidth.
    num_elevation : int, optional
        Directions over twice the radar's elevation field of view, uniform in the sine; used with a vertical extent
        only. Left out: an odd number, at least 11 and four a beamwidth, as far as the map has no more than 2 GiB.

    Returns
    -------
    RangeDopplerAngle

    Raises
    ------
    ParameterRangeError
        If the shape is not the radar's, or a number of directions is too small.

    Warns
    -----
    ScarlWarning
        If 2 GiB leave fewer than two elevations a beamwidth: maxima between them are too low. :func:`detect` looks for
        directions on a grid of its own then.

    Notes
    -----
    A uniform line along y is transformed by FFT over its elements; any other array by a matrix of steering vectors.
    Both assume plane waves at the middle of the sampled ramp. With TDM the motion between transmitters is already
    removed by :func:`range_doppler`. A line cannot tell azimuth from elevation: its azimuth axis is asin of the
    direction's y component. A spherical wavefront blurs the beam of an array of extent D nearer than 2 D^2 / wavelength
    (0.27 m for the default array); the peak stays at the direction from the array's centre.

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 2.
    """
    cube, radar = cube_of(cube, radar)
    rd = range_doppler(cube, radar, window, doppler_window, num_range_bins, num_doppler_bins, compensate_motion)
    line = uniform_line(radar)
    if num_azimuth is None:
        num_azimuth = _default_azimuths(radar)
    if num_azimuth < 2:
        raise ParameterRangeError("num_azimuth", num_azimuth, ">= 2")
    if line is not None and num_azimuth >= radar.num_virtual:
        weights = window_values(angle_window, radar.num_virtual)
        data, azimuth = _line_spectrum(rd, line, weights, num_azimuth)
        elevation = None
    else:
        weights = np.full(radar.num_virtual, 1.0 / radar.num_virtual)
        azimuth = np.arcsin((2.0 * np.arange(num_azimuth) + 1.0) / num_azimuth - 1.0)
        elevation = None
        if has_elevation(radar):
            if num_elevation is None:
                num_elevation = _default_elevations(radar, 4 * rd.data[0].size * num_azimuth)
            elevation = _elevations(radar, num_elevation)
        data = _beamform(
            rd, directions(*np.meshgrid(azimuth, [0.0] if elevation is None else elevation, indexing="ij"))
        )
        data = data[..., 0] if elevation is None else data
    return RangeDopplerAngle(
        data=data,
        range=rd.range,
        radial_velocity=rd.radial_velocity,
        azimuth=azimuth,
        elevation=elevation,
        radar=radar,
        range_doppler=rd,
        noise_power=rd.noise_power * float(np.sum(weights**2)),
    )


def _default_azimuths(radar: RadarSpec) -> int:
    """Return a power of two with at least four directions a beamwidth."""
    beams = max(2.0 / beamwidths(radar)[0], 4.0)
    return int(2 ** np.ceil(np.log2(PER_BEAMWIDTH * beams)))


def _default_elevations(radar: RadarSpec, size: int) -> int:
    """Return an odd number with at least four directions a beamwidth, or as many as go into the largest map.

    `size` is that of the map of one elevation in bytes.
    """
    beams = 2.0 * _highest(radar) / beamwidths(radar)[1]
    wanted = max(2 * int(np.ceil(PER_BEAMWIDTH * beams / 2.0)) + 1, LEAST_ELEVATIONS)
    count = max(min(wanted, LARGEST_MAP // size), LEAST_ELEVATIONS)
    count -= 1 - count % 2
    if (count - 1) / beams < 2.0:
        warnings.warn(
            f"{count} elevations, {(count - 1) / beams:.2g} a beamwidth: with four the map would have"
            f" {wanted * size / 2**30:.3g} GiB. Maxima of the map between them are too low; give num_elevation, or"
            " fewer azimuths or a smaller elevation_fov_deg",
            ScarlWarning,
            stacklevel=3,
        )
    return count


def _highest(radar: RadarSpec) -> float:
    """Return the sine of the largest elevation of maps."""
    return float(np.sin(np.radians(min(radar.elevation_fov_deg, 89.0))))


def _elevations(radar: RadarSpec, count: int) -> Array:
    """Return elevations over twice the field of view, uniform in their sine [rad]."""
    if count < 3:
        raise ParameterRangeError("num_elevation", count, ">= 3")
    return np.arcsin(np.linspace(-_highest(radar), _highest(radar), count))


def _line_spectrum(
    rd: RangeDoppler, line: UniformLine, weights: Array, num_azimuth: int
) -> tuple[npt.NDArray[np.float32], Array]:
    """Return power (doppler, range, azimuth) of a uniform line, and its azimuths."""
    wavelength = SPEED_OF_LIGHT / rd.radar.center_frequency
    sine = (np.arange(num_azimuth) - num_azimuth // 2) * (wavelength / (num_azimuth * line.spacing))
    visible = np.abs(sine) <= 1.0
    _, num_doppler, num_range = rd.data.shape
    out = np.empty((num_doppler, num_range, int(visible.sum())), dtype=np.float32)
    taper = (weights * num_azimuth).astype(np.float32)  # the inverse transform divides by num_azimuth
    for row in range(num_doppler):
        snapshot = rd.data[line.order, row, :].T * taper
        spectrum = np.fft.fftshift(scipy.fft.ifft(snapshot, num_azimuth, axis=1), axes=1)[:, visible]
        out[row] = spectrum.real**2 + spectrum.imag**2
    return out, np.arcsin(sine[visible])


def _beamform(rd: RangeDoppler, unit_vectors: Array) -> npt.NDArray[np.float32]:
    """Return power (doppler, range, ...) of a matrix of steering vectors towards unit vectors (..., 3)."""
    shape = unit_vectors.shape[:-1]
    matrix = np.conj(steering(rd.radar, unit_vectors.reshape(-1, 3))).T / rd.radar.num_virtual
    matrix = np.ascontiguousarray(matrix, dtype=np.complex64)
    _, num_doppler, num_range = rd.data.shape
    out = np.empty((num_doppler, num_range, matrix.shape[1]), dtype=np.float32)
    for row in range(num_doppler):
        spectrum = np.ascontiguousarray(rd.data[:, row, :].T) @ matrix
        out[row] = spectrum.real**2 + spectrum.imag**2
    return out.reshape(num_doppler, num_range, *shape)
