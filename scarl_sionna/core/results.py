"""Results of sensors and the synchronized frame. A result carries the spec that made it and its pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .camera_spec import CameraSpec
from .lidar_spec import LidarSpec
from .pose import Pose, Twist

if TYPE_CHECKING:
    from .radar_spec import RadarSpec


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """Images of one camera at one instant, all in the same projection. An image not asked for is None.

    Attributes
    ----------
    spec : CameraSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    rgb : ndarray of uint8, shape (height, width, 3), sRGB
    depth : ndarray of float32, shape (height, width)
        Distance along the optical axis (z of camera_optical) at the pixel's centre [m]; inf where nothing is hit.
    semantic : ndarray of uint8, shape (height, width)
        Index into `core.semantics.SEMANTIC_CLASSES`; Sky where nothing is hit.
    instance : ndarray of uint16, shape (height, width)
        Instance id; 0 where nothing is hit.
    """

    spec: CameraSpec
    world_from_sensor: Pose
    rgb: npt.NDArray[np.uint8] | None = None
    depth: npt.NDArray[np.float32] | None = None
    semantic: npt.NDArray[np.uint8] | None = None
    instance: npt.NDArray[np.uint16] | None = None


@dataclass(frozen=True, eq=False)
class LidarScan:
    """Returns of one lidar, one row a return, in firing order.

    Attributes
    ----------
    spec : LidarSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    shot : ndarray of int32, shape (num_points,)
        Index of the shot: elevation line * num_azimuth + azimuth column.
    position : ndarray of float32, shape (num_points, 3)
        In the sensor frame [m].
    distance : ndarray of float32, shape (num_points,)
        Along the ray [m].
    radial_velocity : ndarray of float32, shape (num_points,)
        Positive when opening; from the target's and the sensor's motion [m/s].
    intensity : ndarray of float32, shape (num_points,)
        Received power relative to a normally hit white diffuser at 1 m without atmosphere.
    cos_incidence : ndarray of float32, shape (num_points,)
    normal : ndarray of float32, shape (num_points, 3)
        Surface normal in the sensor frame, towards the sensor.
    semantic : ndarray of uint8, shape (num_points,)
    instance : ndarray of uint16, shape (num_points,)
    """

    spec: LidarSpec
    world_from_sensor: Pose
    shot: npt.NDArray[np.int32]
    position: npt.NDArray[np.float32]
    distance: npt.NDArray[np.float32]
    radial_velocity: npt.NDArray[np.float32]
    intensity: npt.NDArray[np.float32]
    cos_incidence: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    semantic: npt.NDArray[np.uint8]
    instance: npt.NDArray[np.uint16]

    @property
    def num_points(self) -> int:
        """Number of returns."""
        return int(self.distance.shape[0])


@dataclass(frozen=True, eq=False)
class RadarFrame:
    """Raw data of one radar at one instant, as its converter gives it.

    Attributes
    ----------
    spec : RadarSpec
    world_from_sensor : Pose
        Radar frame (x boresight, y left, z up) at the start of the first chirp.
    adc_int : ndarray of int16, shape (num_rx, num_chirps_total, num_samples, 2)
        I and Q; times `adc_scale` it is the beat signal [sqrt(W)].
    adc_scale : float
        Value of one step [sqrt(W)].
    num_saturated : int
        Samples at the converter's limit.
    num_paths : int
        Paths that the signal was made of.
    diagnostics : mapping
        What the solver chose and left out.
    """

    spec: RadarSpec
    world_from_sensor: Pose
    adc_int: npt.NDArray[np.int16]
    adc_scale: float
    num_saturated: int = 0
    num_paths: int = 0
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    @property
    def adc(self) -> npt.NDArray[np.complex64]:
        """Beat signal [sqrt(W)], complex64, shape (num_rx, num_chirps_total, num_samples)."""
        scaled = self.adc_int.astype(np.float32) * np.float32(self.adc_scale)
        return np.ascontiguousarray(scaled).view(np.complex64)[..., 0]


SensorResult = ImageFrame | LidarScan | RadarFrame


@dataclass(frozen=True, eq=False)
class ObjectState:
    """Ground truth of one object at one instant.

    `world_from_box` is the pose of the centre of its oriented box with extents `size` (length, width, height) [m].
    `num_pixels`, `num_lidar_points` count what the frame's cameras and lidars see of it, summed over sensors.
    """

    name: str
    instance: int
    semantic: int
    world_from_box: Pose
    size: npt.NDArray[np.float64]
    twist: Twist
    is_actor: bool
    num_pixels: int = 0
    num_lidar_points: int = 0


@dataclass(frozen=True, eq=False)
class Frame:
    """All sensors of a rig at one instant.

    `results` is keyed by the sensor's name in the rig (for instance ``"front_left/radar"``);
    `timings` holds seconds by stage and is not part of the data.
    """

    index: int
    timestamp_ns: int
    seed: int
    world_from_vehicle: Pose
    vehicle_twist: Twist
    results: Mapping[str, SensorResult]
    objects: tuple[ObjectState, ...]
    timings: Mapping[str, float] = field(default_factory=dict)

    def of_type(self, kind: type) -> dict[str, Any]:
        """Return the results of one type, by sensor name."""
        return {name: result for name, result in self.results.items() if isinstance(result, kind)}

    @property
    def radars(self) -> dict[str, RadarFrame]:
        """Radar frames by sensor name."""
        return self.of_type(RadarFrame)

    @property
    def images(self) -> dict[str, ImageFrame]:
        """Camera images by sensor name."""
        return self.of_type(ImageFrame)

    @property
    def lidars(self) -> dict[str, LidarScan]:
        """Lidar scans by sensor name."""
        return self.of_type(LidarScan)
