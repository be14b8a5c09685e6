"""The radar as a sensor: channel, beat signal, noise, converter, in physical order."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect_generator
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.converter import quantize
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .channel import solve_paths
from .interference.heard import hear
from .labels.labels import label_cells
from .paths import RadarPaths
from .synthesis import synthesize
from .synthesis.blocks import retraced_after, synthesize_blocks
from .weather.clutter import through_weather

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


class Radar:
    """A MIMO radar that looks at a state of the world.

    Parameters
    ----------
    spec : RadarSpec
        What the radar is.
    settings : RadarSettings, optional
        How its data are computed: channel solver, noise, blocks of chirps (whose trajectories must cover the frame),
        labels. A solver's own settings may be given, too.
    method : str, optional
        Short form of ``settings.method``.

    Raises
    ------
    InputTypeError
        If `spec` or `settings` are of another type.
    """

    settings_type = RadarSettings

    def __init__(self, spec: RadarSpec, settings: RadarSettings | None = None, method: str | None = None) -> None:
        if not isinstance(spec, RadarSpec):
            raise InputTypeError("spec", spec, "a RadarSpec", "for instance RadarSpec.preset('awr1843boost')")
        if settings is not None and not isinstance(settings, RadarSettings):
            raise InputTypeError(
                "settings", settings, "a RadarSettings", "for instance RadarSettings(method='raycast')"
            )
        self.spec = spec
        self.settings = (settings or RadarSettings()).changed(method)

    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> RadarFrame:
        """Return the raw data of one frame whose first ramp starts at the state's time.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Radar frame: x boresight, y left, z up. A bare pose stands still.
        rng : numpy.random.Generator
            Source of the receiver noise, and of the drops in the air where the weather is not clear.

        Returns
        -------
        RadarFrame
            `diagnostics` holds what the solver chose, and under ``"seconds"`` the time of each stage.

        Raises
        ------
        InputTypeError
            If `rng` is no generator.
        PlacementError
            If the radar or one of its antennas is inside a mesh.
        """
        expect_generator(rng, needed=False)
        settings, place = self.settings, state.as_mount(mount)
        solved = solve_paths(state, self.spec, place, settings=settings)
        drops = None if state.world.weather.is_clear else rng.spawn(1)[0]
        paths = through_weather(solved, state, self.spec, drops, place.twist, settings)
        start = time.perf_counter()
        noise = rng if settings.noise else None
        if settings.chirps_per_block is None:
            adc = synthesize(paths, self.spec, rng=noise, accuracy=settings.accuracy)
        else:
            paths_at = retraced_after(state.world, self.spec, place, state.time, settings, solved)
            adc = synthesize_blocks(
                lambda time: through_weather(paths_at(time), state, self.spec, None),
                self.spec,
                settings.chirps_per_block,
                rng=noise,
                accuracy=settings.accuracy,
            )
            if paths.num_paths > solved.num_paths:  # drops are traced once: they move straight
                drops_alone = paths.select(np.arange(solved.num_paths, paths.num_paths))
                adc += synthesize(drops_alone, self.spec, accuracy=settings.accuracy)
        other = hear(state, self.spec, place, settings.interferers, rng.spawn(1)[0], settings) if self._heard else None
        synthesized = time.perf_counter()
        codes, scale, num_saturated = quantize(adc if other is None else adc + other.adc, self.spec, noise)
        solve = paths.diagnostics.get("seconds", {})
        quantized = time.perf_counter()
        truth = self._truth(adc, paths, state) if settings.cell_labels else {}
        chosen = dict(paths.diagnostics)
        if other is not None:
            truth["interference_hit"] = other.hit_samples
            chosen["interferers"] = list(other.sources)
            if settings.cell_labels:
                truth["interference_power"] = other.cell_power
        seconds = {
            **(solve if isinstance(solve, Mapping) else {"solve": solve}),
            "synthesize": synthesized - start,
            "quantize": quantized - synthesized,
            "label": time.perf_counter() - quantized,
        }
        return RadarFrame(
            spec=self.spec,
            world_from_sensor=place.pose,
            adc_int=codes,
            adc_scale=scale,
            num_saturated=num_saturated,
            num_paths=paths.num_paths,
            diagnostics={**chosen, "seconds": seconds},
            **truth,
        )

    @property
    def _heard(self) -> bool:
        return len(self.settings.interferers) > 0

    def _truth(
        self, adc: npt.NDArray[np.complex64], paths: RadarPaths, state: WorldState
    ) -> dict[str, npt.NDArray[Any]]:
        """Return what fills the cells of the frame's range-Doppler map, and the power of every object."""
        labels = label_cells(range_doppler(virtual_cube(adc, self.spec), self.spec), paths, state, "sidelobes")
        power = labels.entry_share * labels.power.reshape(-1)[labels.cell]
        size = max(state.world.instances, default=0) + 1
        objects = [item.instance for item in state.boxes()]
        direct, ghost = (
            np.bincount(labels.entry_instance[rows], power[rows], size)[objects].astype(np.float64)  # of none, integers
            for rows in (~labels.entry_is_ghost, labels.entry_is_ghost)
        )
        return {
            "cell_instance": labels.instance.astype(np.uint16),
            "cell_share": np.rint(255.0 * labels.share).astype(np.uint8),
            "cell_ghost_share": np.rint(255.0 * labels.ghost_share).astype(np.uint8),
            "cell_power": labels.power,
            "object_power": direct,
            "object_ghost_power": ghost,
        }
