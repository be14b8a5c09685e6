"""Where a lidar shoots, and what comes back in the ideal case. Pure numpy.

Azimuth is positive to the left, elevation positive upwards, both in the sensor frame (x forward, y left, z up). Shot number =
elevation line * num_azimuth + azimuth column; line 0 is the lowest, column 0 the first azimuth.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.lidar_spec import LidarSpec

Array = npt.NDArray[np.float64]

FULL_TURN_DEG = 360.0


def _evenly(first: float, last: float, number: int) -> Array:
    """Return `number` values from first to last, both included; the middle for one value."""
    return np.linspace(first, last, number) if number > 1 else np.array([(first + last) / 2.0])


def raster_angles(spec: LidarSpec) -> tuple[Array, Array]:
    """Return azimuth of every column and elevation of every line [rad].

    Both ends of a field of view are shot at, but for a full turn, whose end is its start. One single column or line looks
    along the middle.
    """
    first, last = spec.azimuth_fov_deg
    if abs(last - first) >= FULL_TURN_DEG:
        azimuth = first + (last - first) * np.arange(spec.num_azimuth) / spec.num_azimuth
    else:
        azimuth = _evenly(first, last, spec.num_azimuth)
    return np.radians(azimuth), np.radians(_evenly(*spec.elevation_fov_deg, spec.num_elevation))


@lru_cache(maxsize=4)
def shot_directions(spec: LidarSpec) -> Array:
    """Return the unit direction of every shot in the sensor frame, in firing order.

    Parameters
    ----------
    spec : LidarSpec

    Returns
    -------
    ndarray of float64, shape (num_elevation * num_azimuth, 3)
        Read-only: lidars of one kind share it.
    """
    azimuth, elevation = raster_angles(spec)
    elevation = elevation[:, None]
    x = np.cos(elevation) * np.cos(azimuth)
    y = np.cos(elevation) * np.sin(azimuth)
    z = np.broadcast_to(np.sin(elevation), x.shape)
    directions = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    directions.setflags(write=False)
    return directions


def radial_velocity(
    surface_velocity: npt.ArrayLike, sensor_velocity: npt.ArrayLike, directions: npt.ArrayLike
) -> Array:
    r"""Return how fast the distance to surface points opens.

    Parameters
    ----------
    surface_velocity : array_like of float, shape (..., 3)
        Velocity of the material point that is hit [m/s].
    sensor_velocity : array_like of float, shape (3,)
        Velocity of the point from which the light leaves [m/s], same axes.
    directions : array_like of float, shape (..., 3)
        Unit directions of the light, same axes.

    Returns
    -------
    ndarray of float64, shape (...)
        Positive = opening [m/s].

    Notes
    -----
    .. math:: v_r = (\mathbf v_\text{surface} - \mathbf v_\text{sensor}) \cdot \hat{\mathbf d}

    The Doppler shift of coherent light is :math:`-2 v_r / \lambda` of this material velocity: it is not the change of distance
    along a beam that sweeps over the surface. So the sensor's own rotation does not enter. *Error* of leaving relativity out:
    v/c, 2e-7 at 60 m/s.
    """
    relative = np.asarray(surface_velocity, dtype=np.float64) - np.asarray(sensor_velocity, dtype=np.float64)
    return np.einsum("...i,...i->...", relative, np.asarray(directions, dtype=np.float64))


def return_intensity(
    reflectance: npt.ArrayLike, cos_incidence: npt.ArrayLike, distance: npt.ArrayLike, attenuation: float
) -> Array:
    r"""Return the received power of a return, relative to a white diffuser at 1 m that is hit normally, without atmosphere.

    Parameters
    ----------
    reflectance : array_like of float
        Diffuse (Lambertian) reflectance at the lidar's wavelength, 0 to 1.
    cos_incidence : array_like of float
        Cosine of the angle between ray and surface normal, 0 to 1.
    distance : array_like of float
        Along the ray [m], > 0.
    attenuation : float
        One-way power extinction coefficient of the air [1/m].

    Returns
    -------
    ndarray of float64

    Notes
    -----
    .. math:: I = \rho \cos\theta \, \frac{e^{-2 \alpha d}}{(d / 1\,\text{m})^2}

    *Validity*: a Lambertian surface that holds the whole beam, monostatic optics focused at infinity. *Not modelled*: mirror-like
    and retro-reflecting surfaces, beams across an edge, overlap loss at short distance, speckle.

    References
    ----------
    .. [1] P. McManamon, *Field Guide to Lidar*, SPIE, 2015, lidar range equation for an extended Lambertian target.
    """
    distance = np.asarray(distance, dtype=np.float64)
    spreading = np.exp(-2.0 * attenuation * distance) / distance**2
    return np.asarray(reflectance, dtype=np.float64) * np.asarray(cos_incidence, dtype=np.float64) * spreading
