"""The radar as a sensor: channel, beat signal, noise, converter, in physical order."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.converter import quantize
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .channel import solve_paths
from .labels.labels import label_cells
from .paths import RadarPaths
from .synthesis import synthesize
from .synthesis.blocks import retraced, synthesize_blocks
from .weather.clutter import through_weather

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


class Radar:
    """A MIMO FMCW radar that looks at a state of the world.

    Parameters
    ----------
    spec : RadarSpec
    method : str
        Channel solver, see :func:`scarl_sionna.radar.channel.solve_paths`.
    noise : bool
        False leaves the receiver's thermal noise out: the ideal sensor.
    solver_options : mapping, optional
        Options of the solver, for instance ``{"hits_per_cell": None}``.
    chirps_per_block : int, optional
        The paths are solved again in the middle of every block of so many chirps, for wheels and limbs, see
        :func:`scarl_sionna.radar.synthesis.blocks.synthesize_blocks`; once a frame if left out. The trajectories must cover
        the frame.
    """

    def __init__(
        self,
        spec: RadarSpec,
        method: str = "auto",
        noise: bool = True,
        solver_options: Mapping[str, Any] | None = None,
        chirps_per_block: int | None = None,
    ) -> None:
        self.spec = spec
        self.method = method
        self.noise = noise
        self.solver_options = dict(solver_options or {})
        self.chirps_per_block = chirps_per_block

    def observe(
        self, state: WorldState, world_from_sensor: Pose, sensor_twist: Twist, seed_generator: np.random.Generator
    ) -> RadarFrame:
        """Return the raw data of one frame whose first ramp starts at the state's time.

        Parameters
        ----------
        state : WorldState
        world_from_sensor : Pose
            Radar frame: x boresight, y left, z up.
        sensor_twist : Twist
            Velocity of the radar, world axes.
        seed_generator : numpy.random.Generator
            Source of the receiver noise, and of the drops in the air where the weather is not clear.

        Returns
        -------
        RadarFrame
            `diagnostics` holds what the solver chose, and under ``"seconds"`` the time of each stage.

        Raises
        ------
        PlacementError
            If the radar or one of its antennas is inside a mesh.
        """
        options = {"radar_twist": sensor_twist, **self.solver_options}
        paths = solve_paths(state, self.spec, world_from_sensor, self.method, **options)
        drops = None if state.world.weather.is_clear else seed_generator.spawn(1)[0]
        alone, paths = paths, through_weather(paths, state, self.spec, drops, sensor_twist)
        start = time.perf_counter()
        rng = seed_generator if self.noise else None
        if self.chirps_per_block is None:
            adc = synthesize(paths, self.spec, rng=rng)
        else:
            paths_at = retraced(state.world, self.spec, world_from_sensor, state.time, self.method, **options)
            adc = synthesize_blocks(
                lambda time: through_weather(paths_at(time), state, self.spec, None),
                self.spec,
                self.chirps_per_block,
                rng=rng,
            )
            if paths.num_paths > alone.num_paths:  # drops are traced once: they move straight
                adc += synthesize(paths.select(np.arange(alone.num_paths, paths.num_paths)), self.spec)
        synthesized = time.perf_counter()
        codes, scale, num_saturated = quantize(adc, self.spec)
        solve = paths.diagnostics.get("seconds", {})
        quantized = time.perf_counter()
        truth = self._truth(adc, paths, state) if self.spec.cell_labels else {}
        seconds = {
            **(solve if isinstance(solve, Mapping) else {"solve": solve}),
            "synthesize": synthesized - start,
            "quantize": quantized - synthesized,
            "label": time.perf_counter() - quantized,
        }
        return RadarFrame(
            spec=self.spec,
            world_from_sensor=world_from_sensor,
            adc_int=codes,
            adc_scale=scale,
            num_saturated=num_saturated,
            num_paths=paths.num_paths,
            diagnostics={**paths.diagnostics, "seconds": seconds},
            **truth,
        )

    def _truth(
        self, adc: npt.NDArray[np.complex64], paths: RadarPaths, state: WorldState
    ) -> dict[str, npt.NDArray[Any]]:
        """Return what fills the cells of the frame's range-Doppler map, and the power of every object."""
        labels = label_cells(range_doppler(virtual_cube(adc, self.spec), self.spec), paths, state)
        power = labels.entry_share * labels.power.reshape(-1)[labels.cell]
        size = max(state.world.instances, default=0) + 1
        objects = [item.instance for item in state.boxes()]
        direct, ghost = (
            np.bincount(labels.entry_instance[rows], power[rows], size)[objects]
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
