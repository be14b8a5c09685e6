"""Paths whose transfer changes over a wide band: solved at several frequencies, put together by path."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.warn import WarningLevels
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths, band_nodes
from scarl_sionna.radar.tuned import band_of, material_frequency, tuned_to
from scarl_sionna.scene.materials.fresnel import reflection

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Complex = npt.NDArray[np.complex128]

WIDE = 1e9
"""Narrower bands are not asked whether layers resonate in them [Hz]."""
NUM_ASKED = 17
"""Frequencies in the band at which it is asked."""
SAME_PATH = 1e-4
"""Paths of two frequencies are one if their ends and inner lengths are that near [m]."""
NOTHING = 1e-3
"""A transfer in the middle of the band below that part of its largest is a zero: the largest stands for it."""


def solved_over_band(
    solve: Callable[[RadarSpec], RadarPaths], radar: RadarSpec, count: int, level: float
) -> RadarPaths:
    r"""Return the paths of a radar with their transfer over its band.

    Parameters
    ----------
    solve : callable
        A radar tuned to one frequency -> its paths.
    radar : RadarSpec
    count : int
        Odd number of frequencies, Chebyshev's nodes in the band.
    level : float
        Part of the amplitude by which the transfer may be off before there is a warning.

    Returns
    -------
    RadarPaths
        Those of the middle of the band, with `over_band`. In `diagnostics` the error of the interpolation
        (``band_error``) and the part of the power whose paths are not the same at all frequencies
        (``band_unmatched``); these keep the transfer of the middle.

    Warns
    -----
    ScarlWarning
        If one of both is above the level.

    Notes
    -----
    A path's transfer at the frequency f is :math:`a \sum_k g_k l_k(f)` with the polynomials :math:`l_k` that are 1 at
    one node. The error is estimated from the last two coefficients of the same polynomial in Chebyshev's:
    :math:`|c_{K-1}|^2 / |c_{K-2}|`, the next one where they fall geometrically. *Not modelled*: polarisation that turns
    over the band (one factor for all four elements, of the strongest).

    References
    ----------
    .. [1] L. N. Trefethen, *Approximation Theory and Approximation Practice*, SIAM, 2013, chapter 8.
    """
    band = band_of(radar)
    solved = [solve(tuned_to(radar, float(frequency))) for frequency in band_nodes(band, count)]
    middle = solved[count // 2]
    factor, a = np.ones((middle.num_paths, count), dtype=np.complex128), middle.a.copy()
    rows = [_matches(middle, other) for other in solved]
    same = np.all([row >= 0 for row in rows], axis=0)
    if same.any():
        transfer = np.stack([other.a[row[same]] for other, row in zip(solved, rows, strict=True)], axis=1)
        factor[same], a[same] = _factors(transfer, a[same])
    power = np.sum(np.abs(a) ** 2, axis=(1, 2))
    total = max(float(power.sum()), 1e-300)
    error = float(np.sqrt(power @ _next(factor) ** 2 / total))
    unmatched = float(power[~same].sum() / total)
    if max(error, unmatched) > level:
        warnings.warn(
            f"over the band of {(band[1] - band[0]) / 1e9:.3g} GHz the transfer at {count} frequencies is off by about "
            f"{error:.2g} of the amplitude, and {100 * unmatched:.2g} % of the power is of paths that are not the same "
            "at all of them and keep that of the middle; more num_band_frequencies help the first",
            ScarlWarning,
            stacklevel=3,
        )
    report = {"band_error": error, "band_unmatched": unmatched}
    return replace(middle, a=a, over_band=factor, band=band, diagnostics={**middle.diagnostics, **report})


def _matches(paths: RadarPaths, other: RadarPaths) -> npt.NDArray[np.int64]:
    """Return which path of the others each path is, -1 where there is none.

    Paths at one place are told apart by their order, if there are as many of them.
    """
    both = [np.column_stack([item.tx_point, item.rx_point, item.inner_length, item.length]) for item in (paths, other)]
    if both[0].shape == both[1].shape and np.abs(both[0] - both[1]).max(initial=0.0) < SAME_PATH:
        return np.arange(len(both[0]))
    place = np.rint(np.concatenate(both) / SAME_PATH).astype(np.int64)
    _, key = np.unique(place, axis=0, return_inverse=True)
    mine, theirs = np.split(key.reshape(-1), [len(both[0])])
    count = [np.bincount(item, minlength=key.max() + 1) for item in (mine, theirs)]
    out = np.full(len(mine), -1, dtype=np.int64)
    alike = count[0] == count[1]
    here, there = (np.argsort(item, kind="stable") for item in (mine, theirs))
    out[here[alike[mine[here]]]] = there[alike[theirs[there]]]
    return out


def _factors(transfer: Complex, middle: Complex) -> tuple[Complex, Complex]:
    """Return the factors (n, count) and what they multiply (n, 2, 2), from transfers (n, count, 2, 2)."""
    flat = transfer.reshape(*transfer.shape[:2], 4)
    best = np.abs(flat).sum(axis=1).argmax(axis=1)
    along = np.take_along_axis(flat, best[:, None, None], axis=2)[:, :, 0]
    largest = np.abs(along).argmax(axis=1)
    row = np.arange(len(flat))
    here = along[:, transfer.shape[1] // 2]
    weak = np.abs(here) < NOTHING * np.abs(along[row, largest])
    base = np.where(weak, along[row, largest], here)
    a = np.where(weak[:, None, None], transfer[row, largest], middle)
    factor = np.divide(along, base[:, None], out=np.ones_like(along), where=base[:, None] != 0.0)
    return factor, a


def _next(factor: Complex) -> npt.NDArray[np.float64]:
    """Return the size of the first Chebyshev coefficient that is left out, where they fall geometrically."""
    size = np.abs(scipy.fft.dct(factor.real, axis=1) + 1j * scipy.fft.dct(factor.imag, axis=1)) / factor.shape[1]
    last, before = size[:, -1], size[:, -2]
    ratio = np.divide(last, before, out=np.zeros_like(last), where=before > 1e-12)
    return np.asarray(last * np.minimum(ratio, 1.0))


def warn_of_band(state: WorldState, radar: RadarSpec, levels: WarningLevels) -> float:
    """Warn where a layer of the scene reflects otherwise over a wide band than in its middle, which stands for all.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    levels : WarningLevels

    Returns
    -------
    float
        Largest difference of a layer's reflection in the band from that of the paths (the middle of the band of one
        ramp), at normal incidence, relative to its root mean square over the band. Frequencies without data do not
        count.
    """
    low, high = band_of(radar)
    if high - low <= WIDE:
        return 0.0
    worst, said, power = 0.0, "", ""
    frequencies, middle = np.linspace(low, high, NUM_ASKED), material_frequency(radar)
    for material in {name: state.world.materials[name] for name in state.world.parts.material}.values():
        if material.thickness is None or not material.covers(middle):
            continue
        known = [float(frequency) for frequency in frequencies if material.covers(float(frequency))] or [middle]
        own, *over = (complex(reflection(material, frequency, 1.0)[0]) for frequency in (middle, *known))
        mean = max(float(np.mean(np.abs(over) ** 2)), 1e-24)
        change = float(np.abs(np.array(over) - own).max() / np.sqrt(mean))
        if change > worst:
            worst = change
            said = f"'{material.name}' differs by up to {100 * change:.0f} %"
            power = f"{10.0 * np.log10(max(abs(own) ** 2, 1e-24) / mean):+.1f} dB"
    if worst > levels.band_change:
        warnings.warn(
            f"over the band of {(high - low) / 1e9:.3g} GHz the reflection of {said} from that at "
            f"{middle / 1e9:.4g} GHz, which paths have for all of it: the mean power of such an echo is off by "
            f"{power}, and it has the shape over range of a single surface. Set num_band_frequencies=3 or more",
            ScarlWarning,
            stacklevel=3,
        )
    return worst
