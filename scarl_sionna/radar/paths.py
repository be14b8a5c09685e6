"""What every channel solver returns: geometric paths between the radar's antennas, exact for each antenna."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
from scarl_sionna.core.prompt.describe import Described, Row, field_rows, listed


@dataclass(frozen=True, eq=False, repr=False)
class RadarPaths(
    Described,
    units={"tx_point": "m", "rx_point": "m", "inner_length": "m", "length_rate": "m/s", "length_acceleration": "m/s2"},
):
    """Propagation paths of one radar at one instant.

    The length of a path from an antenna at p to one at q is ``|tx_point - p| + inner_length + |rx_point - q|``. For a
    single scattering both points are the hit point and the inner length is 0; behind a chain of mirror reflections a point
    is the image of the scatterer. A path of mirror reflections only has no scattering point: its length is
    ``|rx_image(q) - p|``, and `rx_image` holds the isometry.

    Attributes
    ----------
    tx_point, rx_point : ndarray of float64, shape (num_paths, 3)
        Virtual end points [m, world].
    inner_length : ndarray of float64, shape (num_paths,)
        Length between the two end points [m].
    a : ndarray of complex128, shape (num_paths, 2, 2)
        Polarimetric transfer between the array centres (the radar frame's origins), without the carrier's phase over the
        length and without antennas, so that ``|a|**2`` is received over transmitted power of isotropic antennas. Rows:
        received theta-hat (V), phi-hat (H); columns: transmitted. Spherical basis of the radar frame (z up) at each end.
        The field at the receiver is ``a * exp(-2j pi f tau)``.
    length_rate : ndarray of float64, shape (num_paths,)
        d(length)/dt at the array centres [m/s].
    length_acceleration : ndarray of float64, shape (num_paths,)
        Second derivative of the length [m/s2]; zero where a solver keeps to first order (SCaRL's linear motion).
    instance, interaction : ndarray of int32, shape (num_paths, max_depth)
        Instance id and kind of each interaction, -1 beyond the path's depth.
    depth : ndarray of int32, shape (num_paths,)
        Number of interactions.
    semantic : ndarray of uint8, shape (num_paths,)
        Semantic class of the last scatterer.
    rx_image : ndarray of float64, shape (num_paths, 3, 4), or None
        For paths of mirror reflections only: isometry that maps the receiver to its image; NaN for other paths.
    world_from_tx, world_from_rx : Pose
        Radar frames of the transmitter and of the receiver; equal for a monostatic radar.
    diagnostics : mapping
        What the solver chose and left out.
    """

    tx_point: npt.NDArray[np.float64]
    rx_point: npt.NDArray[np.float64]
    inner_length: npt.NDArray[np.float64]
    a: npt.NDArray[np.complex128]
    length_rate: npt.NDArray[np.float64]
    length_acceleration: npt.NDArray[np.float64]
    instance: npt.NDArray[np.int32]
    interaction: npt.NDArray[np.int32]
    depth: npt.NDArray[np.int32]
    semantic: npt.NDArray[np.uint8]
    world_from_tx: Pose
    world_from_rx: Pose
    rx_image: npt.NDArray[np.float64] | None = None
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> Iterable[Row]:
        yield "num_paths", f"{self.num_paths}, of at most {self.instance.shape[1]} interactions"
        yield "method", str(self.diagnostics.get("method", "not stated"))
        yield from field_rows(self, without=("diagnostics",))
        yield "diagnostics", listed(self.diagnostics)

    @property
    def num_paths(self) -> int:
        """Number of paths."""
        return int(self.inner_length.shape[0])

    @property
    def length(self) -> npt.NDArray[np.float64]:
        """Length between the array centres [m], shape (num_paths,)."""
        tx, rx = self.world_from_tx.position, self.world_from_rx.position
        legs = np.linalg.norm(self.tx_point - tx, axis=1) + np.linalg.norm(self.rx_point - rx, axis=1)
        length = legs + self.inner_length
        if self.rx_image is not None:
            mirror = np.isfinite(self.rx_image).all(axis=(1, 2))
            image = self.rx_image[mirror]
            length[mirror] = np.linalg.norm(image[:, :, :3] @ rx + image[:, :, 3] - tx, axis=1)
        return length

    @property
    def apparent_points(self) -> npt.NDArray[np.float64]:
        """Where the receiver sees each path: along its direction of arrival, at half its length; (num_paths, 3) [m, world]."""
        arrival = self.rx_point - self.world_from_rx.position
        if self.rx_image is not None:  # by mirrors only: from the transmitter's image under the inverse isometry
            mirror = np.isfinite(self.rx_image).all(axis=(1, 2))
            image = self.rx_image[mirror]
            ahead = image[:, :, :3] @ self.world_from_rx.position + image[:, :, 3] - self.world_from_tx.position
            arrival[mirror] = -np.einsum("pji,pj->pi", image[:, :, :3], ahead)
        unit = arrival / np.maximum(np.linalg.norm(arrival, axis=1, keepdims=True), 1e-12)
        return self.world_from_rx.position + unit * (self.length / 2.0)[:, None]

    def plot(self, view: str = "range", dynamic_range_db: float = 60.0, ax: Axes | None = None) -> Axes:
        """Draw the paths.

        Parameters
        ----------
        view : {"range", "map"}
            ``"range"``: received power of isotropic antennas over half the length, coloured by radial velocity. ``"map"``: from
            above, where the radar sees each path (its direction of arrival, at half its length), coloured by power.
        dynamic_range_db : float
            Paths farther below the strongest are left out [dB].
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError
            If there is no such view.
        """
        from .path_plot import plot_paths

        return plot_paths(self, view, dynamic_range_db, ax)

    def select(self, index: npt.ArrayLike) -> RadarPaths:
        """Return the paths of an index, a mask or a slice."""
        chosen = np.asarray(index) if not isinstance(index, slice) else index
        changed = {
            item.name: value[chosen]
            for item in fields(self)
            if isinstance(value := getattr(self, item.name), np.ndarray)
        }
        rest = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in changed}
        return RadarPaths(**changed, **rest)
