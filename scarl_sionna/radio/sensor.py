"""The radio as a sensor: paths by Sionna RT, the strongest of each station, impulse and frequency response."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.channels import RadioChannels
from scarl_sionna.core.errors import ScarlWarning, SmallMirrorWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radio import RadioSettings
from scarl_sionna.core.specs.radio import RadioSpec, RadioStation
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.paths.links import Links, trace_links
from scarl_sionna.engine.paths.tracing import PathBufferOverflowError
from scarl_sionna.engine.rays.placement import check_placement
from scarl_sionna.engine.world import WorldState
from scarl_sionna.signal.radio import response

SMALL_MIRROR_SHARE = 0.01
"""Share of the gain over mirrors smaller than their Fresnel zone from which on there is a warning: 0.04 dB."""
_DIRECTIONS = ("theta_t", "phi_t", "theta_r", "phi_r")


class Radio:
    """A radio that talks to stations, looking at a state of the world.

    Parameters
    ----------
    spec : RadioSpec
        What it is, and where the stations are.
    settings : RadioSettings, optional
        How the paths are found, and how many are kept.
    """

    def __init__(self, spec: RadioSpec, settings: RadioSettings | None = None) -> None:
        self.spec = spec
        self.settings = settings or RadioSettings()

    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> RadioChannels:
        """Return the channels to all stations at the state's time, from one call of the solver.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Frame of the radio's array (x forward, y left, z up) and its velocity.
        rng : numpy.random.Generator
            Not used: a channel has no noise, and the solver's rays are the same for every frame.

        Raises
        ------
        PlacementError
            If the radio or a station is inside a closed mesh.
        UnknownNameError
            If a station rides on an actor that the world does not have.
        MaterialRangeError
            If a material of the scene has no data at the carrier, unless the settings allow the nearest.
        PathBufferOverflowError
            If the solver's buffer was filled (``on_overflow="raise"``).

        Warns
        -----
        ScarlWarning
            If the buffer was filled (``on_overflow="warn"``).
        SmallMirrorWarning
            If more than 1 % of the gain comes over mirrors that are smaller than their first Fresnel zone.
        """
        started = time.perf_counter()
        place = state.as_mount(mount)
        wanted = self.spec.stations
        stations = {index: _placed(state, one) for index, one in enumerate(wanted) if _is_there(state, one)}
        check_placement(state, place.pose.position, "radio")
        for index, one in stations.items():
            check_placement(state, one.pose.position, f"station '{wanted[index].name}'")
        rows: dict[str, npt.NDArray[Any]] = self._no_paths()
        diagnostics: dict[str, Any] = {
            "absent_stations": [station.name for k, station in enumerate(wanted) if k not in stations]
        }
        if stations:
            found = trace_links(
                state,
                self.spec.frequency,
                (place, list(stations.values())),
                (self.spec.array, self.spec.station_array),
                self.settings,
            )
            self._check(found)
            diagnostics["small_mirror_share"] = self._small_mirrors(found)
            for position, index in enumerate(stations):
                self._keep(rows, index, found, np.flatnonzero(found.receiver == position), state.world.parts.instance)
            diagnostics |= {"num_candidates": found.num_candidates, "borrowed_materials": found.borrowed}
        rows["cfr"] = response(rows["a"], rows["tau"], rows["doppler"], self.spec.subcarrier_frequencies)
        rows["a"], rows["cfr"] = rows["a"].astype(np.complex64), rows["cfr"].astype(np.complex64)
        world_from_station, velocity = np.full((len(wanted), 7), np.nan), np.full((len(wanted), 3), np.nan)
        for index, one in stations.items():
            world_from_station[index] = *one.pose.position, *one.pose.quaternion
            velocity[index] = one.twist.linear
        return RadioChannels(
            spec=self.spec,
            world_from_sensor=place.pose,
            world_from_station=world_from_station,
            station_velocity=velocity,
            **rows,
            diagnostics={**diagnostics, "seconds": time.perf_counter() - started},
        )

    def _check(self, found: Links) -> None:
        """Raise or warn if the solver's buffer was filled."""
        if not found.overflow:
            return
        error = PathBufferOverflowError(self.settings.solver.max_num_paths)
        if self.settings.solver.on_overflow == "raise":
            raise error
        warnings.warn(str(error), ScarlWarning, stacklevel=3)

    def _small_mirrors(self, found: Links) -> float:
        """Warn of mirrors that are smaller than their first Fresnel zone; return the share of all gain over them."""
        gain = (np.abs(found.a) ** 2).sum(axis=(1, 2))
        share = float(gain[found.small_mirror].sum() / gain.sum()) if gain.any() else 0.0
        if share > SMALL_MIRROR_SHARE:
            warnings.warn(
                f"{100.0 * share:.2g} % of the gain comes by {int(found.small_mirror.sum())} of {len(gain)} paths over "
                "flat faces smaller than the first Fresnel zone; Sionna RT gives them the amplitude of an endless "
                "mirror, most often too strong: take this gain for an upper bound, or a higher carrier",
                SmallMirrorWarning,
                stacklevel=3,
            )
        return share

    def _no_paths(self) -> dict[str, npt.NDArray[Any]]:
        """Return the arrays of paths of all stations without any path; coefficients in double precision."""
        spec, num = self.spec, len(self.spec.stations)
        paths = num, self.settings.max_paths
        steps = *paths, max(1, self.settings.solver.max_depth)
        return {
            "a": np.zeros((num, spec.station_array.num_antennas, spec.array.num_antennas, paths[1]), np.complex128),
            "tau": np.zeros(paths),
            "doppler": np.zeros(paths),
            **{name: np.zeros(paths, np.float32) for name in _DIRECTIONS},
            "valid": np.zeros(paths, np.bool_),
            "interaction": np.zeros(steps, np.uint8),
            "instance": np.zeros(steps, np.uint16),
            "small_mirror": np.zeros(paths, np.bool_),
            "num_paths": np.zeros(num, np.int32),
            "gain_left_out": np.zeros(num),
        }

    def _keep(
        self,
        rows: dict[str, npt.NDArray[Any]],
        station: int,
        found: Links,
        chosen: npt.NDArray[np.int64],
        instances: npt.NDArray[np.int32],
    ) -> None:
        """Put the strongest of a station's paths into its rows; those without any power are no paths."""
        gain = (np.abs(found.a[chosen]) ** 2).mean(axis=(1, 2))
        order = np.argsort(-gain, kind="stable")[: np.count_nonzero(gain)]
        kept = chosen[order[: self.settings.max_paths]]
        count, depth = len(kept), found.kind.shape[1]
        tau = found.length[kept] / SPEED_OF_LIGHT
        turned = found.a[kept] * np.exp(-2j * np.pi * (self.spec.frequency * tau % 1.0))[:, None, None]
        rows["a"][station, ..., :count] = np.moveaxis(turned, 0, -1)
        rows["tau"][station, :count] = tau
        for name in ("doppler", *_DIRECTIONS):
            rows[name][station, :count] = getattr(found, name)[kept]
        rows["valid"][station, :count] = True
        rows["small_mirror"][station, :count] = found.small_mirror[kept]
        rows["interaction"][station, :count, :depth] = found.kind[kept]
        part = found.part[kept]
        rows["instance"][station, :count, :depth] = np.where(part >= 0, instances[part], 0)
        rows["num_paths"][station] = len(order)
        rows["gain_left_out"][station] = gain[order[self.settings.max_paths :]].sum()


def _placed(state: WorldState, station: RadioStation) -> Mount:
    """Return where a station is and how it moves."""
    if station.actor is None:
        return Mount.passing(station.pose, station.velocity, state.time)
    return state.mount(station.actor, station.pose)


def _is_there(state: WorldState, station: RadioStation) -> bool:
    """Return whether a station is in the scene: its actor may come later or be gone."""
    return station.actor is None or state.is_present(station.actor)
