"""Sensing targets of 3GPP TR 38.901, clause 7.9.2, as Sionna RT evaluates them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError

from . import variant

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SensingTarget:
    """The points of a target.

    Attributes
    ----------
    centers : ndarray of float64, shape (num_points, 3)
        Scattering points [m], target frame.
    rcs : ndarray of float64, shape (num_views, num_points)
        Mean monostatic RCS of each point [m2].
    xpr_mean_db : float
        Mean cross-polar ratio [dB].
    dimensions : tuple of float
        Length, width, height [m].
    """

    centers: Array
    rcs: Array
    xpr_mean_db: float
    dimensions: tuple[float, ...]


def sensing_target(name: str, model_type: int, views: Array, aliases: tuple[str, ...] = ()) -> SensingTarget:
    """Return a target seen along directions.

    Parameters
    ----------
    name : str
        Of Sionna RT.
    model_type : int
        1 or 2, as in the standard.
    views : ndarray of float64, shape (num_views, 3)
        Unit vectors from the target to the radar, target frame.
    aliases : tuple of str
        Further names that the caller knows, for the error.

    Raises
    ------
    UnknownNameError
        If there is no such target.
    ParameterRangeError
        If the standard has no such model of it.
    """
    with variant.radio() as mi:
        from sionna.rt.rcs import TR38901SensingTarget
        from sionna.rt.rcs.tr38901 import OBJECT_TYPES, get_target_parameters
        from sionna.rt.utils import rotation_matrix

        if name not in OBJECT_TYPES:
            raise UnknownNameError("TR 38.901 target", name, [*OBJECT_TYPES, *aliases])
        try:
            parameters = get_target_parameters(name, model_type)
        except ValueError as error:
            raise ParameterRangeError("model_type", model_type, f"a model of '{name}'", str(error)) from None
        points = TR38901SensingTarget(name="target", object_type=name, model_type=model_type).scattering_model.spst
        centers = np.asarray(points.lcs_positions.numpy(), dtype=np.float64).T.reshape(-1, 3)
        flat = np.ascontiguousarray(views.T.astype(np.float32))
        columns = []
        for number, rcs in enumerate(points.rcs_callables):  # each has axes of its own, along which its lobe is stated
            turn = rotation_matrix(mi.Point3f(*(float(angle[number]) for angle in points.lcs_orientations)))
            outward = mi.Vector3f(turn.T @ mi.Vector3f(flat))
            columns.append(np.asarray(rcs(-outward, outward).numpy(), dtype=np.float64))
    sigma = np.stack(columns, axis=1)
    return SensingTarget(centers, sigma, float(parameters.xpr_mean_db), tuple(map(float, parameters.dimensions)))
