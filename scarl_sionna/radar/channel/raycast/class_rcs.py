"""Reflectivity of semantic classes: SCaRL's "target class to determine the RCS"."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SKY, semantic_id
from scarl_sionna.core.settings.raycast import RaycastSettings
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.untrusted.toml_text import read_toml
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.rough import diffuse_albedo
from scarl_sionna.signal.antenna import pair_polarizations

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World
    from scarl_sionna.scene.materials.table import RadioMaterial

BUILTIN_FILE = Path(__file__).with_name("rcs_by_class.toml")

GROUND = ("Roads", "SideWalks", "Terrain", "RoadLine", "Ground")
"""Classes whose echo is that of a rough surface of their material."""
ClassRcs = Mapping[str, float] | str | Path


_KEYS = {"gamma", "source", "crossed", "crossed_source"}
"""Of a class in a file."""


def _entries(path: str | Path, key: str = "gamma") -> dict[str, Any]:
    """Return gamma by class name as a file states it, or another key of the classes that have it."""
    values: dict[str, Any] = {}
    for name, entry in read_toml(path).items():
        semantic_id(name)
        if not isinstance(entry, dict) or set(entry) - _KEYS or "gamma" not in entry:
            raise ParameterRangeError(f"[{name}] of {Path(path).name}", entry, "a table with gamma and source")
        values |= {name: entry[key]} if key in entry else {}
    return values


@cache
def _builtin(key: str = "gamma") -> dict[str, Any]:
    return _entries(BUILTIN_FILE, key)


def is_smoother_than_class(material: RadioMaterial, semantic: int, frequency: float) -> bool:
    """Return whether a material scatters less along its normal than its class has, by the law of rough surfaces.

    Parameters
    ----------
    material : RadioMaterial
    semantic : int
        Of the class.
    frequency : float
        [Hz].
    """
    if material.volume_albedo or not material.covers(frequency):
        return False
    by_class = class_reflectivity()[semantic] * float(power_reflectance(material, frequency, 1.0)[0])
    return 4.0 * diffuse_albedo(material, frequency) < by_class


def rough_ground(
    world: World, frequency: float, knobs: RaycastSettings, others: Iterable[int] = ()
) -> npt.NDArray[np.float64]:
    """Return what each part of the ground sends back by the law of rough surfaces, NaN for parts that go by class.

    Parameters
    ----------
    world : World
    frequency : float
        [Hz].
    knobs : RaycastSettings
        Classes that its `class_rcs` names go by class.
    others : iterable of int
        Further parts that go by the law, whatever their class: nothing comes from them if they are smooth.

    Returns
    -------
    ndarray of float64, shape (num_parts, 3)
        Co- and cross-polar, times the cosine of incidence the RCS for each m2 of projected area, see
        :func:`~scarl_sionna.scene.materials.rough.sigma0`. Third: 0, or the albedo of the scatterers of a deep layer,
        whose :func:`~scarl_sionna.scene.materials.rough.layer_albedo` then is a factor.
    """
    result = np.full((len(world.parts.name), 3), np.nan)
    named: Iterable[str] = ()
    if knobs.class_rcs is not None:
        named = knobs.class_rcs if isinstance(knobs.class_rcs, Mapping) else _entries(knobs.class_rcs)
    ground = [semantic_id(name) for name in GROUND if name not in named] if knobs.rough_ground else []
    by_class = [semantic_id(name) for name in named]
    also = {part for part in others if world.parts.semantic[part] not in by_class}
    for part in {*np.flatnonzero(np.isin(world.parts.semantic, ground)).tolist(), *also}:
        material = world.materials[world.parts.material[part]]
        if not material.covers(frequency):
            continue
        albedo = 1.0 if material.volume_albedo else diffuse_albedo(material, frequency)
        if albedo > 0.0 or part in also:
            crossed = material.xpd_coefficient
            result[part] = 4.0 * albedo * (1.0 - crossed), 4.0 * albedo * crossed, material.volume_albedo or 0.0
    return result


def class_reflectivity(changes: ClassRcs | None = None) -> npt.NDArray[np.float64]:
    """Return the reflectivity gamma of every semantic class.

    Parameters
    ----------
    changes : mapping of class name to gamma, or path of a TOML file, optional
        What replaces the built-in table, class by class.

    Returns
    -------
    ndarray of float64, shape (num_classes,)
        RCS for each m2 of projected area before the material's reflectance [1]; the index is the semantic id. Sky is 0.

    Raises
    ------
    UnknownNameError
        If a class does not exist.
    ParameterRangeError
        If a value is negative or not finite.
    """
    own = {} if changes is None else dict(changes) if isinstance(changes, Mapping) else _entries(changes)
    gamma = np.zeros(len(SEMANTIC_CLASSES))
    for name, value in {**_builtin(), **own}.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < np.inf:
            raise ParameterRangeError(f"gamma of class '{name}'", value, "a finite number >= 0")
        gamma[semantic_id(name)] = value
    if SKY not in (semantic_id(name) for name in own):
        gamma[SKY] = 0.0
    return gamma


def class_crossed(changes: ClassRcs | None = None) -> npt.NDArray[np.float64]:
    """Return the cross-polar over the co-polar power of every semantic class.

    Parameters
    ----------
    changes : mapping of class name to gamma, or path of a TOML file, optional
        As of :func:`class_reflectivity`; a file's `crossed` replaces the built-in ratio.

    Returns
    -------
    ndarray of float64, shape (num_classes,)
        Of mean powers, [1]; the index is the semantic id. Sky is 0.

    Raises
    ------
    UnknownNameError
        If a class does not exist.
    ParameterRangeError
        If a value is not within 0 and 1.
    """
    own = {} if changes is None or isinstance(changes, Mapping) else _entries(changes, "crossed")
    ratio = np.zeros(len(SEMANTIC_CLASSES))
    for name, value in {**_builtin("crossed"), **own}.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
            raise ParameterRangeError(f"crossed of class '{name}'", value, "a number from 0 to 1")
        ratio[semantic_id(name)] = value
    return ratio


def heard_share(array: AntennaArray) -> npt.NDArray[np.float64]:
    r"""Return the mean power that the best pair of antennas hears of each class, over the co-polar power.

    Parameters
    ----------
    array : AntennaArray

    Returns
    -------
    ndarray of float64, shape (num_classes,)
        1 where antennas are alike, :func:`class_crossed` for V that sends and H that hears.

    Notes
    -----
    For fields t sent and h heard, by the second moments of :func:`.depolarization.rough_matrix` with x^2 = r v^2,

    .. math:: (1 - r) |h \cdot t|^2 + r (|h_V t_V - h_H t_H|^2 + |h_V t_H + h_H t_V|^2)
    """
    ratio = class_crossed()
    if array.is_of_one_polarization:
        return np.ones_like(ratio)
    shares = []
    for _, (sent_v, sent_h), (heard_v, heard_h) in pair_polarizations(array):
        alike = abs(heard_v * sent_v + heard_h * sent_h) ** 2
        apart = abs(heard_v * sent_v - heard_h * sent_h) ** 2 + abs(heard_v * sent_h + heard_h * sent_v) ** 2
        shares.append((1.0 - ratio) * alike + ratio * apart)
    return np.asarray(np.max(shares, axis=0))
