"""A device's specification from captures of reflectors: least squares over raw data whose noise was measured first."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from scarl_sionna.calibration.errors import ConvergenceError
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.gradients.operator import check_radar

from .capture import ReflectorCapture, mean_of
from .model import COUPLING, OF_CAPTURE, PULLED, DeviceModel
from .noise import MeasuredNoise
from .result import LARGE_PULL, CaptureResidual, DeviceFit
from .settings import DeviceFitSettings
from .start import add_leakage, first_guess

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MIN_LEAKAGE_GAIN = 25.0
"""By how much a leakage must lower the sum of squares to be fitted: three parameters of noise alone exceed it once in
60,000 devices."""

LEAST_GAIN = 0.01
"""Steps that lower the sum of squares by less end the search: a standard deviation is 1."""


def fit_device(
    captures: Sequence[ReflectorCapture], radar: RadarSpec, settings: DeviceFitSettings | None = None
) -> DeviceFit:
    r"""Fit a radar's front end and antennas to captures of reflectors at known places.

    Parameters
    ----------
    captures : sequence of ReflectorCapture
        At least one that is not held out. Several ranges tell range bias from survey; several directions antenna places
        and coupling from gains and phases of the channels.
    radar : RadarSpec
        What is stated of the device: waveform, antennas, nominal power, filters. Linear FMCW, I and Q, transmitters in
        turn or apart; gains, leakage, imbalance and constant are fitted from nothing.
    settings : DeviceFitSettings, optional

    Returns
    -------
    DeviceFit
        Estimates with 95 % intervals, what could not be identified, residuals over the noise (of held-out captures,
        too), pulls against what was stated, and the device as a `RadarSpec`.

    Warns
    -----
    ScarlWarning
        If the fit moves a place, a level, an antenna or a coupling by more than four of the standard deviations stated
        for it: it names the largest, by which intervals are widened.

    Raises
    ------
    ParameterRangeError
        If the radar or a capture is not of the kind above.
    CalibrationError
        If no reflector stands out of the noise where it should be.
    ConvergenceError
        If the search does not end.

    Notes
    -----
    Chirps are averaged, since nothing moves. The noise of each receiver over frequency is what chirps differ by from
    their mean. With y the averaged raw data of a pair in the frequency domain, f its model, S that noise and p what is
    fitted,

    .. math:: \min_p \sum \frac{|y - f(p)|^2}{S / M} + \sum \frac{p_k^2}{\sigma_k^2}, \quad C = (J^T J)^{-1}

    where the second sum has what is known beforehand: the survey, RCS, antenna places, coupling. The phase of each
    capture is free, since no survey is exact to a fraction of a wavelength. The first transmitter and receiver have
    gain and phase zero; coupling matrices have ones on their diagonals, so that gains and phases are the channels' own.
    As the phase of each direction is free, the coupling of n antennas takes n directions whose levels are known, else
    n + 1.

    References
    ----------
    .. [1] S. M. Kay, *Fundamentals of Statistical Signal Processing: Estimation Theory*, 1993, chapters 3, 8 and 15.
    """
    settings = settings or DeviceFitSettings()
    stated = radar.with_(front_end=radar.front_end.ideal())
    check_radar(stated)
    stated = radar.with_(front_end=stated.front_end.with_(filters=radar.front_end.filters))
    for number, item in enumerate(captures):
        item.check(stated, f"captures[{number}]")
    used = [item for item in captures if not item.held_out]
    if not used:
        raise ParameterRangeError("captures", f"{len(captures)}, all held out", "at least one that is fitted")
    noise = MeasuredNoise.of(captures, stated)
    fit = _search(used, stated, settings, noise)
    fitted = iter(fit.residuals())
    residuals = [_held_out(item, fit, noise) if item.held_out else next(fitted) for item in captures]
    result = fit.result(noise, residuals)
    _warn_of_pulls(result)
    return result


def _warn_of_pulls(found: DeviceFit) -> None:
    """Warn if what was stated of captures or antennas is far from what the fit says."""
    pulls = found.all_pulls
    large = sorted((name for name in pulls if abs(pulls[name]) > LARGE_PULL), key=lambda name: -abs(pulls[name]))
    if not large:
        return
    more = f" ({len(large) - 1} more are above {LARGE_PULL:g})" if len(large) > 1 else ""
    names = {f"captures[{number}]": f" ('{item.name}')" for number, item in enumerate(found.residuals) if item.name}
    label = large[0] + names.get(large[0].partition(".")[0], "")
    text = f"{label} is fitted {abs(pulls[large[0]]):.3g} of its stated standard deviations from what was stated{more}"
    remedy = (
        "what was stated is wrong, its standard deviation is too small, or the device has what is not fitted "
        "(coupling, antenna places); intervals are widened by the largest of what is fitted, held-out captures aside"
    )
    warnings.warn(f"{text}; {remedy}", ScarlWarning, stacklevel=3)


class _Fit:
    """A search that has ended: the point, its derivatives, and what is left."""

    def __init__(
        self, model: DeviceModel, noise: MeasuredNoise, data: Complex, point: Array, rows: Array, reason: str
    ) -> None:
        count = len(model.device)
        self.model, self.noise, self.data, self.rows, self._reason = model, noise, data, rows, reason
        self.device, self.own = point[:count], point[count:].reshape(-1, len(OF_CAPTURE))

    def ended(self) -> _Fit:
        """Return this, or raise if the search stopped before its end."""
        if self._reason:
            raise ConvergenceError(self._reason)
        return self

    @property
    def rms(self) -> Array:
        """Residual over the noise of each capture, shape (num_captures,); 1 where the model is right."""
        left = self.noise.whitened(self.data - self.model.value(self.device, self.own), self.model.captures)
        return np.asarray(np.sqrt(np.mean(np.abs(left) ** 2, axis=(1, 2, 3))))

    def residuals(self) -> list[CaptureResidual]:
        """Return what each capture differs by from the fit, and its pulls."""
        pulls = self.model.pulls(self.device, self.own)[1][:, : len(PULLED)].tolist()
        return [
            CaptureResidual(item.name, item.held_out, float(rms), tuple(row))
            for item, rms, row in zip(self.model.captures, self.rms, pulls, strict=True)
        ]

    @property
    def leakage_gain(self) -> float:
        """By how much the leakage lowers the sum of squares."""
        without = self.device.copy()
        for name in ("leakage_i", "leakage_q"):
            without[self.model.names.index(name)] = 0.0
        left = [
            self.noise.whitened(self.data - self.model.value(device, self.own), self.model.captures)
            for device in (without, self.device)
        ]
        return float(np.sum(np.abs(left[0]) ** 2) - np.sum(np.abs(left[1]) ** 2))

    def result(self, noise: MeasuredNoise, residuals: list[CaptureResidual]) -> DeviceFit:
        """Return the estimates with their covariance."""
        information = self.rows.T @ self.rows
        prior = np.zeros(len(information))
        prior[: len(self.device)] = [1.0 / item.std**2 if COUPLING in item.name else 0.0 for item in self.model.device]
        alone = np.sqrt(np.diag(_inverse(information - np.diag(prior))))[: len(self.device)]
        return DeviceFit.of(self.model, self.device, self.own, (_inverse(information), alone), noise, residuals)


def _inverse(information: Array) -> Array:
    """Return the covariance, infinite for parameters of which nothing is known."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    known = values > 1e-12 * values[-1]
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T * np.outer(scale, scale)
    lost = (vectors[:, ~known] ** 2).sum(axis=1) > 1e-6
    inverse[lost, lost] = np.inf
    return np.asarray(inverse)


def _search(
    captures: Sequence[ReflectorCapture], radar: RadarSpec, settings: DeviceFitSettings, noise: MeasuredNoise
) -> _Fit:
    """Search with the leakage that stands out of what the first guess leaves, and without if it does not pay."""
    data = np.array([mean_of(item, radar) for item in captures])
    plain = DeviceModel(radar, captures, settings.with_(leakage=False), noise.amplitude)
    device, own = first_guess(plain, data)
    model = DeviceModel(radar, captures, settings, noise.amplitude)
    if model.index("leakage_length") is not None:
        start = np.array([device[plain.names.index(name)] if name in plain.names else 0.0 for name in model.names])
        if add_leakage(model, data, start, own) > MIN_LEAKAGE_GAIN:
            found = _minimum(model, noise, data, np.concatenate([start, own.ravel()]), must_end=False)
            if found.leakage_gain > MIN_LEAKAGE_GAIN:
                return found.ended()
    return _minimum(plain, noise, data, np.concatenate([device, own.ravel()]))


def _held_out(item: ReflectorCapture, fit: _Fit, noise: MeasuredNoise) -> CaptureResidual:
    """Return the residual of a capture: the device is held, what the capture leaves open is fitted."""
    model = DeviceModel(fit.model.radar, [item], fit.model.settings, fit.model.noise, fit.model.device)
    data = np.array([mean_of(item, fit.model.radar)])
    own = first_guess(model, data, fit.device)[1]
    found = _minimum(model, noise, data, np.concatenate([fit.device, own.ravel()]), fixed=len(fit.device))
    return found.residuals()[0]


def _minimum(
    model: DeviceModel, noise: MeasuredNoise, data: Complex, start: Array, fixed: int = 0, must_end: bool = True
) -> _Fit:
    """Search from a start; the first `fixed` parameters of the device keep their values."""
    count = len(model.device)
    spread = np.concatenate([part.ravel() for part in model.known])
    prior = np.where(np.isfinite(spread), 1.0 / np.maximum(spread, 1e-12), 0.0)
    has_prior = np.flatnonzero(prior[fixed:])

    def split(free: Array) -> tuple[Array, Array]:
        point = np.concatenate([start[:fixed], free])
        return point[:count], point[count:].reshape(-1, len(OF_CAPTURE))

    def residuals(free: Array) -> Array:
        left = noise.whitened(model.value(*split(free)) - data, model.captures)
        return np.concatenate([_parts(left).ravel(), (prior[fixed:] * free)[has_prior]])

    def jacobian(free: Array) -> Array:
        shared, each = (noise.whitened(part, model.captures) for part in model.slopes(*split(free)))
        num_captures, size = len(model.captures), 2 * int(np.prod(data.shape[1:]))
        out = np.zeros((num_captures * size, count + num_captures * len(OF_CAPTURE)))
        out[:, :count] = _parts(shared).reshape(count, -1).T
        own = _parts(each).reshape(len(OF_CAPTURE), num_captures, size)
        for number in range(num_captures):
            first = count + number * len(OF_CAPTURE)
            out[number * size : (number + 1) * size, first : first + len(OF_CAPTURE)] = own[:, number].T
        return np.concatenate([out[:, fixed:], np.diag(prior[fixed:])[has_prior]])

    found = least_squares(
        residuals,
        start[fixed:],
        jac=jacobian,
        x_scale="jac",
        ftol=LEAST_GAIN / data.size,
        xtol=1e-9,
        gtol=1e-9,
        max_nfev=model.settings.max_evaluations,
    )
    reason = ""
    if found.status <= 0:
        reason = f"the search stopped after {found.nfev} evaluations; raise max_evaluations, or survey more closely"
    point = np.concatenate([start[:fixed], found.x])
    fit = _Fit(model, noise, data, point, np.asarray(found.jac), reason)
    return fit.ended() if must_end else fit


def _parts(values: Complex) -> Array:
    """Return real and imaginary parts as residuals of variance one, one more axis at the end."""
    return np.stack([values.real, values.imag], axis=-1) * np.sqrt(2.0)
