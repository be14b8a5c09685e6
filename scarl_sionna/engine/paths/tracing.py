"""Which surfaces propagation paths touch, from Sionna RT's PathSolver.

Their planes are in float64, as phases need them.

The solver works in float32: the surfaces, their order and the kinds of interaction are right, lengths are not good
enough at 77 GHz (2.6 deg rms at 200 m). So only the former are taken from it, with the float64 planes of the triangles
that it met.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from scarl_sionna.core.errors import EngineError, ScarlError
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.engine import variant
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import MitsubaObject
from scarl_sionna.scene.materials.rough import scatters
from scarl_sionna.scene.materials.table import RadioMaterial

if TYPE_CHECKING:
    from scarl_sionna.engine.rays.geometry import Triangles
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]

NONE, SPECULAR, DIFFUSE, REFRACTION, DIFFRACTION = 0, 1, 2, 4, 8
"""Kinds of interaction, the numbers of Sionna RT's ``InteractionType``."""
LANES_PER_BATCH = 1 << 24
"""Depth times rays times targets of one call of the solver: its arrays of candidates then stay below 1 GB."""

ENGINE_SCATTERING = 0.7
"""Of materials that scatter without a scattering coefficient: half of the rays that meet them are scattered."""

_static_extents: WeakKeyDictionary[World, dict[tuple[int, int], float]] = WeakKeyDictionary()
"""Extents that :func:`mirror_extent` found on parts at rest, by part and face [m]."""


class PathBufferOverflowError(ScarlError):
    """Sionna RT found more candidates than its buffer holds, so paths are missing."""

    def __init__(self, max_num_paths: int) -> None:
        self.max_num_paths = max_num_paths
        super().__init__(
            f"the path solver filled its buffer of max_num_paths = {max_num_paths} candidates, so paths may be "
            "missing; raise max_num_paths, or ask for less with max_depth, num_samples or fewer targets "
            "(on_overflow='warn' goes on with what was found)"
        )


@dataclass(frozen=True, eq=False)
class TracedPaths:
    """Paths from one source to many targets, in a canonical order.

    Attributes
    ----------
    target : ndarray of int64, shape (num_paths,)
    kind : ndarray of int32, shape (num_paths, max_depth)
        Interactions, ``NONE`` beyond the path's depth.
    part, face : ndarray of int64, shape (num_paths, max_depth)
        Rows of the part table and faces within the part, -1 beyond the depth.
    vertex : ndarray of float64, shape (num_paths, max_depth, 3)
        The engine's float32 interaction points [m, world].
    normal, offset : ndarray of float64, shape (num_paths, max_depth, 3) and (num_paths, max_depth)
        Planes of the triangles: normal . x = offset [m]; zero beyond the depth.
    a : ndarray of complex128, shape (num_paths, 2, 2)
        The engine's own float32 transfer, spherical basis of the world frame at both ends (theta, phi).
    num_candidates : int
        Largest number of candidates of one call.
    overflow : bool
        Whether a call filled the buffer, so that paths may be missing.
    """

    target: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int32]
    part: npt.NDArray[np.int64]
    face: npt.NDArray[np.int64]
    vertex: Array
    normal: Array
    offset: Array
    a: npt.NDArray[np.complex128]
    num_candidates: int
    overflow: bool

    @property
    def depth(self) -> npt.NDArray[np.int32]:
        """Number of interactions, shape (num_paths,)."""
        return np.count_nonzero(self.kind, axis=1).astype(np.int32)

    def of_targets(self, first: int, stop: int | None = None) -> TracedPaths:
        """Return the paths to a range of the targets, counted from its first."""
        rows = (self.target >= first) & (self.target < (np.inf if stop is None else stop))
        arrays: dict[str, Any] = {
            name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **{**arrays, "target": self.target[rows] - first})


class _CountingGenerator:
    """The solver's generator of candidates, which also tells how many it found: the solver itself drops that number."""

    def __init__(self, inner: Callable[..., MitsubaObject]) -> None:
        self.inner, self.num_candidates = inner, 0

    def __call__(self, *args: object, **options: object) -> MitsubaObject:
        buffer = self.inner(*args, **options)
        self.num_candidates = int(np.array(buffer.paths_counter).ravel()[0])
        return buffer


def solver_options(settings: SionnaSettings) -> dict[str, Any]:
    """Return the arguments of a call of ``PathSolver`` for its settings."""
    return {
        "max_depth": settings.max_depth,
        "samples_per_src": settings.num_samples,
        "max_num_paths_per_src": settings.max_num_paths,
        "specular_reflection": settings.specular,
        "diffuse_reflection": settings.diffuse,
        "refraction": settings.refraction,
        "diffraction": settings.diffraction,
        "edge_diffraction": settings.diffraction,
        "seed": settings.seed,
    }


def trace_paths(
    state: WorldState, source: npt.ArrayLike, targets: npt.ArrayLike, settings: SionnaSettings
) -> TracedPaths:
    """Trace the paths from a source to targets with ``PathSolver(deterministic=True)``.

    Parameters
    ----------
    state : WorldState
    source : array_like of float, shape (3,)
        [m, world].
    targets : array_like of float, shape (num_targets, 3)
        [m, world]. Between a source and a target at the same place there is no line of sight.
    settings : SionnaSettings
        Rays that look for candidates, the solver's buffer of them for each call of it, and the interactions that are
        looked for: diffraction at most once in a path, at edges between faces and at ends of sheets, in the light and
        in the shadow. Its `on_overflow` and `double_bounce` are the caller's.

    Returns
    -------
    TracedPaths
        Sorted by target, depth, kinds, parts, faces, vertices; the same bytes for the same input.

    Raises
    ------
    EngineError
        If the solver fails.
    """
    points = np.asarray(targets, dtype=np.float64).reshape(-1, 3)
    options = solver_options(settings)
    with variant.radio() as mi:
        scene = state._applied("radio").sionna_scene  # velocities are not asked for
        batches, counts = [], [0]
        for chosen in target_batches(len(points), settings):
            with (
                materials_as(scene, _scattering(state) if settings.diffuse else {}),
                polarized_points(mi, scene, np.asarray(source, dtype=np.float64), points[chosen]),
            ):
                columns, count = solve(scene, options)
            columns["target"] += chosen.start
            batches.append(columns)
            counts.append(count)
    if not batches:
        batches = [_no_columns(settings.max_depth)]
    return TracedPaths(
        **on_triangles(state, {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}),
        num_candidates=max(counts),
        overflow=max(counts) >= settings.max_num_paths,
    )


def target_batches(num_targets: int, settings: SionnaSettings) -> Iterator[slice]:
    """Yield ranges of targets that one call of the solver can take; see `LANES_PER_BATCH`."""
    size = max(1, LANES_PER_BATCH // max(1, settings.max_depth * settings.num_samples))
    for first in range(0, num_targets, size):
        yield slice(first, min(first + size, num_targets))


def on_triangles(state: WorldState, columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of :func:`solve` in canonical order, with parts for the engine's objects, and with planes.

    What comes in place of `object`, and `normal` and `offset`, is described in :class:`TracedPaths`.
    """
    found = dict(columns)
    touched = found["kind"] != NONE
    parts = state.world.twin("radio").part_of_number(found.pop("object"))
    found["part"] = np.where(touched, parts, -1)
    found["face"] = np.where(touched, found["face"], -1)
    found["vertex"] = np.where(touched[..., None], found["vertex"], 0.0)
    found = _ordered(found)
    triangles = state._triangles
    touched = found["kind"] != NONE
    row = np.where(touched, triangles.first[found["part"]] + found["face"], 0)
    found["normal"] = np.where(touched[..., None], triangles.normal[row], 0.0)
    found["offset"] = np.where(touched, triangles.offset[row], 0.0)
    return found


def engine_scattering(material: RadioMaterial) -> float:
    """Return the engine's scattering coefficient of a material where it looks for diffuse paths.

    That of the material; where it is 0 and the material scatters by its heights or an albedo, `ENGINE_SCATTERING`: it
    decides how many rays are scattered, and what the engine takes it for is undone.
    """
    own = material.scattering_coefficient
    return ENGINE_SCATTERING if own == 0.0 and scatters(material) else own


def _scattering(state: WorldState) -> dict[str, dict[str, float]]:
    """Return what :func:`materials_as` sets so that all that scatters does so in the engine."""
    entries = state.world.document.materials
    return {
        bsdf: {"scattering_coefficient": engine_scattering(material)}
        for bsdf, material in ((bsdf, state.world.materials[entry.radio]) for bsdf, entry in entries.items())
        if engine_scattering(material) != material.scattering_coefficient
    }


@contextmanager
def materials_as(scene: MitsubaObject, values: Mapping[str, Mapping[str, float]]) -> Iterator[None]:
    """Set fields of the engine's radio materials for a block, by the ids of the document's BSDFs.

    They are inputs of the kernels: as constants in them they would be compiled anew for each value.
    """
    import drjit as dr
    import mitsuba as mi

    before: list[tuple[MitsubaObject, str, MitsubaObject]] = []
    try:
        for bsdf, fields in values.items():
            radio = scene.radio_materials.get(f"radio-{bsdf}")
            if radio is None:  # no shape has it
                continue
            for field, value in fields.items():
                before.append((radio, field, getattr(radio, field)))
                setattr(radio, field, dr.opaque(mi.Float, value))
        yield
    finally:
        for radio, field, value in before:
            setattr(radio, field, value)


@contextmanager
def polarized_points(mi: ModuleType, scene: MitsubaObject, source: Array, targets: Array) -> Iterator[None]:
    """Put a transmitter and receivers of both polarisations into the scene, world axes, and take them out again."""
    import sionna.rt as rt

    array = rt.PlanarArray(
        num_rows=1, num_cols=1, vertical_spacing=0.5, horizontal_spacing=0.5, pattern="iso", polarization="VH"
    )
    first, *others = ({"position": mi.Point3f(*point.tolist())} for point in (source, *targets))
    with endpoints(scene, first, others, (array, array)):
        yield


@contextmanager
def endpoints(
    scene: MitsubaObject,
    source: dict[str, MitsubaObject],
    targets: Sequence[dict[str, MitsubaObject]],
    arrays: tuple[MitsubaObject, MitsubaObject],
) -> Iterator[None]:
    """Put a transmitter and receivers with their arrays into the scene, and take them out again.

    Parameters
    ----------
    scene : sionna.rt.Scene
    source, targets : dict, sequence of dict
        Arguments of ``sionna.rt.Transmitter`` and ``Receiver``: position, orientation, velocity.
    arrays : (sionna.rt.PlanarArray, sionna.rt.PlanarArray)
        Of the transmitter and of the receivers.
    """
    import sionna.rt as rt

    before = scene.tx_array, scene.rx_array
    names = ["scarl_source", *(f"scarl_target_{index}" for index in range(len(targets)))]
    try:
        scene.tx_array, scene.rx_array = arrays
        scene.add(rt.Transmitter(names[0], **source))
        for name, target in zip(names[1:], targets, strict=True):
            scene.add(rt.Receiver(name, **target))
        yield
    finally:
        for name in names:
            if name in scene.transmitters or name in scene.receivers:
                scene.remove(name)
        if before[0] is not None:
            scene.tx_array = before[0]
        if before[1] is not None:
            scene.rx_array = before[1]


def solve(
    scene: MitsubaObject, options: dict[str, Any], also: tuple[str, ...] = ()
) -> tuple[dict[str, npt.NDArray[Any]], int]:
    """Return what the solver finds between the end points of a scene, one row a path, and the number of candidates.

    Parameters
    ----------
    scene : sionna.rt.Scene
        With its end points, inside of ``variant.radio()``.
    options : dict
        Of :func:`solver_options`.
    also : tuple of str
        Further arrays of ``sionna.rt.Paths``, one number a path: ``"doppler"``, ``"theta_t"`` and the like.

    Raises
    ------
    EngineError
        If the solver fails.
    """
    import sionna.rt as rt

    solver = rt.PathSolver(deterministic=True)
    generator = _CountingGenerator(solver._candidate_generator)
    solver._candidate_generator = generator
    try:
        with many_threads():
            found = solver(scene, **options)
        valid = np.array(found.valid, dtype=bool)
        if options["max_depth"] == 0 or not valid.any():
            interactions = np.zeros((options["max_depth"], *valid.shape), dtype=np.uint32)
            objects, faces = interactions, interactions
            vertices = np.zeros((*interactions.shape, 3))
        else:
            interactions, objects = np.array(found.interactions), np.array(found.objects)
            faces, vertices = np.array(found.primitives), np.array(found.vertices)
        a = np.array(found.a[0]).astype(np.complex128) + 1j * np.array(found.a[1])
        more = {name: np.array(getattr(found, name)).astype(np.float64) for name in also}
    except (RuntimeError, MemoryError) as error:
        raise EngineError(
            f"Sionna RT's path solver failed ({error}); use fewer num_samples or less max_depth"
        ) from error
    rx, tx, path = np.nonzero(valid)
    columns: dict[str, npt.NDArray[Any]] = {
        "target": rx.astype(np.int64),
        "kind": np.moveaxis(interactions[:, rx, tx, path], 0, 1).astype(np.int32),
        "object": np.moveaxis(objects[:, rx, tx, path], 0, 1).astype(np.int64),
        "face": np.moveaxis(faces[:, rx, tx, path], 0, 1).astype(np.int64),
        "vertex": np.moveaxis(vertices[:, rx, tx, path], 0, 1).astype(np.float64),
        "a": a[rx, :, tx, :, path].reshape(len(rx), *a.shape[1::2]),
        **{name: value[rx, tx, path] for name, value in more.items()},
    }
    # the solver's depth is that of the deepest path found
    missing = options["max_depth"] - columns["kind"].shape[1]
    for name in ("kind", "object", "face", "vertex"):
        width = [(0, 0), (0, missing)] + [(0, 0)] * (columns[name].ndim - 2)
        columns[name] = np.pad(columns[name], width)
    return columns, generator.num_candidates


def _no_columns(max_depth: int) -> dict[str, npt.NDArray[Any]]:
    return {
        "target": np.zeros(0, np.int64),
        "kind": np.zeros((0, max_depth), np.int32),
        "object": np.zeros((0, max_depth), np.int64),
        "face": np.zeros((0, max_depth), np.int64),
        "vertex": np.zeros((0, max_depth, 3)),
        "a": np.zeros((0, 2, 2), np.complex128),
    }


def _ordered(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Return the paths in canonical order: target, depth, kinds, parts, faces, vertices."""
    count = len(columns["target"])
    keys = [columns["target"], np.count_nonzero(columns["kind"], axis=1)]
    for name in ("kind", "part", "face", "vertex"):
        keys.extend(columns[name].reshape(count, -1).T if count else ())
    order = np.lexsort(keys[::-1])
    return {name: column[order] for name, column in columns.items()}


def mirror_extent(state: WorldState, part: int, face: int) -> float:
    """Return the smaller extent [m] of the flat region of a part that a face belongs to.

    The region is all faces of the part in the same plane (1e-3 rad, 1 mm), joined or not.
    """
    if state.world.parts.actor[part] >= 0:
        return _extent(state._triangles, part, face)
    known = _static_extents.setdefault(state.world, {})
    if (part, face) not in known:
        known[part, face] = _extent(state._triangles, part, face)
    return known[part, face]


def _extent(triangles: Triangles, part: int, face: int) -> float:
    """Return what :func:`mirror_extent` does, from all triangles of a state."""
    rows = slice(triangles.first[part], triangles.first[part + 1])
    normal, offset = triangles.normal[rows], triangles.offset[rows]
    sign = np.sign(normal @ normal[face])
    flat = (np.abs(normal @ normal[face]) > 1.0 - 5e-7) & (np.abs(offset * sign - offset[face]) < 1e-3)
    return _narrowest(triangles.corners[rows][flat].reshape(-1, 3), normal[face])


def _narrowest(points: Array, normal: Array) -> float:
    """Return the smallest width of the convex hull of points in a plane; zero where they lie on a line."""
    across = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    across /= max(float(np.linalg.norm(across)), 1e-300)
    flat = (points - points.mean(axis=0)) @ np.stack([across, np.cross(normal, across)], axis=1)
    try:
        hull = ConvexHull(flat)
    except QhullError:
        return 0.0
    return float(np.ptp(flat[hull.vertices] @ hull.equations[:, :2].T, axis=0).min())
