"""Number plates: a flat box whose front is tiled into letters and what is around them.

Letters are paint. They lie in the plane of the plate and overlap nothing, so that a camera sees them and a radar sees
one flat plate.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..geometry.mesh import Array, Mesh, box, grid, merge

WIDTH, HEIGHT = 0.52, 0.11
"""Of a plate [m]."""
SEGMENTS = {
    "a": (0.0, 0.29, 0.075, 0.1), "b": (0.0275, 0.17, 0.02, 0.34), "c": (0.0275, -0.17, 0.02, 0.34),
    "d": (0.0, -0.29, 0.075, 0.1), "e": (-0.0275, -0.17, 0.02, 0.34), "f": (-0.0275, 0.17, 0.02, 0.34),
    "g": (0.0, 0.0, 0.075, 0.1),
}  # fmt: skip # a table
"""Strokes of a character, named as those of a display of seven segments: middle to the right and up, width and height,
over width and height of the plate."""
LETTERS = {
    "A": "abcefg", "C": "adef", "E": "adefg", "F": "aefg", "H": "bcefg", "J": "bcde", "L": "def", "P": "abefg",
    "U": "bcdef",
}  # fmt: skip # a table
DIGITS = {
    "0": "abcdef", "1": "bc", "2": "abdeg", "3": "abcdg", "4": "bcfg", "5": "acdfg", "6": "acdefg", "7": "abc",
    "8": "abcdefg", "9": "abcdfg",
}  # fmt: skip # a table
"""Strokes of the characters that read as such in seven segments."""


class NumberPlates(NamedTuple):
    """The plates of a vehicle.

    Attributes
    ----------
    reach : float
        How far before and behind the origin their faces are [m].
    front, rear : float
        Height of their middles [m].
    depth : float
        How deep they are [m].
    seed : int
        Of the letters.
    """

    reach: float
    front: float
    rear: float
    depth: float
    seed: int

    def parts(self, fine: bool = True) -> dict[str, tuple[Mesh, str]]:
        """Return the shapes of plates and letters with their roles; plates without letters if not `fine`."""
        ends = (1.0, self.front), (-1.0, self.rear)
        if not fine:
            return {"plates": (merge([self._box(*end) for end in ends]), "plate")}
        made = [self._lettered(*end) for end in ends]
        around, letters = (merge([pair[k] for pair in made]) for k in (0, 1))
        return {"plates": (around, "plate"), "plate_text": (letters, "plate_text")}

    def _box(self, sign: float, z: float) -> Mesh:
        return box((self.depth, WIDTH, HEIGHT), (sign * (self.reach - self.depth / 2.0), 0.0, z))

    def _lettered(self, sign: float, z: float) -> tuple[Mesh, Mesh]:
        """Return a plate without what its letters cover, and the letters."""
        whole, face = self._box(sign, z), sign * self.reach
        behind = (np.abs(whole.vertices[:, 0] - face) > 0.5 * self.depth)[whole.faces].any(axis=1)
        strokes = _strokes(self.seed)
        across, up = (
            np.unique(np.append(strokes[:, axis].ravel(), [-half, half]).round(6))
            for axis, half in ((0, WIDTH / 2.0), (1, HEIGHT / 2.0))
        )
        middle = (across[1:] + across[:-1]) / 2.0, (up[1:] + up[:-1]) / 2.0
        painted = np.zeros((len(middle[0]), len(middle[1])), dtype=np.bool_)
        for stroke in strokes:
            beside, over = ((low < at) & (at < high) for at, (low, high) in zip(middle, stroke, strict=True))
            painted |= beside[:, None] & over
        around, letters = (
            merge([_tile(face, sign * across[list(rows)], z + up[list(columns)]) for rows, columns in _tiles(mask)])
            for mask in (~painted, painted)
        )
        return merge([replace(whole, faces=whole.faces[behind]), around]), letters


def _strokes(seed: int) -> Array:
    """Return the strokes of two letters and four digits, shape (n, 2, 2): across and up, low and high [m].

    Across goes from left to right for who looks at the plate.
    """
    generator = np.random.default_rng(seed)
    found = []
    for k in (0, 1, 3, 4, 5, 6):
        kind = LETTERS if k < 2 else DIGITS
        y = (-0.36 + 0.12 * k) * WIDTH
        for segment in str(generator.choice(list(kind.values()))):
            across, up, width, height = SEGMENTS[segment]
            found.append(_bounds(y + across * WIDTH, up * HEIGHT, width * WIDTH, height * HEIGHT))
    return np.array(found)


def _bounds(y: float, z: float, width: float, height: float) -> Array:
    return np.array([[y - width / 2.0, y + width / 2.0], [z - height / 2.0, z + height / 2.0]])


def _tiles(mask: npt.NDArray[np.bool_]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return few rectangles that cover the cells of a mask: their first and last lines along both axes of the grid."""
    free, found = mask.copy(), []
    for row, column in np.argwhere(mask):
        if not free[row, column]:
            continue
        beside = free[row, column:]
        stop = column + (len(beside) if beside.all() else int(beside.argmin()))
        whole = free[row:, column:stop].all(axis=1)
        end = row + (len(whole) if whole.all() else int(whole.argmin()))
        free[row:end, column:stop] = False
        found.append(((int(row), int(end)), (int(column), int(stop))))
    return found


def _tile(x: float, y: Array, z: Array) -> Mesh:
    """Return a rectangle of the plane of `x`, between two values of y and of z [m], facing away from the origin."""
    corners = np.array([[(x, one, other) for other in z] for one in y])
    return grid(corners, np.stack([corners[..., 1], corners[..., 2]], -1))
