"""A radar without raw data as a sensor: channel, map, noise."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect_generator
from scarl_sionna.core.results import ClosedRadarFrame
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.closed.device import ClosedRadarSpec
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.weather.clutter import through_weather

from .maps import map_of_paths

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


class ClosedRadar:
    """A radar without raw data that looks at a state of the world.

    Parameters
    ----------
    spec : ClosedRadarSpec
        What the device is.
    settings : RadarSettings, optional
        How paths are found, and whether there is noise. What needs raw data is refused: other radars, labels of cells,
        and blocks of chirps.

    Raises
    ------
    InputTypeError
        If `spec` or `settings` are of another type.
    ParameterRangeError
        If the settings ask for what needs raw data.
    """

    settings_type = RadarSettings

    def __init__(self, spec: ClosedRadarSpec, settings: RadarSettings | None = None) -> None:
        if not isinstance(spec, ClosedRadarSpec):
            raise InputTypeError("spec", spec, "a ClosedRadarSpec")
        if settings is not None and not isinstance(settings, RadarSettings):
            raise InputTypeError("settings", settings, "a RadarSettings")
        self.spec, self.settings = spec, settings or RadarSettings()
        for name, asked in (
            ("interferers", bool(self.settings.interferers)),
            ("chirps_per_block", self.settings.chirps_per_block is not None),
        ):
            if asked:
                value = getattr(self.settings, name)
                raise ParameterRangeError(f"settings.{name}", value, "none", "a radar without raw data has no chirps")

    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> ClosedRadarFrame:
        """Return the map of one frame that starts at the state's time.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Radar frame: x boresight, y left, z up. A bare pose stands still.
        rng : numpy.random.Generator
            Source of the noise, and of the drops in the air where the weather is not clear.

        Raises
        ------
        InputTypeError
            If `rng` is no generator.
        PlacementError
            If the radar is inside a mesh.
        """
        expect_generator(rng, needed=False)
        settings, radar, place = self.settings, self.spec.radar, state.as_mount(mount)
        paths = solve_paths(state, radar, place, settings=settings)
        drops = None if state.world.weather.is_clear else rng.spawn(1)[0]
        paths = through_weather(paths, state, radar, drops, place.twist, settings)
        start = time.perf_counter()
        rda = map_of_paths(paths, self.spec, rng if settings.noise else None)
        solve = paths.diagnostics.get("seconds", {})
        seconds = {**(solve if isinstance(solve, Mapping) else {"solve": solve}), "map": time.perf_counter() - start}
        return ClosedRadarFrame(
            spec=self.spec,
            world_from_sensor=place.pose,
            power=rda.data,
            num_paths=paths.num_paths,
            diagnostics={**paths.diagnostics, "seconds": seconds},
        )
