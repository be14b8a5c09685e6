"""A scenario at a glance: a bird's-eye animation of what moves, and a strip of renders from the ego vehicle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from scarl_sionna.core.errors import MissingPackageError, OutputError, ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.show.ground import ACTOR_COLORS, EGO_COLOR, View, actor_color, ground_picture
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

Picture = npt.NDArray[np.uint8]
OnProgress = Callable[[str, int, int], None]

LARGEST = 760
"""Longer side of the plan [px]."""
SMOOTH = 2
"""The plan is drawn this many times larger and averaged."""
MARGIN, NARROWEST = 14.0, 40.0
"""Around everything that moves, and least side of the plan [m]."""
WIDEST, AROUND_EGO = 260.0, 55.0
"""A longer plan shows the ego vehicle's way with so much around it, or follows it where that is too long as well
[m]."""
LARGEST_GROUND = 2200
"""Longer side of the ground that a plan which follows is cut out of [px]."""
TRAIL = 2.0
"""Length of the trails [s]."""
MAX_FRAMES = 240
STRIP_FRAMES = 5
STRIP_CAMERA = CameraSpec(width=384, height=216, horizontal_fov_deg=75.0, samples_per_pixel=8, images=("rgb",))


@dataclass(frozen=True)
class Preview:
    """Files that :func:`write_preview` wrote; `strip` is None if the scenario has no ego vehicle."""

    animation: Path
    strip: Path | None
    num_frames: int


class _View(View):
    """A part of the plane that is drawn `SMOOTH` times larger."""

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
    ground = ground_picture(states[0], whole)
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


def _drawn(
    ground: Image.Image,
    view: _View,
    world: World,
    actors: Sequence[ObjectState],
    trail: Sequence[dict[str, npt.NDArray[np.float64]]],
    time: float,
) -> Image.Image:
    """Draw actors with their trails, a scale and the time."""
    width, height = view.size
    large = ground.resize((width * SMOOTH, height * SMOOTH), Image.Resampling.NEAREST)
    pen = ImageDraw.Draw(large, "RGBA")
    for item in actors:
        color = actor_color(item, world)
        past = np.array([step[item.name] for step in trail if item.name in step])
        if len(past) > 1:
            pen.line([tuple(point) for point in view.pixel(past)], fill=(*color, 150), width=2 * SMOOTH)
    for item in actors:
        color = actor_color(item, world)
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


def _annotate(pen: ImageDraw.ImageDraw, view: _View, world: World, actors: Sequence[ObjectState], time: float) -> None:
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
        path,
        save_all=True,
        append_images=frames[1:],
        duration=[10 * int(step) for step in np.diff(marks)],
        loop=0,
        optimize=False,
    )


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


def _ffmpeg() -> ModuleType:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingPackageError("imageio-ffmpeg", "video") from error
    return imageio_ffmpeg
