"""The synthesis of linear FMCW as an operator: raw data of paths, its derivatives and their adjoint."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.cores import usable_cores
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.radar.synthesis import MAX_THREADS
from scarl_sionna.radar.synthesis.groups import DIRECT_COST, FFT_COST, SPREAD_COST
from scarl_sionna.radar.synthesis.phase import FrameGrid

from .columns import Columns
from .plain import PlainSum
from .series import Box, Factors, Series, num_terms, residual_scales
from .transform import Expansion, PairTransform

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.intp]

DEFAULT_TOLERANCE = 1e-9
"""Error of the raw data over its peak; not charted: docs/gradients.md has the times of several."""
SLOPE_TOLERANCE = 1e-7
"""Least error of the derivatives, over their size at full phase: below, nothing is gained that a fit would see."""
BIN_PHASE = 3.0
"""Paths whose residual phases are farther apart than this [rad] over the frame are transformed apart."""

MAX_KNOWN = 4
"""Series that an operator keeps: each holds some ten to thirty arrays of a frame's size."""


class _Bin(NamedTuple):
    """Some paths, and what transforms them."""

    paths: Index
    transform: PairTransform | PlainSum


class BeatOperator:
    r"""Raw data of linear FMCW as a function of each path's amplitude, length, rate, acceleration and growth.

    Every pair of antennas has columns of its own (:class:`Columns`, shape (num_tx, num_rx, num_paths)). The raw data is
    that of :func:`scarl_sionna.synthesize` with

    .. math:: \tau(t) = (L + L' t + L'' t^2 / 2) / (c + L'/2), \quad \bar a(t) = \bar a \, (1 + g t)

    in float64. :meth:`reverse` is the adjoint of :meth:`forward` to rounding, whatever the tolerance.

    Parameters
    ----------
    radar : RadarSpec
        Linear FMCW whose chirps follow each other regularly with one carrier, transmitters one after the other or
        apart, ideal front end.
    tolerance : float
        Largest error of the raw data over its peak; that of derivatives is the same, but not below 1e-7.

    Raises
    ------
    ParameterRangeError
        If the radar is another, or the tolerance is not in [1e-13, 0.1].

    Notes
    -----
    The inner product of raw data is ``Re sum conj(x) y``, so that the gradient of a loss to a complex value z is
    ``dloss/dRe z + 1j dloss/dIm z``, as TensorFlow and PyTorch have it.
    """

    def __init__(self, radar: RadarSpec, tolerance: float = DEFAULT_TOLERANCE) -> None:
        check_radar(radar)
        if not 1e-13 <= tolerance <= 0.1:
            raise ParameterRangeError("tolerance", tolerance, "1e-13 to 0.1", "1e-9 suits fits in float64")
        self.radar, self.tolerance, self.slope_tolerance = radar, tolerance, max(tolerance, SLOPE_TOLERANCE)
        self._known: dict[tuple[Box, float], Series] = {}
        self._expansions = [Expansion(radar, tx) for tx in range(radar.num_tx)]

    parameters = Columns
    """What :meth:`value` takes."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of the raw data: (num_rx, num_chirps_total, num_samples)."""
        return self.radar.num_rx, self.radar.num_chirps_total, self.radar.num_samples

    def value(self, columns: Columns) -> Complex:
        """Return the raw data [sqrt(W)], complex128 of :attr:`shape`, rows as :func:`scarl_sionna.synthesize` has them.

        Raises
        ------
        ParameterRangeError
            If a column has another shape than (num_tx, num_rx, num_paths) or is not finite, or the receiver filters a
            path out because it is too long.
        """
        out, bins = np.zeros(self.shape, dtype=np.complex128), self._bins(columns, self.tolerance)

        def of_pair(tx: int, rx: int) -> None:
            for index, transform in bins:
                out[rx, tx :: self.radar.num_tx] += transform.value(_pair(columns, tx, rx, index), tx)

        self._each(of_pair)
        return out

    def forward(self, columns: Columns, change: Columns) -> Complex:
        """Return how the raw data changes, to first order, with a change of the columns.

        Parameters
        ----------
        columns, change : Columns
            Each of shape (num_tx, num_rx, num_paths).
        """
        out, bins = np.zeros(self.shape, dtype=np.complex128), self._bins(columns, self.slope_tolerance)
        _check(change, self.radar)

        def of_pair(tx: int, rx: int) -> None:
            for index, transform in bins:
                parts = _pair(columns, tx, rx, index), _pair(change, tx, rx, index)
                out[rx, tx :: self.radar.num_tx] += transform.forward(*parts, tx)

        self._each(of_pair)
        return out

    def reverse(self, columns: Columns, gradient: Complex) -> Columns:
        """Return the adjoint of :meth:`forward`: the gradient to the columns from that to the raw data.

        Parameters
        ----------
        columns : Columns
        gradient : ndarray of complex128
            Of :attr:`shape`.
        """
        bins = self._bins(columns, self.slope_tolerance)
        above = np.asarray(gradient, dtype=np.complex128)
        if above.shape != self.shape:
            raise ParameterRangeError("gradient", f"of shape {above.shape}", f"shape {self.shape}, of the raw data")
        out = Columns._make(np.zeros_like(column) for column in columns)

        def of_pair(tx: int, rx: int) -> None:
            for index, transform in bins:
                ramps = np.ascontiguousarray(above[rx, tx :: self.radar.num_tx])
                found = transform.reverse(_pair(columns, tx, rx, index), ramps, tx)
                for column, part in zip(out, found, strict=True):
                    column[tx, rx, index] = part

        self._each(of_pair)
        return out

    def _bins(self, columns: Columns, tolerance: float) -> list[_Bin]:
        """Return the paths in bins of similar motion, each with its transform."""
        _check(columns, self.radar)
        if columns.length.shape[2] == 0:
            return []
        longest, most = float(columns.length.max()), 2.0 * self.radar.max_range
        if longest >= most:  # as synthesize leaves such paths out; a jump has no derivative
            allowed = f"below twice the unambiguous range of {self.radar.max_range:.4g} m"
            raise ParameterRangeError("columns.length", f"{longest:.4g} m", allowed, "leave longer paths out")
        each = [expansion.tones(_of_tx(columns, tx)).factors for tx, expansion in enumerate(self._expansions)]
        factors = Factors._make(np.stack(rows) for rows in zip(*each, strict=True))  # (num_tx, num_rx, num_paths)
        done, waiting = [], [np.arange(columns.length.shape[2])]
        while waiting:
            index = waiting.pop(0)
            middles = [0.5 * (part[..., index].min((0, 1)) + part[..., index].max((0, 1))) for part in factors[:2]]
            fastest = float(np.abs(factors.rate[..., index]).max())
            scales = residual_scales(self.radar, fastest)
            phases = [np.ptp(values) * scale for values, scale in zip(middles, scales, strict=True)]
            values = middles[int(np.argmax(phases))]
            if max(phases) <= 2.0 * BIN_PHASE:
                box = Box.of(self.radar, Factors._make(part[..., index] for part in factors))
                done.append(_Bin(index, self._transform(box, len(index), tolerance)))
            else:
                upper = values > 0.5 * (values.min() + values.max())
                waiting[:0] = [index[~upper], index[upper]]
        return done

    def _transform(self, box: Box, num_paths: int, tolerance: float) -> PairTransform | PlainSum:
        """Return what is cheaper for the paths of a box.

        The series of the last few boxes are kept, since values and derivatives ask for the same.
        """
        samples, terms = self.radar.num_chirps * self.radar.num_samples, num_terms(self.radar, box, tolerance)
        if num_paths * samples * DIRECT_COST <= terms * (num_paths * SPREAD_COST + samples * FFT_COST):
            return PlainSum(self.radar)
        key = box, tolerance
        if key not in self._known:
            while len(self._known) >= MAX_KNOWN:
                del self._known[next(iter(self._known))]
            self._known[key] = Series.of(self.radar, box, tolerance)
        return PairTransform(self.radar, self._known[key], tolerance)

    def _each(self, of_pair: Callable[[int, int], None]) -> None:
        """Run something for every pair; pairs write to rows of their own."""
        pairs = [(tx, rx) for tx in range(self.radar.num_tx) for rx in range(self.radar.num_rx)]
        with ThreadPoolExecutor(min(usable_cores(), len(pairs), MAX_THREADS)) as pool:
            list(pool.map(lambda pair: of_pair(*pair), pairs))


def check_radar(radar: RadarSpec) -> None:
    """Raise if there are no derivatives of a radar's raw data.

    Raises
    ------
    ParameterRangeError
        If its waveform is not linear FMCW with regular chirps, it sends codes or has no Q, or its front end is not
        ideal.
    """
    linear = "linear FMCW: ss.Fmcw without frequency_step, frequency_offsets, chirp_offsets and chirp_jitter"
    if not isinstance(radar.waveform, Fmcw):
        raise ParameterRangeError("radar.waveform", repr(radar.waveform.kind), linear, "gradients are of linear FMCW")
    if not FrameGrid(radar).even:
        raise ParameterRangeError("radar.waveform", "ramps of uneven starts or carriers", linear)
    if radar.multiplexing.is_coded:
        remedy = "use radar.separated and multiplex the raw data, which is linear"
        raise ParameterRangeError("radar.multiplexing", repr(radar.multiplexing.kind), "'ideal' or 'tdm'", remedy)
    if radar.adc.is_real:
        remedy = "use radar.with_(sampling='complex'): real samples are the real part of its raw data"
        raise ParameterRangeError("radar.adc.sampling", "'real'", "'complex'", remedy)
    if not radar.front_end.is_ideal:
        remedy = "use radar.with_(front_end=radar.front_end.ideal()); gains and phases of channels are parameters"
        raise ParameterRangeError("radar.front_end", "with effects", "ideal", remedy)


def _check(columns: Columns, radar: RadarSpec) -> None:
    for name, column in zip(Columns._fields, columns, strict=True):
        if column.shape != (radar.num_tx, radar.num_rx, columns.length.shape[-1]):
            wanted = f"shape ({radar.num_tx}, {radar.num_rx}, num_paths), the same for all"
            raise ParameterRangeError(f"columns.{name}", f"of shape {column.shape}", wanted)
        if not np.isfinite(column).all():
            raise ParameterRangeError(f"columns.{name}", "NaN or infinity", "finite values", "check the geometry")


def _of_tx(columns: Columns, tx: int) -> Columns:
    return Columns._make(column[tx] for column in columns)


def _pair(columns: Columns, tx: int, rx: int, index: Index) -> Columns:
    return Columns._make(column[tx, rx, index] for column in columns)
