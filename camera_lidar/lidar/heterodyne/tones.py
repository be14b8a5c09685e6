"""What a heterodyne receiver finds in the spectra of the chirps, and how it pairs up and down chirp to returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camera_lidar.lidar.detections import NO_ECHO, Detections
from camera_lidar.lidar.returns import place_in_group
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .detection import beat_limits
from .link import mean_cnr

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Tones:
    """Peaks above the threshold in the spectra of one chirp of all shots, in any order.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_tones,)
    beat : ndarray of float64, shape (num_tones,)
        Frequency as the sampling shows it [Hz]; of a down chirp its negative.
    height : ndarray of float64, shape (num_tones,)
        Sum of the looks in units of the mean noise.
    echo : ndarray of int64, shape (num_tones,)
        Row of the returns that it comes from, or `NO_ECHO`.
    """

    shot: Index
    beat: Array
    height: Array
    echo: Index


def paired(spec: LidarSpec, up: Tones, down: Tones) -> Detections:
    """Return the returns that the tones of an up and a down chirp give, in any order.

    Parameters
    ----------
    spec : LidarSpec
        With a heterodyne receiver.
    up, down : Tones

    Notes
    -----
    Of each chirp the `max_returns` strongest tones are looked at; the strongest of the up chirp and the strongest of
    the down chirp are one return, the second strongest the next, and so on. A return has the same speckle in both
    chirps, and of all pairings this one has the least squared difference of amplitudes; nothing else tells which belong
    together. Tones of equal height are paired wrongly half of the time: in fog, where many cells are alike, the
    velocities scatter. Pairs outside of the distances and velocities that are searched are dropped.
    """
    (one, place), (rows, other_place) = (_strongest(tones, spec.max_returns) for tones in (up, down))
    row_at = np.full(spec.num_shots * spec.max_returns, -1)
    row_at[other_place] = rows
    other = row_at[place]
    one, other = one[other >= 0], other[other >= 0]
    distance, velocity, valid = from_beats(spec, up.beat[one], -down.beat[other])
    one, other, distance, velocity = one[valid], other[valid], distance[valid], velocity[valid]
    echo = np.where(up.echo[one] == down.echo[other], up.echo[one], NO_ECHO)
    return measured(spec, up.shot[one], echo, distance, velocity, (up.height[one] + down.height[other]) / 2.0)


def single(spec: LidarSpec, up: Tones) -> Detections:
    """Return what the tones of an up chirp alone give: range and velocity are coupled, the velocity is NaN."""
    distance = up.beat * SPEED_OF_LIGHT / (2.0 * spec.chirp_slope)
    rows = np.flatnonzero((distance > 0.0) & (distance <= spec.max_distance))
    nothing = np.full(len(rows), np.nan)
    return measured(spec, up.shot[rows], up.echo[rows], distance[rows], nothing, up.height[rows])


def measured(spec: LidarSpec, shot: Index, echo: Index, distance: Array, velocity: Array, height: Array) -> Detections:
    """Return detections with the carrier-to-noise ratio and the intensity that a mean peak height stands for."""
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    cnr = height / receiver.num_looks - 1.0
    place = np.maximum(distance, 1e-3)
    unit = mean_cnr(spec, 1.0 / place**2, place)  # of a white diffuser at this distance
    return Detections(shot, echo, distance, velocity, cnr, cnr / unit / place**2)


def fold(spec: LidarSpec, frequency: Array) -> Array:
    """Return the beats of an up chirp (or the negative ones of a down chirp) as the sampling shows them [Hz].

    Any shape, kept. By definition of sampling: frequencies modulo the sampling frequency.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    low, rate = beat_limits(spec)[0], receiver.sampling_frequency
    return low + np.mod(frequency - low, rate)


def from_beats(spec: LidarSpec, up: Array, down: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Return distance [m] and radial velocity [m/s] of pairs of beats [Hz], and whether they are searched.

    Arrays of any one shape. By definition of the chirps: the exact inverse of the two beat frequencies.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    distance = SPEED_OF_LIGHT / (4.0 * spec.chirp_slope) * (up - down)
    velocity = spec.wavelength / 4.0 * (up + down)
    valid = (distance > 0.0) & (distance <= spec.max_distance) & (np.abs(velocity) <= receiver.max_velocity)
    return distance, velocity, valid


def _strongest(tones: Tones, number: int) -> tuple[Index, Index]:
    """Return the rows of the `number` strongest tones of each shot, and shot times `number` plus rank of each."""
    order = np.argsort(tones.shot, kind="stable")  # fast: all but a few are in order
    shot = tones.shot[order]
    equal = np.flatnonzero(np.diff(shot) == 0)
    shared = np.zeros(order.size, dtype=bool)
    shared[equal] = shared[equal + 1] = True
    alone, rows = order[~shared], order[shared]
    rows = rows[np.lexsort((-tones.height[rows], tones.shot[rows]))]
    rank = place_in_group(tones.shot[rows])
    rows, rank = rows[rank < number], rank[rank < number]
    place = np.concatenate([tones.shot[alone] * number, tones.shot[rows] * number + rank])
    return np.concatenate([alone, rows]), place
