"""Meshes made ready for shooting and bouncing rays, of one material or of several, and their surfaces."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MeshError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.settings.sbr import SMALLEST_SIZE
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.optics.surfaces import PartSurfaces, Surface
from scarl_sionna.scene.document.mesh_files import check_triangles
from scarl_sionna.scene.materials.fresnel import film_of
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial, builtin_materials

from .mesh import Body

if TYPE_CHECKING:
    import trimesh

    from scarl_sionna.engine.world import World

Material: TypeAlias = "str | complex | RadioMaterial"
SingleMesh: TypeAlias = "trimesh.Trimesh | str | Path"
Parts: TypeAlias = "Sequence[tuple[SingleMesh, Material]] | Mapping[Material, SingleMesh]"
"""Meshes in one frame, each with its material."""
Mesh: TypeAlias = "SingleMesh | Body | Parts"

CONDUCTORS = ("metal", "pec")
"""Names of a perfect conductor, whatever the table says."""
LARGEST_SIZE = 50.0
"""Largest extent [m] above which a mesh is taken to be in another unit than metres: decides a warning only."""


def load_body(mesh: Mesh) -> Body:
    """Make a mesh ready for many calls of :func:`scarl_sionna.rcs`.

    Parameters
    ----------
    mesh : trimesh.Trimesh, path, Body, sequence of (mesh, material) or mapping of material to mesh
        [m]. Parts of several materials stand in one frame and are traced together.

    Raises
    ------
    MeshError
        If a file cannot be read or a mesh is not usable.
    """
    if isinstance(mesh, Body):
        return mesh
    pairs = _pairs(mesh)
    if pairs is None:
        return _body([mesh], ())
    if not pairs:
        raise MeshError("the list of parts is empty", remedy="give one (mesh, material) or more")
    return _body([part for part, _ in pairs], tuple(material for _, material in pairs))


def check_size(body: Body, frequency: float) -> None:
    """Warn of a body that is too small for physical optics at a frequency [Hz], or that is hardly in metres."""
    wavelength = SPEED_OF_LIGHT / frequency
    if body.size > LARGEST_SIZE:
        warnings.warn(
            f"the mesh is {body.size:.4g} m across; is it in millimetres? Lengths are metres, and the RCS of a plate "
            "grows with the fourth power of its size",
            ScarlWarning,
            stacklevel=4,
        )
    elif body.size < SMALLEST_SIZE * wavelength:
        warnings.warn(
            f"the mesh is {body.size:.4g} m across, {body.size / wavelength:.2g} wavelengths; below {SMALLEST_SIZE:g} "
            "physical optics is wrong by decibels: use a full-wave solver, or check the unit of the mesh",
            ScarlWarning,
            stacklevel=4,
        )


def actor_parts(world: World, name: str, time: float | None = None) -> list[tuple[trimesh.Trimesh, RadioMaterial]]:
    """Return the meshes of an actor or object of a scene, each with its radio material, for :func:`load_body`.

    Parameters
    ----------
    world : World
    name : str
        An actor's meshes are in the actor's frame, those of a static object in the world's.
    time : float, optional
        At which limbs and wheels stand where their joints have them [s]; 0, or where the scene's time is nearest to it.

    Raises
    ------
    UnknownNameError
        If the scene has nothing of that name.
    TimeRangeError
        If the scene has no such time.
    """
    import trimesh

    known = {info.name: info for info in world.instances.values()}
    if name not in known:
        raise UnknownNameError("actor or object", name, known)
    start, stop = world.time_range
    state = world.at(min(max(0.0, start), stop) if time is None else time)
    joints = state._joints.get(name, {})
    result = []
    for part in known[name].parts:
        corners = state.part_corners(part)
        joint = joints.get(world.parts.name[part])
        if joint is not None:
            corners = joint.pose.apply(corners)
        faces = np.arange(3 * len(corners)).reshape(-1, 3)
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False)
        result.append((mesh, world.materials[world.parts.material[part]]))
    return result


def _pairs(mesh: Mesh) -> list[tuple[Mesh, Material]] | None:
    if isinstance(mesh, Mapping):
        return [(part, material) for material, part in mesh.items()]
    if not isinstance(mesh, Sequence) or isinstance(mesh, str):
        return None
    for entry in mesh:
        if not (isinstance(entry, Sequence) and len(entry) == 2):
            raise ParameterRangeError("mesh", type(entry).__name__, "a sequence of pairs (mesh, material)")
    return [(part, material) for part, material in mesh]


def _body(meshes: Sequence[Any], materials: tuple[Material, ...]) -> Body:
    vertices, faces, part = [], [], []
    first = 0
    for number, mesh in enumerate(meshes):
        path = Path(mesh) if isinstance(mesh, str | Path) else None
        triangles: Any = mesh if path is None else _read(path)
        try:
            points, index = Body.checked(triangles.vertices, triangles.faces)
        except MeshError as error:
            raise MeshError(str(error), path or (f"part {number}" if materials else None)) from error
        except AttributeError:
            raise ParameterRangeError(
                "mesh", type(mesh).__name__, "a trimesh.Trimesh, a path or pairs (mesh, material)"
            ) from None
        vertices.append(points)
        faces.append(index + first)
        part.append(np.full(len(index), number))
        first += len(points)
    named = [str(mesh) for mesh in meshes if isinstance(mesh, str | Path)]
    body = Body.from_mesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(part), materials)
    if body.num_degenerate:
        name = f"{', '.join(named)}: " if named else ""
        warnings.warn(f"{name}{body.num_degenerate} faces without area were left out", ScarlWarning, stacklevel=3)
    return body


def _read(path: Path) -> trimesh.Trimesh:
    import trimesh

    if not path.is_file():
        raise MeshError("there is no such file", path, "check the path")
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # each reader of trimesh raises its own
        raise MeshError(f"cannot be read as a mesh ({error})", path, "give a PLY, OBJ, STL or glTF file") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshError("the mesh has no faces", path, "give a triangle mesh, not a point cloud or a curve")
    try:
        check_triangles(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    except MeshError as error:
        raise MeshError(f"the mesh {error}", path) from None
    return mesh


def surfaces_of(
    body: Body,
    material: Material,
    frequency: npt.NDArray[np.float64],
    materials: MaterialTable | None,
    rough: bool = False,
) -> Iterator[tuple[PartSurfaces, npt.NDArray[np.int64]]]:
    """Yield what the parts of a body reflect like, and the rows of `frequency` for which that is valid.

    Parameters
    ----------
    body : Body
    material : str, complex or RadioMaterial
        Of a body without materials of its own.
    frequency : ndarray of float64, shape (n,)
        [Hz].
    materials : MaterialTable or None
        Where names are looked up; None is the built-in table.
    rough : bool
        Whether scattering and heights take their part from the mirror reflection, :func:`.rough.coherent_share`.

    Raises
    ------
    UnknownMaterialError, MaterialRangeError, ParameterRangeError
        If a material is unknown, has no data at a frequency, or is no usable permittivity.
    """
    if body.materials and material != "metal":
        raise ParameterRangeError("material", repr(material), "left out, since the parts have materials of their own")
    entries = [_entry(one, materials) for one in body.materials or (material,)]
    if all(entry is None for entry in entries):
        yield PartSurfaces((Surface(),) * len(entries)), np.arange(len(frequency))
        return
    for value in np.unique(frequency):
        surfaces = tuple(_surface(entry, float(value), rough) for entry in entries)
        yield PartSurfaces(surfaces), np.flatnonzero(frequency == value)


def material_names(body: Body, material: Material) -> list[str]:
    """Return the name of each part's material."""
    return [str(getattr(one, "name", one)) for one in body.materials or (material,)]


def _entry(material: Material, materials: MaterialTable | None) -> RadioMaterial | complex | None:
    """Return None for a perfect conductor."""
    if isinstance(material, str):
        if material.lower() in CONDUCTORS:
            return None
        return (materials if materials is not None else builtin_materials())[material]
    return material if isinstance(material, RadioMaterial) else _permittivity(material)


def _surface(entry: RadioMaterial | complex | None, frequency: float, rough: bool) -> Surface:
    if entry is None:
        return Surface()
    return surface_of(entry, frequency, rough) if isinstance(entry, RadioMaterial) else Surface(entry, None, frequency)


def surface_of(entry: RadioMaterial, frequency: float, rough: bool = False) -> Surface:
    """Return what a material reflects like at a frequency [Hz]; `rough` as of :func:`surfaces_of`."""
    kept, height = (entry.coherence, entry.roughness_rms) if rough else (1.0, 0.0)
    return Surface(
        entry.at(frequency), entry.thickness, frequency, kept, film_of(entry, frequency), height, entry.rounded
    )


def _permittivity(value: complex) -> complex:
    try:
        number = complex(value)
    except (TypeError, ValueError):
        raise ParameterRangeError(
            "material", repr(value), "a name, a RadioMaterial or a complex permittivity"
        ) from None
    if not (np.isfinite(number) and number.real >= 1.0 and number.imag <= 0.0):
        raise ParameterRangeError(
            "material",
            number,
            "relative permittivity with real part >= 1 and imaginary part <= 0",
            "losses are a negative imaginary part (time dependence e^{+jwt})",
        )
    return number
