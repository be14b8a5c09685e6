"""Light of lamps that haze scatters towards the camera: glows around lamps, and the beams of headlamps."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar_ratio import FOG_LIDAR_RATIO
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import DeviceArray, MitsubaObject

from .haze import Haze
from .lamp_table import SURFACE, LampTable
from .many_lamps import beam_intensity, beam_table, choose_lamp

PLUGIN = "scarl_glow"

ASYMMETRY = 0.85
"""Mean cosine of the angle by which droplets of fog turn visible light."""
_BACKWARD = -0.8
"""Mean cosine of the lobe that goes back: as narrow as it can be while the sum has both moments below."""
_FURTHEST = 8.0
"""Optical depth beyond which no air is looked at: 3e-4 of the light would come through."""
_LEAST = 0.02
"""Share of a lamp's strength by which it is chosen also where its beam does not point."""


def phase_shares() -> tuple[float, float]:
    """Return the share of the forward lobe, and its mean cosine.

    Two lobes of Henyey and Greenstein [1]_ with the mean cosine of droplets and, straight back, the inverse of their
    lidar ratio.

    References
    ----------
    .. [1] L. G. Henyey, J. L. Greenstein, "Diffuse radiation in the Galaxy", Astrophysical Journal 93, 1941.
    """
    straight_back = 1.0 / FOG_LIDAR_RATIO
    lobe = (1.0 + _BACKWARD) ** -2 * (1.0 - _BACKWARD) / (4.0 * np.pi)
    share, mean = 1.0, ASYMMETRY
    for _ in range(30):  # the forward lobe sends a little back itself
        rest = straight_back - share * (1.0 - mean) / (4.0 * np.pi * (1.0 + mean) ** 2)
        share = 1.0 - rest / lobe
        mean = (ASYMMETRY - (1.0 - share) * _BACKWARD) / share
    return float(share), float(mean)


def scattered_share(dr: ModuleType, cosine: DeviceArray) -> DeviceArray:
    """Return the share of the scattered light a steradian that droplets send where it turns by an angle [1/sr]."""
    share, mean = phase_shares()
    total = 0.0
    for weight, g in ((share, mean), (1.0 - share, _BACKWARD)):
        total += weight * (1.0 - g * g) / (4.0 * np.pi) * dr.power(1.0 + g * g - 2.0 * g * cosine, -1.5)
    return total


@lru_cache(maxsize=4)
def _plugin(mi: ModuleType, variant_name: str) -> type:
    """Define and register the integrator for the variant that runs."""
    import drjit as dr

    class GlowIntegrator(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        """Single scattering of lamps along the camera's ray: one lamp and one place of the ray a sample."""

        def place(self, scene: MitsubaObject, table: LampTable, extinction: float) -> None:
            """Take the lamps of a scene and the haze's extinction coefficient [1/m]."""
            lamps, on = glowing(table), Device(mi)
            self._count = dr.opaque(mi.UInt32, len(lamps))
            self._extinction = dr.opaque(mi.Float, float(extinction))
            self._is_surface = on.mask(table.kind[lamps] == SURFACE)
            self._center, self._axis, self._side = (on.single(v[lamps]) for v in (table.center, table.axis, table.side))
            self._strength, self._radius = (on.single(v[lamps]) for v in (table.strength, table.radius))
            self._beam = beam_table(mi)
            emitters = scene.emitters_dr()
            self._emitters = dr.gather(mi.EmitterPtr, emitters, on.index(table.emitter[lamps]))
            self._before, self._share = (on.single(v[lamps]) for v in (table.first_share, table.share))

        def _stretch(
            self, index: DeviceArray, ray: MitsubaObject, length: DeviceArray
        ) -> tuple[DeviceArray, DeviceArray, DeviceArray, DeviceArray]:
            """Return where a ray is nearest to a lamp, how near, and the lamp's angles to its beginning and end."""
            way = dr.gather(mi.Point3f, self._center, index) - ray.o
            nearest = dr.dot(way, ray.d)
            radius = dr.gather(mi.Float, self._radius, index)
            near = dr.sqrt(dr.maximum(dr.squared_norm(way) - dr.square(nearest), 0.0) + dr.square(radius) + 1e-4)
            return nearest, near, dr.atan(-nearest / near), dr.atan((length - nearest) / near)

        def _light(self, index: DeviceArray, ray: MitsubaObject, length: DeviceArray) -> DeviceArray:
            """Return the light that a lamp may send to the ray, at least."""
            nearest, near, low, high = self._stretch(index, ray, length)
            strength = dr.gather(mi.Float, self._strength, index)
            axis, side = (dr.gather(mi.Vector3f, v, index) for v in (self._axis, self._side))
            center = dr.gather(mi.Point3f, self._center, index)
            beam = mi.Float(0.0)
            for part in (0.1, 0.35, 0.65, 0.9):
                point = ray(nearest + near * dr.tan(low + part * (high - low)))
                beam += 0.25 * beam_intensity(mi, self._beam, axis, side, dr.normalize(center - point))
            toward = dr.select(dr.gather(mi.Bool, self._is_surface, index), 1.0, beam + _LEAST)
            dimmed = dr.exp(-self._extinction * (dr.clip(nearest, 0.0, length) + near))
            return strength * toward * dimmed * (high - low) / near

        def sample(
            self,
            scene: MitsubaObject,
            sampler: MitsubaObject,
            ray: MitsubaObject,
            medium: MitsubaObject = None,
            active: DeviceArray = True,
        ) -> tuple[DeviceArray, DeviceArray, list[DeviceArray]]:
            """Return radiance, validity and no further channels."""
            ray = mi.Ray3f(ray)
            hit = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
            reach = dr.minimum(_FURTHEST / self._extinction, Haze.way_out(ray))
            length = dr.minimum(dr.select(hit.is_valid(), hit.t, reach), reach)
            chosen, light, total = choose_lamp(
                mi, self._count, lambda index: self._light(index, ray, length), sampler.next_1d(), mi.Bool(active)
            )
            nearest, near, low, high = self._stretch(chosen, ray, length)
            distance = dr.clip(nearest + near * dr.tan(low + sampler.next_1d() * (high - low)), 0.0, length)
            pdf = near / ((high - low) * (dr.square(near) + dr.square(distance - nearest))) * light / total
            lit = mi.Bool(active) & (light > 0.0) & (pdf > 0.0)
            air = dr.zeros(mi.Interaction3f, dr.width(ray.o))
            air.p, air.t, air.wavelengths = ray(distance), distance, ray.wavelengths
            lamp = dr.gather(mi.EmitterPtr, self._emitters, chosen, lit)
            before, share = (dr.gather(mi.Float, v, chosen, lit) for v in (self._before, self._share))
            where = sampler.next_2d(lit)
            toward, value = lamp.sample_direction(air, mi.Point2f(where.x, before + where.y * share), lit)
            lit &= toward.pdf > 0.0
            lit &= ~scene.ray_test(air.spawn_ray_to(toward.p), lit)
            through = dr.exp(-self._extinction * (distance + toward.dist))
            turned = scattered_share(dr, dr.dot(-toward.d, -ray.d))
            return dr.select(lit, value * (share * self._extinction * turned * through / pdf), 0.0), mi.Bool(active), []

    mi.register_integrator(PLUGIN, GlowIntegrator)
    return GlowIntegrator


def glowing(table: LampTable) -> npt.NDArray[np.int64]:
    """Return the rows of the lamps whose light is followed through haze; without any there is nothing to render."""
    return np.flatnonzero((table.kind <= 1) & (table.strength > 0.0))


def glow_integrator(mi: ModuleType, scene: MitsubaObject, table: LampTable, haze: Haze) -> MitsubaObject:
    r"""Return an integrator of the light of lamps that haze scatters once; inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    scene : mitsuba.Scene
    table : LampTable
        Of :func:`.many_lamps.lamp_table`. Sky and sun are left out: their scattered light is the haze's own.
    haze : Haze

    Notes
    -----
    Along the ray, :math:`\int \sigma\, p(\theta)\, e^{-\sigma (t + d)} L\, d\Omega\, dt` with the extinction
    :math:`\sigma`, all of which scatters, the droplets' phase function p, the distance d to the lamp and its radiance
    L. A place of the ray is drawn by equal angles at the lamp [1]_, which takes out the square of d.

    References
    ----------
    .. [1] C. Kulla, M. Fajardo, "Importance sampling techniques for path tracing in participating media", Computer
           Graphics Forum 31(4), 2012.
    """
    _plugin(mi, mi.variant())
    integrator: Any = mi.load_dict({"type": PLUGIN})
    integrator.place(scene, table, haze.extinction)
    return integrator
