"""Link budget of a heterodyne lidar: photons received, noise of the receiver, carrier-to-noise ratio, saturation.

The carrier-to-noise ratio is the one after the transform of one chirp: peak of the beat's spectrum over the mean noise
in its resolution cell of 1 / chirp_time. In the limit of shot noise it is the number of photoelectrons that the return
makes in a chirp.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.beam import beam_radius
from camera_lidar.lidar.photons import ELEMENTARY_CHARGE, SUN_TEMPERATURE, photon_energy
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import BOLTZMANN

Array = npt.NDArray[np.float64]


def received_power(spec: LidarSpec, intensity: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    r"""Return the power of a return that mixes with the local oscillator [W], in the mean over speckle.

    Parameters
    ----------
    spec : LidarSpec
        With a heterodyne receiver.
    intensity : array_like of float, any shape
        Relative to a white diffuser at 1 m without air: reflectance cos(theta) exp(-2 alpha R) / (R / 1 m)^2, times the
        share of the beam.
    distance : array_like of float, of a shape that broadcasts
        R [m].

    Returns
    -------
    ndarray of float64, of the broadcast shape
        [W].

    Notes
    -----
    .. math:: P = P_T \, \eta \, \frac{\rho \cos\theta}{\pi} e^{-2 \alpha R} \frac{\lambda^2}{\pi w(R)^2}

    The last factor is the coherent responsivity :math:`\lambda^2 \int j_T j_{BPLO} \, d^2p` of equal transmitted and
    back-propagated local oscillator beams at the target [1]_, Gaussian with the radius w(R); far from a
    diffraction-limited lens it is the solid angle :math:`\pi (D/2)^2 / R^2` [2]_, near it the return stays finite. *Not
    modelled*: truncation by the lens, turbulence, the lag of a scanning mirror.

    References
    ----------
    .. [1] R. G. Frehlich, M. J. Kavaya, "Coherent laser radar performance for general atmospheric refractive
       turbulence", Appl. Opt. 30(36), 1991.
    .. [2] C. M. Sonnenschein, F. A. Horrigan, "Signal-to-noise relationships for coaxial systems that heterodyne
       backscatter from the atmosphere", Appl. Opt. 10(7), 1971.
    """
    receiver = _heterodyne(spec)
    distance = np.asarray(distance, dtype=np.float64)
    per_steradian = np.asarray(intensity, dtype=np.float64) * distance**2 / math.pi
    responsivity = spec.wavelength**2 / (math.pi * beam_radius(spec, distance) ** 2)
    return spec.transmit_power * receiver.system_efficiency * per_steradian * responsivity


def noise_factor(spec: LidarSpec) -> float:
    r"""Return the noise of the receiver over the shot noise of its local oscillator.

    Notes
    -----
    .. math:: F = 1 + \frac{i_\text{th}^2}{2 q \mathcal R P_{LO}} + \frac{\text{RIN} \, \mathcal R P_{LO}}{2 q}

    with the responsivity :math:`\mathcal R = \eta_q q / (h \nu)`; 1 is the limit of shot noise.

    References
    ----------
    .. [1] B. Behroozpour, P. A. M. Sandborn, M. C. Wu, B. E. Boser, "Lidar system architectures and circuits", IEEE
       Commun. Mag. 55(10), 2017.
    """
    receiver = _heterodyne(spec)
    responsivity = receiver.quantum_efficiency * ELEMENTARY_CHARGE / photon_energy(spec.wavelength)
    current = responsivity * receiver.local_oscillator_power
    shot = 2.0 * ELEMENTARY_CHARGE * current
    intensity_noise = 0.0 if receiver.intensity_noise_db is None else 10.0 ** (receiver.intensity_noise_db / 10.0)
    return 1.0 + receiver.thermal_current_density**2 / shot + intensity_noise * current**2 / shot


def background_noise_ratio(wavelength: float, temperature: float = SUN_TEMPERATURE) -> float:
    r"""Return a black body's noise in the receiver's single mode over the shot noise of the local oscillator.

    .. math:: \bar n = \frac{1}{e^{h\nu / kT} - 1}

    photons per second and hertz in the receiver's mode and polarization (Planck), where the local oscillator's shot
    noise is that of one. It does not depend on the aperture: what mixes with a single mode sees a single mode of the
    background. Looking straight into the sun gives 0.25 at 1550 nm, 1 dB; a white surface in full sun has 2.2e-5 of
    that, the sun's share of the sky.
    """
    return 1.0 / math.expm1(photon_energy(wavelength) / (BOLTZMANN * temperature))


def mean_cnr(spec: LidarSpec, intensity: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    r"""Return the carrier-to-noise ratio of a return after the transform of one chirp: linear, mean over speckle.

    .. math:: C = \frac{\eta_q P T}{h \nu F}

    Arguments and shape as of :func:`received_power`.
    """
    return power_to_cnr(spec, received_power(spec, intensity, distance))


def power_to_cnr(spec: LidarSpec, power: npt.ArrayLike) -> Array:
    """Return the carrier-to-noise ratio of a received power [W], without saturation.

    Any shape, kept. By definition, see :func:`mean_cnr`.
    """
    scale = (
        _heterodyne(spec).quantum_efficiency * spec.chirp_time / (photon_energy(spec.wavelength) * noise_factor(spec))
    )
    return np.asarray(power, dtype=np.float64) * scale


def saturated(spec: LidarSpec, cnr: npt.ArrayLike) -> Array:
    r"""Return what is left of a carrier-to-noise ratio where I and Q are clipped at full scale.

    Parameters
    ----------
    spec : LidarSpec
    cnr : array_like of float, any shape
        Linear.

    Returns
    -------
    ndarray of float64, shape of `cnr`
        Linear.

    Notes
    -----
    Of a tone of amplitude A that is clipped at L < A the fundamental has the amplitude g A with

    .. math:: g = \frac{2}{\pi} \left[ \arcsin\frac{L}{A} + \frac{L}{A} \sqrt{1 - (L/A)^2} \right]

    the describing function of a saturation (A. Gelb, W. E. Vander Velde, *Multiple-Input Describing Functions*, 1968).
    *Validity*: one return that is far above the noise, as it is at full scale.
    """
    cnr = np.asarray(cnr, dtype=np.float64)
    limit = full_scale_cnr(spec)
    ratio = np.sqrt(np.minimum(np.divide(limit, cnr, out=np.ones_like(cnr), where=cnr > limit), 1.0))
    gain = 2.0 / math.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio * ratio))
    return cnr * gain * gain


def full_scale_cnr(spec: LidarSpec) -> float:
    """Return the carrier-to-noise ratio of a tone that just reaches full scale.

    Infinite for a receiver without saturation.

    By definition of full scale.
    """
    power = _heterodyne(spec).saturation_power
    return math.inf if power is None else float(power_to_cnr(spec, power))


def _heterodyne(spec: LidarSpec) -> HeterodyneReceiver:
    assert isinstance(spec.receiver, HeterodyneReceiver)
    return spec.receiver
