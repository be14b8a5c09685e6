"""Sensing targets of 3GPP TR 38.901 as scattering centres, by Sionna RT's implementation of clause 7.9.2."""

from __future__ import annotations

from typing import Any

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.engine.sensing_targets import sensing_target

from .table import AspectTable, direction_of

ASPECT_STEP_DEG = 2.0
"""Step of the table [deg]: the narrowest lobe is 4.9 deg wide, 12 (x / w)^2 dB; linear interpolation is then within 0.3
dB down to 20 dB below its peak."""
POINT_DISTANCE = 5.0
"""A target stands for its body farther than this many of its largest dimension: it then fills less than 0.2 rad."""
ALIASES = {"car": "vehicle-multi-sp", "pedestrian": "human"}


def tr38901_fields(object_type: str, frequency: float, model_type: int = 2) -> dict[str, Any]:
    """Return the mean monostatic model of a target: no random draws, real and positive co-polar amplitudes.

    Parameters
    ----------
    object_type : str
        Of Sionna RT ("human", "vehicle-single-sp", "vehicle-multi-sp", "agv-single-sp", ...), or "car", "pedestrian".
    frequency : float
        [Hz]. The standard's numbers do not depend on it (0.5 to 100 GHz).
    model_type : int
        2: with lobes; 1: the same from all sides ("human", "uav-small-size").

    Returns
    -------
    dict
        Fields of a :class:`~scarl_sionna.radar.scatterers.model.ScattererModel`. Origin of the body frame: centre of
        the target, x forward.

    Raises
    ------
    UnknownNameError
        If there is no such target.
    ParameterRangeError
        If the standard has no such model of it, or the frequency is outside.

    References
    ----------
    .. [1] 3GPP TR 38.901 v19, clause 7.9.2, Tables 7.9.2.1-1 to 7.9.2.1-7, 7.9.2.2-1.
    """
    if not 0.5e9 <= frequency <= 100e9:
        raise ParameterRangeError("frequency", f"{frequency / 1e9:g} GHz", "0.5 to 100 GHz, the range of TR 38.901")
    name = ALIASES.get(object_type, object_type)
    azimuth = np.radians(np.arange(-180.0, 180.0, ASPECT_STEP_DEG))
    elevation = np.radians(np.arange(-90.0, 90.0 + ASPECT_STEP_DEG / 2.0, ASPECT_STEP_DEG))
    view = direction_of(azimuth[None, :], elevation[:, None])
    target = sensing_target(name, model_type, view.reshape(-1, 3), aliases=tuple(ALIASES))
    centers, sigma = target.centers, target.rcs
    cross = 10.0 ** (-target.xpr_mean_db / 20.0)
    pattern = np.array([[1.0, cross], [cross, 1.0]])
    amplitude = np.sqrt(sigma / (4.0 * np.pi))[:, :, None, None] * pattern
    return dict(
        centers=centers,
        azimuth=azimuth,
        elevation=elevation,
        amplitude=AspectTable.dense(amplitude.reshape(len(elevation), len(azimuth), len(centers), 2, 2)),
        frequency=float(frequency),
        cell=float(max(target.dimensions)),
        nearest_distance=POINT_DISTANCE * float(max(target.dimensions)),
        provenance={
            "source": "3GPP TR 38.901 v19 clause 7.9.2 by Sionna RT",
            "object_type": name,
            "model_type": model_type,
            "random_components": "none: sigma_S = 1, XPR at its mean, phases zero",
        },
    )
