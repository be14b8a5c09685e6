"""Derivatives of Sionna RT's own path gains by Dr.Jit's automatic differentiation through ``PathSolver``.

The solver runs with evaluated loops, materials carry a gradient in forward mode, and geometry does not depend on them.
What comes out is float32 and of Sionna's model, in which every material is a slab: a check of, and an alternative to,
the derivatives in float64 of :mod:`scarl_sionna.calibration`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import EngineError, UnknownNameError
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine import variant
from scarl_sionna.engine.types import DeviceArray, MitsubaObject
from scarl_sionna.engine.world import WorldState

from .tracing import polarized_points, solver_options

Complex = npt.NDArray[np.complex128]

FIELDS = ("relative_permittivity", "conductivity", "thickness", "scattering_coefficient")
"""What of a radio material may carry a gradient: its values at the carrier frequency."""


@dataclass(frozen=True, eq=False)
class PathSlopes:
    """Gains of paths and their derivatives, one row a path in the order of the target and then of the length.

    Attributes
    ----------
    target : ndarray of int64, shape (num_paths,)
    length : ndarray of float64, shape (num_paths,)
        [m], from the engine's delay.
    a : ndarray of complex128, shape (num_paths, 2, 2)
        The engine's float32 transfer, spherical basis of the world frame at both ends.
    slopes : ndarray of complex128, shape (num_paths, 2, 2, num_parameters)
        Its derivatives, a unit of the parameter.
    """

    target: npt.NDArray[np.int64]
    length: npt.NDArray[np.float64]
    a: Complex
    slopes: Complex


@dataclass(frozen=True, eq=False)
class TrialParameters:
    """Fields of radio materials, and the values that they take.

    Attributes
    ----------
    names : sequence of (material, field)
        Radio materials of the scene and one of `FIELDS` each.
    values : array_like of float, shape (num_parameters,), optional
        Instead of the materials' own.
    """

    names: Sequence[tuple[str, str]]
    values: npt.ArrayLike | None = None


def path_slopes(
    state: WorldState,
    source: npt.ArrayLike,
    targets: npt.ArrayLike,
    parameters: TrialParameters,
    settings: SionnaSettings | None = None,
    with_slopes: bool = True,
) -> PathSlopes:
    """Return path gains and their derivatives to material parameters.

    Parameters
    ----------
    state : WorldState
    source : array_like of float, shape (3,)
        [m, world].
    targets : array_like of float, shape (num_targets, 3)
        [m, world].
    parameters : TrialParameters
        What the derivatives are to, and where they are taken.
    settings : SionnaSettings, optional
        As of :func:`.tracing.trace_paths`; the defaults if left out.
    with_slopes : bool
        False solves once, for the gains alone; `slopes` is then empty.

    Raises
    ------
    UnknownNameError
        If the scene has no such material, or the field cannot carry a gradient.
    EngineError
        If the solver fails.

    References
    ----------
    .. [1] J. Hoydis et al., "Learning Radio Environments by Differentiable Ray Tracing", IEEE Trans. Mach. Learn.
       Commun. Netw. 2, 2024.
    """
    names = parameters.names
    chosen = [_bsdfs(state, material, field) for material, field in names]
    points = np.asarray(targets, dtype=np.float64).reshape(-1, 3)
    with variant.radio() as mi:
        import drjit as dr
        import sionna.rt as rt

        scene = state.radio_scene()
        objects = [[scene.radio_materials[name] for name in bsdfs] for bsdfs in chosen]
        before = [[getattr(one, field) for one in group] for group, (_, field) in zip(objects, names, strict=True)]
        solver = rt.PathSolver(deterministic=True)
        solver.loop_mode = "evaluated"  # symbolic loops carry no derivatives
        options = solver_options(settings or SionnaSettings())
        given = (
            [float(group[0][0]) for group in before]
            if parameters.values is None
            else np.asarray(parameters.values, dtype=np.float64).tolist()
        )
        slopes: list[Complex] = []
        try:
            with polarized_points(mi, scene, np.asarray(source, dtype=np.float64), points):
                for active in range(len(names)) if with_slopes and names else (None,):
                    leaves = [mi.Float(value) for value in given]
                    if active is not None:
                        dr.enable_grad(leaves[active])
                    for leaf, group, (_, field) in zip(leaves, objects, names, strict=True):
                        for one in group:
                            setattr(one, field, leaf)
                    found = solver(scene, **options)
                    if active is not None:
                        slopes.append(_forward(dr, leaves[active], found.a))
        except (RuntimeError, MemoryError) as error:
            raise EngineError(
                f"Sionna RT's path solver failed ({error}); use fewer num_samples or less max_depth"
            ) from error
        finally:
            for group, (_, field), old in zip(objects, names, before, strict=True):
                for one, value in zip(group, old, strict=True):
                    setattr(one, field, value)
        return _rows(found, slopes)


def _bsdfs(state: WorldState, material: str, field: str) -> list[str]:
    """Return the ids of a radio material's BSDFs in the radio twin."""
    if field not in FIELDS:
        raise UnknownNameError("material field with a gradient", field, FIELDS)
    entries = state.world.document.materials
    found = [f"radio-{bsdf}" for bsdf, entry in entries.items() if entry.radio == material]
    if not found:
        raise UnknownNameError(
            "radio material of the scene", material, sorted({entry.radio for entry in entries.values()})
        )
    return found


def _forward(dr: ModuleType, seed: DeviceArray, gains: tuple[DeviceArray, DeviceArray]) -> Complex:
    """Return the derivative of both parts to a seed."""
    dr.set_grad(seed, 1.0)
    dr.forward_to(*gains)
    return np.array(dr.grad(gains[0])).astype(np.complex128) + 1j * np.array(dr.grad(gains[1]))


def _rows(found: MitsubaObject, slopes: list[Complex]) -> PathSlopes:
    """Return one row a path."""
    valid = np.array(found.valid, dtype=bool)
    rx, tx, path = np.nonzero(valid)
    gains = np.array(found.a[0]).astype(np.complex128) + 1j * np.array(found.a[1])
    length = SPEED_OF_LIGHT * np.array(found.tau).astype(np.float64)[rx, tx, path]
    order = np.lexsort((length, rx))
    pick = (rx[order], slice(None), tx[order], slice(None), path[order])
    stacked = [slope[pick].reshape(-1, 2, 2) for slope in slopes]
    return PathSlopes(
        rx[order].astype(np.int64),
        length[order],
        gains[pick].reshape(-1, 2, 2),
        np.stack(stacked, axis=-1) if stacked else np.zeros((len(order), 2, 2, 0), np.complex128),
    )
