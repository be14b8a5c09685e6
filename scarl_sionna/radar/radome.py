"""What a radome or bumper does: to waves that pass it, for each antenna, and what it sends back into the receivers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.prompt.describe import Described, Row, array_text
from scarl_sionna.core.specs.radar.antennas.element import AntennaElement
from scarl_sionna.core.specs.radar.antennas.radome import Radome
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt, power_to_db
from scarl_sionna.scene.materials.dielectrics import water_permittivity
from scarl_sionna.scene.materials.fresnel import layer_coefficients
from scarl_sionna.signal.angle import directions
from scarl_sionna.signal.antenna import antenna_fields, element_field, spherical_basis

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_STILL, _ROUNDS = 1e-13, 500
"""A reflection point that moves by less [m] is found; most steps of the search."""
_FOCUS = 0.05
"""A tube of reflected rays that widens by less (in area, over that of parallel rays) is near a focus."""


@dataclass(frozen=True, eq=False)
class RadomeEcho:
    """What a radome sends back.

    Attributes
    ----------
    length : ndarray of float64, shape (num_tx, num_rx)
        From transmitter over the reflection point to receiver [m].
    amplitude : ndarray of complex128, shape (num_tx, num_rx)
        Of the received field, without the phase over the length [sqrt(W)].
    """

    length: Array
    amplitude: Complex


@dataclass(frozen=True, eq=False, repr=False)
class RadomeEffect(Described):
    """What a radome does to a radar.

    Attributes
    ----------
    loss_db : ndarray of float64, shape (...)
        Two-way loss of an isotropic point's power, the mean of all channels [dB].
    phase_deg : ndarray of float64, shape (..., num_virtual)
        Two-way phase of each channel that the radome adds [deg].
    echo_db : ndarray of float64, shape (num_tx, num_rx)
        Power of the radome's echo over the transmitted power [dB]; -400 where it is left out.
    echo_length : ndarray of float64, shape (num_tx, num_rx)
        Of its way [m].
    """

    loss_db: Array
    phase_deg: Array
    echo_db: Array
    echo_length: Array

    def _facts(self) -> Iterable[Row]:
        yield "loss_db", array_text(np.ravel(self.loss_db), "dB two-way")
        yield "phase_deg", f"{np.ptp(self.phase_deg, axis=-1).max():.3g} deg between channels at most"
        yield "echo_db", array_text(np.ravel(self.echo_db), "dB of the transmitted power")
        yield "echo_length", array_text(np.ravel(self.echo_length), "m")


def settled(radar: RadarSpec) -> RadarSpec:
    """Return the radar with a radome whose frequency is stated, so that parts of its waveform see the same layers.

    By definition of :class:`Radome`.
    """
    radome = radar.array.radome
    if radome is None or radome.frequency is not None:
        return radar
    return radar.with_(array=radar.array.with_(radome=radome.with_(frequency=radar.center_frequency)))


def _layers(radome: Radome, frequency: float) -> tuple[list[complex], list[float]]:
    """Return permittivities, with the air behind, and depths [m], from the radar outwards."""
    media = [layer.permittivity for layer in radome.layers]
    depths = [layer.thickness for layer in radome.layers]
    if radome.water_film > 0.0:
        media.append(water_permittivity(frequency, radome.water_temperature))
        depths.append(radome.water_film)
    return [*media, 1.0 + 0j], depths


def through_radome(fields: list[Complex], radar: RadarSpec, places: Array, vectors: Array) -> list[Complex]:
    r"""Return the far fields of antennas behind the radome; the same ones where there is none.

    Parameters
    ----------
    fields : list of ndarray of complex128, shape (num_paths, 2)
        Of each antenna, parts along theta-hat and phi-hat.
    radar : RadarSpec
    places : ndarray of float64, shape (num_antennas, 3)
        Of the antennas [m, radar frame].
    vectors : ndarray of float64, shape (num_paths, 3)
        Where the waves go to or come from, of any length [radar frame].

    Notes
    -----
    Where the ray from the antenna meets the inner face, the parts across (TE) and in the plane of incidence (TM) are
    multiplied with the layers' transmission in place of as much air,

    .. math:: T_{TE,TM}(\theta)\, e^{j k d \cos\theta}

    For plane layers that is the far field behind them exactly. Rays that do not meet a plane face stay as they are.

    References
    ----------
    .. [1] M. Born, E. Wolf, *Principles of Optics*, 7th ed., section 1.6.
    """
    radome = radar.array.radome
    if radome is None:
        return fields
    frequency = radome.frequency or radar.center_frequency
    unit = np.asarray(vectors, dtype=np.float64)
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    if radome.radius is None:
        jones = _transmission(radome, frequency, places[0], unit)
        known: dict[int, Complex] = {}
        for field in fields:
            if id(field) not in known:
                known[id(field)] = np.einsum("...ik,...k->...i", jones, field)
        return [known[id(field)] for field in fields]
    return [
        np.einsum("...ik,...k->...i", _transmission(radome, frequency, place, unit), field)
        for place, field in zip(places, fields, strict=True)
    ]


def _transmission(radome: Radome, frequency: float, place: Array, unit: Array) -> Complex:
    """Return the Jones matrices of transmission for rays from a place, shape (..., 2, 2), in theta-hat and phi-hat."""
    length = radome.crossings(place, unit)
    met = np.isfinite(length)
    normal = radome.normals(place + np.where(met, length, 0.0)[..., None] * unit)
    cosine = np.where(met, np.clip(np.einsum("...i,...i->...", unit, normal), 0.0, 1.0), 1.0)
    media, depths = _layers(radome, frequency)
    turn = np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT * sum(depths) * cosine)
    te, tm = (np.where(met, part * turn, 1.0) for part in layer_coefficients(media, depths, cosine, frequency)[1])
    across = _across(unit, normal)
    basis = spherical_basis(unit)
    s = np.einsum("...ki,...i->...k", basis, across)
    p = np.einsum("...ki,...i->...k", basis, np.cross(across, unit))
    outer = (part[..., :, None] * part[..., None, :] for part in (s, p))
    return np.asarray(sum(value[..., None, None] * each for value, each in zip((te, tm), outer, strict=True)))


def _across(unit: Array, normal: Array) -> Array:
    """Return unit vectors across the plane of incidence (..., 3); any across the ray along the normal."""
    across = np.cross(normal, unit)
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    fallback = spherical_basis(unit)[..., 1, :]
    return np.asarray(np.where(size > 1e-9, across / np.where(size > 1e-9, size, 1.0), fallback))


def radome_echo(radar: RadarSpec) -> RadomeEcho:
    r"""Return what the radome sends back from every transmitter into every receiver.

    Parameters
    ----------
    radar : RadarSpec
        With a radome.

    Raises
    ------
    ParameterRangeError
        If the face is bent so much that the echo comes to a focus.

    Notes
    -----
    Geometrical optics: one reflection at the inner face, with the coefficients of all layers at its angle, the far
    fields of both antennas towards the reflection point, and a spreading by the curvature of the face,

    .. math:: \frac{\lambda}{4 \pi s} \frac{1}{\sqrt{\det(1 + s' Q)}}, \quad
        Q = \frac{1}{s} + 2 \begin{pmatrix} C_{11} / \cos\theta & C_{12} \\ C_{12} & C_{22} \cos\theta
        \end{pmatrix}

    with the curvature C in and across the plane of incidence; for a plane, the image at the distance s + s'.

    *Not modelled*: near fields of the antennas, ways that go back and forth between face and board, edges.

    References
    ----------
    .. [1] G. A. Deschamps, "Ray techniques in electromagnetics", Proc. IEEE 60(9), 1972.
    """
    radome, array = radar.array.radome, radar.array
    assert radome is not None  # by the caller
    length, amplitude = np.empty((radar.num_tx, radar.num_rx)), np.empty((radar.num_tx, radar.num_rx), np.complex128)
    frequency = radome.frequency or radar.center_frequency
    media, depths = _layers(radome, frequency)
    scale = np.sqrt(dbm_to_watt(radar.front_end.tx_power_dbm)) * SPEED_OF_LIGHT / frequency / (4.0 * np.pi)
    for tx, sender in enumerate(radar.tx_array):
        for rx, receiver in enumerate(radar.rx_array):
            point, normal = _reflection_point(radome, sender, receiver)
            there, back = point - sender, receiver - point
            first, second = float(np.linalg.norm(there)), float(np.linalg.norm(back))
            there, back = there / first, back / second
            cosine = float(there @ normal)
            te, tm = layer_coefficients(media, depths, cosine, frequency)[0]
            across = _across(there, normal)
            sent = _vector(array.tx[tx], there)
            reflected = te * (across @ sent) * across
            reflected = reflected + tm * (np.cross(across, there) @ sent) * np.cross(across, back)
            spread = _spreading(radome, normal, across, cosine, (first, second))
            amplitude[tx, rx] = scale * spread * (_vector(array.rx[rx], -back) @ reflected)
            length[tx, rx] = first + second
    return RadomeEcho(length, amplitude)


def _vector(element: AntennaElement, direction: Array) -> Complex:
    """Return an antenna's far field towards a direction (3,) as a vector."""
    return np.asarray(element_field(element, direction) @ spherical_basis(direction))


def _reflection_point(radome: Radome, sender: Array, receiver: Array) -> tuple[Array, Array]:
    """Return where the face reflects from one antenna to another (3,) [m], and its outward normal there.

    By images in the tangent plane, again and again: a plane takes one step.
    """
    point = radome.point
    for _ in range(_ROUNDS):
        normal = radome.normals(point)
        image = receiver - 2.0 * ((receiver - point) @ normal) * normal
        part = ((point - sender) @ normal) / ((image - sender) @ normal)
        found = sender + part * (image - sender)
        found = found - radome.heights(found) * radome.normals(found)
        moved, point = float(np.linalg.norm(found - point)), found
        if moved < _STILL:
            break
    return point, radome.normals(point)


def _spreading(radome: Radome, normal: Array, across: Array, cosine: float, legs: tuple[float, float]) -> float:
    """Return the spreading over both legs [1/m] of a ray tube reflected by the inner, hollow, side of the face."""
    first, second = legs
    if radome.radius is None:
        return 1.0 / (first + second)
    along = np.cross(across, normal)
    curvature = -np.eye(2) / radome.radius
    if radome.bend == "cylinder":
        bent = np.cross(radome.frame[2], normal)
        parts = np.array([along @ bent, across @ bent])
        curvature = -np.outer(parts, parts) / radome.radius
    wave = np.eye(2) / first + 2.0 * curvature * np.array([[1.0 / cosine, 1.0], [1.0, cosine]])
    widened = float(np.linalg.det(np.eye(2) + second * wave))
    if widened <= _FOCUS:
        place = (
            f"{first:.3g} m from antennas, bent by {radome.radius:g} m: its echo comes to a focus at another antenna"
        )
        remedy = "a larger radius, or echo=False"
        raise ParameterRangeError("radar.array.radome", place, "a face that the antennas are well inside of", remedy)
    return 1.0 / (first * np.sqrt(widened))


def radome_effect(radar: RadarSpec, azimuth: npt.ArrayLike, elevation: npt.ArrayLike = 0.0) -> RadomeEffect:
    """Return what a radar's radome does to waves towards directions, and what it sends back.

    By definition: fields behind the radome over those without it, for an isotropic point.

    Parameters
    ----------
    radar : RadarSpec
        With a radome.
    azimuth, elevation : array_like of float, of shapes that broadcast
        Left and up positive [rad].

    Raises
    ------
    ParameterRangeError
        If the radar has no radome.
    InputTypeError
        If `radar` is no RadarSpec.
    """
    expect("radar", radar, RadarSpec, HOW_TO_RADAR)
    if radar.array.radome is None:
        raise ParameterRangeError("radar.array.radome", "None", "a Radome", "radar.with_(radome=ss.Radome(...))")
    ahead = directions(azimuth, elevation)
    flat = ahead.reshape(-1, 3)
    pairs = []
    for screened in (False, True):
        ends = []
        for elements, places in ((radar.array.tx, radar.tx_array), (radar.array.rx, radar.rx_array)):
            fields = antenna_fields(elements, flat)
            ends.append(np.stack(through_radome(fields, radar, places, flat) if screened else fields))
        pairs.append(np.einsum("iuk,juk->uij", *ends).reshape(*ahead.shape[:-1], -1))
    free, behind = pairs
    none = np.zeros((radar.num_tx, radar.num_rx))
    echo = radome_echo(radar) if radar.array.has_echo else RadomeEcho(none, none.astype(np.complex128))
    power = np.abs(echo.amplitude) ** 2 / dbm_to_watt(radar.front_end.tx_power_dbm)
    loss = power_to_db(np.mean(np.abs(free) ** 2, axis=-1)) - power_to_db(np.mean(np.abs(behind) ** 2, axis=-1))
    return RadomeEffect(loss, np.degrees(np.angle(behind * np.conj(free))), power_to_db(power), echo.length)
