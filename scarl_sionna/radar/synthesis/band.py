"""Paths whose transfer changes over the band, as paths of constant transfer, each times a known screen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.paths import RadarPaths, band_nodes

from .coded.symbols import Signal, lagrange
from .phase import FrameGrid

Array = npt.NDArray[np.float64]

FLAT = 0.1
"""Part of the tolerance below which a path's transfer is taken as constant."""


def parts(paths: RadarPaths, radar: RadarSpec, tolerance: float | None) -> Iterator[tuple[RadarPaths, Array | None]]:
    r"""Yield paths of constant transfer and the factor of their samples; None where there is none.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
        With ramps or tones.
    tolerance : float or None
        Of the synthesis; paths that change by less than a tenth of it are taken as constant.

    Yields
    ------
    paths : RadarPaths
    screen : ndarray of float64, shape (num_chirps, num_samples) or (1, num_samples), or None

    Raises
    ------
    ParameterRangeError
        If the radar's samples see frequencies outside the band that the paths were solved for.

    Notes
    -----
    By definition of interpolation: :math:`a(f) = a \sum_k g_k l_k(f)`, and each sample is taken at one frequency.
    """
    if paths.over_band is None or paths.band is None:
        yield paths, None
        return
    flat = np.abs(paths.over_band - 1.0).max(axis=1) < FLAT * (tolerance or 0.0)
    plain = replace(paths, over_band=None, band=None)
    if flat.any():
        yield plain.select(flat), None
    if flat.all():
        return
    rest, factor = plain.select(~flat), paths.over_band[~flat]
    for row, screen in enumerate(screens(radar, paths.band, factor.shape[1])):
        yield rest.scaled(factor[:, row]), screen


def screens(radar: RadarSpec, band: tuple[float, float], count: int) -> Array:
    """Return the polynomials that are 1 at one node of a band [Hz], at the frequencies of the samples.

    By definition, shape (count, num_chirps or 1, num_samples).
    """
    grid, sweep = FrameGrid(radar), radar.waveform.sweep
    frequency = grid.center_frequency + sweep.slope * np.atleast_2d(grid.z)
    middle, half = 0.5 * (band[0] + band[1]), 0.5 * (band[1] - band[0])
    place = (frequency - middle) / half
    if np.abs(place).max() > 1.001:
        shown = f"{frequency.min() / 1e9:.6g} to {frequency.max() / 1e9:.6g} GHz"
        allowed = f"within {band[0] / 1e9:.6g} to {band[1] / 1e9:.6g} GHz, for which the paths were solved"
        raise ParameterRangeError("radar.waveform", shown, allowed, "solve the paths with this radar")
    nodes = (band_nodes(band, count) - middle) / half
    return lagrange(nodes, place.ravel()).reshape(count, *place.shape)


def screened(signal: Signal, screen: Array, first: int) -> Signal:
    """Return what makes a pair's signal from some chirp on times a factor of each sample."""

    def of_pair(tx: int, rx: int) -> npt.NDArray[np.complexfloating]:
        found = signal(tx, rx)
        return np.asarray(found * (screen if len(screen) == 1 else screen[first : first + len(found)]))

    return of_pair


def constant(paths: RadarPaths) -> RadarPaths:
    """Return paths with the transfer of the band's middle.

    Raises
    ------
    ParameterRangeError
        If a path's transfer changes over the band.
    """
    if paths.over_band is not None and np.abs(paths.over_band - 1.0).max(initial=0.0) > 0.0:
        allowed = "None where symbols or coded ramps are summed plainly, sample by sample"
        remedy = "solve with num_band_frequencies=1, take method='nufft', or a prefix as long as the longest delay"
        raise ParameterRangeError("paths.over_band", "changes over the band", allowed, remedy)
    return replace(paths, over_band=None, band=None)
