"""From raw data to range-Doppler maps: virtual channels, windows, transforms, axes and their normalisation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, check_finite, expect
from scarl_sionna.core.prompt.describe import Described, Row, array_text, short
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.units import SPEED_OF_LIGHT, watt_to_dbm

from .multiplexing import fill_with_noise, images, separate
from .noise import cell_noise_power, floor_of
from .receivers import channel_of, range_weights
from .uneven import before_range, burst_map, doppler_matrix, dopplers, middle_time, over_range, stepped_map
from .windows import window_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

_QUIET = 0.1
"""Part of a map's cells that hold noise only, by which the noise is measured: clutter and its images fill many rows."""


def virtual_cube(adc: npt.NDArray[np.complexfloating], radar: RadarSpec) -> npt.NDArray[np.complex64]:
    """Return the raw data sorted by transmit-receive pair.

    Parameters
    ----------
    adc : ndarray of complex, shape (num_rx, num_chirps_total, num_samples)
        Beat signal [sqrt(W)].
    radar : RadarSpec

    Returns
    -------
    ndarray of complex64, shape (num_virtual, num_chirps, num_samples)
        [sqrt(W)]; channel ``i * num_rx + j`` is transmitter i, receiver j. Of a coded multiplexing each row is a chirp,
        times the transmitter's conjugate code; in random order of time division they are ``num_tx * num_chirps`` rows.

    Raises
    ------
    ParameterRangeError
        If the shape is not the radar's, or values are not finite.

    References
    ----------
    .. [1] J. Li, P. Stoica, "MIMO radar with colocated antennas", IEEE Signal Process. Mag. 24(5), 2007.
    """
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    expected = (radar.num_rx, radar.num_chirps_total, radar.num_samples)
    if np.shape(adc) != expected:
        raise ParameterRangeError(
            "adc", f"shape {np.shape(adc)}", f"shape {expected} = (num_rx, num_chirps_total, num_samples)"
        )
    check_finite("adc", np.asarray(adc))
    if radar.multiplexing.is_coded:
        return separate(np.asarray(adc), radar)
    split = np.asarray(adc).reshape(radar.num_rx, radar.num_chirps, radar.num_tx, radar.num_samples)
    ordered = split.transpose(2, 0, 1, 3).reshape(radar.num_virtual, radar.num_chirps, radar.num_samples)
    return np.ascontiguousarray(ordered, dtype=np.complex64)


def cube_of(
    cube: npt.NDArray[np.complexfloating] | RadarFrame, radar: RadarSpec | None
) -> tuple[npt.NDArray[np.complexfloating], RadarSpec]:
    """Return a cube and its radar: as given, or those of a radar's frame.

    A cube is of complex numbers [sqrt(W)], shape (num_virtual, num_chirps, num_samples), by definition of
    :func:`virtual_cube`.

    Raises
    ------
    InputTypeError
        If an array stands without its radar.
    """
    if isinstance(cube, RadarFrame):
        return virtual_cube(cube.adc, cube.spec), cube.spec
    expect(
        "cube", cube, np.ndarray, "give ss.virtual_cube(adc, radar), or a RadarFrame (of a stored radar: to_result())"
    )
    if radar is None:
        raise InputTypeError("radar", radar, "a RadarSpec", HOW_TO_RADAR)
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    return cube, radar


@dataclass(frozen=True, eq=False, repr=False)
class RangeDoppler(Described):
    """Range-Doppler data of every channel.

    Attributes
    ----------
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        ``abs(data)**2`` at the peak of a point is its received power [W].
    range : ndarray of float64, shape (num_range_bins,)
        Distance at the start of the first ramp [m].
    radial_velocity : ndarray of float64, shape (num_doppler_bins,)
        Rising; positive when the distance opens [m/s].
    radar : RadarSpec
        In random order of time division that of its channels, ``radar.separated``; of real samples the one with such
        maps, ``radar.one_sided``.
    window : tuple of str
        Over range and over Doppler.
    noise_power : float
        Mean thermal noise power of a cell of one channel [W], from the radar's noise figure.
    is_compensated : bool
        Whether motion is compensated in `data`.
    """

    data: npt.NDArray[np.complex64]
    range: Array
    radial_velocity: Array
    radar: RadarSpec
    window: tuple[str, str]
    noise_power: float
    is_compensated: bool = True

    def _facts(self) -> Iterable[Row]:
        power = self.power
        row, column = np.unravel_index(int(power.argmax()), power.shape)
        yield "data", f"complex64 {self.data.shape} = (num_virtual, num_doppler_bins, num_range_bins) [sqrt(W)]"
        yield "range", array_text(self.range, "m")
        yield "radial_velocity", array_text(self.radial_velocity, "m/s")
        place = f"{self.range[column]:.4g} m, {self.radial_velocity[row]:.3g} m/s"
        yield "strongest cell", f"{watt_to_dbm(power[row, column]):.1f} dBm at {place}"
        yield "noise_power", f"{watt_to_dbm(self.noise_power):.1f} dBm in a cell of one channel"
        yield "window", f"{self.window[0]} over range, {self.window[1]} over Doppler"
        yield "radar", short(self.radar)

    @property
    def power(self) -> npt.NDArray[np.float32]:
        """Power averaged over the channels [W], shape (num_doppler_bins, num_range_bins)."""
        total = np.zeros(self.data.shape[1:], dtype=np.float32)
        for channel in self.data:
            total += channel.real**2 + channel.imag**2
        return total / np.float32(len(self.data))

    def plot(self, max_range: float | None = None, dynamic_range_db: float = 60.0, ax: Axes | None = None) -> Axes:
        """Draw the mean power of the channels [dBm] over range and radial velocity.

        Parameters
        ----------
        max_range : float, optional
            Last range shown [m]; default: all.
        dynamic_range_db : float
            Powers farther below the peak have the darkest colour [dB].
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from .plots import plot_range_doppler

        return plot_range_doppler(self, max_range, dynamic_range_db, ax)


def range_axis(radar: RadarSpec, num_range_bins: int | None = None) -> Array:
    """Return the distances of the range bins [m].

    Shape (num_range,).

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    count = radar.num_range_bins if num_range_bins is None else num_range_bins
    return np.arange(count, dtype=np.float64) * (radar.max_range / count)


def doppler_axis(radar: RadarSpec, num_doppler_bins: int | None = None) -> Array:
    """Return the radial velocities of the Doppler bins [m/s], rising, positive when opening.

    Shape (num_doppler,).

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    count = radar.num_doppler_bins if num_doppler_bins is None else num_doppler_bins
    return np.arange(-(count // 2), count - count // 2, dtype=np.float64) * (2.0 * radar.unambiguous_velocity / count)


def range_doppler(
    cube: npt.NDArray[np.complexfloating] | RadarFrame,
    radar: RadarSpec | None = None,
    window: str | None = "hann",
    doppler_window: str | None = None,
    num_range_bins: int | None = None,
    num_doppler_bins: int | None = None,
    compensate_motion: bool = True,
) -> RangeDoppler:
    r"""Return the range-Doppler map of every channel.

    Parameters
    ----------
    cube : ndarray of complex, shape (num_virtual, num_chirps, num_samples), or RadarFrame
        From :func:`virtual_cube` [sqrt(W)]; or a radar's frame, whose raw data and specification are taken.
    radar : RadarSpec, optional
        Needed with an array.
    window, doppler_window : str, optional
        ``"rect"`` (or None), ``"hann"``, ``"hamming"``, ``"blackman"``, ``"blackmanharris"``, ``"chebyshev"`` (80 dB),
        ``"taylor"``; `doppler_window` left out is the same as `window`.
    num_range_bins, num_doppler_bins : int, optional
        More bins than samples or chirps interpolate the map (zero padding).
    compensate_motion : bool
        Refer range to the start of the first ramp and remove the phase that motion adds between the transmitters of
        ``"tdm"``. False is the plain transform.

    Returns
    -------
    RangeDoppler

    Raises
    ------
    ParameterRangeError
        If the shape is not the radar's, values are not finite, fewer bins than samples are asked for, or Doppler bins
        that are no multiple of the period of its codes.

    Notes
    -----
    Of periodic codes (:class:`Ddm`, :class:`Bpm`) the images at other velocities are lowered to the noise.

    A point of Doppler frequency nu (the slow-time frequency of the beat signal) has, about the middle of the frame, the
    beat frequency ``S tau(0) + nu + S nu t_mid / f_c``: range-Doppler coupling and migration until the middle. Each
    Doppler row is multiplied by the opposite tone over fast time before the range transform, and for transmitter i by
    ``exp(-2j pi nu t_i)``. Both use the row's own velocity, so a target beyond the unambiguous velocity comes out at
    an aliased velocity **and** a range that is off by the corresponding amount.

    In frequency division the carriers of transmitter i are higher by F_i, which adds the phase ``2 pi F_i tau``: it is
    removed for each range bin's delay, so that channels hold pure array phases.

    Of real samples the half of the bins that is their image is left out, and the other half doubled: a tone has its
    power, the noise is 3 dB higher.

    Of symbols (OFDM, phase codes) the receiver takes the channel first, by division or correlation: all tones at one
    time, so that the coupling ``nu`` is not there.

    What is left is the smear by migration within the frame, symmetric about the point, and a scale error of the
    velocity of ``S tau / f_c``, 2e-4 at the largest range of the default radar.

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    cube, radar = cube_of(cube, radar)
    if radar.num_slow_chirps != radar.num_chirps:
        radar = radar.separated
    expected = (radar.num_virtual, radar.num_chirps, radar.num_samples)
    if np.shape(cube) != expected:
        raise ParameterRangeError(
            "cube",
            f"shape {np.shape(cube)}",
            f"shape {expected} = (num_virtual, num_chirps, num_samples)",
            "make it with virtual_cube",
        )
    check_finite("cube", np.asarray(cube))
    if radar.adc.is_real:
        return _of_real(cube, radar, (window, doppler_window), (num_range_bins, num_doppler_bins), compensate_motion)
    seen = seen_by(radar)
    num_range = _bins("num_range_bins", num_range_bins, seen.num_samples)
    num_doppler = _bins("num_doppler_bins", num_doppler_bins, radar.num_doppler_bins)
    doppler_window = window if doppler_window is None else doppler_window
    fast = range_weights(radar, window).astype(np.float32)
    slow = window_values(doppler_window, radar.num_chirps).astype(np.float32)
    data = np.empty((radar.num_virtual, num_doppler, num_range), dtype=np.complex64)
    is_periodic = radar.multiplexing.code_period(radar.num_tx) is not None
    for tx in range(radar.num_tx):
        factor = None if is_periodic or not compensate_motion else _motion_compensation(seen, num_doppler, tx)
        taper = fast if factor is None else factor * fast
        for channel in range(tx * radar.num_rx, (tx + 1) * radar.num_rx):
            samples, shape = channel_of(cube[channel], radar, tx=tx), (num_doppler, num_range)
            if radar.waveform.burst > 1:
                windows = window, doppler_window
                data[channel] = burst_map(samples, radar, windows, shape, tx if compensate_motion else None)
            elif radar.waveform.chirp_frequencies is not None:
                data[channel] = stepped_map(samples, radar, slow, taper, shape, compensate_motion)
            else:
                data[channel] = over_range(_over_doppler(samples, seen, slow, num_doppler) * taper, seen, num_range)
            _turn_carriers(data[channel], seen, tx)
    noise_power = cell_noise_power(radar, window, doppler_window)
    if is_periodic:
        _one_velocity(data, radar, noise_power, compensate_motion)
    return RangeDoppler(
        data=data,
        range=range_axis(radar, num_range),
        radial_velocity=doppler_axis(radar, num_doppler),
        radar=radar,
        window=("rect" if window is None else window, "rect" if doppler_window is None else doppler_window),
        noise_power=noise_power,
        is_compensated=compensate_motion,
    )


def _one_velocity(data: npt.NDArray[np.complex64], radar: RadarSpec, noise_power: float, compensate: bool) -> None:
    """Take the images of periodic codes out of a map, in place; `compensate`: its motion is compensated, too.

    Images are told before the compensation, which is another one in their rows, and taken out after it: beside cells
    that were taken out the noise would no longer be that of a window.
    """
    period, seen, (channels, num_doppler, num_range) = (
        radar.multiplexing.code_period(radar.num_tx),
        seen_by(radar),
        data.shape,
    )
    assert period is not None
    power = np.zeros((num_doppler, 2 * num_range), dtype=np.float32)
    factor = _motion_compensation(seen, num_doppler, 0, num_range)
    for channel in range(channels):
        samples = before_range(data[channel], seen)
        fine = over_range(samples.copy(), seen, 2 * num_range)
        power += fine.real**2 + fine.imag**2
        if compensate:
            data[channel] = over_range(factor * samples, seen, num_range)
    power /= np.float32(channels)
    moved = bins_a_hertz(radar, num_range) * dopplers(seen, num_doppler) * compensate
    floor = floor_of(power, channels, noise_power, _QUIET)
    fill_with_noise(data, images(power, channels, period, floor, moved), floor)


def _of_real(
    cube: npt.NDArray[np.complexfloating],
    radar: RadarSpec,
    windows: tuple[str | None, str | None],
    shape: tuple[int | None, int | None],
    compensate_motion: bool,
) -> RangeDoppler:
    """Return the maps of real samples: those of twice the samples as if they were complex, without the image's half."""
    num_range = _bins("num_range_bins", shape[0], radar.num_range_bins)
    both = range_doppler(2.0 * cube, radar.with_quadrature, *windows, 2 * num_range, shape[1], compensate_motion)
    data, distance = np.ascontiguousarray(both.data[..., :num_range]), both.range[:num_range]
    return replace(both, data=data, range=distance, radar=radar.one_sided)


def _over_doppler(
    samples: npt.NDArray[np.complex64], radar: RadarSpec, window: npt.NDArray[np.float32], num_doppler: int
) -> npt.NDArray[np.complex64]:
    """Return the spectrum over slow time, rising; shape (num_doppler, num_samples)."""
    if radar.waveform.chirp_delays is not None:
        return np.asarray(doppler_matrix(radar, window, num_doppler) @ samples)
    rows = scipy.fft.fft(samples * window[:, None], num_doppler, axis=0, workers=-1, overwrite_x=True)
    return np.asarray(np.fft.fftshift(rows, axes=0))


def _bins(name: str, asked: int | None, least: int) -> int:
    """Return a number of bins, or raise if it is below the number of values transformed."""
    if asked is None:
        return least
    if asked < least:
        raise ParameterRangeError(name, asked, f">= {least}", "fewer bins would fold the data")
    return int(asked)


def uncompensated(rd: RangeDoppler) -> npt.NDArray[np.complex64]:
    """Return a map's data as it is before the compensation of motion, and of the carriers of frequency division.

    Shape (num_virtual, num_doppler_bins, num_range_bins) [sqrt(W)]. There a point of even chirps is one tone over both
    axes. Exact: the transform over range is undone and made again.
    """
    if not rd.is_compensated and rd.radar.multiplexing.shares_band:
        return rd.data
    seen, (num_doppler, num_range) = seen_by(rd.radar), rd.data.shape[1:]
    out = rd.data.copy()
    for channel, data in enumerate(out):
        tx = channel // rd.radar.num_rx
        _turn_carriers(data, seen, tx, back=True)
        if not rd.is_compensated:
            continue
        if channel % rd.radar.num_rx == 0:
            moved = _motion_compensation(seen, num_doppler, tx, num_range)
        out[channel] = over_range(np.conj(moved) * before_range(data, seen), seen, num_range)
    return out


def _turn_carriers(data: npt.NDArray[np.complex64], seen: RadarSpec, tx: int, back: bool = False) -> None:
    """Remove from a transmitter's map, in place, the phase that its own carriers add over range; `back` adds it."""
    higher = seen.tx_frequency(tx)
    if higher:
        cycles = higher * 2.0 / SPEED_OF_LIGHT * range_axis(seen, data.shape[1])
        data *= np.exp((2j if back else -2j) * np.pi * cycles).astype(np.complex64)


def coupling(radar: RadarSpec, tx: int = 0) -> float:
    """Return by how much the beat frequency rises with the Doppler frequency, dimensionless.

    1 for the range-Doppler coupling, and the migration until the middle of a transmitter's frame: ``S t_mid / f_c``.

    References
    ----------
    .. [1] A. G. Stove, "Linear FMCW radar techniques", IEE Proc. F 139(5), 1992.
    """
    middle = middle_time(radar) + radar.tx_delay(tx)
    return 1.0 + radar.waveform.sweep.slope * middle / radar.center_frequency


def bins_a_hertz(radar: RadarSpec, num_range: int) -> float:
    """Return by how many range bins the compensation of motion moves a row of a Doppler frequency of 1 Hz down.

    By definition of :func:`range_doppler`; a target whose velocity is aliased is seen as much too far for each Hz that
    its row lies too low.
    """
    seen = seen_by(radar)
    sign = 1.0 if seen.waveform.sweep.slope > 0.0 else -1.0
    return float(sign * coupling(seen) * num_range / seen.sample_rate)


def _motion_compensation(
    radar: RadarSpec, num_doppler: int, tx: int, num_samples: int | None = None
) -> npt.NDArray[np.complex64]:
    """Return the factor over (Doppler row, fast time) that undoes motion until the middle of the frame."""
    row = np.arange(num_doppler) - num_doppler // 2
    doppler = row / (num_doppler * radar.doppler_interval)
    tx_delay = radar.tx_delay(tx)
    sample = np.arange(num_samples or radar.num_samples)
    ts_middle = (radar.num_samples - 1) / (2.0 * radar.sample_rate)
    shift = doppler * coupling(radar, tx)
    higher = radar.tx_frequency(tx)
    if higher:  # tones above the first transmitter's, as a sweep's later ones
        ts_middle -= higher / radar.waveform.sweep.slope
    cycles = shift[:, None] * (sample / radar.sample_rate - ts_middle)[None, :] + (doppler * tx_delay)[:, None]
    return np.exp(-2j * np.pi * cycles).astype(np.complex64)
