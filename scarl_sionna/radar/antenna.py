"""Paths seen from the antennas of a radar: gains, lengths and amplitudes of every transmit-receive pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.blocks import in_blocks
from scarl_sionna.core.arrays.rows import row_norm
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec

from .link import received_amplitude
from .pair_fields import PairFields
from .paths import RadarPaths

Array = npt.NDArray[np.float64]

POINTS_AT_ONCE = 1 << 13
"""Points whose distances are worked out together, so that they stay in the cache."""


@dataclass(frozen=True, eq=False)
class PathGeometry:
    """Paths seen from the antennas of one radar.

    Attributes
    ----------
    tx_distance : ndarray of float64, shape (num_tx, num_paths)
        From each transmitter to the path's first end point [m].
    rx_distance : ndarray of float64, shape (num_rx, num_paths)
        From the path's last end point to each receiver [m].
    inner_length : ndarray of float64, shape (num_paths,) [m]
    mirror : ndarray of bool, shape (num_paths,)
        True for paths of mirror reflections only; their lengths stand in `mirror_length`.
    mirror_length : ndarray of float64, shape (num_tx, num_rx, num_mirror_paths) [m]
    amplitude : ndarray of complex128, shape (num_paths,)
        Of the beat signal at the array centres [sqrt(W)].
        Where antennas are described one by one, the root mean square of all pairs; `fields` has each.
    center_distance : tuple of ndarray of float64, shape (num_paths,), (num_paths,) and (num_mirror_paths,)
        Distances of the array centres: transmit, receive, and total of the mirror paths [m].
    fields : PairFields or None
        What each pair receives, where antennas are described one by one or paths say how they differ over the array.
    """

    tx_distance: Array
    rx_distance: Array
    inner_length: Array
    mirror: npt.NDArray[np.bool_]
    mirror_length: Array
    amplitude: npt.NDArray[np.complex128]
    center_distance: tuple[Array, Array, Array]
    fields: PairFields | None = None

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec, receiver: RadarSpec | None = None) -> PathGeometry:
        """Return the geometry of paths for a radar, or from the transmitters of one to the receivers of another."""
        tx = paths.world_from_tx.apply(radar.tx_array)
        rx = paths.world_from_rx.apply((receiver or radar).rx_array)
        mirror = paths.is_mirror_chain
        image = np.zeros((0, 3, 4)) if paths.rx_image is None else paths.rx_image[mirror]
        mirror_length = np.linalg.norm(_image_of(image, rx)[None] - tx[:, None, None, :], axis=-1)
        tx_vector, rx_vector = paths.end_vectors()
        sent = tx_vector @ paths.world_from_tx.rotation
        one = rx_vector is tx_vector and np.array_equal(paths.world_from_tx.rotation, paths.world_from_rx.rotation)
        local = sent, sent if one else rx_vector @ paths.world_from_rx.rotation
        fields = None
        slopes = None
        if paths.tx_slope is not None or paths.rx_slope is not None:
            slopes = paths.filled("tx_slope"), paths.filled("rx_slope")
        if slopes is not None or not (radar.array.is_uniform and (receiver or radar).array.is_uniform):
            fields = PairFields.of(paths.a, *local, radar, receiver, slopes)
        tx_center = row_norm(tx_vector)
        rx_center = tx_center if rx_vector is tx_vector else row_norm(rx_vector)
        return cls(
            tx_distance=_distances(paths.tx_point, tx),
            rx_distance=_distances(paths.rx_point, rx),
            inner_length=paths.inner_length,
            mirror=mirror,
            mirror_length=mirror_length,
            # conj of the field, since the beat is tx conj(rx)
            amplitude=np.conj(
                received_amplitude(paths.a, *local, radar, receiver) if fields is None else fields.root_mean_square()
            ),
            center_distance=(tx_center, rx_center, tx_center[mirror]),
            fields=fields,
        )

    def center_length(self) -> Array:
        """Return the length between the array centres [m], shape (num_paths,)."""
        tx, rx, mirror = self.center_distance
        length = tx + self.inner_length + rx
        length[self.mirror] = mirror
        return length

    def length(self, tx: int, rx: int) -> Array:
        """Return the length of every path for one pair [m], shape (num_paths,)."""
        length = self.tx_distance[tx] + self.inner_length + self.rx_distance[rx]
        length[self.mirror] = self.mirror_length[tx, rx]
        return length

    def pair_amplitude(self, tx: int, rx: int) -> npt.NDArray[np.complex128]:
        """Return every path's beat amplitude for one pair [sqrt(W)], its spreading scaled to the pair's distances.

        Shape (num_paths,).

        Raises
        ------
        ParameterRangeError
            If a path ends at an antenna.
        """
        tx_center, rx_center, mirror_center = self.center_distance
        with np.errstate(divide="ignore", invalid="ignore"):
            spreading = (tx_center / self.tx_distance[tx]) * (rx_center / self.rx_distance[rx])
        spreading[self.mirror] = mirror_center / self.mirror_length[tx, rx]
        if not np.isfinite(spreading).all():
            index = int(np.flatnonzero(~np.isfinite(spreading))[0])
            raise ParameterRangeError("paths", f"path {index} ends at an antenna", "end points away from every antenna")
        return self.at_centers(tx, rx) * spreading

    def at_centers(self, tx: int, rx: int) -> npt.NDArray[np.complex128]:
        """Return every path's beat amplitude for a pair whose antennas stood at the array centres [sqrt(W)]."""
        return self.amplitude if self.fields is None else np.conj(self.fields.pair(tx, rx))

    def mean_power(self) -> Array:
        """Return every path's power, the mean of all pairs at the array centres; of the first pair if all are alike."""
        first = self.pair_amplitude(0, 0) if self.fields is None else self.amplitude
        return np.asarray(np.abs(first) ** 2)


def _distances(points: Array, antennas: Array) -> Array:
    """Return the distances between antennas (A, 3) and points (P, 3), shape (A, P)."""
    out = np.empty((len(antennas), len(points)))
    for block in in_blocks(len(points), POINTS_AT_ONCE):
        axes = points[block].T.copy()
        apart = np.empty(axes.shape[1])
        for row, antenna in zip(out[:, block], antennas, strict=True):
            row[:] = 0.0
            for axis, place in zip(axes, antenna, strict=True):
                np.subtract(axis, place, out=apart)
                apart *= apart
                row += apart
            np.sqrt(row, out=row)
    return out


def _image_of(image: Array, points: Array) -> Array:
    """Return points (A, 3) under isometries (P, 3, 4), shape (A, P, 3)."""
    return np.einsum("pij,aj->api", image[:, :, :3], points) + image[None, :, :, 3]
