"""What networks are fed with: radar maps, radar points, images and road users of every frame of a dataset."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

import scarl_sionna as ss
from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.dataset.derived.radar_points import velocity_over_ground
from scarl_sionna.dataset.readers.reader import Dataset, StoredFrame
from scarl_sionna.dataset.statistics.groups import GROUP_OF_SEMANTIC, weather_name
from scarl_sionna.signal.angle import RangeDopplerAngle

from .grid import Objects, PolarGrid

Array = npt.NDArray[np.float32]

METHODS = ("auto", "raycast")
"""Ways in which the radar of a frame may be simulated, a sensor of the rig each."""
INPUTS = ("map", "points", "camera and map")
"""What a network may see."""
CAMERA = "front/camera"
GRID = PolarGrid()
MOST_POINTS = 256
"""The strongest radar points of a frame; the rest are left out."""
FEWEST_PIXELS = 12
"""Road users of whom the camera sees less count neither as labels nor as objects to be found."""
NEAREST = 3.0
"""Distance from the radar from which road users count [m]."""
FULL_SNR_DB = 60.0
"""Signal-to-noise ratio that is 1 to a network [dB]."""
VELOCITY_BINS = ((0, 0), (1, 1), (-1, -1), (2, 4), (-4, -2), (5, None), (None, -5))
"""Groups of Doppler bins over ground, first and last: standing, then slowly, faster and fast opening and closing."""
POINT_FEATURES = ("range", "sine of azimuth", "SNR", "RCS", "velocity over ground", "its size")


@dataclass(frozen=True, eq=False)
class Samples:
    """Frames as arrays, the first axis is the frame.

    Attributes
    ----------
    methods : tuple of str
        Those of `METHODS` whose radar the dataset has, the most accurate first.
    drives : ndarray of str, shape (N,)
        Scenario and seed; variants of a drive in other weather share it.
    weather, splits : ndarray of str, shape (N,)
    maps : dict of str to ndarray of float16, shape (N, num_range, num_sine, num_velocity_groups)
        By method: signal-to-noise ratio, 0 to 1 for 0 to 60 dB.
    points : dict of str to ndarray of float32, shape (N, MOST_POINTS, num_features)
        By method: see `POINT_FEATURES`; rows of nan: no point.
    images : ndarray of uint8, shape (N, height, width, 3)
    objects : list of Objects
    """

    methods: tuple[str, ...]
    drives: npt.NDArray[np.str_]
    weather: npt.NDArray[np.str_]
    splits: npt.NDArray[np.str_]
    maps: dict[str, npt.NDArray[np.float16]]
    points: dict[str, Array]
    images: npt.NDArray[np.uint8]
    objects: list[Objects]

    def __len__(self) -> int:
        return len(self.drives)

    def digest(self) -> str:
        """Return a text that tells these frames from others."""
        told = hashlib.sha256()
        for part in (self.drives, self.weather, self.splits):
            told.update("\n".join(part).encode())
        for some in self.objects:
            told.update(some.places.tobytes())
        for method in self.methods:
            told.update(method.encode() + self.maps[method].tobytes())
        return told.hexdigest()[:16]

    def rows(self, split: str, weather: str | None = None, drives: Sequence[str] | None = None) -> npt.NDArray[np.intp]:
        """Return the numbers of the frames of a split, of all or one weather, of all or some drives."""
        chosen = self.splits == split
        if weather is not None:
            chosen &= self.weather == weather
        if drives is not None:
            chosen &= np.isin(self.drives, drives)
        return np.flatnonzero(chosen)


def read_samples(*places: str | Path) -> Samples:
    """Return all frames of datasets that a command of docs/baseline.md made, of one rig.

    Raises
    ------
    UnknownNameError
        If one has no radar of a known method.
    """
    datasets: list[Dataset] = [ss.open_dataset(place) for place in places]
    dataset = datasets[0]
    methods = tuple(method for method in METHODS if all(f"{method}/radar" in one.sensors for one in datasets))
    if not methods:
        raise UnknownNameError(
            "sensor", f"{METHODS[0]}/radar", dataset.sensors, "make it with examples/baseline/rig.yaml"
        )
    split_of = {scene: split for one in datasets for split, scenes in one.splits.items() for scene in scenes}
    names = [(name, one.scene(name)) for one in datasets for name in one.scenes]
    frames = [(name, frame) for name, scene in names for frame in scene]
    weather = {name: weather_name(scene.configuration) for name, scene in names}
    maps: dict[str, list[Array]] = {method: [] for method in methods}
    points: dict[str, list[Array]] = {method: [] for method in methods}
    for _, frame in frames:
        for method in methods:
            radar_map, radar_points = radar_inputs(frame, f"{method}/radar")
            maps[method].append(radar_map.astype(np.float16))
            points[method].append(radar_points)
    return Samples(
        methods,
        np.array([name.partition("_weather")[0] for name, _ in frames]),
        np.array([weather[name] for name, _ in frames]),
        np.array([split_of[name] for name, _ in frames]),
        {method: np.stack(rows) for method, rows in maps.items()},
        {method: np.stack(rows) for method, rows in points.items()},
        np.stack([frame.image[CAMERA].rgb for _, frame in frames]),
        [road_users(frame) for _, frame in frames],
    )


def road_users(frame: StoredFrame, grid: PolarGrid = GRID) -> Objects:
    """Return the road users inside of the grid that the camera sees something of, in the radar's frame."""
    labels = frame.label_arrays
    radar: Pose = next(iter(frame.radar.values())).world_from_sensor
    places = radar.inverse().apply(labels["world_from_box"][:, :3])[:, :2]
    kinds = GROUP_OF_SEMANTIC[labels["semantic"]].astype(np.int64)
    seen = (kinds >= 0) & (labels["num_pixels"] >= FEWEST_PIXELS) & grid.inside(places)
    seen &= np.hypot(*places.T) >= NEAREST
    return Objects(places[seen], kinds[seen], np.ones(int(seen.sum())))


def radar_inputs(frame: StoredFrame, sensor: str, grid: PolarGrid = GRID) -> tuple[Array, Array]:
    """Return a radar's map and points of a frame, with the vehicle's own motion taken out; see `Samples`."""
    radar = frame.radar[sensor]
    vehicle, twist, mount = frame.world_from_vehicle, frame.vehicle_twist, radar.world_from_sensor
    own = mount.inverse().rotate(twist.velocity_at(mount.position - vehicle.position))
    rda = ss.range_doppler_angle(ss.virtual_cube(radar.adc, radar.spec), radar.spec)
    found = ss.detect(rda, radar.spec)
    unit = found.position / np.maximum(found.range, 1e-9)[:, None]
    velocity = velocity_over_ground(found, own)
    columns = [
        found.range / grid.max_range,
        unit[:, 1],
        found.snr_db / FULL_SNR_DB,
        np.log10(np.maximum(np.nan_to_num(found.rcs, nan=1.0), 1e-6)) / 3.0,  # 0 dBsm where it is not known
        velocity / 10.0,
        np.minimum(np.abs(velocity), 1.0),
    ]
    inside = np.flatnonzero(grid.inside(found.position[:, :2]))[:MOST_POINTS]  # the strongest come first
    points = np.full((MOST_POINTS, len(POINT_FEATURES)), np.nan, np.float32)
    points[: len(inside)] = np.stack(columns, axis=1)[inside]
    return velocity_map(rda, own, grid), points


def velocity_map(rda: RangeDopplerAngle, own: npt.NDArray[np.float64], grid: PolarGrid = GRID) -> Array:
    """Return the strongest power of every cell of a grid by groups of velocity over ground, 0 to 1 for 0 to 60 dB.

    Parameters
    ----------
    rda : RangeDopplerAngle
        Without elevation.
    own : ndarray, shape (3,)
        Velocity of the radar over ground in its own axes [m/s].
    grid : PolarGrid

    Returns
    -------
    ndarray of float32, shape (num_range, num_sine, num_velocity_groups)
        Signal-to-noise ratio over 60 dB, within 0 and 1, by `VELOCITY_BINS`.
    """
    num_doppler = len(rda.radial_velocity)
    step = rda.radial_velocity[1] - rda.radial_velocity[0]
    middle = int(np.argmin(np.abs(rda.radial_velocity)))
    sine = np.sin(rda.azimuth)
    columns = np.floor((sine + grid.max_sine) / grid.sine_step).astype(int)
    rows = np.floor(np.asarray(rda.range) / grid.range_step).astype(int)
    rows = rows[rows < grid.num_range]
    out = np.zeros((*grid.shape, len(VELOCITY_BINS)), np.float32)
    for number, column in enumerate(columns):
        if not 0 <= column < grid.num_sine:
            continue
        standing = middle - round(float(own[0] * np.cos(rda.azimuth[number]) + own[1] * sine[number]) / float(step))
        power = np.roll(rda.data[:, : len(rows), number], num_doppler // 2 - standing, axis=0)
        for group, (first, last) in enumerate(VELOCITY_BINS):
            start = 0 if first is None else num_doppler // 2 + first
            stop = num_doppler if last is None else num_doppler // 2 + last + 1
            np.maximum.at(out[:, column, group], rows, power[start:stop].max(axis=0))
    level = 10.0 * np.log10(np.maximum(out / rda.noise_power, 1e-9))
    return np.clip(level / FULL_SNR_DB, 0.0, 1.0).astype(np.float32)
