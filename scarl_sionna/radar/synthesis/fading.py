"""What directions that turn over a frame do to strengths: gains of the antennas, and what scatters.

Of each path one factor for all pairs, a polynomial in time that is 1 at the frame's start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.arrays.rows import row_cross, row_norm
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.paths import RadarPaths

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

NUM_TIMES = 3
"""Times after the start at which a factor is exact, the last one at the frame's end: with a half-power width of 15 deg
of the field there and back, 13 deg over a frame are followed to -60 dB."""
LEAST_TURN = 1e-4
"""Directions that turn by less over a frame are those of its start [rad]."""


@dataclass(frozen=True, eq=False)
class Fading:
    """Factors of the beat signal of paths over a frame.

    Attributes
    ----------
    terms : ndarray of complex128, shape (num_terms, num_paths)
        By t, t**2, ... [1/s, 1/s**2, ...].
    """

    terms: Complex

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec, moving: npt.NDArray[np.bool_]) -> Fading | None:
        """Return the factors of paths, 1 of those that are not `moving`; None where all are 1.

        Gains in the directions that the array centres see, and `over_time` of the paths. Where antennas are described
        one by one, of all pairs the root mean square.
        """
        rows = np.flatnonzero(moving)
        if not len(rows):
            return None
        offsets, velocities = _ends(paths)
        turned = np.zeros(paths.num_paths)
        for offset, velocity, twist in zip(offsets, velocities, (paths.tx_twist, paths.rx_twist), strict=True):
            squared = np.maximum(np.einsum("pi,pi->p", offset, offset), 1e-18)
            turned += row_norm(row_cross(offset, velocity)) / squared + float(np.linalg.norm(twist.angular))
        rows = rows[radar.frame_time * turned[rows] > LEAST_TURN]
        if not len(rows):
            return None
        times = radar.frame_time * np.arange(1, NUM_TIMES + 1) / NUM_TIMES
        some = paths.select(rows)
        ends = _ends(some)
        start = _gain(some, ends, radar, 0.0)
        values = np.empty((NUM_TIMES, len(rows)), dtype=np.complex128)
        for value, time in zip(values, times, strict=True):
            gain = np.divide(_gain(some, ends, radar, time), start, out=np.ones(len(rows)), where=start > 0.0)
            value[:] = gain * np.conj(over_time(some, time))
        terms = np.zeros((NUM_TIMES, paths.num_paths), dtype=np.complex128)
        terms[:, rows] = np.linalg.solve(times[:, None] ** np.arange(1, NUM_TIMES + 1), values - 1.0)
        return cls(terms)

    def select(self, rows: npt.NDArray[np.intp]) -> Fading:
        """Return the factors of some paths."""
        return Fading(self.terms[:, rows])

    def at(self, times: Array) -> Complex:
        """Return the factors at times [s], shape (num_times, num_paths)."""
        found = np.zeros((len(times), self.terms.shape[1]), dtype=np.complex128)
        for term in self.terms[::-1]:
            found = (found + term) * times[:, None]
        return found + 1.0

    def growth(self, times: Array) -> Complex:
        """Return their relative rates at times [1/s], shape (num_times, num_paths)."""
        rate = np.zeros((len(times), self.terms.shape[1]), dtype=np.complex128)
        for order in range(len(self.terms), 0, -1):
            rate = rate * times[:, None] + order * self.terms[order - 1]
        value = self.at(times)
        return np.divide(rate, value, out=np.zeros_like(rate), where=value != 0.0)


def over_time(paths: RadarPaths, time: float) -> Complex:
    """Return `a` at a time [s] over that at the frame's start, at equal spreading, shape (num_paths,)."""
    if paths.over_time is None:
        return np.ones(paths.num_paths, dtype=np.complex128)
    return np.asarray(1.0 + time * (paths.over_time[:, 0] + time * paths.over_time[:, 1]))


def fading_from(paths: RadarPaths, time: float) -> Complex | None:
    """Return `over_time` of the same paths for a frame that starts at a time [s] of theirs; None where it is None."""
    if paths.over_time is None:
        return None
    first, second = paths.over_time.T
    terms = np.stack([first + 2.0 * time * second, second], axis=1)
    value = over_time(paths, time)[:, None]
    return np.divide(terms, value, out=np.zeros_like(terms), where=value != 0.0)


_Ends = tuple[tuple[Array, Array], tuple[Array, Array]]


def _ends(paths: RadarPaths) -> _Ends:
    """Return the vectors to the ends of paths, and their velocities, of paths of mirrors those of the other end.

    What both ends have alike is one array.
    """
    offsets = paths.end_vectors()
    sent, heard = (paths.filled(f"{end}_velocity") for end in ("tx", "rx"))
    alike = offsets[0] is offsets[1] and np.array_equal(sent, heard, equal_nan=True)
    sent = np.nan_to_num(sent, nan=0.0)
    heard = sent if alike else np.nan_to_num(heard, nan=0.0)
    mirror = paths.is_mirror_chain
    if mirror.any():
        turn, velocity = paths.filled("rx_image")[mirror, :, :3], heard[mirror]
        sent[mirror] = velocity
        heard[mirror] = -np.einsum("pji,pj->pi", turn, velocity)
    return offsets, (sent, heard)


def _gain(paths: RadarPaths, ends: _Ends, radar: RadarSpec, time: float) -> Array:
    """Return what antennas receive of the transfer at the frame's start in the directions at a time [sqrt(W)].

    `ends` as :func:`_ends` gives them.
    """
    (sent, heard), (leaving, coming) = ends
    turns = (
        Rotation.from_rotvec(-twist.angular * time).as_matrix().T @ pose.rotation
        for pose, twist in ((paths.world_from_tx, paths.tx_twist), (paths.world_from_rx, paths.rx_twist))
    )
    tx_turn, rx_turn = turns
    tx_vector = (sent + time * leaving) @ tx_turn
    alike = sent is heard and leaving is coming and np.array_equal(tx_turn, rx_turn)
    rx_vector = tx_vector if alike else (heard + time * coming) @ rx_turn
    return np.abs(received_amplitude(paths.a, tx_vector, rx_vector, radar))
