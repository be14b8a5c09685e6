"""Mitsuba's analytic shapes as meshes, and what an actor's shape keeps of its transform."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import SceneError

from .mesh_files import ply_bytes

if TYPE_CHECKING:
    import trimesh

Array = npt.NDArray[np.float64]

ANALYTIC_PLUGINS = ("rectangle", "disk", "sphere", "cylinder")
"""Shape plugins that become meshes when a scene is read."""
SAGITTA = 2e-4
"""Facets lie at most this far inside a curved shape [m], 1/20 of a wavelength at 77 GHz, up to `MOST_SEGMENTS`."""
FEWEST_SEGMENTS, MOST_SEGMENTS = 32, 256
MOST_SUBDIVISIONS = 6
_VERSION = 1
"""Of the meshes; a new number makes new folders."""
_EDGE = 1.1071487
"""Angle of the edges of an icosahedron [rad]."""


def mesh_element(shape: ET.Element, path: Path) -> ET.Element:
    """Return an analytic shape as a ``ply`` shape with the same id, transform, BSDF and emitter.

    Parameters
    ----------
    shape : Element
        Of one of `ANALYTIC_PLUGINS`, with Mitsuba's properties.
    path : Path
        Of the scene, for error messages.

    Raises
    ------
    SceneError
        If a property is no number, a radius is not positive, or the mesh cannot be kept.

    Notes
    -----
    Facets of curved shapes lie inside by at most `SAGITTA`; their shading normals are smooth. A cylinder is a tube
    without caps, as Mitsuba's. The file is kept in the user's cache.
    """
    from scenes_xml.cache import kept_folder

    body = _body(shape, path)
    content = ply_bytes(body)
    digest = hashlib.sha256(str(_VERSION).encode() + content).hexdigest()[:16]

    def fill(place: Path) -> None:
        (place / "shape.ply").write_bytes(content)

    try:
        folder = kept_folder("shapes", f"{shape.get('type')}-{digest}", ("shape.ply",), fill)
    except OSError as error:
        raise SceneError(f"the mesh of shape '{shape.get('id')}': {error.strerror or error}", path) from error
    own = {"center", "radius", "p0", "p1"}
    found = ET.Element("shape", {**shape.attrib, "type": "ply"})
    ET.SubElement(found, "string", {"name": "filename", "value": str(folder / "shape.ply")})
    found.extend(child for child in shape if child.get("name") not in own)
    return found


def kept_transform(transform: ET.Element, path: Path) -> ET.Element | None:
    """Return what an actor's shape keeps of its ``to_world``: its stretch, without turn and place; None: nothing.

    An actor's trajectory says where it is and how it is turned; the transform in the XML places it for Mitsuba alone.

    Raises
    ------
    SceneError
        If the transform is not one that Mitsuba knows, or mirrors the shape.

    Notes
    -----
    The polar decomposition M = R P: the rotation R is left out, the stretch P stays.
    """
    linear = linear_part(transform, path)
    if np.linalg.det(linear) <= 0.0:
        raise SceneError("the to_world of an actor's shape mirrors or flattens it", path, "mirror the mesh itself")
    _, stretch, axes = np.linalg.svd(linear)
    if np.abs(stretch - 1.0).max() < 1e-6:
        return None
    matrix = np.eye(4)
    matrix[:3, :3] = axes.T @ np.diag(stretch) @ axes
    kept = ET.Element("transform", {"name": "to_world"})
    ET.SubElement(kept, "matrix", {"value": " ".join(repr(float(value)) for value in matrix.ravel())})
    return kept


def linear_part(transform: ET.Element, path: Path) -> Array:
    """Return the linear part (3, 3) of a Mitsuba ``<transform>``, whose steps act one after the other."""
    linear = np.eye(3)
    for step in transform:
        if step.tag == "translate":
            continue
        if step.tag == "scale":
            linear = np.diag(_vector(step, path, 1.0)) @ linear
        elif step.tag == "rotate":
            axis = _vector(step, path, 0.0)
            angle = np.radians(_number(step.get("angle", "0"), path))
            linear = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix() @ linear
        elif step.tag == "matrix":
            values = _numbers(step.get("value", ""), path)
            if values.size not in (9, 16):
                raise SceneError(f"a matrix has {values.size} numbers", path, "give 9 or 16")
            linear = values.reshape(3 if values.size == 9 else 4, -1)[:3, :3] @ linear
        elif step.tag in ("lookat", "look_at"):
            origin, target, up = (_numbers(step.get(key, ""), path) for key in ("origin", "target", "up"))
            ahead = (target - origin) / np.linalg.norm(target - origin)
            left = np.cross(up, ahead) / np.linalg.norm(np.cross(up, ahead))
            linear = np.column_stack([left, np.cross(ahead, left), ahead]) @ linear
        else:
            raise SceneError(f"<{step.tag}> is no step of a transform", path)
    return linear


def _body(shape: ET.Element, path: Path) -> trimesh.Trimesh:
    import trimesh  # half a second, which few scenes need

    kind, given = shape.get("type"), {str(child.get("name")): child for child in shape}
    transform = given.get("to_world")
    linear = np.eye(3) if transform is None else linear_part(transform, path)
    grown = float(np.linalg.norm(linear, 2))
    radius = _number(given["radius"].get("value", ""), path) if "radius" in given else 1.0
    if not radius > 0.0:
        raise SceneError(f"the radius of shape '{shape.get('id')}' is {radius} m", path, "give one above 0 m")
    if kind == "rectangle":
        corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    if kind == "sphere":
        center = _vector(given["center"], path, 0.0) if "center" in given else np.zeros(3)
        counts = range(3, MOST_SUBDIVISIONS)
        fine = (n for n in counts if radius * grown * (1.0 - np.cos(_EDGE / 2**n / np.sqrt(3.0))) <= SAGITTA)
        body = trimesh.creation.icosphere(next(fine, MOST_SUBDIVISIONS), radius)
        return trimesh.Trimesh(body.vertices + center, body.faces, process=False)
    size = grown * (radius if kind == "cylinder" else 1.0)
    wanted = np.pi / np.arccos(max(1.0 - SAGITTA / size, 0.0))
    count = int(np.clip(np.ceil(wanted), FEWEST_SEGMENTS, MOST_SEGMENTS))
    angle = 2.0 * np.pi * np.arange(count) / count
    rim, number = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1), np.arange(count)
    following = np.roll(number, -1)
    if kind == "disk":
        faces = np.stack([np.full(count, count), number, following], axis=1)
        return trimesh.Trimesh(np.vstack([rim, np.zeros(3)]), faces, process=False)
    ends = [
        _vector(given[name], path, 0.0) if name in given else np.array([0.0, 0.0, height])
        for name, height in (("p0", 0.0), ("p1", 1.0))
    ]
    along = ends[1] - ends[0]
    if not np.linalg.norm(along) > 0.0:
        raise SceneError(f"p0 and p1 of shape '{shape.get('id')}' are one point", path, "give two points")
    frame = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along)[:3, :3]
    ring = radius * rim @ frame.T
    faces = np.concatenate(
        [np.stack([number, following, following + count], 1), np.stack([number, following + count, number + count], 1)]
    )
    return trimesh.Trimesh(np.vstack([ring + ends[0], ring + ends[1]]), faces, process=False)


def _vector(element: ET.Element, path: Path, default: float) -> Array:
    """Return ``value="x, y, z"`` or ``x= y= z=``; one value stands for all three."""
    if (text := element.get("value")) is not None:
        values = _numbers(text, path)
        return np.full(3, values[0]) if values.size == 1 else values
    return np.array([_number(element.get(key, repr(default)), path) for key in "xyz"])


def _numbers(text: str, path: Path) -> Array:
    return np.array([_number(word, path) for word in text.replace(",", " ").split()])


def _number(text: str, path: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise SceneError(f"'{text}' is no number", path, "correct the value")
    return value
