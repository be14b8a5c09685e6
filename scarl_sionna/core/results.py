"""Results of sensors and the synchronized frame. A result carries the spec that made it and its pose."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .channels import RadioChannels
from .pose import Pose, Twist
from .prompt.describe import Described, Row, field_rows, html_table, listed, quantity
from .prompt.frames import frame_plot
from .prompt.pictures import thumbnail
from .scans.radar import RadarScan
from .semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from .specs.camera import CameraSpec
from .specs.lidar.spec import LidarSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .specs.radar.closed.device import ClosedRadarSpec
    from .specs.radar.spec import RadarSpec


@dataclass(frozen=True, eq=False, repr=False)
class ImageFrame(Described, units={"depth": "m"}):
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
    normal : ndarray of float32, shape (height, width, 3)
        Unit surface normal in the sensor frame (x forward, y left, z up), towards the camera; zeros where nothing is
        hit.
    flow : ndarray of float32, shape (height, width, 2)
        Way [px] (column, row) of the surface point in a pixel within the next ``spec.flow_interval`` seconds; NaN where
        nothing is hit, or where the point leaves what the lens sees. It may lead out of the image.
    object_pixels : ndarray of int32, shape (num_objects,)
        Pixels of the instance image, in the order of `Frame.objects`, as all that follows.
    object_box, object_visible_box : ndarray of float32, shape (num_objects, 4)
        Smallest rectangle [px] (left, top, right, bottom) around all of the object that would be in the image if
        nothing hid it, and around what is seen; NaN where there is nothing. Pixel centres lie at half numbers.
    object_occlusion : ndarray of float32, shape (num_objects,)
        Share of the object's silhouette in the image that something nearer hides, 0 to 1; NaN where it is not in the
        image.
    object_truncation : ndarray of float32, shape (num_objects,)
        Share of its silhouette that lies outside of the image, 0 to 1; NaN where nothing of it is in the image. Of its
        area on the plane before the camera up to 76 deg off the axis; of a fisheye, in angles off the axis.
    """

    spec: CameraSpec
    world_from_sensor: Pose
    rgb: npt.NDArray[np.uint8] | None = None
    depth: npt.NDArray[np.float32] | None = None
    semantic: npt.NDArray[np.uint8] | None = None
    instance: npt.NDArray[np.uint16] | None = None
    normal: npt.NDArray[np.float32] | None = None
    flow: npt.NDArray[np.float32] | None = None
    object_pixels: npt.NDArray[np.int32] | None = None
    object_box: npt.NDArray[np.float32] | None = None
    object_visible_box: npt.NDArray[np.float32] | None = None
    object_occlusion: npt.NDArray[np.float32] | None = None
    object_truncation: npt.NDArray[np.float32] | None = None

    @property
    def picture(self) -> npt.NDArray[np.uint8] | None:
        """What a person looks at first: the RGB image, or the colours of the classes, shape (height, width, 3).

        None without both.
        """
        if self.rgb is not None:
            return self.rgb
        return None if self.semantic is None else SEMANTIC_COLORS[self.semantic]

    def plot(self, image: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw one of the images.

        Parameters
        ----------
        image : {"rgb", "depth", "semantic", "instance", "normal", "flow"}, optional
            Default: the first of them that the camera made. Depth in metres, logarithmic; flow as its length in pixels
            with arrows.
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError, ParameterRangeError
            If the frame does not hold this image, or none at all.
        """
        from .prompt.images import plot_image

        return plot_image(self, image, ax)

    def _repr_html_(self) -> str:
        shown = "" if self.picture is None else thumbnail(self.picture)
        return html_table(type(self).__name__, self._facts(), shown)


@dataclass(frozen=True, eq=False, repr=False)
class LidarScan(Described, units={"position": "m", "distance": "m", "radial_velocity": "m/s", "time": "s"}):
    """Returns of one lidar, one row a return, in the order of the shot numbers and of the distance in each shot.

    What the receiver measured (distance, radial velocity, position, carrier-to-noise ratio) holds its noise; labels,
    normal, incidence and reflectance are those of the surface. A return from fog or rain and a false alarm have
    instance 0, class Unlabeled, reflectance 0 and a zero normal.

    Attributes
    ----------
    spec : LidarSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    shot : ndarray of int32, shape (num_points,)
        Number of the shot in the order of `spec.scan`.
    position : ndarray of float32, shape (num_points, 3)
        In the sensor frame at the shot's own time, or at the timestamp if `spec.deskew` [m].
    distance : ndarray of float32, shape (num_points,)
        Along the ray [m].
    radial_velocity : ndarray of float32, shape (num_points,)
        Positive when opening; from the target's and the sensor's motion [m/s]. NaN where a
        single chirp or a pulse cannot tell.
    intensity : ndarray of float32, shape (num_points,)
        Received power relative to a normally hit white diffuser at 1 m without atmosphere; a heterodyne receiver adds
        speckle and noise to it.
    cos_incidence : ndarray of float32, shape (num_points,)
    normal : ndarray of float32, shape (num_points, 3)
        Surface normal in the sensor frame of `position`, towards the sensor.
    semantic : ndarray of uint8, shape (num_points,)
    instance : ndarray of uint16, shape (num_points,)
    time : ndarray of float32, shape (num_points,)
        Time of the shot after the frame's timestamp [s].
    return_index : ndarray of uint8, shape (num_points,)
        0 for the first return of its shot, 1 for the next farther one, ...
    reflectance : ndarray of float32, shape (num_points,)
        Diffuse reflectance of the surface at the lidar's wavelength.
    cnr : ndarray of float32, shape (num_points,)
        Measured carrier-to-noise ratio of the beat after the transform of one chirp, of a pulse its squared peak over
        the noise's variance, linear; NaN if the receiver has none.
    beat_signal : ndarray of complex64, shape (num_shots, 2, num_samples), or None
        Up and down chirp of every shot in units of the noise's standard deviation a sample; only on request.
    waveform : ndarray of float32, shape (num_shots, num_samples), or None
        Filtered output of a pulsed receiver over time, in photoelectrons of the pulse's peak; only on request.
    object_points : ndarray of int32, shape (num_objects,), or None
        Returns of each object, in the order of `Frame.objects`.
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
    time: npt.NDArray[np.float32] | None = None
    return_index: npt.NDArray[np.uint8] | None = None
    reflectance: npt.NDArray[np.float32] | None = None
    cnr: npt.NDArray[np.float32] | None = None
    beat_signal: npt.NDArray[np.complex64] | None = None
    waveform: npt.NDArray[np.float32] | None = None
    object_points: npt.NDArray[np.int32] | None = None

    @property
    def num_points(self) -> int:
        """Number of returns."""
        return int(self.distance.shape[0])

    def plot(self, color: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw the returns from above, in the sensor frame.

        Parameters
        ----------
        color : {"radial_velocity", "distance", "intensity", "reflectance", "height", "time"}, optional
            What a point's colour stands for; default: radial velocity, or height where the receiver tells none.
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError, ParameterRangeError
            If there is no such quantity, or the scan does not hold it.
        """
        from .prompt.images import plot_lidar

        return plot_lidar(self, color, ax)


@dataclass(frozen=True, eq=False, repr=False)
class RadarFrame(
    Described,
    units={
        "adc_scale": "sqrt(W)",
        "cell_power": "W",
        "object_power": "W",
        "object_ghost_power": "W",
        "interference_power": "W",
    },
):
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
    cell_instance : ndarray of uint16, shape (num_doppler_bins, num_range_bins), or None
        Ground truth of the range-Doppler map with Hann windows and without zero padding: the instance with most power
        in the cell; 0 where no path reaches. Only with ``cell_labels`` of the settings.
    cell_share, cell_ghost_share : ndarray of uint8, same shape, or None
        That instance's share of the cell's power, and the share of all power that came by multipath, times 255.
    cell_power : ndarray of float32, same shape, or None
        Power of all paths in the cell without noise [W]; compare with `RangeDoppler.noise_power`.
    object_power, object_ghost_power : ndarray of float64, shape (num_objects,), or None
        Power of an object over all cells of that map, direct and by multipath [W], in the order of `Frame.objects`. The
        cells of two Hann windows overlap: it is 2.25 times the power that one channel receives from the object, in long
        frames (1.5 = N sum(w^2) / (sum w)^2 of a window over N chirps or samples).
    interference_hit : ndarray of bool, shape (num_chirps_total, num_samples), or None
        Samples with more power of other radars than of thermal noise, mean over the receivers. Only where the settings
        have `interferers`, as the next.
    interference_power : ndarray of float32, shape (num_doppler_bins, num_range_bins), or None
        Power of other radars in the cells of that map [W], mean over the channels.
    """

    spec: RadarSpec
    world_from_sensor: Pose
    adc_int: npt.NDArray[np.int16]
    adc_scale: float
    num_saturated: int = 0
    num_paths: int = 0
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    cell_instance: npt.NDArray[np.uint16] | None = None
    cell_share: npt.NDArray[np.uint8] | None = None
    cell_ghost_share: npt.NDArray[np.uint8] | None = None
    cell_power: npt.NDArray[np.float32] | None = None
    object_power: npt.NDArray[np.float64] | None = None
    object_ghost_power: npt.NDArray[np.float64] | None = None
    interference_hit: npt.NDArray[np.bool_] | None = None
    interference_power: npt.NDArray[np.float32] | None = None

    def _facts(self) -> Iterable[Row]:
        yield "adc", f"complex64 {self.adc_int.shape[:-1]} = (num_rx, num_chirps_total, num_samples) [sqrt(W)]"
        yield from field_rows(self, without=("adc_int", "diagnostics"))
        yield "diagnostics", listed(self.diagnostics)

    @property
    def adc(self) -> npt.NDArray[np.complex64]:
        """Beat signal [sqrt(W)], complex64, shape (num_rx, num_chirps_total, num_samples)."""
        scaled = self.adc_int.astype(np.float32) * np.float32(self.adc_scale)
        return np.ascontiguousarray(scaled).view(np.complex64)[..., 0]


@dataclass(frozen=True, eq=False, repr=False)
class ClosedRadarFrame(Described):
    """The map of a radar that gives no raw data, at one instant.

    Attributes
    ----------
    spec : ClosedRadarSpec
    world_from_sensor : Pose
        Radar frame (x boresight, y left, z up) at the start of the frame.
    power : ndarray of float32, shape (num_velocity, num_range, num_azimuth)
        Of the cells in ``spec.axes``, in the device's unit: [W] times its gain.
    num_paths : int
        Paths that the map was made of.
    diagnostics : mapping
        What the solver chose and left out.
    """

    spec: ClosedRadarSpec
    world_from_sensor: Pose
    power: npt.NDArray[np.float32]
    num_paths: int = 0
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> Iterable[Row]:
        yield "power", f"float32 {self.power.shape} = (num_velocity, num_range, num_azimuth) [W, times the gain]"
        yield "num_paths", str(self.num_paths)
        yield "diagnostics", listed(self.diagnostics)


SensorResult = ImageFrame | LidarScan | RadarFrame | RadioChannels | RadarScan | ClosedRadarFrame


@dataclass(frozen=True, eq=False, repr=False)
class ObjectState(Described, units={"size": "m", "tight_center": "m", "tight_size": "m"}):
    """Ground truth of one object at one instant.

    `world_from_box` is the pose of the centre of its oriented box with extents `size` (length, width, height) [m]. Both
    belong to the track: the size is one, and the centre moves with the body, at the velocity `twist`. The box of a
    walker has room for its steps.
    `num_pixels`, `num_lidar_points` count what the frame's cameras and lidars see of it, summed over sensors.
    `tight_center`, `tight_size` are the box around the object as it is at this instant, limbs and all: its centre
    relative to that of the other box, in the axes of that box, and its extents along them [m]; left out: the same box.
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
    tight_center: npt.NDArray[np.float64] = None  # type: ignore[assignment]  # follows from the box
    tight_size: npt.NDArray[np.float64] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.tight_center is None:
            object.__setattr__(self, "tight_center", np.zeros(3))
        if self.tight_size is None:
            object.__setattr__(self, "tight_size", self.size)

    @property
    def world_from_tight_box(self) -> Pose:
        """Pose of the centre of the box around the object at this instant, which has the extents `tight_size`."""
        return self.world_from_box.compose(Pose(self.tight_center))


@dataclass(frozen=True, eq=False, repr=False)
class Frame(Described):
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

    def _facts(self) -> Iterable[Row]:
        yield "index", str(self.index)
        yield "time", quantity(self.timestamp_ns * 1e-9, "s")
        yield "seed", str(self.seed)
        yield "world_from_vehicle", repr(self.world_from_vehicle)
        yield "vehicle_twist", repr(self.vehicle_twist)
        for name, found in (("radars", self.radars), ("images", self.images), ("lidars", self.lidars)):
            yield name, f"{len(found)}: {listed(found)}" if found else "none"
        if self.radar_scans:
            yield "radar_scans", f"{len(self.radar_scans)}: {listed(self.radar_scans)}"
        if self.closed_radars:
            yield "closed_radars", f"{len(self.closed_radars)}: {listed(self.closed_radars)}"
        if self.radios:
            yield "radios", f"{len(self.radios)}: {listed(self.radios)}"
        counts = Counter(SEMANTIC_CLASSES[item.semantic] for item in self.objects)
        yield "objects", f"{len(self.objects)}: " + listed(f"{count} {name}" for name, count in counts.most_common())
        yield "timings", listed(f"{stage} {quantity(taken, 's')}" for stage, taken in self.timings.items())

    def _repr_html_(self) -> str:
        seen = [image.picture for image in self.images.values() if image.picture is not None]
        return html_table(type(self).__name__, self._facts(), thumbnail(seen[0]) if seen else "")

    def plot(self, suite: str | None = None, title: str = "", max_range: float = 100.0, markers: bool = True) -> Figure:
        """Return a contact sheet: images, lidar depth and radar maps of one suite.

        Parameters
        ----------
        suite : str, optional
            Group of sensors, the part of their names before the last ``/``; default: ``front_center`` if there, else
            the first.
        title : str
            First words of the headline, for instance the scene's name.
        max_range : float
            Last range and depth shown [m].
        markers : bool
            Mark the true places of the moving objects on the radar maps.

        Returns
        -------
        matplotlib.figure.Figure
            For a notebook, or ``savefig``.

        Raises
        ------
        UnknownNameError
            If the frame has no such suite.
        """
        return frame_plot()(self, suite=suite, title=title, max_range=max_range, markers=markers)

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

    @property
    def radar_scans(self) -> dict[str, RadarScan]:
        """Turns of scanning radars by sensor name."""
        return self.of_type(RadarScan)

    @property
    def closed_radars(self) -> dict[str, ClosedRadarFrame]:
        """Maps of radars without raw data by sensor name."""
        return self.of_type(ClosedRadarFrame)

    @property
    def radios(self) -> dict[str, RadioChannels]:
        """Channels of radio links by sensor name."""
        return self.of_type(RadioChannels)
