"""RCS of a mesh with the ray tubes held fixed.

Traced once, surface coefficients evaluated again for each trial material.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.optics.body.parts import check_size, load_body, surface_of
from scarl_sionna.radar.optics.plane_waves import Looks
from scarl_sionna.radar.optics.replay import FixedTubes
from scarl_sionna.radar.optics.surfaces import PartSurfaces
from scarl_sionna.scene.materials.table import MaterialTable

from .physics import TrialMaterial
from .spec import MeshRcs

Complex = npt.NDArray[np.complex128]


def mesh_field(measurement: MeshRcs, table: MaterialTable) -> Callable[[Mapping[str, TrialMaterial]], Complex]:
    r"""Return the model of a mesh.

    From trial materials to :math:`\sqrt{4 \pi} S` [m], whose squared magnitude is the RCS.

    Raises
    ------
    MeshError
        If the mesh cannot be used.
    UnknownMaterialError, MaterialRangeError
        If the material is unknown, or has no data at the frequency.
    """
    base = table[measurement.material]
    body = load_body(measurement.mesh)
    check_size(body, measurement.frequency)
    count = max(len(measurement.values), np.size(measurement.theta_deg), np.size(measurement.phi_deg))
    theta, phi = (np.broadcast_to(np.radians(a), (count,)) for a in (measurement.theta_deg, measurement.phi_deg))
    looks = Looks(np.full(count, measurement.frequency), theta, phi, theta, phi)
    as_given = PartSurfaces((surface_of(base, measurement.frequency),))
    tubes = FixedTubes.trace(body, looks, rounded=as_given.rounded)
    receive, transmit = ("VH".index(letter) for letter in measurement.polarization)

    def field(materials: Mapping[str, TrialMaterial]) -> Complex:
        trial = materials.get(measurement.material) or TrialMaterial.of(base, {})
        surfaces = PartSurfaces((surface_of(trial.as_radio(), measurement.frequency),))
        return np.sqrt(4.0 * np.pi) * tubes.matrices(surfaces)[:, receive, transmit]

    return field
