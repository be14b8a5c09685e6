"""Clothes on a body, and the body cut into the rigid segments of a walker.

Clothes are regions of the body's surface, moved outward. Where two segments meet, both go on below the surface of the
other, so that no gap opens as limbs turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..geometry.mesh import Array, Faces, Mesh

SOLE = 0.018
"""Thickness of a shoe's sole [m]."""
_HIDDEN = 0.04
"""Least weight at which a segment goes on below another."""
_DEPTH = 0.05
"""How deep it goes below, for a weight that is less by one [m at a height of 1.75 m]."""
_CUFF = 0.03
"""How far a trouser leg hangs over the shoe [m at a height of 1.75 m]."""
_SHAFT = 20
"""Faces from which on a shoe has a shaft within the trouser leg."""
_FLARE = 0.016
"""How much farther than at the knee trousers stand off the ankle [m at a height of 1.75 m]."""
_THIN = 0.4
"""Part of its girth that a thigh lacks below a hem."""
_SHEETS = ("hem", "skirt", "long_skirt", "long_hair")
"""Regions that hang free: no skin is below them."""


@dataclass(frozen=True)
class Layer:
    """What covers regions: its slot of materials, and how far it stands off the body [m]."""

    slot: str
    regions: tuple[str, ...]
    thickness: float


@dataclass(frozen=True)
class Outfit:
    """Layers, and the thickness of the hair [m]; regions of no layer are skin, sheets of no layer are left out."""

    layers: tuple[Layer, ...]
    hair: float = 0.012
    long_hair: bool = False


LEGS = ("waist", "seat", "thigh", "lap", "calf")
TOPS = ("chest", "hem", "sleeve")
ARMS = ("half_sleeve", "forearm")


def outfit(top: str, bottom: str, hair: float, long_hair: bool) -> Outfit:
    """Return an outfit.

    Parameters
    ----------
    top : str
        ``jacket``, ``shirt``, ``t_shirt``, ``coat``, or ``dress``.
    bottom : str
        ``trousers``, ``shorts`` or ``skirt``; of no meaning under a dress.
    hair : float
        Thickness [m]; 0: bald.
    long_hair : bool

    Raises
    ------
    KeyError
        If there is no such garment.
    """
    thickness = {"jacket": 0.014, "shirt": 0.006, "t_shirt": 0.007, "coat": 0.018, "dress": 0.005}[top]
    over: tuple[str, ...] = TOPS if top in ("t_shirt", "dress") else (*TOPS, *ARMS)
    if top in ("coat", "dress"):
        over = (*over, "skirt")
    if top == "dress":
        over = (*over, "long_skirt")
    if top in ("jacket", "coat"):
        over = (*over, "collar")
    layers = [Layer("shoes", ("foot",), 0.004)]
    if top != "dress":
        below = {
            "trousers": Layer("trousers", LEGS, 0.009),
            "shorts": Layer("trousers", ("waist", "seat", "thigh"), 0.012),
            "skirt": Layer("trousers", ("waist", "seat", "skirt", "long_skirt"), 0.004),
        }[bottom]
        layers.append(Layer(below.slot, tuple(r for r in below.regions if r not in over), below.thickness))
    return Outfit((*layers, Layer("top", over, thickness)), hair, long_hair)


@dataclass(frozen=True)
class Surface:
    """A whole body at one level of detail.

    Attributes
    ----------
    points : ndarray, shape (num_vertices, 3)
        In the walker's frame [m].
    faces : ndarray of int, shape (num_faces, 3)
    regions : ndarray of str, shape (num_faces,)
    weights : mapping of str to ndarray, shape (num_vertices,)
        By segment of the walker.
    origins : mapping of str to ndarray, shape (3,)
        Of the segments' frames at rest [m].
    """

    points: Array
    faces: Faces
    regions: npt.NDArray[np.str_]
    weights: Mapping[str, Array]
    origins: Mapping[str, Array]

    @property
    def scale(self) -> float:
        """Its size over that of an adult."""
        return float(np.ptp(self.points[:, 2])) / 1.75


def vertex_normals(points: Array, faces: Faces) -> Array:
    """Return unit normals, the mean of the faces around each vertex by area, shape (num_vertices, 3)."""
    first, second, third = (points[corner] for corner in faces.T)
    crosses = np.cross(second - first, third - first)
    sums = np.stack(
        [sum(np.bincount(corner, crosses[:, k], len(points)) for corner in faces.T) for k in range(3)], axis=1
    )
    return sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-12)[:, None]  # type: ignore[no-any-return]


def dressed(surface: Surface, worn: Outfit, plain: Sequence[str] = ()) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of a dressed body, name -> (mesh in the frame of its segment, slot).

    Parameters
    ----------
    surface : Surface
    worn : Outfit
    plain : sequence of str
        Slots that are drawn as skin.

    Returns
    -------
    dict
        Names are a segment's with the slot behind. Slots: ``skin``, ``lips``, ``eyes``, ``iris``, ``hair`` and those of
        the layers.
    """
    parts: dict[str, tuple[Mesh, str]] = {}
    for cover in covers(surface, worn, plain):
        for segment, mesh in segmented(surface, cover, tuple(surface.weights)).items():
            parts[f"{segment}_{cover.slot}"] = (mesh.moved(-surface.origins[segment]), cover.slot)
    return parts


def segmented(surface: Surface, cover: Cover, segments: Sequence[str]) -> dict[str, Mesh]:
    """Return the shares of segments in a cover, where the cover has them."""
    owners = _owners(surface)
    shares = {name: _segment(surface, cover, owners == name, name, surface.weights[name]) for name in segments}
    return {name: mesh for name, mesh in shares.items() if mesh is not None}


def remainder(surface: Surface, cover: Cover, apart: Sequence[str]) -> Mesh | None:
    """Return all of a cover but the segments in `apart`, below which it goes on; None if nothing is left."""
    is_own = ~np.isin(_owners(surface), apart)
    weight = 1.0 - sum((surface.weights[segment] for segment in apart), np.zeros(len(surface.points)))
    return _segment(surface, cover, is_own, "", weight)


@dataclass(frozen=True)
class Cover:
    """All of a body that has one slot.

    Attributes
    ----------
    slot : str
    is_own : ndarray of bool, shape (num_faces,)
        Which faces of the surface it has.
    points, outward, normals : ndarray, shape (num_vertices, 3)
        Where all vertices are [m], unit normals of the body, and those of the cover.
    """

    slot: str
    is_own: npt.NDArray[np.bool_]
    points: Array
    outward: Array
    normals: Array


def covers(surface: Surface, worn: Outfit, plain: Sequence[str] = ()) -> list[Cover]:
    """Return skin, hair and clothes of a body at rest; arguments as of `dressed`."""
    slots = _slots(surface, worn)
    slots[np.isin(slots, plain)] = "skin"
    solid = ~np.isin(surface.regions, _SHEETS)
    normals = vertex_normals(surface.points, surface.faces[solid])
    sheets = vertex_normals(surface.points, surface.faces[~solid])
    of_sheet = np.zeros(len(surface.points), bool)
    of_sheet[surface.faces[~solid]] = True
    normals[of_sheet] = sheets[of_sheet]
    thickness = {layer.slot: layer.thickness for layer in worn.layers}
    found = []
    for slot in dict.fromkeys(slots[slots != ""].tolist()):
        chosen = slots == slot
        points = surface.points + normals * (thickness.get(slot, 0.0) * surface.scale)
        if slot == "hair":
            points = surface.points + normals * _hair(surface, slots, worn)[:, None]
        elif slot == "shoes":
            points = _shoes(surface, normals, points, chosen)
        elif slot == "skin":
            points = surface.points - normals * (0.003 * _tights(surface))[:, None]
        elif slot == "trousers":
            points = _trouser_legs(surface, normals, points)
        if slot in ("skin", "trousers"):
            points = _under_hems(surface, worn, points)
        found.append(Cover(slot, chosen, points, normals, vertex_normals(points, surface.faces[chosen])))
    return found


def _slots(surface: Surface, worn: Outfit) -> npt.NDArray[np.str_]:
    """Return the slot of each face, empty for what is left out, shape (num_faces,)."""
    table = {"lips": "lips", "eye": "eyes", "iris": "iris", "brow": "hair"}
    table |= dict.fromkeys(_SHEETS, "")
    if worn.hair > 0.0:
        table["scalp"] = "hair"
    if worn.long_hair:
        table["long_hair"] = "hair"
    for layer in worn.layers:
        table |= dict.fromkeys(layer.regions, layer.slot)
    return np.array([table.get(region, "skin") for region in surface.regions.tolist()])


def _tights(surface: Surface) -> Array:
    """Return 1 for vertices of the suit below the clothes, and 0 for those of head and hands, shape (num_vertices,)."""
    found = np.zeros(len(surface.points))
    found[surface.faces[np.isin(surface.regions, (*LEGS, *ARMS, "collar", "chest", "sleeve", "foot"))]] = 1.0
    return found


def _trouser_legs(surface: Surface, normals: Array, points: Array) -> Array:
    """Return the vertices of trousers: legs that hang off the shanks, over the shoes."""
    knee, ankle = surface.origins["left_lower_leg"][2], surface.origins["left_foot"][2]
    below = np.clip((knee - surface.points[:, 2]) / (knee - ankle), 0.0, 1.0)
    level = normals * [1.0, 1.0, 0.0]
    moved = points + level * (_FLARE * surface.scale * below)[:, None]
    ends = np.intersect1d(surface.faces[surface.regions == "calf"], surface.faces[surface.regions == "foot"])
    moved[ends, 2] -= _CUFF * surface.scale
    return moved


def _under_hems(surface: Surface, worn: Outfit, points: Array) -> Array:
    """Return points with thinner thighs where a hem hides them: they swing below it without coming through."""
    hung = [region for layer in worn.layers for region in layer.regions if region in _SHEETS]
    if not hung:
        return points
    lower = surface.points[surface.faces[np.isin(surface.regions, hung)], 2].min()
    hidden = np.clip((surface.points[:, 2] - lower) / (0.1 * surface.scale), 0.0, 1.0)
    moved = points.copy()
    for side in ("left", "right"):
        segment = f"{side}_upper_leg"
        share = (_THIN * surface.weights[segment] * hidden)[:, None]
        moved[:, :2] += share * (surface.origins[segment][:2] - points[:, :2])
    return moved


def _hair(surface: Surface, slots: npt.NDArray[np.str_], worn: Outfit) -> Array:
    """Return how far hair stands off the head: nothing at its border, all of it beyond, shape (num_vertices,)."""
    scalp = surface.faces[surface.regions == "scalp"]
    away = np.full(len(surface.points), np.inf)
    away[np.intersect1d(scalp, surface.faces[slots == "skin"])] = 0.0
    edges = np.concatenate([scalp[:, [0, 1]], scalp[:, [1, 2]], scalp[:, [2, 0]]])
    lengths = np.linalg.norm(surface.points[edges[:, 0]] - surface.points[edges[:, 1]], axis=1)
    for _ in range(30):
        np.minimum.at(away, edges[:, 1], away[edges[:, 0]] + lengths)
        np.minimum.at(away, edges[:, 0], away[edges[:, 1]] + lengths)
    found = np.minimum(0.002 + 0.6 * away, worn.hair)
    found[np.isinf(away)] = 0.001
    return found


def _shoes(surface: Surface, normals: Array, points: Array, chosen: npt.NDArray[np.bool_]) -> Array:
    """Return the vertices of shoes: flat soles on the ground, heel and toe where the walker's feet have them."""
    used = np.unique(surface.faces[chosen])
    moved = points.copy()
    under = used[(normals[used, 2] < -0.35) & (surface.points[used, 2] < 2.2 * SOLE)]
    moved[under, 2] = 0.0
    for side in ("left", "right"):
        ankle = surface.origins[f"{side}_foot"]
        own = used[(surface.points[used, 1] > 0.0) == (side == "left")]
        sole = np.intersect1d(own, under)
        first, last = moved[sole, 0].min(), moved[sole, 0].max()
        heel, toe = ankle[0] - ankle[2], ankle[0] + 3.2 * ankle[2]  # the sole is a quarter of the foot below the ankle
        moved[own, 0] = heel + (moved[own, 0] - first) * (toe - heel) / (last - first)
    return moved


def _owners(surface: Surface) -> npt.NDArray[np.str_]:
    """Return to which segment each face belongs, shape (num_faces,): legs end where shoes begin."""
    names = np.array(list(surface.weights))
    shares = np.stack([own[surface.faces].mean(axis=1) for own in surface.weights.values()])
    shares[np.char.endswith(names, "foot")[:, None] & (surface.regions != "foot")] = -1.0
    return names[shares.argmax(axis=0)]  # type: ignore[no-any-return]


def _segment(surface: Surface, cover: Cover, is_own: npt.NDArray[np.bool_], segment: str, weight: Array) -> Mesh | None:
    """Return a segment's share of a cover at rest, or None where it has none."""
    chosen = cover.is_own
    kept = chosen & (is_own | (weight[surface.faces].min(axis=1) > _HIDDEN))
    if segment.endswith("foot"):
        kept &= surface.regions == "foot"
    if not (kept & is_own).any() and not (segment.endswith("lower_leg") and kept.sum() > _SHAFT):
        return None
    depth = np.clip(0.5 - weight, 0.0, 0.5) * _DEPTH * surface.scale
    used, faces = np.unique(surface.faces[kept], return_inverse=True)
    inside = cover.points[used] - cover.outward[used] * depth[used, None]
    normals = None if cover.slot == "shoes" else cover.normals[used]
    return Mesh(inside, faces.reshape(-1, 3).astype(np.int64), normals=normals)
