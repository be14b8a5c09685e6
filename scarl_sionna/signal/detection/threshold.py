"""Constant false-alarm rate: which cells exceed what the training cells around them say of noise and clutter."""

from __future__ import annotations

import warnings
from typing import Literal, NamedTuple, TypedDict, Unpack

import numpy as np
import numpy.typing as npt
import scipy.ndimage
import scipy.special

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning

from ..processing import RangeDoppler
from ..windows import window_values
from .correlated import MOST_CELLS, MOST_VALUES, Links, factor_of_links
from .statistics import LEAST_PFA, LEAST_PFA_OF_MEAN, Halves, factor, factor_on_mean, order_of, rate_of_each

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Phasors = npt.NDArray[np.complex128]
Kind = Literal["ca", "go", "so", "os", "osgo"]
Along = Literal["either", "both", "range", "doppler"]
Widths = tuple[int, int]

KINDS = ("ca", "go", "so", "os", "osgo")
GUARD: Widths = (3, 3)
TRAINING: Widths = (6, 8)
RANK = 0.75
"""Part of the training cells that the ordered statistic is not below."""
_VALUES_A_BLOCK = 4_000_000
_RATE_KEPT = 0.7
"""Part of a rate of false alarms below which links to the training cells are told."""
_INDEPENDENT = 1.0 - 1e-9
"""Part of the training cells from which on all count as independent."""


class Options(TypedDict, total=False):
    """Keywords of a threshold, see :class:`Statistic`."""

    kind: Kind
    along: Along
    rank: float


class Statistic(NamedTuple):
    """What training cells are summed up to."""

    kind: Kind = "ca"
    """``"ca"``: the mean of all (cell averaging); ``"go"``, ``"so"``: the greater, the smaller of the means before and
    behind the cell; ``"os"``: the value of a rank among all (ordered statistic); ``"osgo"``: the greater of those of
    the two halves."""
    along: Along = "either"
    """Where training cells lie: in the cell's own row (``"range"``) or column (``"doppler"``), all around (``"both"``);
    ``"either"``: it stands out in its row or in its column. The halves are before and behind in range, for
    ``"doppler"`` slower and faster."""
    rank: float = RANK
    """Of the ordered statistic, from 0 (smallest) to 1 (largest)."""

    def check(self, pfa: float) -> None:
        """Raise if a value is out of range.

        Raises
        ------
        ParameterRangeError
            If one is, or `pfa` is not at least `LEAST_PFA_OF_MEAN` and below 1.
        """
        if not LEAST_PFA_OF_MEAN <= pfa < 1.0:
            raise ParameterRangeError("pfa", pfa, f"{LEAST_PFA_OF_MEAN:g} <= pfa < 1")
        if self.kind not in KINDS:
            raise ParameterRangeError("kind", repr(self.kind), " or ".join(map(repr, KINDS)))
        if pfa < LEAST_PFA and self.kind != "ca":
            raise ParameterRangeError("pfa", pfa, f">= {LEAST_PFA:g} for kind '{self.kind}'")
        if self.along not in ("either", "both", "range", "doppler"):
            raise ParameterRangeError("along", repr(self.along), "'either', 'both', 'range' or 'doppler'")
        if not 0.0 < self.rank <= 1.0:
            raise ParameterRangeError("rank", self.rank, "0 < rank <= 1")


def cfar(
    rd: RangeDoppler,
    pfa: float = 1e-6,
    guard: Widths = GUARD,
    training: Widths = TRAINING,
    **options: Unpack[Options],
) -> npt.NDArray[np.bool_]:
    r"""Return which cells of the channels' mean power stand out, shape (num_doppler, num_range).

    Parameters
    ----------
    rd : RangeDoppler
    pfa : float
        Probability of false alarm of a cell in white noise, 1e-300 <= pfa < 1; of other kinds than ``"ca"`` 1e-18 and
        more.
    guard, training : tuple of int
        Half-widths in cells (Doppler, range): of the neighbours left out, and of the training cells beyond them.
    **options
        `kind` (``"ca"``, ``"go"``, ``"so"``, ``"os"``, ``"osgo"``), `along` (``"either"``, ``"both"``, ``"range"``,
        ``"doppler"``) and `rank`, see :class:`Statistic`.

    Returns
    -------
    ndarray of bool, shape (num_doppler, num_range)

    Raises
    ------
    ParameterRangeError
        If a value is out of range, or the window is empty or larger than the map.

    Notes
    -----
    Doppler is periodic; beyond the ends of range there is nothing, so cells there have fewer training cells. An axis of
    one or two bins has no training cells. The factors are exact for independent training cells; how windows link them
    counts by the effective number of independent ones, and cell by cell where a window has few of them
    (:mod:`~scarl_sionna.signal.detection.correlated`). The cell itself counts as independent of its training cells:
    where the guard is too narrow for the map's window, or for zero padding, fewer cells stand out, and a
    :class:`~scarl_sionna.core.errors.ScarlWarning` says about how many, and which guard suffices.

    In a window all around, a car hides the people beside it. Along its own velocity a person is alone, and a long
    vehicle, which fills its row, stands out along range: a cell counts if it stands out along either. Both thresholds
    together have the rate that is asked for (:func:`~scarl_sionna.signal.detection.statistics.rate_of_each`).

    References
    ----------
    .. [1] H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", IEEE Trans. Aerosp.
       Electron. Syst. 19(4), 1983: cell averaging and ordered statistic.
    .. [2] V. G. Hansen, J. H. Sawyers, "Detectability loss due to greatest of selection in a cell-averaging CFAR", IEEE
       Trans. Aerosp. Electron. Syst. 16(1), 1980.
    """
    statistic = Statistic(**options)
    windows, pfa = windows_of(rd, len(rd.data), pfa, guard, training, statistic)
    power = rd.power.astype(np.float64)
    found = [_stand_out(power, len(rd.data), pfa, window, statistic) for window in windows]
    return np.logical_or.reduce(found)


def windows_of(
    rd: RangeDoppler, num_looks: int, pfa: float, guard: Widths, training: Widths, statistic: Statistic
) -> tuple[list[TrainingWindow], float]:
    """Return the windows of a threshold, and the rate at which a cell may exceed it in each, see :func:`cfar`.

    Raises
    ------
    ParameterRangeError
        If a value is out of range, or the window is empty or larger than the map.
    """
    statistic.check(pfa)
    axes: list[Along] = [statistic.along]
    if statistic.along == "either":  # an axis of one or two bins tells nothing
        named: list[tuple[Along, int]] = [("doppler", rd.data.shape[1]), ("range", rd.data.shape[2])]
        axes = [name for name, bins in named if bins > 2] or ["both"]
    windows = [TrainingWindow.of(rd, guard, training, axis) for axis in axes]
    _warn_of_links(rd, windows, (num_looks, pfa), guard, training)
    if len(windows) == 2:
        halves = windows[0].halves(statistic.kind), windows[1].halves(statistic.kind)
        pfa = rate_of_each(statistic.kind, pfa, num_looks, halves, statistic.rank)
    return windows, pfa


def _warn_of_links(
    rd: RangeDoppler, windows: list[TrainingWindow], asked: tuple[int, float], guard: Widths, training: Widths
) -> None:
    """Warn if a cell's own noise is in its training cells, so that fewer exceed them; `asked`: looks and rate."""
    kept = float(np.mean([_rate_kept(window.link, *asked) for window in windows]))
    if kept >= _RATE_KEPT:
        return
    enough = []
    for axis, bins in enumerate(rd.data.shape[1:]):
        count = (rd.radar.num_doppler_bins, rd.radar.num_range_bins)[axis]
        most = min(bins, 16 * max(bins // count, 1))
        links = np.abs(_noise_correlation(rd.window[1 - axis], count, bins, most + training[axis] + 1)) ** 2
        links = links[len(links) // 2 :]
        kept_by = [_rate_kept(links[g + 1 : g + 1 + training[axis]].mean(), *asked) for g in range(most)]
        fits = [g for g, part in enumerate(kept_by) if part >= _RATE_KEPT]
        enough.append(max(guard[axis], fits[0] if fits else most))
    warnings.warn(
        f"guard = {tuple(guard)}: windows {rd.window} link a cell to its training cells, and about {kept:.2g} of the "
        f"false alarms that pfa = {asked[1]:g} asks for remain; guard = {tuple(enough)} suffices",
        ScarlWarning,
        stacklevel=4,
    )


def _rate_kept(link: float, num_looks: int, pfa: float) -> float:
    """Return the part of a rate that is left where training cells have a part `link` of a cell's own noise power.

    A cell x times the mean raises the mean of its training cells by ``(x - 1) link``; to first order of the gamma
    distribution's tail.
    """
    level = float(scipy.special.gammainccinv(num_looks, min(pfa, 0.5))) / num_looks
    return float(np.exp(-num_looks * (level - 1.0) ** 2 * link))


def _stand_out(
    power: Array, num_looks: int, pfa: float, window: TrainingWindow, statistic: Statistic
) -> npt.NDArray[np.bool_]:
    """Return which cells of a map of powers stand out of their training cells in one window."""
    if statistic.kind == "ca":
        return above_mean(window, power, num_looks, pfa)
    cells = np.indices(power.shape).reshape(2, -1)
    return exceeds(window, power, (cells[0], cells[1]), num_looks, pfa, statistic).reshape(power.shape)


def above_mean(
    window: TrainingWindow, power: npt.NDArray[np.floating], num_looks: int, pfa: float
) -> npt.NDArray[np.bool_]:
    """Return which cells of a map stand out of the mean of their training cells, see :func:`exceeds`."""
    total, count = window.sums(power.astype(np.float64))
    return np.asarray(power * count > total * _threshold_factor(window, num_looks, pfa, count))


def exceeds(
    window: TrainingWindow,
    power: npt.NDArray[np.floating],
    cells: tuple[Index, Index],
    num_looks: int,
    pfa: float,
    statistic: Statistic,
) -> npt.NDArray[np.bool_]:
    """Return which of some cells (row, column) of a map of powers stand out, see :func:`cfar`.

    `num_looks` is the number of independent powers whose mean a value is: the channels, or 1 in a beam.
    """
    statistic.check(pfa)
    kind, _, rank = statistic
    row, column = cells
    out = np.zeros(len(row), dtype=bool)
    offsets, side = window.offsets(kind)
    block = max(1, _VALUES_A_BLOCK // len(offsets))
    for first in range(0, len(row), block):
        part = slice(first, first + block)
        columns = column[part, None] + offsets[:, 1]
        inside = (columns >= 0) & (columns < power.shape[1])
        values = power[(row[part, None] + offsets[:, 0]) % power.shape[0], np.clip(columns, 0, power.shape[1] - 1)]
        level = np.zeros((len(values), 2))
        counts = np.stack([(inside & (side == half)).sum(axis=1) for half in (0, 1)], axis=1)
        for half in range(int(side.max()) + 1):
            mine = side == half
            level[:, half] = _level(values[:, mine], inside[:, mine], counts[:, half], kind, rank)
        which, inverse = np.unique(counts, axis=0, return_inverse=True)
        factors = np.array([factor(kind, pfa, num_looks, Halves(int(a), int(b), window.loss), rank) for a, b in which])[
            inverse.reshape(-1)
        ]
        factors = factors * window.linked(kind, pfa, num_looks, rank)
        if kind == "so":
            level = np.where(counts > 0, level, np.inf)
            out[part] = power[row[part], column[part]] > factors * level.min(axis=1)
        else:
            out[part] = power[row[part], column[part]] > factors * level.max(axis=1)
    return out


def _level(values: Array, inside: npt.NDArray[np.bool_], count: Index, kind: Kind, rank: float) -> Array:
    """Return what training values (n, num_cells) are summed up to: their mean, or their value of a rank; 0 for none."""
    if kind in ("ca", "go", "so"):
        return np.asarray(np.where(inside, values, 0.0).sum(axis=1) / np.maximum(count, 1))
    out = np.zeros(len(values))
    for number in np.unique(count[count > 0]):
        rows = count == number
        place = order_of(int(number), rank) - 1
        ordered = np.partition(np.where(inside[rows], values[rows], np.inf), place, axis=1)
        out[rows] = ordered[:, place]
    return out


class TrainingWindow:
    """Training cells around a cell: full widths in cells (Doppler, range) of the window and of what it leaves out.

    Parameters
    ----------
    outer, inner : tuple of int
    correlation : (ndarray, ndarray) of complex128, shape (2 * width - 1,)
        Of the noise of two cells, over their distance in Doppler and range.
    split : int
        Axis along which the halves lie: 1 for range, 0 for Doppler.
    """

    def __init__(self, outer: Widths, inner: Widths, correlation: tuple[Phasors, Phasors], split: int) -> None:
        self.outer, self.inner, self.correlation, self.split = outer, inner, correlation, split
        self.loss = _correlation_loss(correlation, outer, inner)
        """Independent training cells over training cells."""
        offsets, _ = self.offsets("ca")
        near = [np.abs(axis[at + len(axis) // 2]) ** 2 for axis, at in zip(correlation, offsets.T, strict=True)]
        self.link = float(np.mean(near[0] * near[1]))
        """Part of a cell's own noise power in its training cells, on average."""

    @classmethod
    def of(cls, rd: RangeDoppler, guard: Widths, training: Widths, along: Along = "both") -> TrainingWindow:
        """Return the window on a map.

        Raises
        ------
        ParameterRangeError
            If a width is out of range, or the window larger than the map.
        """
        if min(guard) < 0 or min(training) < 1:
            raise ParameterRangeError("guard, training", f"{guard}, {training}", "guard >= 0 and training >= 1 cells")
        shape = rd.data.shape[1:]
        used = [along in ("both", name) and bins > 2 for name, bins in zip(("doppler", "range"), shape, strict=True)]
        if not any(used):
            raise ParameterRangeError("along", repr(along), "an axis of 3 bins or more", f"the map has {shape} bins")
        outer, inner = (
            (sizes[0] if used[0] else 1, sizes[1] if used[1] else 1)
            for sizes in ([2 * (g + t) + 1 for g, t in zip(guard, training, strict=True)], [2 * g + 1 for g in guard])
        )
        if outer[0] > shape[0] or outer[1] > shape[1]:
            raise ParameterRangeError("guard + training", f"a window of {outer} cells", f"at most {shape} cells")
        counts = rd.radar.num_doppler_bins, rd.radar.num_range_bins
        doppler, distance = (
            _noise_correlation(rd.window[1 - axis], counts[axis], shape[axis], outer[axis]) for axis in (0, 1)
        )
        return cls(outer, inner, (doppler, distance), 1 if used[1] else 0)

    def sums(self, power: Array) -> tuple[Array, Array]:
        """Return the sum [W] of the training cells around every cell, and their number."""
        ones = np.ones_like(power)
        total = _box_sum(power, self.outer) - _box_sum(power, self.inner)
        return total, np.rint(_box_sum(ones, self.outer) - _box_sum(ones, self.inner))

    def halves(self, kind: Kind) -> Halves:
        """Return the numbers of training cells of a cell that has all of them."""
        _, side = self.offsets(kind)
        return Halves(int((side == 0).sum()), int((side == 1).sum()), self.loss)

    def linked(self, kind: Kind, pfa: float, num_looks: int, rank: float) -> float:
        """Return by how much the exact factor is that of so many independent cells, dimensionless.

        Counted where cells times looks are few (:mod:`~scarl_sionna.signal.detection.correlated`).
        """
        offsets, side = self.offsets(kind)
        many = len(offsets) > MOST_CELLS and len(offsets) * num_looks > MOST_VALUES
        if many or self.loss > _INDEPENDENT:
            return 1.0
        covariances = []
        for half in range(int(side.max()) + 1):
            apart = offsets[side == half, None] - offsets[None, side == half] + np.array(self.outer) - 1
            covariances.append(self.correlation[0][apart[..., 0]] * self.correlation[1][apart[..., 1]])
        exact = factor_of_links(kind, pfa, num_looks, Links(*covariances), rank)
        if kind == "ca":  # also for rates that the integral cannot tell
            return exact / float(factor_on_mean(pfa, num_looks, np.array(len(offsets) * self.loss)))
        return exact / factor(kind, pfa, num_looks, self.halves(kind), rank)

    def offsets(self, kind: Kind) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return the training cells (n, 2) from the cell, and the half that each is in (0 where there are no halves).

        Cells that are in neither half are left out.
        """
        half = [size // 2 for size in self.outer]
        grid = np.stack(np.meshgrid(*(np.arange(-size, size + 1) for size in half), indexing="ij"), axis=-1).reshape(
            -1, 2
        )
        grid = grid[(2 * np.abs(grid) >= self.inner).any(axis=1)]
        if kind in ("ca", "os"):
            return grid, np.zeros(len(grid), dtype=np.int64)
        grid = grid[2 * np.abs(grid[:, self.split]) >= self.inner[self.split]]
        return grid, (grid[:, self.split] > 0).astype(np.int64)


def fitting_window(shape: tuple[int, int], guard: Widths = GUARD, training: Widths = TRAINING) -> tuple[Widths, Widths]:
    """Return guard and training cells that fit into a map of (Doppler, range) bins: training gives way first.

    By definition; an axis of fewer than 3 bins has no room for training cells, and the detector takes none along it.
    """
    fitted = []
    for bins, own_guard, own_training in zip(shape, guard, training, strict=True):
        while 2 * (own_guard + own_training) + 1 > bins and (own_training > 1 or own_guard > 0):
            if own_training > 1:
                own_training -= 1
            else:
                own_guard -= 1
        fitted.append((own_guard, own_training))
    return (fitted[0][0], fitted[1][0]), (fitted[0][1], fitted[1][1])


def _threshold_factor(window: TrainingWindow, num_looks: int, pfa: float, count: Array) -> Array:
    """Return the factor on the training average for every cell."""
    values, inverse = np.unique(count, return_inverse=True)
    factors = factor_on_mean(pfa, num_looks, values * window.loss) * window.linked("ca", pfa, num_looks, RANK)
    return np.asarray(factors[inverse].reshape(count.shape))


def _box_sum(values: Array, size: tuple[int, ...]) -> Array:
    """Return the sum over a box around every cell: periodic over Doppler, zero beyond range."""
    mean = scipy.ndimage.uniform_filter(values, size=size, mode=("wrap", "constant"))
    return mean * float(np.prod(size))


def _correlation_loss(correlation: tuple[Phasors, Phasors], outer: Widths, inner: Widths) -> float:
    """Return independent training cells over training cells.

    N / (mean over cells of the sum of squared correlations).
    """
    doppler, distance = (np.abs(axis) ** 2 for axis in correlation)
    mask = np.ones(outer)
    middle = tuple(slice((o - i) // 2, (o + i) // 2) for o, i in zip(outer, inner, strict=True))
    mask[middle] = 0.0
    from scipy.signal import correlate  # 0.5 s, which labels, for example, need not wait for

    overlap = correlate(mask, mask, mode="full", method="fft")
    total = float((overlap * np.outer(doppler, distance)).sum())
    return float(mask.sum() / total)


def _noise_correlation(window: str, count: int, num_bins: int, reach: int) -> Phasors:
    """Return the correlation of the noise of two bins at distances -(reach-1) .. reach-1."""
    squared = window_values(window, count) ** 2
    distance = np.arange(-(reach - 1), reach)
    phasors = np.exp(-2j * np.pi * np.outer(distance, np.arange(count)) / num_bins)
    return np.asarray(phasors @ squared / squared.sum())
