"""Path tracing with many lamps: at every point a lamp is chosen by the light that it may send there.

Mitsuba's path tracer picks emitters by fixed weights. With 50 lamps in a street most of its picks are lamps that are
far away, face away or shine elsewhere, and the image is noise. Here a lamp's chance at a point is its intensity towards
the point over the squared distance, as if nothing stood between; the estimate stays unbiased, whatever the chances.
What sends light back to its lamp asks once more, by the light that it may send to the eye.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device
from scarl_sionna.engine.joined import PartPlace
from scarl_sionna.engine.types import DeviceArray, MitsubaObject

from .lamp_table import BEAM, SKY, LampTable, lamp_table
from .lamps import BEAM_FOV_DEG, low_beam
from .retroreflectors import WHITE_SHEET, Retroreflectors, beads_law, observation_angle, sheet_law
from .sky import UNIT_LUMINANCE
from .windows import LitWindows, WindowTable

Array = npt.NDArray[np.float64]

PLUGIN = "scarl_many_lamps"

_LEAST_COSINE = 0.02
"""Of the angles at lamp and surface: no lamp gets the chance 0 where a part of it may be seen."""
_TABLE_SIZE = (96, 192)
"""Rows and columns of the beam's intensity over the plane before the lamp."""


class ShiningSurfaces(NamedTuple):
    """What shines by its material or place, not by an emitter: what sends light back, and lit windows."""

    retroreflectors: Retroreflectors
    windows: LitWindows
    places: Mapping[str, PartPlace]
    """Where the scene has the faces of each part."""


@lru_cache(maxsize=1)
def _beam_table() -> npt.NDArray[np.float32]:
    """Return the intensity of the low beam on the square plane at 1 m, in the scenes' unit; none of it is 0."""
    half = np.tan(np.radians(BEAM_FOV_DEG / 2.0))
    x, y = np.meshgrid(*(((np.arange(n) + 0.5) / n * 2.0 - 1.0) * half for n in _TABLE_SIZE[::-1]))
    light = low_beam(np.degrees(np.arctan(x)), np.degrees(np.arctan(y / np.sqrt(1.0 + x * x))))
    return np.asarray((light + 25.0) / UNIT_LUMINANCE, dtype=np.float32)


def beam_table(mi: ModuleType) -> MitsubaObject:
    """Return the intensity of a low beam as a texture, for :func:`beam_intensity`."""
    table = _beam_table()
    return mi.Texture2f(mi.TensorXf(Device(mi).single(table), (*table.shape, 1)))


def beam_intensity(
    mi: ModuleType, table: MitsubaObject, axis: DeviceArray, side: DeviceArray, toward: DeviceArray
) -> DeviceArray:
    """Return the intensity of a low beam, in the scenes' unit, where the lamp lies in the direction `toward`."""
    import drjit as dr

    half = float(np.tan(np.radians(BEAM_FOV_DEG / 2.0)))
    ahead = -dr.dot(axis, toward)
    up = dr.cross(axis, side)
    safe = dr.maximum(ahead, 1e-3)
    u, v = dr.dot(side, toward) / safe, -dr.dot(up, toward) / safe  # to the right, up, on the plane at 1 m
    lit = (ahead > 1e-3) & (dr.abs(u) < half) & (dr.abs(v) < half)
    return dr.select(lit, table.eval(mi.Point2f(u, v) / (2.0 * half) + 0.5, lit)[0], 0.0)


def choose_lamp(
    mi: ModuleType,
    count: DeviceArray,
    light_of: Callable[[DeviceArray], DeviceArray],
    random: DeviceArray,
    active: DeviceArray,
) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
    """Return a lamp's index, drawn by the light that each may send, this light, and the sum over all; one pass."""
    import drjit as dr

    def step(
        index: DeviceArray, total: DeviceArray, chosen: DeviceArray, light: DeviceArray, random: DeviceArray
    ) -> tuple[DeviceArray, ...]:
        value = light_of(index)
        total += value
        share = dr.select(total > 0.0, value / total, 0.0)
        take = (value > 0.0) & (random < share)
        chosen, light = dr.select(take, index, chosen), dr.select(take, value, light)
        random = dr.select(take, random / share, (random - share) / dr.maximum(1.0 - share, 1e-7))
        return index + 1, total, chosen, light, dr.clip(random, 0.0, 0.99999994)

    start = (mi.UInt32(0), mi.Float(0.0), mi.UInt32(0), mi.Float(0.0), mi.Float(random))
    _, total, chosen, light, _ = dr.while_loop(start, lambda index, *_: active & (index < count), step)
    return chosen, light, total


@lru_cache(maxsize=4)
def _plugin(mi: ModuleType, variant_name: str) -> type:
    """Define and register the integrator for the variant that runs."""
    import drjit as dr

    class ManyLampsIntegrator(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        """A path tracer with next-event estimation and multiple importance sampling, as Mitsuba's `path`."""

        def place(
            self,
            scene: MitsubaObject,
            table: LampTable,
            surfaces: ShiningSurfaces,
            max_depth: int,
            roulette_depth: int,
        ) -> None:
            """Take the lamps of a scene. All numbers are variables, so that no frame costs a compilation."""
            self._modules = mi, dr
            self._max_depth, self._roulette = dr.opaque(mi.UInt32, max_depth), dr.opaque(mi.UInt32, roulette_depth)
            self._count = dr.opaque(mi.UInt32, len(table.kind))
            on = Device(mi)
            self._kind = on.index(table.kind)
            self._center, self._axis, self._side = (on.single(v) for v in (table.center, table.axis, table.side))
            self._strength, self._radius = on.single(table.strength), on.single(table.radius)
            self._before, self._share = on.single(table.first_share), on.single(table.share)
            self._beam = beam_table(mi)
            emitters = scene.emitters_dr()
            self._emitters = dr.gather(mi.EmitterPtr, emitters, on.index(table.emitter))
            self._start, self._step, self._row = (on.index(v) for v in table.pieces)
            ids = np.array(dr.reinterpret_array(mi.UInt32, emitters), dtype=np.int64)
            index = np.zeros(int(ids.max()) + 1, dtype=np.uint32)
            index[ids] = np.arange(len(ids))
            self._index_of_id = on.index(index)
            back = surfaces.retroreflectors
            self._sheets, self._beads = (on.single(column) for column in back.columns(surfaces.places))
            self._sends_back = bool(back.sheets or back.beads)
            self._windows = WindowTable(mi, surfaces.places, surfaces.windows)

        def _chance(
            self, index: DeviceArray, point: DeviceArray, normal: DeviceArray, active: DeviceArray
        ) -> DeviceArray:
            """Return the light that a lamp may send to a point, at least; not yet divided by the sum."""
            kind = dr.gather(mi.UInt32, self._kind, index, active)
            strength = dr.gather(mi.Float, self._strength, index, active)
            radius = dr.gather(mi.Float, self._radius, index, active)
            axis, side = (dr.gather(mi.Vector3f, v, index, active) for v in (self._axis, self._side))
            way = dr.gather(mi.Point3f, self._center, index, active) - point
            squared = dr.squared_norm(way) + dr.square(radius) + 1e-4
            distance = dr.sqrt(squared)
            toward = way / distance
            cosine = dr.clip(dr.abs(dr.dot(normal, toward)) + radius / distance, _LEAST_COSINE, 1.0)
            flat = dr.norm(axis)
            spread = 0.25 * (1.0 - flat) + dr.maximum(-dr.dot(axis, toward), 0.0) + _LEAST_COSINE
            beam = beam_intensity(mi, self._beam, axis, side, toward)
            light = dr.select(kind == BEAM, beam, spread) * strength * cosine / squared
            return dr.select(kind >= SKY, strength, light)

        def _sent_back(
            self, index: DeviceArray, point: DeviceArray, eye: DeviceArray, active: DeviceArray
        ) -> DeviceArray:
            """Return how much more a sheet sends to where `eye` points for being near a lamp; never 0."""
            radius = dr.gather(mi.Float, self._radius, index, active)
            way = dr.gather(mi.Point3f, self._center, index, active) - point
            angle = observation_angle(mi, dr.normalize(way), eye)
            seen = dr.rad2deg(radius / dr.maximum(dr.norm(way), 1e-3))
            return sheet_law(mi, dr.maximum(angle - seen, 0.0)) + 1e-3

        def _choose(
            self,
            point: DeviceArray,
            normal: DeviceArray,
            random: DeviceArray,
            active: DeviceArray,
            eye: DeviceArray = None,
        ) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
            """Return a lamp's index, the light that it may send, and the sum over all lamps.

            By the light that a sheet may send to where `eye` points, where that is given.
            """

            def light_of(index: DeviceArray) -> DeviceArray:
                light = self._chance(index, point, normal, active)
                return light if eye is None else light * self._sent_back(index, point, eye, active)

            return choose_lamp(mi, self._count, light_of, random, active)

        def _lamp_met(self, emitter: DeviceArray, face: DeviceArray, active: DeviceArray) -> DeviceArray:
            """Return the row of the table for the face of an emitter."""
            number = dr.gather(mi.UInt32, self._index_of_id, dr.reinterpret_array(mi.UInt32, emitter), active)
            start, step = (dr.gather(mi.UInt32, v, number, active) for v in (self._start, self._step))
            return dr.gather(mi.UInt32, self._row, start + step * face, active)

        def _toward(
            self, chosen: DeviceArray, si: MitsubaObject, random: DeviceArray, active: DeviceArray
        ) -> tuple[MitsubaObject, DeviceArray]:
            """Return a direction to a lamp, and its radiance over the direction's density there."""
            lamp = dr.gather(mi.EmitterPtr, self._emitters, chosen, active)
            before, share = (dr.gather(mi.Float, v, chosen, active) for v in (self._before, self._share))
            toward, value = lamp.sample_direction(si, mi.Point2f(random.x, before + random.y * share), active)
            toward.pdf /= share
            return toward, value * share

        def _returned(
            self,
            scene: MitsubaObject,
            sampler: MitsubaObject,
            si: MitsubaObject,
            bsdf: DeviceArray,
            active: DeviceArray,
        ) -> DeviceArray:
            """Return the radiance that sheets, prisms and beads send back, by one lamp; not met by chance elsewhere."""
            number = dr.reinterpret_array(mi.UInt32, si.shape)
            sheet, beads = (dr.gather(mi.Float, column, number, active) for column in (self._sheets, self._beads))
            asked = active & ((sheet > 0.0) | (beads > 0.0))
            eye = si.to_world(si.wi)
            chosen, light, total = self._choose(si.p, si.n, sampler.next_1d(asked), asked, eye)
            lit = asked & (light > 0.0)
            toward, value = self._toward(chosen, si, sampler.next_2d(lit), lit)
            lit &= toward.pdf > 0.0
            lit &= dr.dot(si.n, toward.d) * dr.dot(si.n, eye) > 0.0
            lit &= ~scene.ray_test(si.spawn_ray_to(toward.p), lit)
            angle = observation_angle(mi, toward.d, eye)
            back = sheet * dr.square(dr.dot(si.n, toward.d)) * sheet_law(mi, angle) + beads * beads_law(mi, angle)
            tint = dr.minimum(bsdf.eval_diffuse_reflectance(si, lit) / WHITE_SHEET, 1.0)
            return dr.select(lit, tint * value * (back * total / light), 0.0)

        @dr.syntax  # type: ignore[misc]
        def sample(
            self,
            scene: MitsubaObject,
            sampler: MitsubaObject,
            ray: MitsubaObject,
            medium: MitsubaObject = None,
            active: DeviceArray = True,
        ) -> tuple[DeviceArray, DeviceArray, list[DeviceArray]]:
            """Return radiance, validity and no further channels."""
            mi, dr = self._modules
            context = mi.BSDFContext()
            ray = mi.Ray3f(ray)
            active = mi.Bool(active)
            valid = mi.Bool(False)
            throughput, result = mi.Color3f(1.0), mi.Color3f(0.0)
            eta, depth = mi.Float(1.0), mi.UInt32(0)
            last_point, last_normal = mi.Point3f(0.0), mi.Normal3f(0.0)
            last_pdf, last_sum, last_delta = mi.Float(1.0), mi.Float(0.0), mi.Bool(True)
            while active:
                si = scene.ray_intersect(ray, mi.RayFlags.All, depth == 0, active)
                # what the path meets shines: weighted against the chance that the lamp would have been chosen
                emitter = si.emitter(scene, active)
                start = dr.zeros(mi.Interaction3f)
                start.p = last_point
                seen = mi.DirectionSample3f(scene, si, start)
                shines = active & (emitter != None)  # noqa: E711 # compares pointers
                met = self._lamp_met(emitter, si.prim_index, shines)
                asked = shines & ~last_delta & (last_sum > 0.0)
                chance = self._chance(met, last_point, last_normal, asked) / last_sum
                chance /= dr.gather(mi.Float, self._share, met, asked)
                lamp_pdf = dr.select(asked, emitter.pdf_direction(start, seen, asked) * chance, 0.0)
                weight = dr.select(lamp_pdf > 0.0, last_pdf / (last_pdf + lamp_pdf), 1.0)
                result += dr.select(shines, throughput * weight * emitter.eval(si, shines), 0.0)
                if dr.hint(self._windows.any, mode="scalar"):
                    pane = self._windows.pane(si, active & si.is_valid())
                    if pane >= 0:
                        result += throughput * self._windows.radiance(si, pane)
                valid |= active & si.is_valid()
                active &= si.is_valid() & (depth + 1 < self._max_depth)

                # light of one lamp
                bsdf = si.bsdf(ray)
                normal = si.sh_frame.n
                lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
                chosen, light, total = self._choose(si.p, normal, sampler.next_1d(active), lit)
                lit &= light > 0.0
                toward, value = self._toward(chosen, si, sampler.next_2d(active), lit)
                lit &= toward.pdf > 0.0
                lit &= ~scene.ray_test(si.spawn_ray_to(toward.p), lit)
                share = light / total
                wo = si.to_local(toward.d)
                reflected, pdf = bsdf.eval_pdf(context, si, wo, lit)
                pdf = dr.select(toward.delta, 0.0, pdf)
                weight = toward.pdf * share / (toward.pdf * share + pdf)
                result += dr.select(lit, throughput * reflected * value * (weight / share), 0.0)

                if dr.hint(self._sends_back, mode="scalar"):
                    result += throughput * self._returned(scene, sampler, si, bsdf, active)

                # the next segment
                drawn, factor = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
                ray = si.spawn_ray(si.to_world(drawn.wo))
                last_point, last_normal = si.p, normal
                last_pdf, last_sum = drawn.pdf, total
                last_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
                throughput *= factor
                eta *= drawn.eta
                depth += 1
                strongest = dr.max(throughput)
                active &= strongest > 0.0
                stay = dr.minimum(strongest * dr.square(eta), 0.95)
                plays = depth >= self._roulette
                active &= ~plays | (sampler.next_1d(active) < stay)
                throughput *= dr.select(plays, dr.rcp(dr.maximum(stay, 1e-12)), 1.0)
            return result, valid, []

    mi.register_integrator(PLUGIN, ManyLampsIntegrator)
    return ManyLampsIntegrator


def many_lamps_integrator(
    mi: ModuleType,
    scene: MitsubaObject,
    max_depth: int,
    roulette_depth: int,
    surfaces: ShiningSurfaces,
    sky_share: float = 1.0,
) -> MitsubaObject | None:
    """Return the integrator for a scene in its present state, or None where it has emitters of other kinds.

    Inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    scene : mitsuba.Scene
    max_depth : int
        Longest light path [segments].
    roulette_depth : int
        Segments after which a light path ends at random.
    surfaces : ShiningSurfaces
        What sends the light of lamps back to them, and lit windows.
    sky_share : float
        Of the sky's and the sun's light, how much may reach a point: their chance, not their light.
    """
    table = lamp_table(mi, scene)
    if table is None:
        return None
    table = table._replace(strength=np.where(table.kind >= SKY, sky_share, 1.0) * table.strength)
    _plugin(mi, mi.variant())
    integrator: Any = mi.load_dict({"type": PLUGIN})
    integrator.place(scene, table, surfaces, max_depth, roulette_depth)
    return integrator
