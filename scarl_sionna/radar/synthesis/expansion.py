r"""The beat signal of paths in any motion: straight paths, times a short series in time.

A frame is cut into blocks of chirps. About the middle of a block the delay of a path is a straight line in time, whose
signal is that of a path at constant speed, and a rest delta(q). What the rest does to phase and strength is a smooth
factor that depends on the time q and, weakly, on the fast time x,

.. math:: g(q, x) = \frac{A(q)}{A_0}\, e^{j 2 \pi \delta(q) (f_0 + S (t_s - \tau - \delta / 2))}
                  = \sum_{k, m} c_{km} T_k(q / Q)\, T_m(x / X)

so that the signal is a sum of signals of straight paths with the amplitudes c_km, each times one known screen. The
coefficients follow from exact lengths at Chebyshev's nodes, for every pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .motion import Ends, PathMotion
from .phase import FrameGrid, phasor

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MAX_NODES = 33
"""Nodes in time at which the length of the series is found; one that has not ended there is cut into more blocks."""
FAST_NODES = 4
"""Nodes in fast time, likewise: the factor's part in it is the bend's phase times the relative bandwidth."""
TAIL_SHARE, REST_SHARE, PAIR_SHARE = 0.3, 0.2, 0.3
"""Shares of the tolerance of the motion: terms left out, transforms of all terms but the main one, which has the
tolerance of the synthesis, and coefficients of the centres for all pairs."""
UNSEEN = 2.0
"""Terms are kept by this factor of the largest seen on some paths, since others and other pairs may have more."""


@lru_cache(maxsize=64)
def chebyshev(count: int) -> tuple[Array, Array, Array]:
    """Return nodes in [-1, 1], the matrix from values there to coefficients, and that to derivatives there."""
    angle = (np.arange(count) + 0.5) * np.pi / count
    nodes = np.cos(angle)
    order = np.arange(count)[:, None]
    coefficients = np.cos(order * angle) * (2.0 / count)
    coefficients[0] *= 0.5
    slopes = (order * np.sin(order * angle) / np.sin(angle)).T  # of T_k at the nodes
    return nodes, coefficients, slopes @ coefficients


def polynomials(values: Array, count: int) -> Array:
    """Return T_0 .. T_(count-1) at values in [-1, 1], shape (count, *values.shape)."""
    found = np.ones((count, *values.shape))
    for order in range(1, count):  # by recurrence: a tenth of the time of a cosine for each
        found[order] = 2.0 * found[1] * found[order - 1] - found[order - 2] if order > 1 else np.clip(values, -1.0, 1.0)
    return found


class Tones(NamedTuple):
    """Straight paths: lengths at the first ramp of a block [m] and rates [m/s], shape (num_paths,)."""

    length: Array
    rate: Array


class Expansion(NamedTuple):
    """Straight paths of a pair and their coefficients, shape (num_in_time, num_in_fast_time, num_paths)."""

    tones: Tones
    coefficients: Complex


@dataclass(frozen=True, eq=False)
class Block:
    """Some chirps of a frame.

    Attributes
    ----------
    radar : RadarSpec
        With that many chirps.
    first : int
        Its first chirp in the frame.
    """

    radar: RadarSpec
    first: int

    @property
    def start(self) -> float:
        """Time of its first ramp in the frame [s]."""
        return self.first * self.radar.doppler_interval

    @cached_property
    def grid(self) -> FrameGrid:
        """Sampling times about its middle."""
        return FrameGrid(self.radar)

    @cached_property
    def half(self) -> tuple[float, float]:
        """Half the spans of slow and fast time together, and of the frequency over the slope [s]; never 0."""
        (x, y), least = self.grid.reach, 0.5 / self.radar.sample_rate
        return max(x + y, least), max(x if self.grid.even else float(np.abs(self.grid.z).max()), least)

    def times(self, tx: int, count: int) -> Array:
        """Return nodes in time for a transmitter [s]."""
        return self.start + self.grid.center_time(tx) + self.half[0] * chebyshev(count)[0]

    def expand(
        self,
        motion: PathMotion,
        pair: tuple[int | None, int | None],
        tx: int,
        nodes: tuple[int, int],
    ) -> Expansion:
        """Return the straight paths of a pair and their coefficients.

        Parameters
        ----------
        motion : PathMotion
        pair : tuple of int or None
            Transmitter and receiver; None for a centre.
        tx : int
            Transmitter whose ramps give the time.
        nodes : tuple of int
            In time, three or more, and in fast time.
        """
        sweep, (half, fast) = self.radar.waveform.sweep, self.half
        count, num_fast = nodes
        place, coefficients, derivatives = chebyshev(count)
        length, strength = motion.ends(*pair, self.times(tx, count))
        delay = length / (SPEED_OF_LIGHT + (0.5 / half) * (derivatives @ length))
        middle, slope = coefficients[:2] @ delay
        rest = delay - middle - place[:, None] * slope
        delay -= rest
        found = np.zeros((count, num_fast, len(middle)), dtype=np.complex128)
        fast_place, fast_coefficients, _ = chebyshev(num_fast)
        time = self.grid.ts_center - sweep.video * delay - 0.5 * sweep.video * rest
        middle_frequency = sweep.start_frequency + sweep.slope * time
        for z, shares in zip(fast * fast_place, fast_coefficients.T, strict=True):
            factor = strength * phasor(rest * (middle_frequency + sweep.slope * z))
            # a real matrix on complex columns: one product of float64 matrices
            in_time = (coefficients @ factor.view(np.float64)).view(np.complex128)
            for order, share in enumerate(shares):
                found[:, order] += share * in_time
        turn = slope / half
        rate = SPEED_OF_LIGHT * turn / (1.0 - 0.5 * turn)
        at_start = middle - turn * self.grid.center_time(tx)
        return Expansion(Tones(at_start * (SPEED_OF_LIGHT + 0.5 * rate), rate), found)

    def of_pair(
        self,
        motion: PathMotion,
        pair: tuple[int, int],
        center: Expansion,
        other: Ends,
        known: tuple[Array, Array],
    ) -> tuple[Tones, Array]:
        """Return a pair's straight paths and strengths over the centre's, with the same coefficients.

        They differ from those of the centre by what the pair's lengths do from one node to the other of two.

        Parameters
        ----------
        motion : PathMotion
        pair : tuple of int
        center : Expansion
        other : Ends
            Of the centres at the two nodes.
        known : pair of ndarray
            Distances of the pair's ends at the two nodes.
        """
        late_time, early_time = times = self.times(pair[0], 2)
        middle = 0.5 * (late_time + early_time) - self.start
        own = motion.ends(*pair, times, known)
        late, early = own.length - other.length
        apart = (late - early) / (late_time - early_time)
        length = center.tones.length + 0.5 * (early + late) - middle * apart
        return Tones(length, center.tones.rate + apart), own.strength.mean(axis=0) / other.strength.mean(axis=0)


@dataclass(frozen=True, eq=False)
class Series:
    """Terms that some paths need.

    Attributes
    ----------
    terms : tuple of (int, int)
        Orders in time and in fast time; the first is (0, 0).
    rest : float
        What all but the first hold together, over a path's amplitude.
    """

    terms: tuple[tuple[int, int], ...]
    rest: float

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes in time and in fast time."""
        return max(3, *(k + 2 for k, _ in self.terms)), 1 + max(m for _, m in self.terms)

    @classmethod
    def of(cls, coefficients: Complex, tolerance: float) -> Series | None:
        """Return the terms for coefficients of some paths; None if they do not end within the tolerance.

        Parameters
        ----------
        coefficients : ndarray of complex128, shape (num_in_time, num_in_fast_time, num_paths)
        tolerance : float
            Of the motion, over a path's amplitude.
        """
        size = UNSEEN * np.abs(coefficients).max(axis=2, initial=0.0)
        budget = TAIL_SHARE * tolerance
        if size[-2:].sum() + size[:, -1].sum() > budget:
            return None
        size[0, 0] = np.inf
        order = np.argsort(size, axis=None, kind="stable")
        dropped = int(np.searchsorted(np.cumsum(size.ravel()[order]), budget))
        kept = np.sort(order[dropped:])
        terms = tuple((int(k), int(m)) for k, m in zip(*np.unravel_index(kept, size.shape), strict=True))
        return cls(terms, float(size.ravel()[kept[1:]].sum()))

    def screens(self, block: Block) -> Array:
        """Return what each term but the first is multiplied with, shape (num_terms - 1, num_chirps, num_samples)."""
        half, fast = block.half
        x, y = block.grid.x, block.grid.y
        in_time = polynomials((x[None, :] + y[:, None]) / half, self.nodes[0])
        in_fast = polynomials(block.grid.z / fast, self.nodes[1])
        return np.stack([in_time[k] * in_fast[m] for k, m in self.terms[1:]]) if self.terms[1:] else in_time[:0]
