"""Radio links by Sionna RT's PathSolver at any carrier: its amplitudes, with delays in float64.

The radio twin is tuned to the carrier for the call and put back after it, so that the radars of the same frame see it
as it was.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.settings.radio import RadioSettings
from scarl_sionna.core.specs.radio import RadioArray
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine import variant
from scarl_sionna.engine.twins import ENGINE_THICKNESS
from scarl_sionna.engine.types import MitsubaObject
from scarl_sionna.engine.world import WorldState
from scarl_sionna.scene.materials.carrier import at_carrier, nearest_to_carrier
from scarl_sionna.scene.materials.table import RadioMaterial

from .tracing import DIFFRACTION, SPECULAR, endpoints, materials_as, on_triangles, solve, solver_options, target_batches
from .zones import mirror_sizes, zone_diameters

Array = npt.NDArray[np.float64]

_ANGLES = ("theta_t", "phi_t", "theta_r", "phi_r")
HALF_SPACE_LOSS = 110.0
"""Attenuation of the field [Np] on the way through the layer that stands for a half space: nothing in float32."""
SAME_PLACE = 1e-3
"""Mirrors within it of each other [m] are one, and points of other steps."""
LEAST_ATTENUATION = 1e-2
"""Below it [Np/m] a layer of that loss would be kilometres thick: such a material counts as without losses."""


@dataclass(frozen=True, eq=False)
class Links:
    """Paths from a sender to receivers, one row a path in canonical order.

    Attributes
    ----------
    receiver : ndarray of int64, shape (num_paths,)
    a : ndarray of complex128, shape (num_paths, num_receiver_antennas, num_sender_antennas)
        The engine's passband coefficient: antennas, spreading and interactions, without the carrier's phase over the
        length.
    length : ndarray of float64, shape (num_paths,)
        [m].
    doppler : ndarray of float64, shape (num_paths,)
        [Hz], the engine's: positive where the length falls.
    theta_t, phi_t, theta_r, phi_r : ndarray of float64, shape (num_paths,)
        Zenith and azimuth, in world axes, of where the path leaves the sender, and of where the receiver sees it come
        from [rad].
    kind : ndarray of int32, shape (num_paths, max_depth)
        Interactions, as in :mod:`.tracing`.
    part : ndarray of int64, shape (num_paths, max_depth)
        Rows of the part table, -1 beyond the path's depth.
    small_mirror : ndarray of bool, shape (num_paths,)
        Whether a mirror reflection is on a flat face that is smaller than the first Fresnel zone there: the engine
        gives it the amplitude of an endless one.
    num_candidates : int
        Largest number of candidates of one call of the solver.
    overflow : bool
        Whether a call filled the solver's buffer, so that paths may be missing.
    borrowed : dict of str to float
        Materials without data at the carrier, and the frequency [Hz] of the values that they had instead.
    """

    receiver: npt.NDArray[np.int64]
    a: npt.NDArray[np.complex128]
    length: Array
    doppler: Array
    theta_t: Array
    phi_t: Array
    theta_r: Array
    phi_r: Array
    kind: npt.NDArray[np.int32]
    part: npt.NDArray[np.int64]
    small_mirror: npt.NDArray[np.bool_]
    num_candidates: int
    overflow: bool
    borrowed: dict[str, float]


def trace_links(
    state: WorldState,
    frequency: float,
    ends: tuple[Mount, Sequence[Mount]],
    arrays: tuple[RadioArray, RadioArray],
    settings: RadioSettings,
) -> Links:
    """Trace the paths from a sender to receivers at a carrier.

    Parameters
    ----------
    state : WorldState
    frequency : float
        Carrier [Hz].
    ends : (Mount, sequence of Mount)
        The sender and one or more receivers.
    arrays : (RadioArray, RadioArray)
        Antennas of the sender and of every receiver.
    settings : RadioSettings
        `max_paths` is the caller's.

    Raises
    ------
    MaterialRangeError
        If a material of the scene has no data at the carrier, unless the settings allow the nearest.
    EngineError
        If the solver fails.

    Notes
    -----
    The engine's points are float32: 4 um at 100 m. Moved onto the float64 planes of the triangles that they lie on, the
    length of a path over mirrors and through layers is right to the second order in what remains, since it is
    stationary there; that of a path over an edge has the engine's error, a degree of phase at 77 GHz.
    """
    sender, receivers = ends
    options = solver_options(settings.solver)
    batches, counts = [], []
    with variant.radio() as mi:
        scene = state.radio_scene()
        engine_arrays = _engine_array(arrays[0]), _engine_array(arrays[1])
        with _tuned(state, scene, frequency, settings.without_data == "nearest") as borrowed:
            for chosen in target_batches(len(receivers), settings.solver):
                placed = [_placed(mi, mount) for mount in receivers[chosen]]
                with endpoints(scene, _placed(mi, sender), placed, engine_arrays):
                    columns, count = solve(scene, options, ("doppler", *_ANGLES))
                columns["target"] += chosen.start
                batches.append(columns)
                counts.append(count)
    found = on_triangles(state, {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]})
    places = np.array([mount.pose.position for mount in receivers])
    length = _lengths(found, sender.pose.position, places[found["target"]])
    keep = _once(found, length)
    found, length = {name: column[keep] for name, column in found.items()}, length[keep]
    sizes = mirror_sizes(state, found["kind"], found["part"], found["face"])
    zones = zone_diameters(found["vertex"], sender.pose.position, length, SPEED_OF_LIGHT / frequency)
    return Links(
        receiver=found["target"],
        length=length,
        small_mirror=np.any(sizes < zones, axis=1),
        **{name: found[name] for name in ("a", "doppler", *_ANGLES, "kind", "part")},
        num_candidates=max(counts),
        overflow=max(counts) >= settings.solver.max_num_paths,
        borrowed=borrowed,
    )


def _once(found: dict[str, npt.NDArray[Any]], length: Array) -> npt.NDArray[np.bool_]:
    """Return which paths to keep so that none is there twice, shape (num_paths,).

    Of paths with the same steps whose mirrors are one mirror within `SAME_PLACE` (each point lies on the other's plane:
    two surfaces that coincide, facets of a crowned road or of a bonnet) the shorter one stays: that over a marking, not
    that over the road below it. Other steps are the same where their points are.
    """
    kind, vertex, normal, offset = (found[name] for name in ("kind", "vertex", "normal", "offset"))
    keep = np.ones(len(kind), dtype=np.bool_)
    alike = np.concatenate([found["target"][:, None], kind], axis=1) * 1e6  # far apart where they differ
    tree = cKDTree(np.concatenate([alike, length[:, None]], axis=1))
    for one, other in sorted(tree.query_pairs(SAME_PLACE, p=np.inf)):
        off = [np.abs((vertex[a] * normal[b]).sum(axis=-1) - offset[b]) for a, b in ((one, other), (other, one))]
        apart = np.where(kind[one] == SPECULAR, np.maximum(*off), np.linalg.norm(vertex[one] - vertex[other], axis=-1))
        if keep[one] and keep[other] and np.all(apart < SAME_PLACE):
            keep[other if length[one] <= length[other] else one] = False
    return keep


def _lengths(found: dict[str, npt.NDArray[Any]], start: Array, stop: Array) -> Array:
    """Return lengths in float64 [m] from a start (3,) over the vertices of each path to its stop (num_paths, 3)."""
    vertex, kind = found["vertex"], found["kind"]
    off = (vertex * found["normal"]).sum(axis=-1) - found["offset"]
    on_plane = vertex - off[..., None] * found["normal"]  # normals are zero beyond the depth
    points = np.where((kind == DIFFRACTION)[..., None], vertex, on_plane)
    here = np.broadcast_to(start, stop.shape)
    length = np.zeros(len(stop))
    for column in range(kind.shape[1]):
        there = np.where((kind[:, column] != 0)[:, None], points[:, column], here)
        length += np.linalg.norm(there - here, axis=1)
        here = there
    return np.asarray(length + np.linalg.norm(stop - here, axis=1))


@contextmanager
def _tuned(state: WorldState, scene: MitsubaObject, frequency: float, nearest: bool) -> Iterator[dict[str, float]]:
    """Tune the engine's scene and its radio materials to a carrier for a block; what it yields is `Links.borrowed`."""
    import drjit as dr
    import mitsuba as mi

    world = state.world
    borrowed: dict[str, float] = {}
    chosen: dict[str, RadioMaterial] = {}
    for name in {entry.radio for entry in world.document.materials.values()}:
        if nearest:
            chosen[name], found = nearest_to_carrier(world.materials[name], frequency)
            if found != frequency:
                borrowed[name] = found
        else:
            chosen[name] = at_carrier(world.materials[name], frequency)
    tuned = {bsdf: chosen[entry.radio] for bsdf, entry in world.document.materials.items()}
    values = {bsdf: _engine_values(material, frequency) for bsdf, material in tuned.items()}
    carrier = scene.frequency
    try:
        scene.frequency = dr.opaque(mi.Float, frequency)  # an input of the kernels, see `materials_as`
        with materials_as(scene, values):
            yield dict(sorted(borrowed.items()))
    finally:
        scene.frequency = carrier


def _engine_values(material: RadioMaterial, frequency: float) -> dict[str, float]:
    """Return the fields of the engine's layer for a material at a carrier."""
    return {
        "relative_permittivity": material.permittivity_at(frequency),
        "conductivity": material.conductivity_at(frequency),
        "thickness": material.thickness or _thickness_of_half_space(material.at(frequency), frequency),
        "scattering_coefficient": material.scattering_coefficient,
        "xpd_coefficient": material.xpd_coefficient,
    }


def _thickness_of_half_space(permittivity: complex, frequency: float) -> float:
    """Return how thick a layer must be so that nothing comes back from its rear or passes [m].

    A material without losses has no such thickness: it gets that of the radio twin.
    """
    attenuation = -2.0 * math.pi * frequency / SPEED_OF_LIGHT * float(np.sqrt(permittivity).imag)  # [Np/m]
    return HALF_SPACE_LOSS / attenuation if attenuation > LEAST_ATTENUATION else ENGINE_THICKNESS


def _engine_array(array: RadioArray) -> MitsubaObject:
    import sionna.rt as rt

    return rt.PlanarArray(
        num_rows=array.num_rows,
        num_cols=array.num_columns,
        vertical_spacing=array.vertical_spacing,
        horizontal_spacing=array.horizontal_spacing,
        pattern=array.pattern,
        polarization=array.polarization,
    )


def _placed(mi: ModuleType, mount: Mount) -> dict[str, MitsubaObject]:
    """Return position, orientation and velocity as the engine takes them: yaw, pitch and roll about z, y, x."""
    yaw, pitch, roll = Rotation.from_matrix(mount.pose.rotation).as_euler("ZYX").tolist()
    return {
        "position": mi.Point3f(*mount.pose.position.tolist()),
        "orientation": mi.Point3f(yaw, pitch, roll),
        "velocity": mi.Vector3f(*mount.twist.linear.tolist()),
    }
