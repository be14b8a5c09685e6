"""The lidar as a sensor of the rig."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect_generator
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver, PulsedReceiver, ScarlReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.light.sky import daylight_share
from scarl_sionna.engine.rays.placement import check_placement
from scarl_sionna.engine.rays.shelter import is_under_cover
from scarl_sionna.engine.spray import SprayCloud, spray_clouds
from scarl_sionna.engine.threads import few_threads
from scarl_sionna.engine.world import World, WorldState
from scarl_sionna.scene.tables import PartTable

from .detections import NO_ECHO, Detections
from .heterodyne import estimate_beats, receive_heterodyne, synthesize_beats
from .heterodyne.air import AirPeaks
from .heterodyne.spray import spray_peaks
from .motion import Motion, sensor_motion, shot_rays, to_timestamp
from .pattern import shot_directions, shot_times
from .photons import sun_irradiance
from .pulsed import density_of_shots, estimate_waveforms, receive_pulsed, spray_cells, synthesize_waveforms
from .receiver import Slots, receive
from .returns import MIRRORED, Cast, Echoes, Shots, gather, join, nearest_of, place_in_group, trace
from .rolling import RollingCaster
from .spray import FreePaths, dim_echoes

Array = npt.NDArray[np.float64]

RAYS_AT_ONCE = 1 << 20
"""Rays that are traced at once: about 300 MB of temporary arrays."""


class Lidar:
    """A scanning lidar, coherent or pulsed.

    Parameters
    ----------
    spec : LidarSpec
    """

    def __init__(self, spec: LidarSpec) -> None:
        self.spec = spec

    @few_threads()
    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> LidarScan:
        """Return the scan that begins at the state's time: one row a detected return.

        The air is that of the spec's own `atmosphere`; where that is clear, the world's weather with the spec's
        `lidar_ratio`, without rain and snow for a lidar under cover
        (:func:`~scarl_sionna.engine.rays.shelter.is_under_cover`).

        Sunlight on what a pulsed receiver sees is its `solar_irradiance`; where that is None, the daylight of the
        world's lighting (:func:`~scarl_sionna.engine.light.sky.daylight_share` of the sun above the air), none indoors,
        and the sun above the air in a world without a lighting.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Sensor frame (x forward, y left, z up) at the state's time; its velocity enters the radial velocity and the
            motion during the scan.
        rng : numpy.random.Generator
            All randomness of the receiver; the moments stand at :func:`camera_lidar.lidar.receiver.receive`,
            :func:`camera_lidar.lidar.heterodyne.receive_heterodyne` and
            :func:`camera_lidar.lidar.pulsed.receive_pulsed`.

        Raises
        ------
        InputTypeError
            If `rng` is no generator.
        PlacementError
            If the lidar is inside a closed mesh.
        """
        expect_generator(rng)
        place, spec = state.as_mount(mount), self._in_daylight(state.world)
        check_placement(state, place.pose.position, "lidar")
        weather = state.world.weather
        if not weather.is_clear and spec.atmosphere.is_clear:
            air = weather.atmosphere.with_(lidar_ratio=spec.atmosphere.lidar_ratio)
            if (air.rain_rate or air.snow_rate) and is_under_cover(state, place.pose.position):
                air = air.with_(rain_rate=0.0, snow_rate=0.0)
            spec = spec.with_(atmosphere=air)
        if spec is self.spec:
            return self._observe(state, place, rng)
        return replace(Lidar(spec)._observe(state, place, rng), spec=self.spec)

    def _in_daylight(self, world: World) -> LidarSpec:
        """Return the lidar with the sunlight of a world on what it sees, where its receiver does not state one."""
        receiver = self.spec.receiver
        if not isinstance(receiver, PulsedReceiver) or receiver.solar_irradiance is not None or world.lighting is None:
            return self.spec
        share = 0.0 if world.is_indoors else daylight_share(world.lighting)
        light = receiver.with_(solar_irradiance=share * sun_irradiance(self.spec.wavelength))
        return self.spec.with_(receiver=light)

    def _observe(self, state: WorldState, mount: Mount, rng: np.random.Generator) -> LidarScan:
        spec, parts = self.spec, state.world.parts
        times = shot_times(spec)
        motion = sensor_motion(state, mount.pose, mount.twist, float(times.max()))
        origins, directions = shot_rays(motion, shot_directions(spec), times)
        still = len(motion.times) == 1 or bool(np.all(motion.linear == motion.linear[0]))
        velocity = motion.linear[0] if still else motion.linear_at(times)
        shots = Shots(np.arange(spec.num_shots), origins, directions, velocity)
        clouds = spray_clouds(state)
        echoes = dim_echoes(self._trace(state, _caster(state, motion, times), shots), clouds, origins, directions)
        returns = gather(spec, echoes)
        wind = np.array([*state.world.weather.wind, 0.0])
        if isinstance(spec.receiver, PulsedReceiver):
            found, waveform = self._receive_pulses(echoes, returns, shots, clouds, parts, rng)
            return replace(self._scan(mount.pose, motion, parts, returns, found), waveform=waveform)
        found, beats = self._receive(echoes, returns, shots, clouds, wind, rng)
        return replace(self._scan(mount.pose, motion, parts, returns, found), beat_signal=beats)

    def _trace(self, state: WorldState, cast: Cast, shots: Shots) -> Echoes:
        spec = self.spec
        step = max(RAYS_AT_ONCE // spec.sub_rays, 1)
        blocks = []
        for first in range(0, spec.num_shots, step):
            some = shots.select(np.arange(first, min(first + step, spec.num_shots)))
            blocks.append(trace(spec, state.world.parts, cast, some))
        return join(blocks) if len(blocks) > 1 else blocks[0]

    def _receive(
        self,
        echoes: Echoes,
        returns: Echoes,
        shots: Shots,
        clouds: tuple[SprayCloud, ...],
        wind: Array,
        rng: np.random.Generator,
    ) -> tuple[Detections, npt.NDArray[np.complex64] | None]:
        spec, receiver = self.spec, self.spec.receiver
        if isinstance(receiver, ScarlReceiver):
            slot = returns.shot * spec.max_returns + place_in_group(returns.shot)
            slots = Slots(spec.num_shots * spec.max_returns, slot)
            measured = receive(receiver, slots, returns, rng)
            kept = measured.kept
            none = np.full(len(kept), np.nan)
            return Detections(
                returns.shot[kept], kept, measured.distance, measured.radial_velocity, none, returns.intensity[kept]
            ), None
        assert isinstance(receiver, HeterodyneReceiver)
        air_velocity = -np.einsum(
            "...j,...j->...", np.broadcast_to(shots.velocity - wind, shots.directions.shape), shots.directions
        )
        if receiver.raw_signal:
            beats = synthesize_beats(spec, echoes, air_velocity, rng)
            return estimate_beats(spec, beats, returns), beats
        spray: list[AirPeaks] = []
        if clouds:
            spray = spray_peaks(spec, clouds, self._free_paths(echoes, shots, air_velocity), rng.spawn(1)[0])
        return receive_heterodyne(spec, returns, air_velocity, rng, spray), None

    def _receive_pulses(
        self,
        echoes: Echoes,
        returns: Echoes,
        shots: Shots,
        clouds: tuple[SprayCloud, ...],
        parts: PartTable,
        rng: np.random.Generator,
    ) -> tuple[Detections, npt.NDArray[np.float32] | None]:
        spec, receiver = self.spec, self.spec.receiver
        assert isinstance(receiver, PulsedReceiver)
        density = density_of_shots(spec, returns, parts.lidar_reflectance)
        still = np.zeros(spec.num_shots)  # a pulse does not tell how the drops move
        spray = spray_cells(spec, clouds, self._free_paths(echoes, shots, still)) if clouds else ()
        if receiver.raw_signal:
            waveform = synthesize_waveforms(spec, echoes, density, rng, spray)
            return estimate_waveforms(spec, waveform, density, returns), waveform
        return receive_pulsed(spec, returns, density, rng, spray), None

    def _free_paths(self, echoes: Echoes, shots: Shots, air_velocity: Array) -> FreePaths:
        nearest = nearest_of(self.spec.num_shots, echoes.shot, echoes.distance)
        return FreePaths(shots.origins, shots.directions, air_velocity, nearest)

    def _scan(
        self,
        world_from_sensor: Pose,
        motion: Motion,
        parts: PartTable,
        returns: Echoes,
        found: Detections,
    ) -> LidarScan:
        spec = self.spec
        surface = found.echo != NO_ECHO
        surface[surface] = returns.part[found.echo[surface]] != MIRRORED
        echo = found.echo if surface.all() else found.echo[surface]
        part = returns.part[echo]

        def of_surface(values: npt.NDArray[Any], kind: type) -> npt.NDArray[Any]:
            if len(echo) == len(surface):
                return values.astype(kind)
            out = np.zeros((len(surface), *values.shape[1:]), dtype=kind)
            out[surface] = values
            return out

        times = shot_times(spec)[found.shot]
        position = shot_directions(spec)[found.shot] * found.distance[:, None]
        normal = motion.rotate_back(times[surface], returns.normal[echo])
        normal = of_surface(normal, np.float64)
        if spec.deskew and len(motion.times) > 1:
            position, normal = to_timestamp(motion, times, position, normal)
        return LidarScan(
            spec=spec,
            world_from_sensor=world_from_sensor,
            shot=found.shot.astype(np.int32),
            position=position.astype(np.float32),
            distance=found.distance.astype(np.float32),
            radial_velocity=found.radial_velocity.astype(np.float32),
            intensity=found.intensity.astype(np.float32),
            cos_incidence=of_surface(returns.cos_incidence[echo], np.float32),
            normal=normal.astype(np.float32),
            semantic=of_surface(parts.semantic[part], np.uint8),
            instance=of_surface(parts.instance[part], np.uint16),
            time=times.astype(np.float32),
            return_index=place_in_group(found.shot).astype(np.uint8),
            reflectance=of_surface(parts.lidar_reflectance[part], np.float32),
            cnr=found.cnr.astype(np.float32),
        )


def _caster(state: WorldState, motion: Motion, times: Array) -> Cast:
    """Return what intersects rays with the world, each at the time of its shot."""
    duration = float(times.max())
    if duration == 0.0:
        return lambda origins, directions, shots, distance, first: state.cast(
            origins, directions, max_distance=distance
        )
    rolling = RollingCaster(state, duration, motion)
    return lambda origins, directions, shots, distance, first: rolling.cast(
        origins, directions, times[shots], distance, first
    )
