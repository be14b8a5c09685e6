"""Plots of images and lidar scans."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS, SKY

from .axes import DARK, DEPTH_MAP, NOTHING, VELOCITY_MAP, axes_or_new, centred, colour_bar, sensor_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, Normalize

    from scarl_sionna.core.specs.camera import CameraSpec

NEAREST_DEPTH = 1.0
"""First colour of the depth maps [m]."""
LIDAR_COLORS: Mapping[str, str] = {
    "radial_velocity": "radial velocity [m/s], opening is positive",
    "distance": "distance [m]",
    "intensity": "intensity [dB]",
    "reflectance": "reflectance",
    "height": "z, up [m]",
    "time": "time of the shot [s]",
}
"""What a point's colour can stand for, and the label of its bar."""


class Images(Protocol):
    """What is drawn of :class:`scarl_sionna.core.results.ImageFrame`; an image that is not there is None."""

    @property
    def spec(self) -> CameraSpec:
        """The camera."""

    @property
    def rgb(self) -> npt.NDArray[np.uint8] | None:
        """Colours, (height, width, 3), sRGB."""

    @property
    def depth(self) -> npt.NDArray[np.float32] | None:
        """Depth [m]."""

    @property
    def semantic(self) -> npt.NDArray[np.uint8] | None:
        """Classes."""

    @property
    def instance(self) -> npt.NDArray[np.uint16] | None:
        """Instances."""

    @property
    def normal(self) -> npt.NDArray[np.float32] | None:
        """Normals, (height, width, 3)."""

    @property
    def flow(self) -> npt.NDArray[np.float32] | None:
        """Flow, (height, width, 2) [px]."""


class Returns(Protocol):
    """What is drawn of :class:`scarl_sionna.core.results.LidarScan`; the fields in `LIDAR_COLORS` are read by name."""

    @property
    def num_points(self) -> int:
        """Number of returns."""

    @property
    def position(self) -> npt.NDArray[np.float32]:
        """Positions, (num_points, 3) [m, sensor frame]."""

    @property
    def radial_velocity(self) -> npt.NDArray[np.float32]:
        """Radial velocities [m/s]; NaN where a receiver tells none."""

    @property
    def intensity(self) -> npt.NDArray[np.float32]:
        """Received power, relative."""


def draw_rgb(axis: Axes, rgb: npt.NDArray[np.uint8]) -> None:
    """Draw an RGB image."""
    axis.imshow(rgb, interpolation="antialiased")


def draw_depth(axis: Axes, depth: npt.NDArray[np.floating], last: float) -> None:
    """Draw a depth image from `NEAREST_DEPTH` to `last` [m], logarithmic, with its bar."""
    from matplotlib.colors import LogNorm

    norm = LogNorm(NEAREST_DEPTH, max(last, 2.0 * NEAREST_DEPTH))
    image = axis.imshow(np.ma.masked_invalid(depth), cmap=depth_colors(), norm=norm, interpolation="nearest")
    depth_bar(axis, image, norm)


def draw_classes(
    axis: Axes, semantic: npt.NDArray[np.uint8], instance: npt.NDArray[np.uint16] | None, most: int = 10
) -> None:
    """Draw classes in their colours, white outlines of instances, and a legend of the largest classes."""
    from matplotlib.patches import Patch

    colors = SEMANTIC_COLORS[semantic].copy()
    if instance is not None:
        colors[outlines(instance)] = 255
    axis.imshow(colors, interpolation="nearest")
    ids, counts = np.unique(semantic, return_counts=True)
    by_size = [int(i) for i in ids[np.argsort(-counts)] if i != SKY][:most]
    patches = [Patch(facecolor=SEMANTIC_COLORS[i] / 255.0, edgecolor="0.3", label=SEMANTIC_CLASSES[i]) for i in by_size]
    axis.legend(
        handles=patches,
        loc="lower center",
        ncols=5,
        fontsize=7.0,
        framealpha=0.85,
        handlelength=0.9,
        handletextpad=0.5,
        columnspacing=0.9,
        labelspacing=0.25,
        borderpad=0.4,
        borderaxespad=0.3,
    )


def outlines(instance: npt.NDArray[np.uint16]) -> npt.NDArray[np.bool_]:
    """Return the pixels whose right or lower neighbour is of another instance."""
    out = np.zeros(instance.shape, dtype=np.bool_)
    out[:, :-1] |= instance[:, :-1] != instance[:, 1:]
    out[:-1] |= instance[:-1] != instance[1:]
    return out


def depth_colors() -> Colormap:
    """Return the colours of depths, with one for what is not there."""
    import matplotlib as mpl

    return mpl.colormaps[DEPTH_MAP].with_extremes(bad=NOTHING)


def depth_bar(axis: Axes, image: ScalarMappable, norm: Normalize) -> None:
    """Draw the bar of a depth map."""
    bar = colour_bar(axis, image, "depth [m]", extend="both")
    ticks = [tick for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500) if norm.vmin <= tick <= norm.vmax]
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    bar.minorticks_off()


def _draw_instances(axis: Axes, instance: npt.NDArray[np.uint16]) -> None:
    """Draw instances in colours of their own; 0, nothing, is grey."""
    colors = np.random.Generator(np.random.PCG64(7)).integers(40, 256, (int(instance.max()) + 1, 3), dtype=np.uint8)
    colors[0] = 225
    axis.imshow(colors[instance], interpolation="nearest")


def _draw_normals(axis: Axes, normal: npt.NDArray[np.float32]) -> None:
    axis.imshow(np.clip(0.5 + 0.5 * normal, 0.0, 1.0), interpolation="nearest")


def _draw_flow(axis: Axes, flow: npt.NDArray[np.float32]) -> None:
    speed = np.linalg.norm(flow, axis=-1)
    known = speed[np.isfinite(speed)]
    top = float(np.quantile(known, 0.99)) if known.size else 1.0
    image = axis.imshow(np.ma.masked_invalid(speed), vmin=0.0, vmax=max(top, 1e-3), interpolation="nearest")
    colour_bar(axis, image, "length of the flow [px]", extend="max")
    step = max(flow.shape[0] // 18, 1)
    rows, columns = np.mgrid[step // 2 : flow.shape[0] : step, step // 2 : flow.shape[1] : step]
    axis.quiver(
        columns,
        rows,
        flow[rows, columns, 0],
        flow[rows, columns, 1],
        color="white",
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0018,
    )


def plot_image(frame: Images, image: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw one of the images of a camera, see `ImageFrame.plot`."""
    draw: Mapping[str, Callable[[Axes], None]] = {
        "rgb": lambda axis: draw_rgb(axis, frame.rgb),  # type: ignore[arg-type]
        "depth": lambda axis: draw_depth(axis, frame.depth, _farthest(frame.depth)),  # type: ignore[arg-type]
        "semantic": lambda axis: draw_classes(axis, frame.semantic, frame.instance),  # type: ignore[arg-type]
        "instance": lambda axis: _draw_instances(axis, frame.instance),  # type: ignore[arg-type]
        "normal": lambda axis: _draw_normals(axis, frame.normal),  # type: ignore[arg-type]
        "flow": lambda axis: _draw_flow(axis, frame.flow),  # type: ignore[arg-type]
    }
    there = [name for name in draw if getattr(frame, name) is not None]
    if not there:
        raise ParameterRangeError(
            "image", image, "an image that the camera made", "it made none: CameraSpec(images=...)"
        )
    chosen = there[0] if image is None else image
    if chosen not in there:
        raise UnknownNameError("image of this frame", chosen, there)
    axis = axes_or_new(ax, 7.5, 7.5 * frame.spec.height / frame.spec.width + 0.7)
    draw[chosen](axis)
    axis.set(xlabel="column [px]", ylabel="row [px]", title=chosen)
    return axis


def _farthest(depth: npt.NDArray[np.floating]) -> float:
    known = depth[np.isfinite(depth)]
    return float(np.quantile(known, 0.99)) if known.size else 100.0


def plot_lidar(scan: Returns, color: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the returns of a lidar from above, see `LidarScan.plot`."""
    has_velocity = bool(np.isfinite(scan.radial_velocity).any())
    chosen = color or ("radial_velocity" if has_velocity else "height")
    if chosen not in LIDAR_COLORS:
        raise UnknownNameError("color", chosen, LIDAR_COLORS)
    values: npt.NDArray[Any] | None
    if chosen == "height":
        values = scan.position[:, 2]
    elif chosen == "intensity":
        values = 10.0 * np.log10(np.maximum(scan.intensity, 1e-30))
    else:
        values = getattr(scan, chosen)
        if values is None:
            raise ParameterRangeError("color", chosen, "a field that the scan has", "give another color")
    axis = axes_or_new(ax, 7.0, 6.0)
    low, high = centred(values) if chosen == "radial_velocity" else _ends(values)
    points = axis.scatter(
        scan.position[:, 1],
        scan.position[:, 0],
        c=values,
        s=2.5,
        linewidths=0,
        rasterized=True,
        vmin=low,
        vmax=high,
        cmap=VELOCITY_MAP if chosen == "radial_velocity" else "viridis",
    )
    axis.plot([0.0], [0.0], marker="^", color="white", markersize=7)
    axis.set_facecolor(DARK)
    aside = float(np.abs(scan.position[:, 1]).max(initial=10.0)) * 1.05
    sensor_map(axis, aside)
    axis.set_title(f"{scan.num_points} lidar returns, sensor frame")
    colour_bar(axis, points, LIDAR_COLORS[chosen])
    return axis


def _ends(values: npt.NDArray[Any]) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = (float(end) for end in np.quantile(known, [0.005, 0.995]))
    return low, max(high, low + 1e-6)
