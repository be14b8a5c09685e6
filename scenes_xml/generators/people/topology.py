"""One half of a person as triangles that all bodies share.

Cut from MakeHuman's base mesh into regions that clothes cover, and with fewer triangles at two levels of detail. The
other half is its mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..geometry.collapse import collapsed
from ..geometry.mesh import Array, Faces
from .makehuman import MakeHuman, Phenotype

SEGMENTS = ("head", "torso", "pelvis", "upper_arm", "lower_arm", "upper_leg", "lower_leg", "foot")
"""Segments of a half, those of limbs without their side."""
REGIONS = (
    "face", "lips", "ear", "scalp", "brow", "eye", "iris", "hand", "collar", "chest", "sleeve", "half_sleeve",
    "forearm", "waist", "seat", "thigh", "lap", "calf", "foot", "hem", "skirt", "long_skirt", "long_hair",
)  # fmt: skip # a table
"""What a triangle is a part of; clothes cover whole regions."""
TRIANGLES = (4000, 1100)
"""Of a half, detailed and light, with what some clothes leave out."""
_BONES = {
    "torso": ("spine01", "spine02", "spine03", "spine04", "clavicle", "shoulder01", "breast", "neck01", "neck02",
              "neck03", "head"),
    "pelvis": ("root", "pelvis", "spine05"),
    "upper_arm": ("upperarm01", "upperarm02"),
    "lower_arm": ("lowerarm", "wrist", "metacarpal", "finger"),
    "upper_leg": ("upperleg",),
    "lower_leg": ("lowerleg",),
    "foot": ("foot", "toe"),
}  # fmt: skip # a table


@dataclass(frozen=True)
class Topology:
    """Triangles of a half.

    Attributes
    ----------
    vertices : ndarray of int, shape (num_vertices,)
        Which vertices of the base mesh are left, those of the middle plane first.
    num_middle : int
        How many lie in the middle plane.
    faces, regions : tuple of ndarray of int
        Triangles, shape (num_faces, 3), and what each is a part of, at both levels.
    weights : ndarray, shape (num_vertices, num_segments)
        How much a vertex belongs to each segment; sums are 1.
    """

    vertices: npt.NDArray[np.int64]
    num_middle: int
    faces: tuple[Faces, Faces]
    regions: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]
    weights: Array


def segment_weights(mesh: MakeHuman) -> Array:
    """Return how much each vertex of the base mesh belongs to each of `SEGMENTS`, shape (num_vertices, num_segments).

    What is part of the body's own head belongs to the head alone.
    """
    found = np.zeros((len(mesh.vertices), len(SEGMENTS)))
    for bone, weight in mesh.weights().items():
        name = bone.removesuffix(".L").removesuffix(".R")
        owner = next((s for s, starts in _BONES.items() if name.startswith(starts)), "torso")
        found[:, SEGMENTS.index(owner)] += weight
    return found / found.sum(axis=1, keepdims=True)  # type: ignore[no-any-return]


def _region_of_quads(mesh: MakeHuman, points: Array, weights: Array) -> npt.NDArray[np.int64]:
    """Return the region of each quad, -1 for what is left out, shape (num_quads,)."""
    middle = points[mesh.quads].mean(axis=1)
    x, y, z = middle.T
    owner = np.array(SEGMENTS)[weights[mesh.quads].mean(axis=1).argmax(axis=1)]
    region = np.full(len(middle), -1)

    def at(name: str) -> float:
        return float(mesh.joint(points, name)[2])

    def mark(name: str, chosen: npt.NDArray[np.bool_]) -> None:
        region[chosen] = REGIONS.index(name)

    body, tights = mesh.groups == "body", mesh.groups == "helper-tights"
    skull, eye = mesh.joint(points, "head"), mesh.joint(points, "l-eye")
    scale = (points[:, 2].max() - at("ground")) / 1.66
    head = body & (z > at("neck") - 0.035 * scale) & (np.abs(y) < 0.085 * scale)
    mark("face", head & ~mesh.is_painted("inside-mouth"))
    hair_line = skull[2] - 0.045 * scale + np.maximum(x - skull[0] + 0.085 * scale, 0.0) * 0.55
    hairy = ~mesh.is_painted("face") | (z > eye[2] + 0.076 * scale)
    mark("scalp", head & hairy & ~mesh.is_painted("ears") & (z > hair_line))
    mark("ear", head & mesh.is_painted("ears"))
    mark("lips", head & mesh.is_painted("lips") & ~mesh.is_painted("inside-mouth"))
    above, aside = (z - eye[2]) / scale, np.abs(np.abs(y) - eye[1]) / scale
    brow = (above > 0.0155) & (above < 0.0195) & (aside < 0.021) & (x > eye[0] - 0.01 * scale)
    mark("brow", head & mesh.is_painted("face") & brow)
    eyes = (mesh.groups == "helper-l-eye") | (mesh.groups == "helper-r-eye")
    mark("eye", eyes & (x > eye[0] - 0.004 * scale))
    ball = middle - np.stack([np.full(len(y), eye[0]), np.sign(y) * eye[1], np.full(len(y), eye[2])], 1)
    aslant = np.degrees(np.arctan2(np.hypot(ball[:, 1], ball[:, 2]), ball[:, 0]))
    mark("iris", eyes & (aslant < 30.0))
    elbow, wrist = mesh.joint(points, "l-elbow"), mesh.joint(points, "l-hand")
    mirrored = middle * np.stack([np.ones(len(y)), np.sign(y), np.ones(len(y))], 1)
    along = (mirrored - elbow) @ (wrist - elbow) / float((wrist - elbow) @ (wrist - elbow))
    mark("hand", body & (owner == "lower_arm") & (along > 0.68))
    shoulder = mesh.joint(points, "l-shoulder")
    upper = (mirrored - shoulder) @ (elbow - shoulder) / float((elbow - shoulder) @ (elbow - shoulder))
    trunk = tights & ((owner == "torso") | (owner == "pelvis"))
    belt, hip, knee = at("l-upper-leg") + 0.075 * scale, at("l-upper-leg"), at("l-knee")
    mark("chest", trunk & (z > belt))
    mark("sleeve", tights & (owner == "upper_arm") & (upper < 0.66))
    mark("half_sleeve", tights & (owner == "upper_arm") & (upper >= 0.66))
    mark("forearm", tights & (owner == "lower_arm"))
    mark("collar", trunk & (z > at("neck") - 0.012 * scale))
    mark("waist", trunk & (z <= belt) & (z > hip - 0.01 * scale))
    mark("seat", trunk & (z <= hip - 0.01 * scale))
    mark("thigh", tights & (owner == "upper_leg") & (z > knee + 0.3 * (hip - knee)))
    mark("lap", tights & (owner == "upper_leg") & (z <= knee + 0.3 * (hip - knee)))
    mark("calf", tights & (owner == "lower_leg"))
    mark("foot", tights & (owner == "foot"))
    skirt = mesh.groups == "helper-skirt"
    mark("hem", skirt & (z > hip - 0.16 * (hip - knee)))
    mark("skirt", skirt & (z <= hip - 0.16 * (hip - knee)) & (z > hip - 0.48 * (hip - knee)))
    mark("long_skirt", skirt & (z <= hip - 0.48 * (hip - knee)) & (z > knee + 0.05 * (hip - knee)))
    locks = (mesh.groups == "helper-hair") & (x < skull[0] + 0.005 * scale) & (z > at("neck") - 0.10 * scale)
    mark("long_hair", locks & (z < skull[2] + 0.06 * scale))
    return region


def make_topology(mesh: MakeHuman) -> Topology:
    """Return the triangles that all bodies share."""
    points = mesh.body(Phenotype(0.5, 0.45))
    weights = segment_weights(mesh)
    region = _region_of_quads(mesh, points, weights)
    chosen = (region >= 0) & (points[mesh.quads].mean(axis=1)[:, 1] > 0.0)
    quads, labels = mesh.quads[chosen], region[chosen]
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    kept = list(collapsed(points, faces, np.concatenate([labels, labels]), TRIANGLES))
    used = np.unique(kept[0][0])
    is_middle = np.abs(points[used, 1]) < 1e-9
    vertices = np.concatenate([used[is_middle], used[~is_middle]])
    new = np.zeros(len(points), np.int64)
    new[vertices] = np.arange(len(vertices))
    own = weights[vertices]
    of_head = np.zeros(len(vertices), bool)
    heads = [REGIONS.index(name) for name in ("face", "lips", "ear", "scalp", "brow", "eye", "iris", "long_hair")]
    of_head[new[np.unique(kept[0][0][np.isin(kept[0][1], heads)])]] = True
    own[of_head] = np.eye(len(SEGMENTS))[0]
    skirts = np.isin(kept[0][1], [REGIONS.index(name) for name in ("hem", "skirt", "long_skirt")])
    own[new[np.unique(kept[0][0][skirts])]] = np.eye(len(SEGMENTS))[SEGMENTS.index("pelvis")]
    first, second = kept
    return Topology(vertices, int(is_middle.sum()), (new[first[0]], new[second[0]]), (first[1], second[1]), own)
