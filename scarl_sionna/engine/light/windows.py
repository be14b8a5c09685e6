"""Windows of buildings behind which light burns at night: which, how bright, of what colour.

They are no emitters: a light path that meets one takes its radiance along, and none asks for it. Streets have hundreds
of them, each of which lights little; as emitters they would cost every point of every path a look at each.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.joined import PartPlace
from scarl_sionna.engine.types import DeviceArray, MitsubaObject
from scarl_sionna.scene.tables import PartTable

from .lamps import unit_color
from .sky import UNIT_LUMINANCE

Array = npt.NDArray[np.float64]

LUMINANCE = 4.0
"""Median of a lit window [cd/m2], most behind curtains: an engineering estimate, as are all numbers here."""
_SPREAD, _BRIGHTEST = 0.8, 30.0
"""Standard deviation of the logarithm, and the highest [cd/m2]."""
_COLORS = {"room_2700": 0.55, "room_3000": 0.3, "street_lamp": 0.1, "screen": 0.05}
"""Shares of lamps of 2700, 3000 and 4000 K, and of rooms that a screen lights."""
_ROOM = 2.6, 3.4
"""Width and height of what belongs to one room, in glass that is larger than a window [m]."""
_STEEPEST = 0.5
"""Vertical part of a normal above which glass is a roof."""
_CLOSED = 0.35
"""Brightness of curtains over that of the gap between them."""
_ROWS = 256.0
"""Columns of rooms times this, plus rows, is one number of a pane's row."""


class LitWindows(NamedTuple):
    """Rooms behind glass.

    Attributes
    ----------
    faces : dict of str to ndarray of int32
        The row of the pane of each face of a shape, by its id; -1 for none.
    panes : ndarray of float32, shape (n, 8)
        Centre [m], one over half the height [1/m], horizontal direction (x, y) along the pane over half its width
        [1/m], columns and rows of rooms (:data:`_ROWS` times the first plus the other), and the first of its rooms.
    rooms : ndarray of float32, shape (m, 4)
        Radiance (RGB) in the unit of the scenes, and how far curtains reach inwards from both sides, 0 to 1.
    """

    faces: dict[str, npt.NDArray[np.int32]]
    panes: npt.NDArray[np.float32]
    rooms: npt.NDArray[np.float32]

    @classmethod
    def of(cls, parts: PartTable, meshes: Mapping[str, Any], share: float) -> LitWindows:
        """Return the windows of a world's buildings: all that is of glass and stands upright.

        Parameters
        ----------
        parts : PartTable
        meshes : mapping of str to MeshData
            By shape id, static ones in the world's frame.
        share : float
            Of rooms in which light burns. Which ones follows from where they are: a larger share adds some.
        """
        faces: dict[str, npt.NDArray[np.int32]] = {}
        panes: list[Array] = []
        rooms: list[Array] = [np.zeros((0, 4))]
        num_rooms = 0
        building = semantic_id("Building")
        for row, name in enumerate(parts.name):
            if share > 0.0 and parts.semantic[row] == building and "glass" in parts.material[row]:
                of_face, found = _panes(meshes[name].vertices, meshes[name].faces)
                faces[name] = np.where(of_face < 0, -1, of_face + len(panes)).astype(np.int32)
                for pane in found:
                    panes.append(np.append(pane, num_rooms))
                    rooms.append(_rooms(pane, share))
                    num_rooms += len(rooms[-1])
        table = np.array(panes, dtype=np.float32).reshape(-1, 8)
        return cls(faces, table, np.concatenate(rooms).astype(np.float32))


def _panes(vertices: Array, faces: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], list[Array]]:
    """Return the pane of each face, -1 for roofs of glass, and the panes: what touches is one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, point = np.unique(np.round(vertices, 3), axis=0, return_inverse=True)
    corners = point.reshape(-1)[faces]
    links = (np.ones(2 * len(faces)), (corners[:, [0, 0]].ravel(), corners[:, 1:].ravel()))
    size = int(corners.max()) + 1
    label = connected_components(coo_array(links, shape=(size, size)), directed=False)[1][corners[:, 0]]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    of_face = np.full(len(faces), -1)
    found: list[Array] = []
    order = np.argsort(label, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        normal = areas[own[np.linalg.norm(areas[own], axis=1).argmax()]]
        if abs(normal[2]) > _STEEPEST * np.linalg.norm(normal) or not normal.any():
            continue
        out = normal[:2] / np.linalg.norm(normal[:2])
        across = np.array([-out[1], out[0]])
        points = vertices[faces[own]].reshape(-1, 3)
        along, height = points[:, :2] @ across, points[:, 2]
        half = np.maximum(0.5 * np.array([np.ptp(along), np.ptp(height)]), 1e-3)
        middle = 0.5 * (along.min() + along.max()) * across + float((points[:, :2] @ out).mean()) * out
        rooms = np.maximum(np.round(2.0 * half / _ROOM), 1.0)
        of_face[own] = len(found)
        grid = rooms[0] * _ROWS + min(rooms[1], _ROWS - 1.0)
        found.append(np.array([*middle, height.min() + half[1], 1.0 / half[1], *(across / half[0]), grid]))
    return of_face, found


def _rooms(pane: Array, share: float) -> Array:
    """Return radiance and curtains of the rooms behind a pane, row by row."""
    from scipy.special import ndtri

    seed = np.round(10.0 * pane[:3]).astype(np.int64) & 0xFFFFFFFF  # where the pane is, to a decimetre
    random = np.random.default_rng(seed).uniform(1e-6, 1.0 - 1e-6, (int(pane[6] // _ROWS * (pane[6] % _ROWS)), 4))
    luminance = np.minimum(LUMINANCE * np.exp(_SPREAD * ndtri(random[:, 1])), _BRIGHTEST)
    kind = np.searchsorted(np.cumsum(list(_COLORS.values())), random[:, 2]).clip(max=len(_COLORS) - 1)
    light = (luminance / UNIT_LUMINANCE)[:, None] * np.array([unit_color(name) for name in _COLORS])[kind]
    return np.column_stack([np.where(random[:, :1] < share, light, 0.0), np.maximum(random[:, 3] - 0.4, 0.0)])


class WindowTable:
    """Lit windows on the device, by the numbers of a loaded scene; inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    places : mapping of str to PartPlace
        Where the scene has the faces of each part.
    windows : LitWindows
    """

    def __init__(self, mi: ModuleType, places: Mapping[str, PartPlace], windows: LitWindows) -> None:
        first = np.full(max((place.number for place in places.values()), default=0) + 1, -1, dtype=np.int32)
        sizes: dict[int, int] = {places[name].number: 0 for name in windows.faces}
        for place in places.values():
            if place.number in sizes:
                sizes[place.number] = max(sizes[place.number], place.first + place.size)
        count = 1
        for number, size in sizes.items():
            first[number] = count
            count += size
        pane_of_face = np.full(count, -1, dtype=np.int32)
        for name, own in windows.faces.items():
            start = first[places[name].number] + places[name].first
            pane_of_face[start : start + len(own)] = own
        self._mi = mi
        self.any = count > 1
        on = Device(mi)
        self._first = on.label(first)
        self._pane_of_face = on.label(pane_of_face)
        panes = np.zeros((max(len(windows.panes), 1), 8), dtype=np.float32)
        panes[: len(windows.panes)] = windows.panes
        rooms = windows.rooms if len(windows.rooms) else np.zeros((1, 4), dtype=np.float32)
        self._panes, self._rooms = on.single(panes), on.single(rooms)

    def pane(self, si: MitsubaObject, active: DeviceArray) -> DeviceArray:
        """Return the row of the pane that a light path meets, -1 for none."""
        import drjit as dr

        mi = self._mi
        first = dr.gather(mi.Int32, self._first, dr.reinterpret_array(mi.UInt32, si.shape), active)
        is_glass = active & (first >= 0)
        pane = dr.gather(mi.Int32, self._pane_of_face, mi.UInt32(first) + si.prim_index, is_glass)
        return dr.select(is_glass, pane, -1)

    def radiance(self, si: MitsubaObject, pane: DeviceArray) -> DeviceArray:
        """Return what shines through a pane; brighter above, where lamps hang."""
        import drjit as dr

        mi = self._mi
        is_pane = pane >= 0
        x, y, z, up = dr.gather(mi.Vector4f, self._panes, 2 * mi.UInt32(pane), is_pane)
        along_x, along_y, grid, first = dr.gather(mi.Vector4f, self._panes, 2 * mi.UInt32(pane) + 1, is_pane)
        columns = dr.floor(grid / _ROWS)
        rows = grid - _ROWS * columns
        u = 0.5 * columns * ((si.p.x - x) * along_x + (si.p.y - y) * along_y + 1.0)
        v = 0.5 * rows * ((si.p.z - z) * up + 1.0)
        column, row = (dr.clip(dr.floor(w), 0.0, count - 1.0) for w, count in ((u, columns), (v, rows)))
        index = mi.UInt32(first + row * columns + column)
        red, green, blue, curtain = dr.gather(mi.Vector4f, self._rooms, index, is_pane)
        from_middle = dr.abs(2.0 * (u - column) - 1.0)
        glow = dr.select(from_middle > 1.0 - curtain, _CLOSED, 1.0) * (0.4 + 1.2 * (v - row))
        return dr.select(is_pane, mi.Color3f(red, green, blue) * glow, 0.0)
