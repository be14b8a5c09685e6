"""A scenario at a glance: a bird's-eye animation of what moves, and a strip of renders from the ego vehicle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from scarl_sionna.core.errors import MissingPackageError, OutputError, ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, semantic_id
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Picture = npt.NDArray[np.uint8]
OnProgress = Callable[[str, int, int], None]

LARGEST = 760
"""Longer side of the plan [px]."""
SMOOTH = 2
"""The plan is drawn this many times larger and averaged."""
MARGIN, NARROWEST = 14.0, 40.0
"""Around everything that moves, and least side of the plan [m]."""
WIDEST, AROUND_EGO = 260.0, 55.0
"""A longer plan shows the ego vehicle's way with so much around it, or follows it where that is too long as well [m]."""
LARGEST_GROUND = 2200
"""Longer side of the ground that a plan which follows is cut out of [px]."""
HEAD_ROOM = 3.4
"""Where something covers what moves, the plan is a cut at this height above the ego vehicle's ground [m]."""
COVERS = frozenset(map(semantic_id, ("Vegetation", "Bridge", "Pole", "TrafficLight", "TrafficSign", "Static")))
"""Classes that the plan looks through where they are higher than the cut."""
DEEP = 100.0
"""What is this far below the ego vehicle is not drawn [m]."""
TRAIL = 2.0
"""Length of the trails [s]."""
MAX_FRAMES = 240
STRIP_FRAMES = 5
STRIP_CAMERA = CameraSpec(width=384, height=216, horizontal_fov_deg=75.0, samples_per_pixel=8, images=("rgb",))

GROUND_COLORS = {
    "Roads": (74, 76, 80), "RoadLine": (226, 226, 218), "SideWalks": (158, 156, 150), "Building": (112, 92, 84), "Wall": (128, 126, 122),
    "Vegetation": (84, 118, 66), "Terrain": (128, 148, 96), "Ground": (146, 142, 128), "Bridge": (150, 148, 146),
    "GuardRail": (196, 200, 206), "Fence": (122, 100, 80), "Water": (86, 122, 150),
}  # fmt: skip
OTHER_COLOR = (104, 102, 108)
NOTHING_COLOR = (36, 38, 42)
ACTOR_COLORS = {
    "Car": (86, 156, 240), "Truck": (240, 160, 60), "Bus": (232, 196, 60), "Pedestrian": (236, 88, 120), "Rider": (200, 110, 230),
    "Bicycle": (200, 110, 230), "Motorcycle": (170, 90, 220),
}  # fmt: skip
EGO_COLOR = (70, 220, 130)


@dataclass(frozen=True)
class Preview:
    """Files that :func:`write_preview` wrote; `strip` is None if the scenario has no ego vehicle."""

    animation: Path
    strip: Path | None
    num_frames: int


@dataclass(frozen=True)
class _View:
    """Part of the plane that a picture shows: centre [m], half extents [m], pixels a metre."""

    centre: npt.NDArray[np.float64]
    half: npt.NDArray[np.float64]
    scale: float

    @property
    def longest(self) -> float:
        """Return the longer side [m]."""
        return 2.0 * float(self.half.max())

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px], even: video codecs want that."""
        width, height = (2 * max(int(np.round(side * self.scale)), 8) for side in self.half)
        return width, height

    def pixel(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return columns and rows of points (n, 2) [m]; x runs to the right, y up."""
        away = (np.asarray(points, dtype=np.float64) - self.centre) * self.scale * SMOOTH
        width, height = self.size
        return np.stack([width * SMOOTH / 2 + away[:, 0], height * SMOOTH / 2 - away[:, 1]], axis=1)


def write_preview(
    scenario: ScenarioSpec,
    out: str | Path,
    *,
    frame_rate: float | None = None,
    strip: bool = True,
    on_progress: OnProgress = lambda stage, done, total: None,
) -> Preview:
    """Draw a scenario from above as an animation, and its ego vehicle's front view as a strip of pictures.

    Parameters
    ----------
    scenario : ScenarioSpec
    out : path
        A ``.gif`` or ``.mp4`` file; the strip is written beside it, as ``<name>_strip.png``.
    frame_rate : float, optional
        Of the animation [Hz]; by default the scenario's, or less for more than 240 frames. It plays in real time.
    strip : bool
        False leaves the renders out.
    on_progress : callable
        Called with stage, pictures done and pictures in all.

    Raises
    ------
    ParameterRangeError
        If the file's suffix or the frame rate is not allowed.
    MissingPackageError
        If an MP4 file is asked for and imageio-ffmpeg is not there.
    OutputError
        If a file cannot be written.
    ScenarioError
        If the scenario cannot be built.
    """
    path = Path(out)
    if path.suffix not in (".gif", ".mp4"):
        raise ParameterRangeError("out", path, "a name that ends in .gif or .mp4")
    if frame_rate is not None and not 0.0 < frame_rate <= 100.0:
        raise ParameterRangeError("frame_rate", f"{frame_rate} Hz", "above 0 and at most 100 Hz")
    if path.suffix == ".mp4":
        _ffmpeg()
    on_progress("scene", 0, 1)
    world = load_world(scenario)
    on_progress("scene", 1, 1)
    times = _times(scenario, frame_rate)
    rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 1.0
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        pictures = _plans(world, times, lambda done: on_progress("plan", done, len(times)))
        (_write_mp4 if path.suffix == ".mp4" else _write_gif)(path, pictures, rate)
        file = None
        if strip and world.ego is not None:
            file = path.with_name(f"{path.stem}_strip.png")
            count = min(STRIP_FRAMES, len(times))
            chosen = [times[int(i)] for i in np.linspace(0, len(times) - 1, count)]
            _strip(world, chosen, scenario.seed, lambda done: on_progress("renders", done, count)).save(file)
    except OSError as error:
        raise OutputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable folder with room"
        ) from error
    return Preview(path, file, len(times))


def _times(scenario: ScenarioSpec, frame_rate: float | None) -> list[float]:
    times = scenario.times
    span = times[-1] - times[0]
    rate = frame_rate or min(scenario.frame_rate, MAX_FRAMES / max(span, 1e-9))
    count = int(np.floor(span * rate + 1e-6)) + 1
    return [times[0] + index / rate for index in range(count)]


def _plans(world: World, times: Sequence[float], on_done: Callable[[int], None]) -> Iterator[Picture]:
    """Yield the plan at each time."""
    states = [world.at(time) for time in times]
    frames = [[item for item in state.boxes() if item.is_actor] for state in states]
    places = [{item.name: item.world_from_box.position[:2] for item in frame} for frame in frames]
    whole = _view_of(np.array([place for frame in places for place in frame.values()] or [np.zeros(2)]))
    track = np.array([frame[world.ego] for frame in places]) if world.ego is not None else None
    if track is not None and whole.longest > WIDEST:
        whole = _view_of(track, AROUND_EGO)
    follows = track is not None and whole.longest > WIDEST
    ground = _ground(states[0], whole)
    for index, frame in enumerate(frames):
        view, own = whole, ground
        if follows and track is not None:
            view = _view_of(track[index][None], AROUND_EGO)
            own = _cut_out(ground, whole, view)
        first = max(0, index - int(np.ceil(TRAIL / max(times[1] - times[0], 1e-9)))) if len(times) > 1 else 0
        picture = _drawn(Image.fromarray(own), view, world, frame, places[first : index + 1], times[index])
        yield np.asarray(picture)
        on_done(index + 1)


def _cut_out(ground: Picture, whole: _View, view: _View) -> Picture:
    """Return the part of a plan that another view shows, by the nearest pixel."""
    width, height = view.size
    x = view.centre[0] + (np.arange(width) + 0.5 - width / 2.0) / view.scale
    y = view.centre[1] - (np.arange(height) + 0.5 - height / 2.0) / view.scale
    column = ((x - whole.centre[0]) * whole.scale + ground.shape[1] / 2.0).astype(int)
    row = ((whole.centre[1] - y) * whole.scale + ground.shape[0] / 2.0).astype(int)
    inside = np.ix_(np.clip(row, 0, ground.shape[0] - 1), np.clip(column, 0, ground.shape[1] - 1))
    return np.asarray(ground[inside])


def _view_of(points: npt.NDArray[np.float64], margin: float = MARGIN) -> _View:
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    half = np.maximum((high - low) / 2.0, NARROWEST / 2.0)
    half = np.maximum(half, half.max() * 0.45)
    longest = 2.0 * float(half.max())
    return _View((low + high) / 2.0, half, (LARGEST if longest <= WIDEST else LARGEST_GROUND) / longest)


def _ground(state: WorldState, view: _View) -> Picture:
    """Return the static scene from above, in colours of the classes, shaded by height and slope."""
    from scarl_sionna.engine.rays.apart import stand_apart

    width, height = view.size
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x = view.centre[0] + (column.ravel() - width / 2.0) / view.scale
    y = view.centre[1] - (row.ravel() - height / 2.0) / view.scale
    ego = state.world.ego
    floor = float(state.actor_pose(ego).position[2]) if ego is not None else 0.0
    static = stand_apart(state.world).state
    _, upper = state.world._triangles.bounds()
    classes, level, slope = _looked_down(static, x, y, float(upper[:, 2].max()) + 1.0)
    cut, covered = floor + HEAD_ROOM, False
    if ego is not None:
        above = static.cast(state.actor_pose(ego).position + [0.0, 0.0, 1.0], np.array([[0.0, 0.0, 1.0]]))
        covered = above.num_hits > 0 and not np.isin(state.world.parts.semantic[above.part], list(COVERS)).any()
        cut = min(cut, floor + 1.0 + 0.8 * float(above.distance[0])) if covered else cut
    low_classes, low_level, low_slope = _looked_down(static, x, y, cut)
    through = covered | (np.isin(classes, list(COVERS)) & (level > cut))
    classes, level, slope = (
        np.where(through, low, top) for low, top in ((low_classes, classes), (low_level, level), (low_slope, slope))
    )
    palette = np.array(
        [GROUND_COLORS.get(name, OTHER_COLOR) for name in SEMANTIC_CLASSES] + [NOTHING_COLOR], dtype=np.float64
    )
    shade = np.clip(0.72 + 0.28 * slope + 0.012 * np.clip(level - floor, -5.0, 25.0), 0.5, 1.25)
    return np.clip(palette[classes] * shade[:, None], 0, 255).astype(np.uint8).reshape(height, width, 3)


def _looked_down(
    state: WorldState, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], top: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return class (one past the last for nothing), height and cosine of the slope of what stands below points."""
    count = len(x)
    origins = np.stack([x, y, np.full(count, top)], axis=1)
    hits = state.cast(origins, np.broadcast_to([0.0, 0.0, -1.0], (count, 3)))
    classes = np.full(count, len(SEMANTIC_CLASSES), dtype=np.int64)
    level, slope = np.zeros(count), np.ones(count)
    body = state.world.parts.actor[hits.part] < 0
    ray = hits.ray[body]
    classes[ray] = state.world.parts.semantic[hits.part[body]]
    level[ray], slope[ray] = hits.point[body, 2], hits.cos_incidence[body]
    return classes, level, slope


def _drawn(
    ground: Image.Image, view: _View, world: World, actors: Sequence[ObjectState],
    trail: Sequence[dict[str, npt.NDArray[np.float64]]], time: float,
) -> Image.Image:  # fmt: skip
    """Draw actors with their trails, a scale and the time."""
    width, height = view.size
    large = ground.resize((width * SMOOTH, height * SMOOTH), Image.Resampling.NEAREST)
    pen = ImageDraw.Draw(large, "RGBA")
    for item in actors:
        color = _color(item, world)
        past = np.array([step[item.name] for step in trail if item.name in step])
        if len(past) > 1:
            pen.line([tuple(point) for point in view.pixel(past)], fill=(*color, 150), width=2 * SMOOTH)
    for item in actors:
        color = _color(item, world)
        size = np.maximum(item.size[:2], 0.7)
        corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size
        nose = np.array([(0.18, -0.42), (0.46, 0.0), (0.18, 0.42)]) * size
        for shape, fill in ((corners, (*color, 255)), (nose, (20, 24, 30, 200))):
            flat = np.column_stack([shape, np.zeros(len(shape))])
            outline = (16, 18, 22, 255) if shape is corners else None
            pen.polygon(
                [tuple(p) for p in view.pixel(item.world_from_box.apply(flat)[:, :2])], fill=fill, outline=outline
            )
    picture = large.resize((width, height), Image.Resampling.LANCZOS)
    _annotate(ImageDraw.Draw(picture, "RGBA"), view, world, actors, time)
    return picture


def _color(item: ObjectState, world: World) -> tuple[int, int, int]:
    if item.name == world.ego:
        return EGO_COLOR
    return ACTOR_COLORS.get(SEMANTIC_CLASSES[item.semantic], (210, 210, 210))


def _annotate(pen: Any, view: _View, world: World, actors: Sequence[ObjectState], time: float) -> None:
    """Write the time and the ego vehicle's speed, and draw a scale."""
    font = ImageFont.load_default(15)
    ego = next((item for item in actors if item.name == world.ego), None)
    text = f"{world.name}   t = {time:.1f} s" + (
        f"   ego {np.linalg.norm(ego.twist.linear):.1f} m/s" if ego is not None else ""
    )
    pen.rectangle((0, 0, pen.textlength(text, font=font) + 16, 25), fill=(18, 20, 24, 190))
    pen.text((8, 3), text, fill=(240, 240, 240), font=font)
    length = max(step for step in (5, 10, 20, 50, 100) if step * view.scale <= view.size[0] / 3 or step == 5)
    right, bottom = view.size[0] - 12, view.size[1] - 12
    pen.rectangle((right - length * view.scale - 8, bottom - 24, right + 8, bottom + 8), fill=(18, 20, 24, 190))
    pen.line((right - length * view.scale, bottom, right, bottom), fill=(240, 240, 240), width=3)
    pen.text((right - length * view.scale, bottom - 21), f"{length} m", fill=(240, 240, 240), font=font)


def _strip(world: World, times: Sequence[float], seed: int, on_done: Callable[[int], None]) -> Image.Image:
    """Return renders from the ego vehicle's front, side by side."""
    rig = Rig("strip", (SensorMount("front", "camera", STRIP_CAMERA, Pose(np.array([2.36, 0.0, 1.2]))),))
    pictures = []
    for number, time in enumerate(times):
        rgb = observe(world, rig, time, seed).images["front"].rgb
        assert rgb is not None  # STRIP_CAMERA asks for it
        picture = Image.fromarray(rgb)
        pen = ImageDraw.Draw(picture, "RGBA")
        pen.rectangle((0, 0, 74, 22), fill=(18, 20, 24, 190))
        pen.text((7, 2), f"{time:.1f} s", fill=(240, 240, 240), font=ImageFont.load_default(14))
        pictures.append(picture)
        on_done(number + 1)
    gap = 4
    width = sum(item.width + gap for item in pictures) - gap
    strip = Image.new("RGB", (width, pictures[0].height), (255, 255, 255))
    left = 0
    for item in pictures:
        strip.paste(item, (left, 0))
        left += item.width + gap
    return strip


def _write_gif(path: Path, pictures: Iterator[Picture], rate: float) -> None:
    frames: list[Image.Image] = []
    palette: Image.Image | None = None
    for picture in pictures:
        image = Image.fromarray(picture)
        palette = palette or _palette(image)
        frames.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    # hundredths of a second are all that a GIF knows: their sum keeps the time
    marks = np.rint(np.arange(len(frames) + 1) * 100.0 / rate).astype(int)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=[10 * int(step) for step in np.diff(marks)], loop=0, optimize=False,
    )  # fmt: skip


def _palette(picture: Image.Image) -> Image.Image:
    """Return 256 colours of a picture; those of actors, which cover few pixels, get room of their own."""
    colors = [EGO_COLOR, *ACTOR_COLORS.values()]
    with_colors = Image.new("RGB", (picture.width, picture.height + 16 * len(colors)))
    with_colors.paste(picture, (0, 0))
    for number, color in enumerate(colors):
        with_colors.paste(color, (0, picture.height + 16 * number, picture.width, picture.height + 16 * (number + 1)))
    return with_colors.quantize(256, dither=Image.Dither.NONE)


def _write_mp4(path: Path, pictures: Iterator[Picture], rate: float) -> None:
    writer = None
    try:
        for picture in pictures:
            if writer is None:
                size = (picture.shape[1], picture.shape[0])
                writer = _ffmpeg().write_frames(
                    str(path), size, fps=rate, macro_block_size=2, quality=7, ffmpeg_log_level="error"
                )
                writer.send(None)
            writer.send(np.ascontiguousarray(picture))
    finally:
        if writer is not None:
            writer.close()


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingPackageError("imageio-ffmpeg", "video") from error
    return imageio_ffmpeg
