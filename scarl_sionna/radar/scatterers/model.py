"""Scattering centres: points on a body whose complex amplitudes depend on the aspect, compiled once for all frames.

What the model is right for, its measured error and where it breaks stands in docs/scatterers.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, OutputError, ParameterRangeError, SceneError
from scarl_sionna.core.prompt.describe import Described
from scarl_sionna.core.settings.scatterers import TR38901
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.core.untrusted.numpy_file import read_npz

from .stencil import shares_of
from .table import AspectTable, direction_of
from .tr38901 import tr38901_fields

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_MOST_BYTES = 2000 * MEGABYTE
FORMAT_VERSION = 2
"""Version of the saved file; 1 held the amplitudes as one array."""
APERTURE_PHASE = 1.0 / 3.0
"""Bend of the phase over what a centre stands for [rad, rms] from which a warning is given: by definition of its bar,
0.5 dB."""
_NARROWEST = 0.02
"""Circles of azimuth that are a smaller part of the equator, 1.1 deg from the poles, bend the waves as this one."""
_ROUNDING = 1e-9
"""Aspects this far outside of the table [rad] are still inside."""


@dataclass(frozen=True, eq=False, repr=False)
class ScattererModel(
    Described,
    units={
        "centers": "m",
        "azimuth": "rad",
        "elevation": "rad",
        "frequency": "Hz",
        "cell": "m",
        "nearest_distance": "m",
        "elevation_reach": "rad",
        "aperture_distance": "m",
    },
):
    r"""Scattering centres of one rigid body.

    Attributes
    ----------
    centers : ndarray of float64, shape (num_centers, 3)
        [m, body frame].
    azimuth : ndarray of float64, shape (num_azimuths,)
        Rising aspects [rad]: direction from the body to the radar, from +x in the xy plane of the body.
    elevation : ndarray of float64, shape (num_elevations,)
        Rising aspects above the body's xy plane [rad]. With one only, the amplitudes are used up to `elevation_reach`
        from it.
    amplitude : AspectTable, of shape (num_elevations, num_azimuths, num_centers, 2, 2)
        Given as such or as an array. Scattering matrix of each centre [m], receive polarisation (theta_hat, phi_hat of
        the aspect) first; the phase is that at the centre. A centre's RCS is 4 pi abs(amplitude)^2.
    frequency : float
        [Hz].
    cell : float
        Side of the cube that a centre stands for [m].
    nearest_distance : float
        Below this distance a centre's cube is not in its own far field (compiled: 2 cell^2 / wavelength) [m].
    elevation_reach : float
        How far outside of `elevation` the table is still used without a warning [rad].
    error : mapping
        Against the mesh's own physical optics between compiled aspects: ``median_db`` and ``p95_db`` (absolute value,
        per range cell within 20 dB of the strongest), ``num_cells``, ``num_aspects``; empty where nothing was measured.
    provenance : mapping
        Where the model comes from: hash of the mesh, settings, source.
    aperture_distance : ndarray of float64, shape (num_centers,)
        From here on what a corner's mirrors span, and its centre stands for, costs the centre less than 0.5 dB by the
        bend of the waves [m]; 0 of single reflections, and where it is not given (files of before). Nearer the centre
        is too strong: see :meth:`nearest`.

    Raises
    ------
    ParameterRangeError
        If the amplitudes have another shape than the grids, or angles do not rise.

    Notes
    -----
    .. math:: S(u) = \sum_n A_n(u)\, e^{2 j k\, u \cdot c_n}

    with u from the body to the radar. Between aspects the complex amplitudes are interpolated by polynomials along
    azimuth and elevation: through six aspects so far apart that the phase at the edge of a cell turns by 1.1 rad from
    one to the next, or neighbours where the table is coarser; through four, two or one where it has no more. Their
    phase is that at the centre, so it changes slowly with the aspect: by at most k times the cell's width times the
    angle.
    """

    centers: Array
    azimuth: Array
    elevation: Array
    amplitude: AspectTable
    frequency: float
    cell: float
    nearest_distance: float
    elevation_reach: float = 0.0
    error: Mapping[str, float] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    aperture_distance: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not isinstance(self.amplitude, AspectTable):
            object.__setattr__(self, "amplitude", AspectTable.dense(self.amplitude))
        shape = (len(self.elevation), len(self.azimuth), len(self.centers), 2, 2)
        if self.amplitude.shape != shape:
            raise ParameterRangeError("amplitude", f"shape {self.amplitude.shape}", f"shape {shape}")
        if not len(self.aperture_distance):
            object.__setattr__(self, "aperture_distance", np.zeros(len(self.centers)))
        if self.aperture_distance.shape != (len(self.centers),):
            raise ParameterRangeError(
                "aperture_distance", f"shape {self.aperture_distance.shape}", f"shape {(len(self.centers),)}"
            )
        for name in ("azimuth", "elevation"):
            grid = getattr(self, name)
            if not len(grid) or np.any(np.diff(grid) <= 0.0) or not np.isfinite(grid).all():
                raise ParameterRangeError(name, grid, "one or more rising angles [rad]")

    @property
    def num_centers(self) -> int:
        """Number of scattering centres."""
        return len(self.centers)

    @property
    def is_full_turn(self) -> bool:
        """Whether the azimuths go round the body, so that the last is beside the first."""
        if len(self.azimuth) < 2:
            return False
        gap = self.azimuth[0] + 2.0 * np.pi - self.azimuth[-1]
        return bool(gap <= 1.5 * np.diff(self.azimuth).max())

    def inside(self, direction: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return whether directions from the body to the radar are in the table.

        Unit vectors, shape (n, 3), body frame.
        """
        azimuth, elevation = _angles(direction)
        low, high = self.elevation[0] - self.elevation_reach, self.elevation[-1] + self.elevation_reach
        result = (elevation >= low - _ROUNDING) & (elevation <= high + _ROUNDING)
        if not self.is_full_turn:
            span = self.azimuth[-1] - self.azimuth[0]
            result &= (azimuth - self.azimuth[0] + _ROUNDING) % (2.0 * np.pi) <= span + 2.0 * _ROUNDING
        return result

    def matrices(self, direction: npt.ArrayLike, distance: npt.ArrayLike | None = None) -> Complex:
        r"""Return the scattering matrix of every centre, each seen from its own direction.

        Parameters
        ----------
        direction : array_like of float, shape (num_centers, 3) or (3,)
            Unit vectors from the centres to the radar [body frame]. Outside of the table its nearest aspect is used.
        distance : array_like of float, shape (num_centers,) or number, optional
            Of the radar from the centres, > 0 [m]; infinite if None. With a receiver elsewhere the harmonic mean of
            both ways, seen in the direction between them.

        Returns
        -------
        ndarray of complex128, shape (num_centers, 2, 2)
            [m], in theta_hat and phi_hat of each direction.

        Notes
        -----
        Over a centre's cell the waves of a radar at a distance R bend: what is r off the ray through the centre is
        farther by :math:`r^2 / (2 R)`. As r turns the phase of the amplitude with the aspect, that is an operator on
        the table, with the derivatives along both angles,

        .. math:: A_R(u) = \exp(\tfrac{j}{4 k R} \nabla^2) A(u), \quad
                  \nabla^2 = \partial_\epsilon^2 - \tan\epsilon\, \partial_\epsilon
                  + \cos^{-2}\epsilon\, \partial_\alpha^2

        to the second order (:func:`.shares_of`), along angles of which the table has four or more: with one elevation,
        as :func:`scarl_sionna.compile_scatterers` has by default, waves bend over the azimuth alone. A curved surface
        needs it far beyond `nearest_distance`, since its echo is made on less than a cell. Corners, which are a point
        at all aspects, are not helped.

        *Error*: of a point 5 cm beside a centre at 14 m (77 GHz, cell 0.15 m, table of 0.25 deg), where waves that are
        plane are off by 0.29 of the field, 0.005 to 80 deg of elevation and 0.007 at 85, where compiled tables end.
        *Not modelled*: the poles, where circles of azimuth are narrow themselves: 0.014 at 88 deg, 0.07 at 89 in a
        table all round, in one of 24 deg of azimuth 0.07 and 0.23.
        """
        toward = np.broadcast_to(np.asarray(direction, dtype=np.float64), self.centers.shape)
        azimuth, elevation = _angles(toward)
        result = np.zeros((self.num_centers, 2, 2), dtype=np.complex128)
        wavenumber = 2.0 * np.pi * self.frequency / SPEED_OF_LIGHT
        away = np.asarray(np.inf if distance is None else distance, dtype=np.float64)
        bend = np.broadcast_to(1.0 / (4.0 * wavenumber * away), azimuth.shape)
        turn, held = np.full(azimuth.shape, wavenumber * self.cell), np.clip(elevation, *self.elevation[[0, -1]])
        around = np.maximum(np.cos(held), _NARROWEST)
        rows, share_up = shares_of(self.elevation, held, bend, turn, -np.sin(held) / around)
        columns, share_along = self._columns(azimuth, bend / around**2, turn * around)
        row, column = _closest(self.elevation, rows, elevation), _closest(self.azimuth, columns, azimuth)
        centre = np.flatnonzero(self.amplitude.present(row, column, np.arange(self.num_centers)))
        share = (share_up[centre, :, None] * share_along[centre, None, :]).reshape(len(centre), -1)
        up, along, of_centre = np.broadcast_arrays(
            rows[centre, :, None], columns[centre, None, :], centre[:, None, None]
        )
        values = self.amplitude.at(up.reshape(-1), along.reshape(-1), of_centre.reshape(-1))
        result[centre] = (share[:, None, :] @ values.reshape(*share.shape, 4))[:, 0].reshape(-1, 2, 2)
        return result

    def nearest(self, matrices: Complex) -> float:
        r"""Return from where on centres that echo so are right [m].

        That is `nearest_distance`, or, where corners hold much of the power, the distance from which the bend of the
        waves over their mirrors costs less than 0.5 dB of all.

        Parameters
        ----------
        matrices : ndarray of complex128, shape (num_centers, 2, 2)
            As :meth:`matrices` gives them.

        Notes
        -----
        A centre whose waves pass at a distance h beside the ray through it has paths longer by h^2 / R. To the second
        order it loses the share :math:`(k \sigma / R)^2` of its power, sigma being the standard deviation of h^2; the
        distances of the centres are summed by power.
        """
        power = np.sum(np.abs(matrices) ** 2, axis=(1, 2))
        total = float(power.sum())
        of_apertures = float(np.sqrt(power @ self.aperture_distance**2 / total)) if total > 0.0 else 0.0
        return max(self.nearest_distance, of_apertures)

    def _columns(self, azimuth: Array, bend: Array, turn: Array) -> tuple[npt.NDArray[np.int64], Complex]:
        first = self.azimuth[0]
        turned = first + (azimuth - first + _ROUNDING) % (2.0 * np.pi) - _ROUNDING
        if self.is_full_turn:
            turns = 2.0 * np.pi * np.arange(-1, 2)
            column, share = shares_of((self.azimuth + turns[:, None]).reshape(-1), turned, bend, turn)
            return column % len(self.azimuth), share
        gap = 2.0 * np.pi - (self.azimuth[-1] - first)  # outside: the nearer end
        turned = np.where(turned > self.azimuth[-1] + gap / 2.0, first, turned)
        return shares_of(self.azimuth, turned, bend, turn)

    def scattering_matrix(
        self, theta: npt.ArrayLike, phi: npt.ArrayLike, frequency: npt.ArrayLike | None = None
    ) -> Complex:
        """Return the far-field scattering matrix, to compare with :func:`scarl_sionna.radar.rcs.scattering_matrix`.

        Parameters
        ----------
        theta, phi : array_like of float, of shapes that broadcast
            Direction from the body to the radar, from +z and from +x [rad].
        frequency : array_like of float, of a shape that broadcasts, optional
            [Hz]; the model's if left out. The amplitudes are those at the model's frequency.

        Returns
        -------
        ndarray of complex128, shape (..., 2, 2)
            [m].

        Raises
        ------
        ParameterRangeError
            If an aspect is outside of the compiled table.
        """
        f = np.asarray(self.frequency if frequency is None else frequency, dtype=np.float64)
        wide = np.broadcast_arrays(np.asarray(theta, np.float64), np.asarray(phi, np.float64), f)
        columns = [a.reshape(-1) for a in wide]
        result = np.zeros((len(columns[0]), 2, 2), dtype=np.complex128)
        for aspect in np.unique(np.column_stack(columns[:2]), axis=0):
            direction = direction_of(aspect[1], np.pi / 2.0 - aspect[0])
            if not self.inside(direction)[0]:
                raise ParameterRangeError(
                    "aspect",
                    f"theta {np.degrees(aspect[0]):.4g}, phi {np.degrees(aspect[1]):.4g} deg",
                    self._range_text(),
                    "compile the model over these aspects",
                )
            rows = np.flatnonzero((columns[0] == aspect[0]) & (columns[1] == aspect[1]))
            wavenumber = 2.0 * np.pi * columns[2][rows] / SPEED_OF_LIGHT
            phase = np.exp(2j * wavenumber[:, None] * (self.centers @ direction)[None])
            result[rows] = np.einsum("fn,nij->fij", phase, self.matrices(direction))
        return result.reshape((*wide[0].shape, 2, 2))

    def _range_text(self) -> str:
        ends = np.degrees([self.azimuth[0], self.azimuth[-1], self.elevation[0], self.elevation[-1]])
        turn = "all round" if self.is_full_turn else f"{ends[0]:.4g} to {ends[1]:.4g} deg"
        return f"azimuth {turn}, elevation {ends[2]:.4g} to {ends[3]:.4g} deg"

    def save(self, path: str | Path) -> None:
        """Write the model to an ``.npz`` file.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        columns: dict[str, Any] = {
            name: json.dumps(dict(getattr(self, name)), sort_keys=True) for name in ("error", "provenance")
        }
        columns.update(self.amplitude.arrays())
        numbers = (self.frequency, self.cell, self.nearest_distance, self.elevation_reach)
        try:
            with Path(path).open("wb") as file:
                np.savez_compressed(
                    file,
                    version=FORMAT_VERSION,
                    centers=self.centers,
                    azimuth=self.azimuth,
                    elevation=self.elevation,
                    numbers=np.array(numbers),
                    aperture_distance=self.aperture_distance,
                    **columns,
                )
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error})") from error

    @classmethod
    def load(cls, path: str | Path) -> ScattererModel:
        """Read a model that :meth:`save` wrote.

        Raises
        ------
        SceneError
            If the file is missing, no model, or of a newer version.
        """
        try:
            data = read_npz(path, _MOST_BYTES)
            version = int(data["version"])
            if version > FORMAT_VERSION:
                raise SceneError(f"is of version {version}, this program reads up to {FORMAT_VERSION}", path)
            frequency, cell, nearest, reach = (float(value) for value in data["numbers"])
            error_of, provenance = (dict(parse_json(str(data[name]))) for name in ("error", "provenance"))
            centers, azimuth, elevation = (data[name] for name in ("centers", "azimuth", "elevation"))
            table = AspectTable.dense(data["amplitude"]) if version == 1 else AspectTable.from_arrays(data)
            made = cls(centers, azimuth, elevation, table, frequency, cell, nearest, reach, error_of, provenance)
            return replace(made, aperture_distance=data["aperture_distance"]) if "aperture_distance" in data else made
        except (OSError, KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
            raise SceneError(f"is no scatterer model ({error})", path, "write one with ScattererModel.save") from error

    @classmethod
    def tr38901(cls, object_type: str, frequency: float = 77e9, model_type: int = 2) -> ScattererModel:
        """Return a sensing target of 3GPP TR 38.901, evaluated by Sionna RT; see :func:`.tr38901.tr38901_fields`."""
        return cls(**tr38901_fields(object_type, frequency, model_type))


def _angles(direction: npt.ArrayLike) -> tuple[Array, Array]:
    vectors = np.asarray(direction, dtype=np.float64).reshape(-1, 3)
    return np.arctan2(vectors[:, 1], vectors[:, 0]), np.arctan2(vectors[:, 2], np.hypot(vectors[:, 0], vectors[:, 1]))


def _closest(grid: Array, number: npt.NDArray[np.int64], angle: Array) -> npt.NDArray[np.int64]:
    """Return which of the numbers (n, k) on a grid is nearest to angles (n,) [rad], any number of turns away."""
    off = np.abs((grid[number] - angle[:, None] + np.pi) % (2.0 * np.pi) - np.pi)
    return np.asarray(np.take_along_axis(number, off.argmin(axis=1)[:, None], 1)[:, 0])


def loaded_models(named: Mapping[str, object]) -> dict[str, ScattererModel]:
    """Return the models of objects.

    Those in memory come back as they are, those named by a file or as ``"tr38901:<target>"`` loaded.

    Parameters
    ----------
    named : mapping of name to ScattererModel, path or text
        The `models` of :class:`scarl_sionna.core.settings.scatterers.ScattererSettings`.

    Raises
    ------
    InputTypeError
        If a value is none of them.
    UnknownNameError
        If TR 38.901 has no such target.
    """
    return {name: _loaded(name, model) for name, model in named.items()}


def _loaded(name: str, model: object) -> ScattererModel:
    if isinstance(model, ScattererModel):
        return model
    if isinstance(model, str) and model.startswith(TR38901):
        return ScattererModel.tr38901(model.removeprefix(TR38901))
    if isinstance(model, (str, Path)):
        return ScattererModel.load(model)
    raise InputTypeError(f"model of '{name}'", model, f"a ScattererModel, a file of one, or '{TR38901}<target>'")
