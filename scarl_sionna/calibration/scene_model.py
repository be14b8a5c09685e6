"""Paths of a scene with the geometry held fixed.

Traced once, Fresnel coefficients evaluated again for each trial material.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, SceneError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.numpy_file import read_npy
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths.tracing import REFRACTION, SPECULAR, TracedPaths, trace_paths
from scarl_sionna.engine.world import WorldState
from scarl_sionna.radar.channel.multipath.images import Chain, material_coefficients, spherical_basis, transfer
from scarl_sionna.radar.channel.multipath.legs import Legs, legs_of
from scarl_sionna.radar.channel.multipath.scattering import scattered_columns
from scarl_sionna.radar.channel.multipath.station import EndPoints, Station
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.tuned import material_frequency
from scarl_sionna.scene.materials.table import MaterialTable
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .physics import TrialMaterial
from .spec import RadarMap, SceneGeometry, ScenePowers

Complex = npt.NDArray[np.complex128]
Trials = Mapping[str, TrialMaterial]

FAINT = 2.0**-20
"""Amplitude of which each path's map is made: any would do; one of 1 would be more than is sent."""


@dataclass(frozen=True, eq=False)
class FixedPaths:
    """The ways from a radar to points and back, ready for other materials.

    Attributes
    ----------
    state : WorldState
    points : PointScatterers
    legs : Legs
        From the radar to the points, with the materials of the table.
    chain : Chain
        Mirrors and panes of each leg.
    travel, bases : ndarray
        What :func:`transfer` needs.
    used : tuple of str
        Materials that the legs meet.
    index : ndarray of int64, shape (num_legs, max_depth)
        Row of `used` for each interaction, -1 for none.
    frequency : float
        At which materials are met [Hz].
    wavelength : float
        Of the radar equation [m].
    """

    state: WorldState
    points: PointScatterers
    legs: Legs
    chain: Chain
    travel: npt.NDArray[np.float64]
    bases: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
    used: tuple[str, ...]
    index: npt.NDArray[np.int64]
    frequency: float
    wavelength: float

    @classmethod
    def trace(
        cls, measurement: SceneGeometry, table: MaterialTable, frequency: float, wavelength: float | None = None
    ) -> FixedPaths:
        """Trace the paths of a measurement; the wavelength is that of the frequency if left out.

        Raises
        ------
        ParameterRangeError
            If no path reaches a target.
        """
        state = load_scene(measurement.scene, table).at(0.0)
        pose = pose_of(measurement)
        station = Station(pose.position, np.zeros(3), pose.rotation)
        targets = measurement.targets
        points = PointScatterers(
            np.array([item.position for item in targets]),
            np.array([item.velocity for item in targets]),
            np.array([item.rcs for item in targets]),
        )
        settings = SionnaSettings(
            max_depth=measurement.max_depth, num_samples=measurement.num_samples, refraction=measurement.refraction
        )
        with variant.radio():
            traced = trace_paths(state, station.position, points.positions, settings)
        ends = EndPoints(points.positions, points.velocities, pose.rotation)
        legs = legs_of(state, traced, station, ends, frequency)
        if len(legs.length) == 0:
            raise ParameterRangeError(
                f"{measurement.name}.targets",
                "out of sight",
                "at least one target that a path reaches",
                "raise max_depth or move the radar",
            )
        rows = _rows_of(legs, traced)
        chain = Chain(legs.kind == SPECULAR, legs.kind == REFRACTION, traced.normal[rows], traced.offset[rows])
        travel = chain.travel(station.position, chain.images(points.positions[legs.target]))
        material = np.array(state.world.parts.material, dtype=object)
        used = tuple(sorted({str(material[part]) for part in legs.part[legs.part >= 0]}))
        index = np.full(legs.part.shape, -1, dtype=np.int64)
        for number, name in enumerate(used):
            index[(legs.part >= 0) & (material[legs.part] == name)] = number
        bases = spherical_basis(pose.rotation, travel[:, 0]), spherical_basis(pose.rotation, -travel[:, -1])
        return cls(
            state, points, legs, chain, travel, bases, used, index, frequency, wavelength or SPEED_OF_LIGHT / frequency
        )

    def columns(self, trials: Trials) -> dict[str, npt.NDArray[Any]]:
        """Return the paths' columns, as :func:`scattered_columns`, with the materials of `trials`."""
        materials = [
            trials[name].as_radio() if name in trials else self.state.world.materials[name] for name in self.used
        ]
        through = transfer(
            self.chain, self.travel, *self.bases, material_coefficients(materials, self.index, self.frequency)
        )
        legs = replace(self.legs, transfer=through)
        return scattered_columns(self.state, self.wavelength, self.points, legs, legs)


def pose_of(measurement: SceneGeometry) -> Pose:
    """Return world_from_radar."""
    return Pose.from_euler(
        measurement.position, yaw=np.radians(measurement.yaw_deg), pitch=-np.radians(measurement.pitch_deg)
    )


def _rows_of(legs: Legs, traced: TracedPaths) -> npt.NDArray[np.int64]:
    """Return the traced path of each leg."""
    keys: dict[tuple[int, bytes, bytes, bytes], int] = {}
    for row in range(len(traced.target)):
        key = (
            int(traced.target[row]),
            traced.kind[row].tobytes(),
            traced.part[row].tobytes(),
            traced.face[row].tobytes(),
        )
        keys.setdefault(key, row)
    found = zip(legs.target, legs.kind, legs.part, legs.face, strict=True)
    return np.array([keys[(int(a), b.tobytes(), c.tobytes(), d.tobytes())] for a, b, c, d in found], dtype=np.int64)


def path_powers(measurement: ScenePowers, table: MaterialTable) -> Callable[[Trials], Complex]:
    """Return the model of path powers: from trial materials to the field of each measured path.

    Raises
    ------
    ParameterRangeError
        If no path is as long as a measured one.
    """
    fixed = FixedPaths.trace(measurement, table, measurement.frequency)
    column = "VH".index(measurement.polarization)
    total = fixed.columns({})["total"]
    near = np.abs(np.asarray(measurement.lengths)[:, None] - total) <= measurement.resolution
    if not near.any(axis=1).all():
        missing = float(np.asarray(measurement.lengths)[~near.any(axis=1)][0])
        raise ParameterRangeError(
            f"{measurement.name}.lengths",
            f"{missing:g} m",
            f"lengths of paths: {', '.join(f'{x:.3f}' for x in np.unique(total)[:20])} m",
            "correct it, raise max_depth, or widen resolution",
        )
    weights = near * np.exp(-2j * np.pi * measurement.frequency / SPEED_OF_LIGHT * total)
    return lambda trials: weights @ fixed.columns(trials)["a"][:, column, column]


def map_model(measurement: RadarMap, table: MaterialTable) -> Callable[[Trials], Complex]:
    """Return the model of a range-Doppler map: from trial materials to the conjugate of its cells.

    A map is linear in the paths' amplitudes, so each path's map of one amplitude is made once.
    """
    radar = measurement.radar
    fixed = FixedPaths.trace(measurement, table, material_frequency(radar), radar.wavelength)
    columns: dict[str, Any] = dict(fixed.columns({}))
    total = columns.pop("total")
    paths = RadarPaths(**columns, world_from_tx=pose_of(measurement), world_from_rx=pose_of(measurement))
    kept = np.flatnonzero((total < 2.0 * radar.max_range) | (radar.waveform.sweep.video == 0.0))
    faint = replace(paths, a=np.full_like(paths.a, FAINT))
    basis = np.stack([np.conj(_cells(faint.select(np.array([row])), measurement)) for row in kept], axis=1) / FAINT
    column = "VH".index(radar.array.polarization)
    return lambda trials: np.einsum("vp,p->v", basis, fixed.columns(trials)["a"][kept, column, column])  # no threads


def _cells(paths: RadarPaths, measurement: RadarMap) -> Complex:
    """Return the chosen cells of the map of some paths, shape (num_values,)."""
    cube = virtual_cube(synthesize(paths, measurement.radar, method="direct"), measurement.radar)
    data = range_doppler(cube, measurement.radar, window="rect").data
    return data[..., measurement.first_bin : measurement.stop_bin].astype(np.complex128).ravel()


def map_data(measurement: RadarMap) -> Complex:
    """Return the measured cells, shape (num_values,), conjugate as :func:`map_model` has them.

    Raises
    ------
    SceneError
        If the file cannot be read.
    ParameterRangeError
        If its shape is not the radar's, or a value is not finite.
    """
    radar = measurement.radar
    shape = (radar.num_virtual, radar.num_doppler_bins, radar.num_range_bins)
    if measurement.file is None:
        bins = radar.num_range_bins
        stop = bins if measurement.stop_bin is None else min(measurement.stop_bin, bins)
        shape = (*shape[:2], max(stop - measurement.first_bin, 0))
        data = measurement.data
        if data.size != np.prod(shape):
            raise ParameterRangeError(
                f"{measurement.name}.values", f"{data.size} values", f"{np.prod(shape)} of shape {shape}"
            )
        return np.conj(data)
    try:
        data = read_npy(measurement.file, 2000 * MEGABYTE)
    except OSError as error:
        raise SceneError(
            f"cannot be read as .npy ({error})", measurement.file, "save the map with numpy.save"
        ) from error
    if data.shape != shape:
        raise ParameterRangeError(
            f"{measurement.name}.file", f"shape {data.shape}", f"shape {shape} = (virtual, chirps, range)"
        )
    cells = data[..., measurement.first_bin : measurement.stop_bin].ravel()
    if not np.isfinite(cells).all():
        raise ParameterRangeError(
            f"{measurement.name}.file",
            "NaN or infinity",
            "finite values",
            "cut the cells out by first_bin and stop_bin",
        )
    return np.conj(cells.astype(np.complex128))
