"""Compiling a mesh into scattering centres by shooting and bouncing rays.

Its cost and error stand in docs/scatterers.md.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT, power_to_db
from scarl_sionna.radar.optics.body.mesh import Body
from scarl_sionna.radar.optics.body.parts import Material, Mesh, check_size, load_body, material_names, surfaces_of
from scarl_sionna.radar.optics.far_field import both_senses
from scarl_sionna.radar.optics.phase import many_plane_wave_integrals
from scarl_sionna.radar.optics.surfaces import PartSurfaces
from scarl_sionna.scene.materials.table import MaterialTable

from .footprints import Footprints, footprints
from .model import APERTURE_PHASE, ScattererModel
from .table import AspectTable, TableBuilder, direction_of

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

COMPILE_SBR = SbrSettings(max_depth=2, ray_spacing=16.0, edge_spacing=8.0)
"""Rays of 6 cm at 77 GHz, edges followed to 3 cm and then cut. Chosen for time; its error is measured for each model
made, against the same rays, so it does not hold what these rays miss (docs/scatterers.md)."""
WEAKEST = 1e-7
"""A centre is left out of a block of aspects in all of which its power is below this part of all centres' together.
What that costs is inside of the error that is measured for each model made."""
LARGEST_TABLE = 2**31
"""Largest table that is made [bytes]; a larger one is refused."""
HIGHEST_ELEVATION_DEG = 85.0
"""The polarisation basis turns too fast to interpolate closer to the poles."""
CHECK_CELLS = 32
"""Frequencies of the range profiles in which the error of a model is measured: how it is reported, not how large it
is."""
CHECK_DEPTH_DB = 20.0
"""Cells down to this far below the strongest of their profile count in that error."""
_ORIGIN = 1 << 20
"""Numbers of voxels are shifted by this, so that they are positive."""


@dataclass
class _Block:
    """Aspects that share one trace."""

    azimuths: Index
    elevations: Index
    traced: Array
    keys: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    values: npt.NDArray[np.complex64] = field(default_factory=lambda: np.zeros((0, 0, 0, 2, 2), np.complex64))
    weight: Array = field(default_factory=lambda: np.zeros(0))
    moment: Array = field(default_factory=lambda: np.zeros((0, 3)))
    bend: Array = field(default_factory=lambda: np.zeros(0))


def compile_scatterers(
    mesh: Mesh,
    frequency: float = 77e9,
    *,
    azimuths_deg: tuple[float, float] = (-180.0, 180.0),
    azimuth_step_deg: float = 0.25,
    elevations_deg: npt.ArrayLike = (0.0,),
    voxel: float = 0.25,
    trace_step_deg: float = 1.0,
    material: Material = "metal",
    materials: MaterialTable | None = None,
    settings: SbrSettings = COMPILE_SBR,
    num_checks: int = 4,
    progress: bool = True,
) -> ScattererModel:
    r"""Return the scattering centres of a mesh, with their error against its own physical optics.

    Parameters
    ----------
    mesh : trimesh.Trimesh, path, Body, sequence of (mesh, material) or mapping of material to mesh
        [m], in the frame of the body; parts of several materials as in :func:`scarl_sionna.radar.rcs.rcs`.
    frequency : float
        [Hz].
    azimuths_deg : (float, float)
        First and last aspect [deg]; a full turn has no end.
    azimuth_step_deg : float
        [deg], > 0. Ends stay as given, the step is rounded down to fit.
    elevations_deg : array_like of float
        Rising [deg], within 85 deg of the body's xy plane.
    voxel : float
        Footprints in a cube of this side are one centre [m].
    trace_step_deg : float
        Rays are traced once for all aspects within half of this in azimuth and in elevation; between, what is lit is
        kept and only its phases are turned [deg]. A step smaller than that of the aspects traces each of them.
    material : str, complex or RadioMaterial
        Of a mesh without materials of its own. A rough one keeps its coherent part, sqrt(1 - S^2), as in the solver
        `sbr`.
    materials : MaterialTable, optional
    settings : SbrSettings
        Bounces and rays.
    num_checks : int
        Aspects between the compiled ones at which the error is measured; 0 measures none.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    ScattererModel

    Raises
    ------
    MeshError, UnknownNameError, MaterialRangeError
        As of :func:`scarl_sionna.radar.rcs.rcs`.
    ParameterRangeError
        If a number is out of range or the table would be larger than 2 GiB.

    Warns
    -----
    ScarlWarning
        If the step is too wide for the voxel: the phase at its corner turns by more than 90 deg from aspect to aspect.

    Notes
    -----
    Deterministic: the same input gives the same bytes. *Not modelled*: what the mesh's physical optics does not have
    (edge diffraction, creeping waves, transmission), parts of different materials, and the change of a centre's
    amplitude over the radar's band.

    References
    ----------
    .. [1] R. Bhalla, H. Ling, "Three-dimensional scattering center extraction using the shooting and bouncing ray
       technique", IEEE Trans. Antennas Propag. 44(11), 1996.
    """
    azimuth, elevation = _grid(azimuths_deg, azimuth_step_deg, elevations_deg)
    if not (0.0 < frequency < np.inf):
        raise ParameterRangeError("frequency", f"{frequency} Hz", "> 0 Hz and finite")
    if not voxel > 0.0:
        raise ParameterRangeError("voxel", f"{voxel} m", "> 0 m")
    if not trace_step_deg > 0.0:
        raise ParameterRangeError("trace_step_deg", f"{trace_step_deg} deg", "> 0 deg")
    _warn_of_steps(azimuth, elevation, voxel, frequency)
    body = load_body(mesh)
    check_size(body, frequency)
    surfaces = next(surfaces_of(body, material, np.array([float(frequency)]), materials, rough=True))[0]
    blocks = list(_blocks(azimuth, elevation, np.radians(trace_step_deg)))
    keys, size = np.zeros(0, np.int64), 0
    for block in _shown(blocks, progress):
        toward = direction_of(*block.traced)
        found = _cut(footprints(body, surfaces, toward, frequency, settings), voxel)
        _fill(block, found, azimuth, elevation, frequency, voxel)
        keys = np.union1d(keys, block.keys)
        size += block.values.nbytes
        if size > LARGEST_TABLE:
            raise ParameterRangeError(
                "size of the table",
                f"above {size / 2**30:.2g} GiB ({len(keys)} centres)",
                "up to 2 GiB",
                "take fewer aspects or a larger voxel",
            )
    wavelength = SPEED_OF_LIGHT / frequency
    aperture = 2.0 * np.pi / wavelength / APERTURE_PHASE * np.sqrt(_pooled(blocks, keys, "bend"))
    centers, amplitude = _assemble(blocks, keys, azimuth, elevation, frequency, voxel)
    corners = body.triangles.corners
    model = ScattererModel(
        centers,
        azimuth,
        elevation,
        amplitude,
        float(frequency),
        float(voxel),
        2.0 * voxel**2 / wavelength,
        elevation_reach=0.0 if len(elevation) > 1 else _reach(body, wavelength),
        provenance={
            "source": "physical optics of a mesh",
            "mesh_sha256": hashlib.sha256(corners.tobytes()).hexdigest(),
            "num_faces": len(corners),
            "material": ", ".join(dict.fromkeys(material_names(body, material))),
            "settings": settings.model_dump(),
            "trace_step_deg": float(trace_step_deg),
            "extent": np.ptp(corners.reshape(-1, 3), axis=0).tolist(),
        },
        aperture_distance=aperture,
    )
    error = _measured(model, body, surfaces, settings, num_checks) if num_checks and len(azimuth) > 1 else {}
    return ScattererModel(**{**vars(model), "error": error})


def _grid(ends_deg: tuple[float, float], step_deg: float, elevations_deg: npt.ArrayLike) -> tuple[Array, Array]:
    first, last = (float(end) for end in ends_deg)
    if not (np.isfinite([first, last]).all() and first <= last <= first + 360.0):
        raise ParameterRangeError("azimuths_deg", ends_deg, "first <= last <= first + 360 deg")
    if not 0.0 < step_deg <= 360.0:
        raise ParameterRangeError("azimuth_step_deg", f"{step_deg} deg", "above 0 and at most 360 deg")
    elevation = np.asarray(elevations_deg, dtype=np.float64).reshape(-1)
    if not len(elevation) or np.any(np.diff(elevation) <= 0) or np.any(np.abs(elevation) > HIGHEST_ELEVATION_DEG):
        raise ParameterRangeError(
            "elevations_deg", elevations_deg, f"rising, within {HIGHEST_ELEVATION_DEG:g} deg of the xy plane"
        )
    steps = max(int(np.ceil((last - first) / step_deg - 1e-9)), 0)
    azimuth = np.linspace(first, last, steps + 1)
    return np.radians(azimuth[:-1] if last - first == 360.0 else azimuth), np.radians(elevation)


def _reach(body: Body, wavelength: float) -> float:
    """Return how far from the only elevation the amplitudes hold.

    The body's phase in height turns by less than 90 deg.
    """
    height = float(np.ptp(body.triangles.corners[:, :, 2]))
    return min(wavelength / (8.0 * max(height, wavelength)), np.radians(5.0))


def _warn_of_steps(azimuth: Array, elevation: Array, voxel: float, frequency: float) -> None:
    k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    for name, grid in (("azimuth", azimuth), ("elevation", elevation)):
        step = float(np.diff(grid).max()) if len(grid) > 1 else 0.0
        turn = k * voxel * step
        if turn > np.pi / 2.0:
            warnings.warn(
                f"the {name} step of {np.degrees(step):.3g} deg turns the phase at the edge of a {voxel:g} m voxel by "
                f"{np.degrees(turn):.0f} deg; between compiled aspects only mean powers are right. A step of "
                f"{np.degrees(np.pi / 2.0 / (k * voxel)):.2g} deg or a voxel of {np.pi / 2.0 / (k * step):.2g} m "
                "would follow it",
                ScarlWarning,
                stacklevel=3,
            )


def _blocks(azimuth: Array, elevation: Array, step: float) -> Iterator[_Block]:
    """Yield groups of neighbouring aspects at most `step` wide, with the one in their middle."""
    for rows in _groups(elevation, step):
        for columns in _groups(azimuth, step):
            middle = np.array([azimuth[columns[[0, -1]]].mean(), elevation[rows[[0, -1]]].mean()])
            yield _Block(columns, rows, middle)


def _groups(grid: Array, step: float) -> list[Index]:
    count = max(int(np.ceil((grid[-1] - grid[0]) / step - 1e-6)), 1)
    return [np.asarray(rows, dtype=np.int64) for rows in np.array_split(np.arange(len(grid)), min(count, len(grid)))]


def _shown(blocks: list[_Block], progress: bool) -> Iterator[_Block]:
    from rich.progress import track

    yield from track(blocks, description="scattering centres", disable=not progress)


def _cut(found: Footprints, voxel: float) -> Footprints:
    """Halve footprints until none is wider than a voxel."""
    done = []
    while len(found):
        sides = np.linalg.norm(np.roll(found.corners, -1, axis=1) - found.corners, axis=2)
        wide = sides.max(axis=1) > voxel
        done.append(found.take(np.flatnonzero(~wide)))
        longest = sides[wide].argmax(axis=1)
        a, b, c = np.moveaxis(
            found.corners[wide][np.arange(len(longest))[:, None], (longest[:, None] + np.arange(3)) % 3], 1, 0
        )
        middle = (a + b) / 2.0
        halves = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        found = found.take(np.tile(np.flatnonzero(wide), 2), halves)
    return Footprints.joined(done)


def _by_voxel(found: Footprints, voxel: float) -> tuple[Footprints, Index, Index]:
    """Return footprints sorted by voxel, the keys of the voxels, and where the footprints of each begin."""
    cube = np.floor(found.place() / voxel).astype(np.int64) + _ORIGIN
    packed = (cube[:, 0] << 42) | (cube[:, 1] << 21) | cube[:, 2]
    order = np.argsort(packed, kind="stable")
    keys, first = np.unique(packed[order], return_index=True)
    return found.take(order), keys, first.astype(np.int64)


def _summed(
    found: Footprints, keys: Index, first: Index, voxel: float, wave_vectors: Array
) -> tuple[npt.NDArray[np.complex64], Array]:
    """Return what voxels radiate for q = 2 k u, shape (num_q, num_voxels, 4), and powers of footprints at the last q.

    Phases are those at the voxels' middles.
    """
    count = np.diff(np.append(first, len(found)))
    points = found.acting() - np.repeat(_middle(keys, voxel), count, axis=0)[:, None]
    strength = many_plane_wave_integrals(points, found.twice_area(), wave_vectors)
    strength *= (np.linalg.norm(wave_vectors, axis=1) / (8.0 * np.pi)).astype(np.float32)[:, None]  # k / 4 pi
    amplitude = (-1j * found.amplitude).reshape(-1, 4).astype(np.complex64)
    mean = both_senses(found.amplitude, np.ones(len(found), dtype=np.bool_))  # of what is seen where it is lit from
    sent = (-1j * mean).reshape(-1, 4).astype(np.complex64)
    values = np.zeros((len(wave_vectors), len(keys), 4), dtype=np.complex64)
    for entry in range(4) if len(keys) else ():
        values[:, :, entry] = np.add.reduceat(strength * sent[:, entry], first, axis=1)
    return values, np.abs(strength[-1].astype(np.complex128)) ** 2 * np.sum(np.abs(amplitude) ** 2, axis=1)


def _fill(block: _Block, found: Footprints, azimuth: Array, elevation: Array, frequency: float, voxel: float) -> None:
    """Sum the footprints of each voxel for all aspects of a block."""
    found, block.keys, first = _by_voxel(found, voxel)
    view = direction_of(azimuth[block.azimuths][None, :], elevation[block.elevations][:, None]).reshape(-1, 3)
    directions = np.concatenate([view, direction_of(*block.traced)[None]])
    values, power = _summed(found, block.keys, first, voxel, 4.0 * np.pi * frequency / SPEED_OF_LIGHT * directions)
    count = len(block.keys)
    block.values = values[:-1].reshape(len(block.elevations), len(block.azimuths), count, 2, 2)
    which = np.repeat(np.arange(count), np.diff(np.append(first, len(found))))
    block.weight = np.asarray(np.bincount(which, power, count), dtype=np.float64)
    block.bend = _variance(found.apertures(direction_of(*block.traced)), which, np.sqrt(power))
    moment = [np.bincount(which, power * place, count) for place in found.place().T]
    block.moment = np.asarray(np.stack(moment, axis=1), dtype=np.float64)
    _prune(block)


def _variance(values: Array, which: Index, amplitude: Array) -> Array:
    """Return the variance of values (n, 3) in each group, weighted by the amplitudes (n,) of their rows."""
    group, weight = np.repeat(which, 3), np.repeat(amplitude, 3)
    total = np.maximum(np.bincount(group, weight), 1e-300)
    off = values.reshape(-1) - (np.bincount(group, weight * values.reshape(-1)) / total)[group]
    return np.asarray(np.bincount(group, weight * off**2) / total, dtype=np.float64)


def _prune(block: _Block) -> None:
    """Leave out the centres that are below the floor of every aspect of the block."""
    power = np.sum(np.abs(block.values) ** 2, axis=(3, 4), dtype=np.float64)
    strong = np.any(power > WEAKEST * power.sum(axis=2, keepdims=True), axis=(0, 1))
    block.keys, block.weight, block.moment = block.keys[strong], block.weight[strong], block.moment[strong]
    block.bend = block.bend[strong]
    block.values = np.ascontiguousarray(block.values[:, :, strong])


def _middle(keys: Index, voxel: float) -> Array:
    cube = np.stack([keys >> 42, (keys >> 21) & ((1 << 21) - 1), keys & ((1 << 21) - 1)], axis=1) - _ORIGIN
    return np.asarray((cube + 0.5) * voxel, dtype=np.float64)


def _pooled(blocks: list[_Block], keys: Index, name: str) -> Array:
    """Return the mean of a column of the blocks for each key, weighted by power."""
    weight, total = np.zeros(len(keys)), np.zeros(len(keys))
    for block in blocks:
        at = np.searchsorted(keys, block.keys)
        weight[at] += block.weight
        total[at] += block.weight * getattr(block, name)
    return np.divide(total, weight, out=np.zeros_like(total), where=weight > 0.0)


def _assemble(
    blocks: list[_Block], keys: Index, azimuth: Array, elevation: Array, frequency: float, voxel: float
) -> tuple[Array, AspectTable]:
    """Return the centres (centroids of power) and the table of their amplitudes, phases moved there."""
    middle = _middle(keys, voxel)
    weight, moment = np.zeros(len(keys)), np.zeros((len(keys), 3))
    for block in blocks:
        at: Index = np.searchsorted(keys, block.keys).astype(np.int64)
        weight[at] += block.weight
        moment[at] += block.moment
    centers = np.where(weight[:, None] > 0.0, moment / np.where(weight > 0.0, weight, 1.0)[:, None], middle)
    wavenumber = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    row_start = np.unique([block.elevations[0] for block in blocks])
    column_start = np.unique([block.azimuths[0] for block in blocks])
    builder = TableBuilder(row_start, column_start, len(elevation), len(azimuth), len(keys))
    for block in blocks:
        at = np.searchsorted(keys, block.keys).astype(np.int64)
        view = direction_of(azimuth[block.azimuths][None], elevation[block.elevations][:, None])
        moved = np.exp(2j * wavenumber * (view @ (middle - centers)[at].T))
        values = (block.values * moved[..., None, None]).astype(np.complex64)
        builder.put(int(block.elevations[0]), int(block.azimuths[0]), at, values)
        block.values = block.values[:0]  # two tables at once would take twice the memory
    return centers, builder.table()


def range_profile(response: Complex) -> Array:
    """Return the power in each range cell of a response over evenly spaced frequencies, Hann window.

    By definition the squared magnitude of the discrete Fourier transform, scaled so that a lone centre keeps its own.

    Parameters
    ----------
    response : ndarray of complex128, shape (..., num_frequencies)
        [m].

    Returns
    -------
    ndarray of float64, shape (..., num_frequencies)
        [m2].
    """
    window = np.hanning(response.shape[-1] + 2)[1:-1]
    return np.asarray(np.abs(np.fft.fft(response * (window / window.sum()), axis=-1)) ** 2)


def check_frequencies(model: ScattererModel) -> Array:
    """Return frequencies whose range profile holds the body once.

    The check's cells are at least as wide as the voxels. Exact geometry: steps of c / (2 extent) repeat at the extent.

    Returns
    -------
    ndarray of float64, shape (num_frequencies,)
        [Hz].
    """
    extent = float(np.linalg.norm(model.provenance["extent"])) + 4.0 * model.cell
    step = SPEED_OF_LIGHT / (2.0 * extent)
    count = max(min(CHECK_CELLS, int(extent / model.cell)), 8)
    return np.asarray(model.frequency + step * (np.arange(count) - count // 2))


def _measured(
    model: ScattererModel, body: Body, surfaces: PartSurfaces, settings: SbrSettings, num_checks: int
) -> dict[str, float]:
    """Return the error per range cell at aspects half-way between compiled ones."""
    frequencies = check_frequencies(model)
    pick = np.unique(np.linspace(0, len(model.azimuth) - 2, num_checks).round().astype(np.int64))
    azimuths = (model.azimuth[pick] + model.azimuth[pick + 1]) / 2.0
    low = np.arange(len(pick)) % max(len(model.elevation) - 1, 1)
    high = np.minimum(low + 1, len(model.elevation) - 1)
    elevations = (model.elevation[low] + model.elevation[high]) / 2.0
    cells = []
    for az, el in zip(azimuths, elevations, strict=True):
        toward = direction_of(az, el)
        found = _cut(footprints(body, surfaces, toward, model.frequency, settings), model.cell)
        found, keys, first = _by_voxel(found, model.cell)
        q = 4.0 * np.pi / SPEED_OF_LIGHT * frequencies[:, None] * toward
        truth = np.sum(
            _summed(found, keys, first, model.cell, q)[0][:, :, 0] * np.exp(1j * q @ _middle(keys, model.cell).T),
            axis=1,
        )
        predicted = model.scattering_matrix(np.pi / 2.0 - el, az, frequencies)[:, 0, 0]
        wanted, got = range_profile(truth), range_profile(predicted)
        strong = wanted > wanted.max() * 10.0 ** (-CHECK_DEPTH_DB / 10.0)
        if strong.any():
            cells.append(np.abs(power_to_db(np.maximum(got[strong], 1e-300)) - power_to_db(wanted[strong])))
    if not cells:
        return {}
    error = np.concatenate(cells)
    return {
        "median_db": float(np.median(error)),
        "p95_db": float(np.percentile(error, 95)),
        "num_cells": len(error),
        "num_aspects": len(azimuths),
        "range_cell": float(SPEED_OF_LIGHT / 2.0 / np.ptp(frequencies)),
    }
