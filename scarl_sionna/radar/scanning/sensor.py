"""The scanning radar as a sensor: paths in blocks of its turn, beam, ramps, noise, image."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect_generator
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.scanning.spec import TWO_WAY_HALF_DB, ScanningRadarSpec
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.blocks import carried, straight_on
from scarl_sionna.radar.weather.clutter import through_weather
from scarl_sionna.signal.antenna import azimuth_elevation

from .beats import Block, block_beats
from .turn import image_of

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

MOST_FAN = math.pi
"""Widest field of view of one solve [rad]."""


class ScanningRadar:
    """A radar whose antenna turns, looking at a world that moves on meanwhile.

    Parameters
    ----------
    spec : ScanningRadarSpec
        What the radar is.
    settings : RadarSettings, optional
        How the paths are solved (any method), noise, and in `scanning` the knobs of the turn. ``raycast.num_rays`` are
        those of a turn. `cell_labels` and `chirps_per_block` have no use here.

    Raises
    ------
    InputTypeError
        If `spec` or `settings` are of another type.
    ParameterRangeError
        If the settings have interferers or several frequencies of the band, which a scanning radar does not know.
    """

    settings_type = RadarSettings

    def __init__(self, spec: ScanningRadarSpec, settings: RadarSettings | None = None) -> None:
        if not isinstance(spec, ScanningRadarSpec):
            how = "for instance ScanningRadarSpec.preset('cts350x')"
            raise InputTypeError("spec", spec, "a ScanningRadarSpec", how)
        if settings is not None and not isinstance(settings, RadarSettings):
            how = "for instance RadarSettings(method='raycast')"
            raise InputTypeError("settings", settings, "a RadarSettings", how)
        self.spec = spec
        self.settings = settings or RadarSettings()
        if self.settings.interferers:
            raise ParameterRangeError("interferers", len(self.settings.interferers), "none for a scanning radar")
        if self.settings.num_band_frequencies > 1:
            count = self.settings.num_band_frequencies
            raise ParameterRangeError("num_band_frequencies", count, "1 for a scanning radar")

    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> RadarScan:
        """Return the image of one turn whose first ramp starts at the state's time.

        Where the world's motion is not known for all of the turn, everything moves straight on from its end.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Sensor frame: x forward, y left, z up, the axis of the turn. A bare pose stands still.
        rng : numpy.random.Generator
            Source of the receiver noise, and of the drops in the air where the weather is not clear.

        Raises
        ------
        InputTypeError
            If `rng` is no generator.
        PlacementError
            If the radar is inside a mesh.
        """
        expect_generator(rng, needed=False)
        spec, settings, place = self.spec, self.settings, state.as_mount(mount)
        drops = None if state.world.weather.is_clear else rng.spawn(1)[0]
        beats = np.zeros((spec.num_azimuths, spec.waveform.num_samples), dtype=np.complex64)
        seconds = {"solve": 0.0, "synthesize": 0.0}
        num_paths = 0
        diagnostics: dict[str, Any] = {}
        clock = time.perf_counter()
        for block in self._blocks(state, place, drops):
            solved = time.perf_counter()
            beats[block.azimuths] = block_beats(block, spec, settings.scanning, settings.accuracy)
            num_paths += block.paths.num_paths
            diagnostics = diagnostics or dict(block.paths.diagnostics)
            seconds["solve"] += solved - clock
            clock = time.perf_counter()
            seconds["synthesize"] += clock - solved
        places = [self._place(state, place, float(after)) for after in spec.time]
        chosen = {**diagnostics, "num_blocks": self._num_blocks, "seconds": seconds}
        noise = rng if settings.noise else None
        return image_of(beats, spec, (place, places), noise, settings, (num_paths, chosen))

    @property
    def _num_blocks(self) -> int:
        return min(self.settings.scanning.num_blocks, self.spec.num_azimuths)

    def _blocks(self, state: WorldState, place: Mount, drops: np.random.Generator | None) -> Iterator[Block]:
        """Yield the paths of the turn's blocks, each solved in the middle of its time."""
        reach = self.spec.beam_reach(self.settings.scanning.beam_floor_db)
        reach += 0.5 * abs(self.spec.azimuth_rate) * self.spec.waveform.ramp_time
        for azimuths in np.array_split(np.arange(self.spec.num_azimuths), self._num_blocks):
            after = _known(state, float(self.spec.time[azimuths].mean()))
            here = carried(state.world, place, state.time, after)
            first, last = self.spec.azimuth[azimuths[[0, -1]]]
            width = min(abs(last - first) + 2.0 * (reach + self._sweep), 2.0 * math.pi)
            ahead = 0.5 * (first + last)
            now = state if after == 0.0 else state.world.at(state.time + after)
            yield Block(self._fan(now, here, ahead, width, drops), after, ahead, azimuths)

    @property
    def _sweep(self) -> float:
        """By how much the direction of what crosses near the radar may change within half a block [rad]."""
        return 0.5 * _FASTEST_CROSSING * self.spec.turn_time / self._num_blocks

    def _fan(
        self, state: WorldState, place: Mount, ahead: float, width: float, drops: np.random.Generator | None
    ) -> RadarPaths:
        """Return the paths into a sector [rad], in the frame whose x axis points into its middle."""
        count = math.ceil(width / MOST_FAN - 1e-9)
        part = width / count
        radar = self.spec.fan(math.degrees(part))
        resolved = radar if drops is None else self.spec.fan(math.degrees(part), resolved=True)
        common = place.pose.compose(Pose.from_heading(np.zeros(3), ahead))
        found = []
        for number in range(count):
            middle = (number + 0.5) * part - 0.5 * width
            turned = place.at(Pose.from_heading(np.zeros(3), ahead + middle))
            paths = solve_paths(state, radar, turned, settings=self._solver(part))
            rng = None if drops is None else drops.spawn(1)[0]
            paths = through_weather(paths, state, resolved, rng, place.twist, self.settings)
            azimuth = azimuth_elevation(paths.end_vectors()[0] @ paths.world_from_tx.rotation)[0]
            paths = paths.select((azimuth >= -0.5 * part) & (azimuth < 0.5 * part))
            # a turn about z changes neither theta-hat nor phi-hat, so the transfer stays
            found.append(replace(paths, world_from_tx=common, world_from_rx=common))
        whole = found[0] if count == 1 else RadarPaths.concatenate(found, found[0].diagnostics)
        return whole.select(whole.length < 2.0 * radar.max_range)

    def _solver(self, width: float) -> RadarSettings:
        """Return the settings of a solve over a sector [rad]: its share of the rays, cells finer than the beam."""
        rays = self.settings.raycast
        changes: dict[str, object] = {"num_rays": max(1, round(rays.num_rays * width / (2.0 * math.pi)))}
        beam = self.spec.beam_reach(TWO_WAY_HALF_DB)
        own = {"widest_cosine": min(rays.widest_cosine, beam), "cells_per_resolution": 1.0, "grid": "scattered"}
        changes |= {name: value for name, value in own.items() if name not in rays.model_fields_set}
        return self.settings.with_(raycast=rays.with_(**changes))

    @staticmethod
    def _place(state: WorldState, place: Mount, after: float) -> Mount:
        """Return where the sensor is and how it moves some time after the state's [s]."""
        known = _known(state, after)
        return straight_on(carried(state.world, place, state.time, known), after - known)


_FASTEST_CROSSING = 5.0
"""Directions of what is solved change by at most so much [rad/s]: 15 m/s across at 3 m."""


def _known(state: WorldState, after: float) -> float:
    """Return a time after the state's [s], or the nearest one at which the world's motion is known."""
    first, last = state.world.time_range
    return float(np.clip(after, min(first - state.time, 0.0), max(last - state.time, 0.0)))
