"""How far the echo of each object may be off, from the run itself: what cancels is uncertain, and what bounces on is cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.auto import ErrorEstimate
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.paths import RadarPaths

Array = npt.NDArray[np.float64]


def expected_errors(
    paths: RadarPaths, radar: RadarSpec, numbers: Sequence[int], fit: ErrorEstimate, share: float
) -> dict[int, float]:
    r"""Return for objects the error that their echo is expected to have [dB]; none for an object without a path.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    numbers : sequence of int
        Instance ids of objects computed by `sbr`.
    fit : ErrorEstimate
    share : float
        Relative error of one patch of the level that was taken.

    Notes
    -----
    With the amplitudes a of an object's patches, summed in each range cell c, what is left of independent relative
    errors of the patches, and of bounces beyond the last, relative to the echo is

    .. math:: e^2 = \frac{\epsilon^2 \sum |a|^2}{\sum_c |\sum a|^2} + \kappa^2 \frac{\sum_c |\sum_{last} a|^2}
              {\sum_c |\sum a|^2}

    and the error :math:`20 \log_{10}(1 + e)`. A flash, whose patches add up, is certain; a side lobe, which is what
    is left where they cancel, is not. The constants are measured: docs/accuracy.md, expected error.
    """
    found: dict[int, float] = {}
    if not paths.num_paths:
        return found
    length = PathGeometry.of(paths, radar).center_length()
    amplitude = paths.a[:, 0, 0] * np.exp(-2j * np.pi * radar.center_frequency / 299792458.0 * length)
    cell = np.floor(length / 2.0 / radar.range_resolution).astype(np.int64)
    owner = _owners(paths, numbers)
    for number in numbers:
        rows = np.flatnonzero(owner == number)
        if not len(rows):
            continue
        last = paths.depth[rows] == paths.depth[rows].max()
        several = paths.depth[rows].max() > 1
        whole = _power(amplitude[rows], cell[rows])
        apart = float(np.sum(np.abs(amplitude[rows]) ** 2))
        beyond = _power(amplitude[rows][last], cell[rows][last]) if several else 0.0
        square = (share**2 * apart + fit.last_bounce**2 * beyond) / max(whole, 1e-300)
        found[number] = float(20.0 * np.log10(1.0 + np.sqrt(square)))
    return found


def _owners(paths: RadarPaths, numbers: Sequence[int]) -> npt.NDArray[np.int64]:
    """Return the first of the objects that each path meets, -1 if it meets none."""
    owner = np.full(paths.num_paths, -1, dtype=np.int64)
    for column in range(paths.instance.shape[1]):
        here = paths.instance[:, column]
        owner = np.where((owner < 0) & np.isin(here, numbers), here, owner)
    return owner


def _power(amplitude: npt.NDArray[np.complex128], cell: npt.NDArray[np.int64]) -> float:
    """Return the power of amplitudes that add up in each cell."""
    place = cell - cell.min()
    field = np.bincount(place, amplitude.real) + 1j * np.bincount(place, amplitude.imag)
    return float(np.sum(np.abs(field) ** 2))
