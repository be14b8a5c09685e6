"""Noise of a device, from what chirps differ by while nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.calibration.errors import CalibrationError
from scarl_sionna.core.specs.radar.impairments import Mixer
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import REFERENCE_TEMPERATURE, thermal_noise_power
from scarl_sionna.signal.front_end.mixer import image_factors
from scarl_sionna.signal.noise import sample_noise_power

from .capture import ReflectorCapture, by_pair
from .filtering import noise_matrix

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

LEAST_EIGENVALUE = 1e-3
"""Of the noise's covariance behind the stated filters, over the largest: what they suppress further is not raised."""
LEAST_CORRELATED = 0.05
"""Of the correlation's eigenvalues: directions with less are left out."""


@dataclass(frozen=True, eq=False)
class MeasuredNoise:
    """Power of a sample's noise over frequency.

    Attributes
    ----------
    power : ndarray of float64, shape (num_rx, num_samples)
        Of a bin of the unitary transform over a chirp [W].
    white : ndarray of float64, shape (num_rx, num_samples)
        The same of noise that `whitening` was applied to: the same in all bins, if the filters are those stated [W].
    whitening : ndarray of complex128, shape (num_samples, num_samples), or None
        Makes noise behind the stated filters white again: the bins of a chirp are correlated.
    apart : ndarray of complex128, shape (num_samples, num_samples), or None
        Makes bins uncorrelated that `whitening` leaves correlated, where it does not raise what the filters suppress.
    num_looks : int
        Independent values that each is the mean of.
    """

    power: Array
    white: Array
    whitening: Complex | None
    apart: Complex | None
    num_looks: int

    @classmethod
    def of(cls, captures: Sequence[ReflectorCapture], radar: RadarSpec) -> MeasuredNoise:
        """Return the noise of captures: the mean square of the chirps less their mean, by definition."""
        total, looks, whitening = np.zeros((2, radar.num_rx, radar.num_samples)), 0, _whitening(radar)
        for item in captures:
            chirps = by_pair(item.adc, radar)
            chirps -= chirps.mean(axis=0)
            for kind, data in enumerate((chirps, _applied(whitening, chirps))):
                total[kind] += np.sum(np.abs(_transform(data)) ** 2, axis=(0, 1))
            looks += (len(chirps) - 1) * radar.num_tx
        if not np.all(total > 0.0):
            raise CalibrationError("chirps of a capture do not differ: raw data without noise cannot be weighed")
        return cls(total[0] / looks, total[1] / looks, whitening, _apart(radar, whitening), looks)

    @property
    def amplitude(self) -> float:
        """Root mean square of a sample's noise [sqrt(W)]."""
        return float(np.sqrt(self.power.mean()))

    def whitened(self, data: Complex, captures: Sequence[ReflectorCapture]) -> Complex:
        """Return mean raw data over the noise of the mean, in the frequency domain, same shape.

        Parameters
        ----------
        data : ndarray of complex128, shape (..., num_captures, num_tx, num_rx, num_samples)
            [sqrt(W)]
        captures : sequence of ReflectorCapture
        """
        num_tx = data.shape[-3]
        spread = np.array([_spread(item, num_tx) for item in captures])
        white = _transform(_applied(self.whitening, data))
        return _applied(self.apart, np.asarray(white / np.sqrt(spread[:, None, None, None] * self.white)))

    def figure_db(self, radar: RadarSpec, mixer: Mixer) -> tuple[float, float]:
        """Return the noise figure and its standard deviation [dB].

        The median over frequency of what is white behind the mixer and the stated filters.

        Raises
        ------
        CalibrationError
            If the noise is below that of a receiver without noise of its own.
        """
        share, matrix = np.ones(radar.num_samples), noise_matrix(radar)
        if matrix is not None:  # what the filters suppress is not raised to the full
            share = np.sum(np.abs(_transform(_applied(self.whitening, matrix))) ** 2, axis=0)
        ratio = float(np.median(self.white / share)) / sum(abs(factor) ** 2 for factor in image_factors(mixer))
        least = thermal_noise_power(radar.waveform.noise_bandwidth, 0.0, REFERENCE_TEMPERATURE)
        figure = ratio / least + 1.0 - radar.front_end.source_temperature / REFERENCE_TEMPERATURE
        if figure < 1.0:
            level = 10.0 * np.log10(ratio / sample_noise_power(radar))
            raise CalibrationError(
                f"the noise is {-level:.1f} dB below the stated one, less than any receiver's; give samples in sqrt(W)"
            )
        count = self.num_looks * self.white.size
        return 10.0 * float(np.log10(figure)), 10.0 / np.log(10.0) * float(np.sqrt(0.5 * np.pi / count))

    def floor_db(self) -> Array:
        """Return the noise of each frequency over the mean one [dB], mean of the receivers, shape (num_samples,)."""
        mean = self.power.mean(axis=0)
        return np.asarray(10.0 * np.log10(mean / mean.mean()))


def _transform(data: Complex) -> Complex:
    return np.asarray(scipy.fft.fft(data, axis=-1, norm="ortho"))


def _spread(item: ReflectorCapture, num_tx: int) -> float:
    """Return the variance of a capture's mean over that of a chirp."""
    of_empty = 0.0 if item.empty is None else num_tx / item.empty.shape[1]
    return num_tx / item.adc.shape[1] + of_empty


def _whitening(radar: RadarSpec) -> Complex | None:
    """Return the inverse square root of the covariance that the stated filters give white noise."""
    matrix = noise_matrix(radar)
    if matrix is None:
        return None
    values, vectors = np.linalg.eigh(matrix.conj().T @ matrix)
    scale = 1.0 / np.sqrt(np.maximum(values, LEAST_EIGENVALUE * values[-1]))
    return np.asarray((vectors * scale) @ vectors.conj().T)


def _apart(radar: RadarSpec, whitening: Complex | None) -> Complex | None:
    """Return the inverse square root of the correlation of the bins of whitened noise.

    What the filters suppress is not raised to the full, so that the bins that hold it are less than independent, those
    next to zero behind high passes. What is left of it by less than `LEAST_CORRELATED` tells nothing.
    """
    matrix = noise_matrix(radar)
    if whitening is None or matrix is None:
        return None
    rows = _transform(_applied(whitening, matrix))  # white noise through filters, whitening and transform
    covariance = rows.conj().T @ rows
    scale = 1.0 / np.sqrt(np.real(np.diag(covariance)))
    values, vectors = np.linalg.eigh(covariance * scale * scale[:, None])
    kept = values > LEAST_CORRELATED
    inverse = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    return np.asarray((vectors * inverse) @ vectors.conj().T)


def _applied(whitening: Complex | None, data: Complex) -> Complex:
    return data if whitening is None else np.asarray(data @ whitening)
