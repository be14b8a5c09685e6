"""Link budget of a time-of-flight lidar: photoelectrons of a pulse, and what disturbs them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.beam import beam_radius
from camera_lidar.lidar.photons import ELEMENTARY_CHARGE, photon_energy, sun_irradiance
from camera_lidar.lidar.returns import MIRRORED, Echoes
from scarl_sionna.core.specs.lidar.receiver import PulsedReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]

_STEEPEST = 1e3
"""Largest tangent of the angle of incidence that widens a pulse."""


def pulsed(spec: LidarSpec) -> PulsedReceiver:
    """Return the receiver of a specification with a pulsed one."""
    assert isinstance(spec.receiver, PulsedReceiver)
    return spec.receiver


def aperture_area(spec: LidarSpec) -> float:
    """Return the area of the receiver's lens [m2]."""
    return math.pi / 4.0 * pulsed(spec).receiver_aperture ** 2


def overlap(spec: LidarSpec, distance: npt.ArrayLike) -> Array:
    r"""Return the share of a point's light on the lens that the detector sees, 0 to 1; any shape [m], kept.

    Notes
    -----
    .. math:: \xi(R) = \min\left(1, \left(\frac{\Omega R}{D}\right)^2\right) \cdot
        \text{clip}\left(\frac{R - R_1}{R_2 - R_1}\right)

    The lens of the diameter D is focused at infinity: a ray from a near point through the lens at r from its middle
    arrives with the angle r / R, and passes if that is within half of the field of view. Light of a near place
    thus stays the same whatever its distance. The second factor is `blind_distance` [1]_.

    References
    ----------
    .. [1] R. H. Rasshofer, M. Spies, H. Spies, "Influences of weather phenomena on automotive laser radar systems",
       Adv. Radio Sci. 9, 2011.
    """
    receiver = pulsed(spec)
    first, whole = receiver.blind_distance
    distance = np.asarray(distance, dtype=np.float64)
    focus = np.minimum((receiver.field_of_view * distance / receiver.receiver_aperture) ** 2, 1.0)
    if whole == first:
        return np.where(distance >= whole, focus, 0.0)
    return focus * np.clip((distance - first) / (whole - first), 0.0, 1.0)


def photoelectrons(spec: LidarSpec, intensity: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    r"""Return the mean number of photoelectrons that one pulse's return makes.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    intensity : array_like of float, any shape
        Relative to a white diffuser at 1 m without air: reflectance cos(theta) exp(-2 alpha R) / (R / 1 m)^2, times the
        share of the beam.
    distance : array_like of float, of a shape that broadcasts
        R [m]; it only says how far beam and receiver overlap.

    Returns
    -------
    ndarray of float64, of the broadcast shape

    Notes
    -----
    .. math:: N = \frac{\eta_q}{h \nu} E \, \eta \, \xi(R) \, \frac{A}{\pi} \frac{\rho \cos\theta}{R^2} e^{-2 \alpha R}

    the lidar equation of a diffuser that holds the whole beam, with pulse energy E, lens A and overlap xi.

    References
    ----------
    .. [1] A. V. Jelalian, *Laser Radar Systems*, Artech House, 1992.
    """
    receiver = pulsed(spec)
    scale = receiver.quantum_efficiency / photon_energy(spec.wavelength) * receiver.pulse_energy
    scale *= receiver.optical_efficiency * aperture_area(spec) / math.pi
    return scale * np.asarray(intensity, dtype=np.float64) * overlap(spec, distance)


def full_scale(spec: LidarSpec) -> float:
    """Return the photoelectrons of a pulse whose peak just reaches full scale; infinite without saturation.

    By definition of full scale: the energy of a Gaussian pulse of that peak power, before the optics.
    """
    receiver = pulsed(spec)
    if receiver.saturation_power is None:
        return math.inf
    energy = receiver.saturation_power * math.sqrt(2.0 * math.pi) * receiver.pulse_deviation
    return receiver.quantum_efficiency / photon_energy(spec.wavelength) * receiver.optical_efficiency * energy


def excess_noise_factor(receiver: PulsedReceiver) -> float:
    r"""Return by how much the avalanche makes the photoelectrons' shot noise larger in power.

    .. math:: F = k M + (1 - k) \left(2 - \frac{1}{M}\right)

    References
    ----------
    .. [1] R. J. McIntyre, "Multiplication noise in uniform avalanche diodes", IEEE Trans. Electron Devices 13(1), 1966.
    """
    gain, ratio = receiver.avalanche_gain, receiver.ionization_ratio
    return ratio * gain + (1.0 - ratio) * (2.0 - 1.0 / gain)


def background_rate(spec: LidarSpec, reflectance: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    r"""Return the photoelectrons a second that sunlight on a surface makes.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    reflectance : array_like of float, any shape
        Of the diffuser that fills the field of view, 0 to 1.
    distance : array_like of float, of a shape that broadcasts
        [m].

    Notes
    -----
    .. math:: \dot N = \frac{\eta_q}{h \nu} \eta \, A \, \pi \left(\frac{\Omega}{2}\right)^2
        \frac{\rho E_\lambda}{\pi} \Delta\lambda \, e^{-\alpha R}

    by the definition of radiance. Without a `solar_irradiance` that of the sun above the air; in a world it is the
    lighting's, see :class:`camera_lidar.lidar.Lidar`. *Not modelled*: shadows, how the surface stands to the sun (it
    faces it), light of fog.
    """
    receiver = pulsed(spec)
    light = receiver.solar_irradiance
    light = sun_irradiance(spec.wavelength) if light is None else light
    solid_angle = math.pi * (receiver.field_of_view / 2.0) ** 2
    power = light * receiver.optical_bandwidth * 1e9 / math.pi * aperture_area(spec) * solid_angle
    scale = receiver.quantum_efficiency / photon_energy(spec.wavelength) * receiver.optical_efficiency * power
    air = np.exp(-spec.extinction * np.asarray(distance, dtype=np.float64))
    return scale * np.asarray(reflectance, dtype=np.float64) * air


def noise_density(spec: LidarSpec, background: npt.ArrayLike = 0.0) -> Array:
    r"""Return the spectral density of the noise that does not come from the pulse, in photoelectrons squared a second.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    background : array_like of float, any shape
        Photoelectrons a second, see :func:`background_rate`.

    Returns
    -------
    ndarray of float64, shape of `background`
        Two-sided, of white noise; of one pulse.

    Notes
    -----
    .. math:: S = F \left(\dot N + \frac{I_d}{q}\right) + \frac{1}{2} \left(\frac{i_n}{q M}\right)^2

    shot noise of sunlight and of the dark current, which the avalanche multiplies as it does the signal, and the
    amplifier's noise.

    References
    ----------
    .. [1] R. J. McIntyre, "Multiplication noise in uniform avalanche diodes", IEEE Trans. Electron Devices 13(1), 1966.
    """
    receiver = pulsed(spec)
    thermal = 0.5 * (receiver.noise_current_density / (ELEMENTARY_CHARGE * receiver.avalanche_gain)) ** 2
    rate = np.asarray(background, dtype=np.float64) + receiver.dark_current / ELEMENTARY_CHARGE
    return excess_noise_factor(receiver) * rate + thermal


def speckle_cells(spec: LidarSpec, distance: npt.ArrayLike) -> Array:
    r"""Return over how many cells of speckle the receiver's lens averages: the contrast is one over its root.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    distance : array_like of float, any shape
        [m].

    Notes
    -----
    .. math:: M = 1 + \frac{A}{A_c}, \quad A_c = \frac{\lambda^2 R^2}{\pi w(R)^2}

    with the correlation area of the speckle of a Gaussian spot of radius w; exact for a lens far smaller and far larger
    than it, within 10 % between. *Not modelled*: the width of the laser's spectrum.

    References
    ----------
    .. [1] J. W. Goodman, "Some effects of target-induced scintillation on optical radar performance", Proc. IEEE
       53(11), 1965; *Speckle Phenomena in Optics*, 2007.
    """
    radius = beam_radius(spec, distance)
    place = np.maximum(np.asarray(distance, dtype=np.float64), 1e-3)
    return 1.0 + aperture_area(spec) * math.pi * radius**2 / (spec.wavelength * place) ** 2


def pulse_spread(spec: LidarSpec, cos_incidence: npt.ArrayLike, distance: npt.ArrayLike, rays: int = 1) -> Array:
    r"""Return the standard deviation in time of a pulse that a slanting surface sends back [s].

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    cos_incidence : array_like of float, any shape
    distance : array_like of float, of a shape that broadcasts
        [m].
    rays : int
        Rays that share the beam; each stands for its share of the footprint.

    Notes
    -----
    .. math:: \sigma^2 = \sigma_p^2 + \frac{1}{n} \left( \frac{w(R)}{c} \tan\theta \right)^2

    A Gaussian beam of radius w (1/e2) lights a slanting plane over depths of the standard deviation
    :math:`(w / 2) \tan\theta`; exact for one ray.
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / np.maximum(cosine, 1.0 / _STEEPEST)
    depth = beam_radius(spec, distance) * tangent / SPEED_OF_LIGHT
    return np.sqrt(pulsed(spec).pulse_deviation ** 2 + depth**2 / rays)


def density_of_shots(spec: LidarSpec, returns: Echoes, reflectance: Array) -> Array:
    """Return the density of the noise of every shot, sunlight on its nearest surface included, shape (num_shots,).

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    returns : Echoes
        By shot and distance.
    reflectance : ndarray of float64, shape (num_parts,)
        Of the parts of the scene.

    Notes
    -----
    See :func:`noise_density` and :func:`background_rate`. A shot that hits nothing sees no light.
    """
    background = np.zeros(spec.num_shots)
    rows = np.flatnonzero(returns.part != MIRRORED)[::-1]  # the nearest comes last, and stays
    part = returns.part[rows]
    background[returns.shot[rows]] = background_rate(spec, reflectance[part], returns.distance[rows])
    return noise_density(spec, background)
