"""All other radars that a radar hears in a frame, and which samples and cells they hit."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.interferer import Interferer
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.front_end.filters import noise_share_left
from scarl_sionna.signal.noise import sample_noise_power
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .beat import synthesize_interference
from .ways import FARTHEST, one_way_paths

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


@dataclass(frozen=True, eq=False)
class Interference:
    """What other radars leave in the raw data of a radar.

    Attributes
    ----------
    adc : ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        [sqrt(W)], behind the receiver's filters, without noise.
    radar : RadarSpec
        The radar that listens.
    sources : tuple of mapping
        Of each other radar: the number of its paths, gain of the strongest between isotropic antennas [dB], and when it
        started [s].
    """

    adc: npt.NDArray[np.complex64]
    radar: RadarSpec
    sources: tuple[Mapping[str, Any], ...]

    @property
    def hit_samples(self) -> npt.NDArray[np.bool_]:
        """Samples with more power of other radars than of thermal noise, both behind the filters, mean over receivers.

        Shape (num_chirps_total, num_samples).
        """
        power = np.mean(np.abs(self.adc) ** 2, axis=0)
        share = 0.5 if self.radar.adc.is_real else 1.0  # of the noise, which I has
        noise = sample_noise_power(self.radar) * noise_share_left(self.radar)
        return np.asarray(power > share * noise)

    @property
    def cell_power(self) -> npt.NDArray[np.float32]:
        """Power of other radars in every cell of the range-Doppler map with Hann windows, mean over the channels [W].

        Shape (num_doppler_bins, num_range_bins). Compare with `RangeDoppler.noise_power`.
        """
        found = range_doppler(virtual_cube(self.adc, self.radar), self.radar)
        return np.asarray(np.mean(np.abs(found.data) ** 2, axis=0), dtype=np.float32)


def hear(
    state: WorldState | None,
    radar: RadarSpec,
    mount: Mount,
    interferers: Sequence[Interferer],
    rng: np.random.Generator,
    settings: RadarSettings | None = None,
) -> Interference:
    """Return what other radars leave in the raw data of a radar.

    Parameters
    ----------
    state : WorldState or None
        Surroundings; None: free space, at time 0.
    radar : RadarSpec
        The radar that listens.
    mount : Mount
        Its pose and velocity.
    interferers : sequence of Interferer
        One on an actor that is not in the scene at the state's time is not heard.
    rng : numpy.random.Generator
        Of the start times that are not given; :func:`scarl_sionna.observe` gives them all.
    settings : RadarSettings, optional
        Of the paths, see :func:`one_way_paths`.

    Raises
    ------
    ParameterRangeError
        If a radar of the rig is named: :func:`scarl_sionna.observe` knows the rig.
    PlacementError
        If a radar stands in a mesh, or two at one place.
    UnknownNameError
        If there is no such actor.

    Warns
    -----
    ScarlWarning
        If one has gone farther than 1000 km since time 0.

    References
    ----------
    .. [1] G. M. Brooker, "Mutual interference of millimeter-wave radar systems", IEEE Trans. Electromagn. Compat.
       49(1), 2007.
    """
    total = np.zeros((radar.num_rx, radar.num_chirps_total, radar.num_samples), dtype=np.complex64)
    sources = []
    for other in interferers:
        sender = other.radar
        if sender is None:
            raise ParameterRangeError(
                "interferers.sensor",
                repr(other.sensor),
                "a radar with its place where no rig is known",
                "ss.observe(world, rig) knows the other radars of the rig",
            )
        interval = other.frame_interval or sender.frame_time
        start = float(rng.uniform(0.0, interval)) if other.start_time is None else other.start_time
        if state is None or other.actor is None or state.is_present(other.actor):
            paths = one_way_paths(sender, _place(state, other), mount, state, settings)
        else:
            paths = RadarPaths.empty(mount.pose)
        total += synthesize_interference(paths, sender, radar, start, interval, other.frequency_offset)
        strongest = float(np.max(np.abs(paths.a), initial=0.0))
        level = None if strongest == 0.0 else float(20.0 * np.log10(strongest))
        sources.append({"num_paths": paths.num_paths, "path_gain_db": level, "start_time": start})
    return Interference(total, radar, tuple(sources))


def _place(state: WorldState | None, other: Interferer) -> Mount:
    if other.actor is None:
        there = Mount.passing(other.pose, other.velocity, 0.0 if state is None else state.time)
        _warn_of_distance(there, other, state)
        return there
    if state is None:
        raise ParameterRangeError("interferers.actor", repr(other.actor), "none in free space", "give its position")
    return state.mount(other.actor, other.pose)


def _warn_of_distance(there: Mount, other: Interferer, state: WorldState | None) -> None:
    """Warn of a radar that has gone so far since time 0 that nothing of it can be heard."""
    away = float(np.linalg.norm(there.pose.position))
    if state is not None and away > FARTHEST:
        warnings.warn(
            f"an interferer that is at {other.position} m at time 0 is {away / 1e3:.3g} km away at "
            f"{state.time:.10g} s: it is not heard. Let a session's clock start near 0, or let it ride on an actor",
            ScarlWarning,
            stacklevel=4,
        )
