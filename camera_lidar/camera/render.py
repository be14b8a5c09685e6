"""RGB by path tracing with Mitsuba, through exactly the rays of the label images."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.light.glow import glow_integrator, glowing
from scarl_sionna.engine.light.haze import Haze, haze_integrator, haze_numbers
from scarl_sionna.engine.light.lamp_table import lamp_table
from scarl_sionna.engine.light.many_lamps import ShiningSurfaces, many_lamps_integrator
from scarl_sionna.engine.light.recording import LightTracer, launch
from scarl_sionna.engine.light.retroreflectors import Retroreflectors
from scarl_sionna.engine.light.windows import LitWindows
from scarl_sionna.engine.world import World, WorldState

from .denoise import denoise, denoise_darkness
from .develop import develop
from .falling import add_falling
from .ray_sensor import launch_samples, ray_table
from .shining import lamp_light
from .shutter import Band, bands, exposure_moments

ROULETTE_DEPTH = 3
"""Segments after which a light path ends at random (unbiased Russian roulette). 3 takes a quarter less time than
Mitsuba's 5 for 2 % more noise; 2 gains nothing more (docs/camera.md)."""

GUIDE_SAMPLES = 8
"""Samples of the albedo and normal images that lead the denoiser."""

DAYLIGHT_INDOORS = 2e-3
"""Share of the daylight outside by which places in tunnels and car parks ask for it; most of them see no sky."""

MOST_RAYS = 1 << 24
"""Light paths of one launch; more samples are rendered in several, so that memory stays below 2 GB."""


def render_radiance(
    state: WorldState,
    spec: CameraSpec,
    world_from_sensor: Pose,
    rng: np.random.Generator,
    sensor_twist: Twist | None = None,
) -> npt.NDArray[np.float32]:
    """Path trace the linear RGB radiance of every pixel.

    Parameters
    ----------
    state : scarl_sionna.engine.world.WorldState
    spec : CameraSpec
        `samples_per_pixel` are taken in launches of full grids (:func:`launch_samples`); `max_depth` bounds the light
        path. With an `exposure_time` the samples are shared out over `num_shutter_times` instants, with a
        `readout_time` the rows over `num_readout_bands`. `denoise` is done here.
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    rng : numpy.random.Generator
        Draws the seed of the sampler: the same generator state gives the same bytes.
    sensor_twist : Twist, optional
        Velocity of the sensor, for motion blur and a rolling shutter; default: at rest.

    Returns
    -------
    ndarray of float32, shape (height, width, 3)
        Linear RGB (sRGB primaries), in the unit of the scene's emitters; 0 outside of the lens' field.

    Notes
    -----
    Without denoiser the estimate is unbiased but for paths longer than `max_depth`. Its standard deviation falls as
    n^-1/2 with n samples inside smooth areas, and faster at edges (multi-jittered sampling); measured in
    docs/camera.md.
    """
    seed = int(rng.integers(2**32))
    traced = _Traced.black(spec)
    for number, band in enumerate(bands(state, spec, world_from_sensor, sensor_twist or Twist())):
        own = (seed + 15485863 * number) % 2**32
        traced.rows(band.rows).add(band, sensor_twist or Twist(), own, has_lamps(state))
    return traced.finished(state, spec.denoise)


@dataclass(frozen=True, eq=False)
class _Traced:
    """What is traced of an image: light without and with lamps in view apart, albedo and normals; rows are views."""

    reflected: npt.NDArray[np.float64]
    shining: npt.NDArray[np.float64]
    guides: npt.NDArray[np.float64]

    @classmethod
    def black(cls, spec: CameraSpec) -> _Traced:
        return cls(*(np.zeros((spec.height, spec.width, channels)) for channels in (3, 3, 6)))

    def rows(self, rows: slice) -> _Traced:
        return _Traced(self.reflected[rows], self.shining[rows], self.guides[rows])

    def add(self, band: Band, sensor_twist: Twist, seed: int, apart: bool) -> None:
        """Add what a band sees, the mean over the instants of its exposure."""
        spec = band.spec
        moments = exposure_moments(band.state, spec, band.pose, sensor_twist)
        count = -(-spec.samples_per_pixel // len(moments))
        guide_count = -(-min(GUIDE_SAMPLES, spec.samples_per_pixel) // len(moments))
        for number, (moment, pose) in enumerate(moments):
            view = _View(spec, pose, (seed + 7919 * number) % 2**32, count)
            traced = _trace(moment, view)
            if apart:
                seen, sampled = _shining(moment, view, 1.0 / len(moments))
                traced = np.maximum(traced - seen, 0.0)
                self.shining[:] += sampled / len(moments)
            self.reflected[:] += traced / len(moments)
            if spec.denoise:
                self.guides[:] += _guides(moment, _View(spec, pose, seed, guide_count)) / len(moments)

    def finished(self, state: WorldState, denoised: bool) -> npt.NDArray[np.float32]:
        """Return the radiance of a state's image, denoised or as traced."""
        image, apart = self.reflected.astype(np.float32), has_lamps(state)
        if not denoised:
            return (self.reflected + self.shining).astype(np.float32) if apart else image
        guides = self.guides.astype(np.float32)
        if not apart:
            return denoise(image, guides)
        # without guides is sky, which shines itself
        filled = glows(state) | (self.guides != 0.0).any(axis=-1, keepdims=True)
        kept = np.where(filled, denoise_darkness(image, guides), self.reflected)
        return np.asarray(kept + self.shining, dtype=np.float32)


def has_lamps(state: WorldState) -> bool:
    """Return whether lamps light the scene: then they are sampled by :func:`many_lamps_integrator`, and apart."""
    lighting = state.world.lighting
    if lighting is None:
        return False
    return lighting.headlamps or lighting.street_lamps or state.world.is_indoors


def glows(state: WorldState) -> bool:
    """Return whether haze scatters the light of lamps towards the camera."""
    return has_lamps(state) and _haze(state) is not None and state.world.lighting.glow  # type: ignore[union-attr] # haze is of a lighting


@dataclass(frozen=True, eq=False)
class _View:
    """One image to render.

    Through which camera, from where (world_from_sensor), with which seed and how many samples a pixel.
    """

    spec: CameraSpec
    pose: Pose
    seed: int
    samples: int


def _trace(state: WorldState, view: _View) -> npt.NDArray[np.float64]:
    """Return the mean radiance over the view's light paths a pixel, float64, shape (height, width, 3)."""
    scene, haze = state.optical_scene(), _haze(state)
    with variant.optical() as mi:
        tracer = _path_tracer(mi, view.spec.max_depth, haze)
        if has_lamps(state):
            sky_share = DAYLIGHT_INDOORS if state.world.is_indoors else 1.0
            depth, surfaces = view.spec.max_depth, _surfaces(state.world)
            integrator = many_lamps_integrator(mi, scene, depth, ROULETTE_DEPTH, surfaces, sky_share)
            if integrator is not None:
                behind = integrator if haze is None else haze_integrator(mi, integrator, haze)
                tracer = LightTracer(lambda: behind)
        traced = _launched(mi, state, tracer, view, 3)
        if haze is not None and glows(state):
            lamps = lamp_table(mi, scene)
            if lamps is not None and len(glowing(lamps)):
                glow = glow_integrator(mi, scene, lamps, haze)
                traced += _launched(mi, state, LightTracer(lambda: glow), view, 3)
        return traced


def _path_tracer(mi: ModuleType, max_depth: int, haze: Haze | None) -> LightTracer:
    """Return Mitsuba's path tracer, behind haze if there is some."""
    plain = {"type": "path", "max_depth": max_depth, "rr_depth": ROULETTE_DEPTH}
    if haze is None:
        return LightTracer(lambda: mi.load_dict(plain), ("path", max_depth, ROULETTE_DEPTH))
    return LightTracer(
        lambda: haze_integrator(mi, mi.load_dict(plain), haze),
        ("haze", max_depth, ROULETTE_DEPTH),
        haze_numbers(mi, haze),
    )


_SURFACES: WeakKeyDictionary[World, tuple[Retroreflectors, LitWindows]] = WeakKeyDictionary()


def _surfaces(world: World) -> ShiningSurfaces:
    """Return what shines in a world beside its lamps."""
    if world not in _SURFACES:
        meshes = {name: world.mesh(part) for part, name in enumerate(world.parts.name)}
        share = 0.0 if world.lighting is None else world.lighting.lit_windows
        _SURFACES[world] = Retroreflectors.of(world.parts), LitWindows.of(world.parts, meshes, share)
    return ShiningSurfaces(*_SURFACES[world], world.twin("optical").places)


def _haze(state: WorldState) -> Haze | None:
    """Return the haze before the camera; None in rooms."""
    lighting = state.world.lighting
    if lighting is None or lighting.visibility is None or state.world.is_indoors:
        return None
    return Haze.of(lighting.visibility, state.airlight)


def _shining(state: WorldState, view: _View, share: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return what sky and lamps send straight to the camera, each of shape (height, width, 3).

    Along the light paths of :func:`_trace`, and by the lamps' own sampling.
    """
    scene, haze = state.optical_scene(), _haze(state)
    haze = None if haze is None else haze._replace(airlight=np.zeros(3))
    with variant.optical() as mi:
        straight = LightTracer(_path_tracer(mi, 1, haze).make)  # lamps move and are switched: traced anew
        seen = _launched(mi, state, straight, view, 3)
        lamps = lamp_light(mi, scene, view.spec, view.pose, haze, share)
    sampled = seen.copy()
    if lamps is not None:
        sampled[lamps.pixels] = lamps.radiance
    return seen, sampled


def _launched(
    mi: ModuleType, state: WorldState, tracer: LightTracer, view: _View, channels: int
) -> npt.NDArray[np.float64]:
    """Return the mean of the last `channels` over several launches."""
    spec, seed, twin = view.spec, view.seed, state.world.twin("optical")
    state.optical_scene()  # the twin stands in the state
    rays = ray_table(spec, view.pose)
    total = np.zeros((spec.height, spec.width, channels), dtype=np.float64)
    for number, count in enumerate(launch_samples(view.samples, MOST_RAYS // (spec.width * spec.height))):
        image = launch(mi, twin, tracer, rays, count, (seed + 104729 * number) % 2**32)
        total += count / view.samples * image.astype(np.float64)[..., -channels:]
    return total


def _guides(state: WorldState, view: _View) -> npt.NDArray[np.float64]:
    """Return albedo and shading normal of what is seen first, shape (height, width, 6)."""
    with variant.optical() as mi:
        plain = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"}
        return _launched(mi, state, LightTracer(lambda: mi.load_dict(plain), "guides"), view, 6)


def render_rgb(
    state: WorldState,
    spec: CameraSpec,
    world_from_sensor: Pose,
    rng: np.random.Generator,
    sensor_twist: Twist | None = None,
) -> npt.NDArray[np.uint8]:
    """Return the 8-bit sRGB image, shape (height, width, 3).

    :func:`render_radiance`, what falls, then :func:`develop`.
    """
    radiance = render_radiance(state, spec, world_from_sensor, rng, sensor_twist)
    weather = state.world.weather
    if weather.rain_rate > 0.0 or weather.snow_rate > 0.0:
        drops = rng.spawn(1)[0]
        radiance = add_falling(radiance, state, spec, world_from_sensor, sensor_twist or Twist(), drops)
    lighting, info = state.world.lighting, state.world.document.info
    # a scene under its own lamps (tunnel, underground car park) states the exposure that suits them, whatever the sky
    # does
    exposure = float(info["exposure"]) if "exposure" in info else (1.0 if lighting is None else lighting.exposure)
    return develop(radiance, spec, rng, exposure)
