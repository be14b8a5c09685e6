"""A scene from above: the ground in colours of its classes, shaded, as a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, semantic_id
from scarl_sionna.engine.rays.apart import stand_apart

from .view import StateView, WorldView

Picture = npt.NDArray[np.uint8]

HEAD_ROOM = 3.4
"""Where something covers what moves, the plan is a cut at this height above the ego vehicle's ground [m]."""
COVERS = frozenset(map(semantic_id, ("Vegetation", "Bridge", "Pole", "TrafficLight", "TrafficSign", "Static")))
"""Classes that the plan looks through where they are higher than the cut."""

GROUND_COLORS = {
    "Roads": (74, 76, 80), "RoadLine": (226, 226, 218), "SideWalks": (158, 156, 150), "Building": (112, 92, 84),
    "Wall": (128, 126, 122),
    "Vegetation": (84, 118, 66), "Terrain": (128, 148, 96), "Ground": (146, 142, 128), "Bridge": (150, 148, 146),
    "GuardRail": (196, 200, 206), "Fence": (122, 100, 80), "Water": (86, 122, 150),
}  # fmt: skip # a table
OTHER_COLOR = (104, 102, 108)
NOTHING_COLOR = (36, 38, 42)
ACTOR_COLORS = {
    "Car": (86, 156, 240), "Truck": (240, 160, 60), "Bus": (232, 196, 60), "Pedestrian": (236, 88, 120), "Rider": (200,
    110, 230),
    "Bicycle": (200, 110, 230), "Motorcycle": (170, 90, 220),
}  # fmt: skip # a table
EGO_COLOR = (70, 220, 130)


@dataclass(frozen=True)
class View:
    """Part of the plane that a picture from above shows: centre [m], half extents [m], pixels a metre."""

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


def actor_color(item: ObjectState, world: WorldView) -> tuple[int, int, int]:
    """Return the colour of an actor in plans, sRGB of 0 to 255."""
    if item.name == world.ego:
        return EGO_COLOR
    return ACTOR_COLORS.get(SEMANTIC_CLASSES[item.semantic], (210, 210, 210))


def ground_picture(state: StateView, view: View) -> Picture:
    """Return the static scene from above, in colours of the classes, shaded by height and slope."""
    width, height = view.size
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x = view.centre[0] + (column.ravel() - width / 2.0) / view.scale
    y = view.centre[1] - (row.ravel() - height / 2.0) / view.scale
    ego = state.world.ego
    floor = float(state.actor_pose(ego).position[2]) if ego is not None else 0.0
    static = stand_apart(state.world).state
    _, upper = state.world.part_bounds()
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
    state: StateView, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], top: float
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
