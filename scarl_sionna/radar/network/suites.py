"""Radars of a network: where they are, how their clocks differ, and all paths and raw data between them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described, Row, vector
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY, Accuracy
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.sbr.reciprocity import of_both_senses
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import raw_data
from scarl_sionna.radar.synthesis.receiver import oscillators
from scarl_sionna.radar.weather.clutter import through_weather

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Pair = tuple[int, int]
"""Numbers of the radar that sends and of the one that receives."""


@dataclass(frozen=True, eq=False, repr=False)
class RadarNetwork(Described):
    """Equal radars that hear each other, told apart perfectly.

    Parameters
    ----------
    radar : RadarSpec
        What each of them is.
    mounts : tuple of Mount or Pose
        Where each is and how it moves; bare poses stand still.
    time_offsets : tuple of float
        Start of each radar's chirps after the common time [s]; empty: one clock.
    phases_deg : tuple of float
        Of each radar's oscillator [deg]; empty: 0.

    Raises
    ------
    ParameterRangeError
        If there are not as many offsets or phases as radars, or no radar.
    InputTypeError
        If `radar` is no RadarSpec, or a place neither Mount nor Pose.
    """

    radar: RadarSpec
    mounts: tuple[Mount | Pose, ...]
    time_offsets: tuple[float, ...] = ()
    phases_deg: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.radar, RadarSpec):
            raise InputTypeError("radar", self.radar, "a RadarSpec", "for instance RadarSpec.preset('awr1843boost')")
        object.__setattr__(self, "mounts", tuple(Mount.of(place) for place in self.mounts))
        if not self.mounts:
            raise ParameterRangeError("mounts", "()", "at least one radar")
        for name in ("time_offsets", "phases_deg"):
            given = tuple(getattr(self, name)) or (0.0,) * len(self.mounts)
            if len(given) != len(self.mounts) or not np.isfinite(given).all():
                raise ParameterRangeError(name, given, f"{len(self.mounts)} finite values, one a radar, or none")
            object.__setattr__(self, name, given)

    def _facts(self) -> Iterable[Row]:
        yield "radars", str(len(self.mounts))
        for number, place in enumerate(self.places):
            yield f"radar {number}", vector(place.pose.position, "m")

    @property
    def places(self) -> tuple[Mount, ...]:
        """Mounts of all radars."""
        return tuple(Mount.of(place) for place in self.mounts)

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs of a radar that sends and one that receives, a radar with itself included."""
        numbers = range(len(self.mounts))
        return tuple((tx, rx) for tx in numbers for rx in numbers)

    def delay(self, pair: Pair) -> float:
        """Return how much later echoes seem to come by the clocks of a pair [s]."""
        return self.time_offsets[pair[0]] - self.time_offsets[pair[1]]

    def turn(self, pair: Pair) -> complex:
        """Return the factor of the beat signal of ramps by a pair's oscillators: that of the receiver leads.

        Of symbols, which are sampled as they arrive, the conjugate.
        """
        return complex(np.exp(1j * np.radians(self.phases_deg[pair[1]] - self.phases_deg[pair[0]])))


@dataclass(frozen=True, eq=False, repr=False)
class NetworkFrame(Described):
    """Raw data of a network.

    Attributes
    ----------
    network : RadarNetwork
    adc : mapping of (int, int) to ndarray of complex64, shape (num_rx, num_chirps_total, num_samples)
        What radar j receives of what radar i sends [sqrt(W)], by the pair (i, j).
    """

    network: RadarNetwork
    adc: Mapping[Pair, npt.NDArray[np.complex64]]

    def _facts(self) -> Iterable[Row]:
        yield "pairs", str(len(self.adc))
        yield "network", repr(self.network)


def network_paths(
    network: RadarNetwork,
    state: WorldState | None = None,
    *,
    settings: RadarSettings | None = None,
    points: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike] | None = None,
    drops: np.random.Generator | None = None,
) -> dict[Pair, RadarPaths]:
    """Return the paths of all pairs of a network, a radar with itself included.

    By definition, :func:`scarl_sionna.solve_paths` or :func:`scarl_sionna.point_targets` for each. Physical optics is
    not reciprocal off its flashes: unless ``SbrSettings.reciprocal`` is False, either sense of a pair by `sbr` is the
    mean of both, which costs no further solve here (docs/sbr.md). In a state with weather all are lowered by its air,
    by :func:`scarl_sionna.radar.weather.clutter.through_weather`, which also gives the echoes of the drops.

    Parameters
    ----------
    network : RadarNetwork
    state : WorldState, optional
        Surroundings; left out: free space, with `points`.
    settings : RadarSettings, optional
        With a method that knows a separate receiver: ``"sbr"`` (default) or ``"sionna"``.
    points : tuple of array_like, shapes (N, 3), (N, 3) and (N,), optional
        Positions [m], velocities [m/s] and radar cross-sections [m2] of ideal points.
    drops : numpy.random.Generator, optional
        Of the places and speckle of what falls in the state's weather, whose echoes stand in the pair of each radar
        with itself, not in the others; None leaves them out.

    Raises
    ------
    ParameterRangeError
        If there is neither a state nor points, or the method is monostatic.
    """
    if state is None and points is None:
        raise ParameterRangeError("state, points", "None", "a state of the world, or points in free space")
    found: dict[Pair, RadarPaths] = {}
    chosen = settings or RadarSettings(method="sbr")
    is_mean = points is None and chosen.method == "sbr" and chosen.sbr.reciprocal is not False
    one_sense = chosen.with_(sbr=chosen.sbr.with_(reciprocal=False)) if is_mean else chosen  # once, whoever sends
    for tx, rx in network.pairs:
        here, there = network.places[tx], None if tx == rx else network.places[rx]
        if points is not None:
            given: dict[str, Any] = {} if settings is None or state is None else {"settings": settings}
            found[tx, rx] = point_targets(*points, network.radar, here, state, there, **given)
        elif state is not None:
            wanted = chosen if there is None else one_sense
            found[tx, rx] = solve_paths(state, network.radar, here, settings=wanted, receiver=there)
    if state is None:
        return found
    if is_mean:
        found = {(i, j): one if i == j else of_both_senses(state, [one, found[j, i]]) for (i, j), one in found.items()}
    return {pair: through_weather(one, state, network.radar, drops, None, settings) for pair, one in found.items()}


def synthesize_network(
    paths: Mapping[Pair, RadarPaths],
    network: RadarNetwork,
    rng: np.random.Generator | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
) -> NetworkFrame:
    r"""Return the raw data of all pairs of a network.

    Parameters
    ----------
    paths : mapping of pairs to RadarPaths
        Of :func:`network_paths`.
    network : RadarNetwork
    rng : numpy.random.Generator, optional
        Of phase noise and jitter, where the front end has them: each radar's own, shared by all its pairs; and of the
        receivers' noise, independent for each pair.
    accuracy : Accuracy

    Raises
    ------
    ParameterRangeError
        If the clocks differ and paths are of mirror reflections only, or an echo seems to come before it is sent.

    Notes
    -----
    A pair whose transmitter starts :math:`\delta_i` and whose receiver :math:`\delta_j` late sees the delay
    :math:`\tau + \delta_i - \delta_j`, carrier included; the phase of the oscillators adds :math:`\phi_j - \phi_i`.

    References
    ----------
    .. [1] J. Li, P. Stoica, *MIMO Radar Signal Processing*, Wiley, 2009.
    """
    radar, adc = network.radar, {}
    lines = [oscillators(radar, rng) for _ in network.mounts]
    for pair, some in paths.items():
        sent, own = (lines[number] for number in pair)
        both = None if sent is None or own is None else sent.heard_by(own)
        seen = _clocked(some, network.delay(pair))
        adc[pair] = raw_data(_turned(seen, network.turn(pair)), radar, rng, accuracy, lines=both)
    return NetworkFrame(network, adc)


def _turned(paths: RadarPaths, turn: complex) -> RadarPaths:
    """Return paths whose beat signals, transmit times conj(receive), are turned before the receiver."""
    if turn == 1.0:
        return paths
    return paths.scaled(np.conj(turn))


def _clocked(paths: RadarPaths, delay: float) -> RadarPaths:
    """Return paths whose echoes seem to come later by the clocks."""
    if delay == 0.0 or not paths.num_paths:
        return paths
    if paths.is_mirror_chain.any():
        raise ParameterRangeError(
            "time_offsets", f"{delay:g} s", "0 with paths of mirror reflections only", "leave these paths out"
        )
    later = replace(paths, inner_length=paths.inner_length + SPEED_OF_LIGHT * delay)
    if (later.length < 0.0).any():
        raise ParameterRangeError(
            "time_offsets", f"{delay:g} s", f">= {-float(paths.length.min()) / SPEED_OF_LIGHT:g} s for the nearest echo"
        )
    return later
