"""Haze, fog and rain between the camera and what it sees: a path tracer whose first segment is attenuated."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.types import DeviceArray, MitsubaObject

PLUGIN = "scarl_haze"

CONTRAST_AT_VISIBILITY = 3.0
"""Extinction coefficient times meteorological range: exp(-3) = 5 % of the contrast is left (WMO-No. 8, vol. I, chapter
9)."""
LAYER_HEIGHT = 400.0
"""Thickness of the haze [m]: a ray into the sky leaves it there."""


class Haze(NamedTuple):
    """Extinction coefficient [1/m] and radiance of haze without end, shape (3,), in the unit of the scenes."""

    extinction: Any
    airlight: Any

    @classmethod
    def of(cls, visibility: float, airlight: npt.ArrayLike) -> Haze:
        """Return the haze of a meteorological range [m]."""
        return cls(CONTRAST_AT_VISIBILITY / visibility, np.asarray(airlight, dtype=np.float64))

    @staticmethod
    def way_out(ray: MitsubaObject) -> DeviceArray:
        """Return how far rays go inside of the layer [m]."""
        import drjit as dr

        return dr.maximum((LAYER_HEIGHT - ray.o.z) / dr.maximum(ray.d.z, 1e-4), 0.0)

    def transmittance(self, ray: MitsubaObject, is_hit: DeviceArray, distance: DeviceArray) -> DeviceArray:
        """Return the share of the light that comes through along rays, to what they hit or out of the layer."""
        import drjit as dr

        out = self.way_out(ray)
        length = dr.select(is_hit, dr.minimum(distance, out), out)
        return dr.exp(-self.extinction * length)


@lru_cache(maxsize=4)
def _plugin(mi: ModuleType, variant_name: str) -> type:
    """Define and register the integrator for the variant that runs."""

    class HazeIntegrator(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        """L = T L0 + (1 - T) A along the camera's ray, T = exp(-extinction * distance)."""

        def place(self, inner: MitsubaObject, extinction: float, airlight: npt.ArrayLike) -> None:
            """Take the integrator behind the haze, the extinction coefficient [1/m] and the haze's radiance."""
            self._inner = inner
            self.take(*haze_numbers(mi, Haze(extinction, airlight)))

        def take(self, extinction: DeviceArray, airlight: DeviceArray) -> None:
            """Take another haze."""
            self._extinction, self._airlight = extinction, airlight

        def sample(
            self,
            scene: MitsubaObject,
            sampler: MitsubaObject,
            ray: MitsubaObject,
            medium: MitsubaObject = None,
            active: DeviceArray = True,
        ) -> tuple[DeviceArray, DeviceArray, list[DeviceArray]]:
            """Return radiance, validity and no further channels."""
            hit = scene.ray_intersect_preliminary(mi.Ray3f(ray), coherent=True, active=active)
            radiance, valid, aovs = self._inner.sample(scene, sampler, ray, medium, active)
            transmittance = Haze(self._extinction, self._airlight).transmittance(ray, hit.is_valid(), hit.t)
            return radiance * transmittance + self._airlight * (1.0 - transmittance), valid, aovs

    mi.register_integrator(PLUGIN, HazeIntegrator)
    return HazeIntegrator


def haze_numbers(mi: ModuleType, haze: Haze) -> tuple[DeviceArray, ...]:
    """Return extinction coefficient and airlight as the integrator takes them."""
    import drjit as dr

    airlight = (dr.opaque(mi.Float, float(value)) for value in np.asarray(haze.airlight))
    return dr.opaque(mi.Float, float(haze.extinction)), mi.Color3f(*airlight)


def haze_integrator(mi: ModuleType, inner: MitsubaObject, haze: Haze) -> MitsubaObject:
    """Return an integrator that sees `inner` through haze; inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    inner : mitsuba.SamplingIntegrator
    haze : Haze

    Notes
    -----
    H. Koschmieder, "Theorie der horizontalen Sichtweite", 1924: homogeneous haze of the brightness of the horizon.
    Light is attenuated between camera and surface only; what the haze scatters of lamps is in :mod:`.glow`.
    """
    _plugin(mi, mi.variant())
    integrator = mi.load_dict({"type": PLUGIN})
    integrator.place(inner, *haze)
    return integrator
