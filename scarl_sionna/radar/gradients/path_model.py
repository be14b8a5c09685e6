"""Raw data as a function of a path list and of the antennas, with derivatives and their adjoint."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.arguments import HOW_TO_RADAR, expect
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.synthesis.motion import PathMotion, is_known
from scarl_sionna.radar.synthesis.phase import FrameGrid
from scarl_sionna.signal.antenna import field_gain, field_gain_slope

from .columns import Columns
from .legs import Distance, Kept, Leg, Motion
from .operator import DEFAULT_TOLERANCE, BeatOperator

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


class PathParameters(NamedTuple):
    """What raw data depends on; also a change of it, and a gradient to it.

    Attributes
    ----------
    strength : ndarray of complex128, shape (num_paths,)
        Transfer `a` of the radar's polarisation times the distances of both ends from the array centres [m2]: what
        stays of a scatterer that moves. Of point targets ``wavelength sqrt(rcs) / (4 pi)**1.5``.
    tx_point, rx_point : ndarray of float64, shape (num_paths, 3)
        [m, world].
    tx_velocity, rx_velocity : ndarray of float64, shape (num_paths, 3)
        Relative to the radars [m/s, world axes].
    inner_length, inner_rate, inner_acceleration : ndarray of float64, shape (num_paths,)
        Between the two end points [m], [m/s], [m/s2]: a change of a path's length, rate or acceleration. Paths of
        `linear_motion` (``"raycast"``, rain) are kept to first order in time: of these the acceleration has no effect.
    tx_origin, rx_origin : ndarray of float64, shape (3,)
        Places of the radar frames [m, world].
    tx_array, rx_array : ndarray of float64, shape (num_tx, 3) and (num_rx, 3)
        Antennas [m, radar frame].
    tx_factor, rx_factor : ndarray of complex128, shape (num_tx,) and (num_rx,)
        Gain and phase of channels, of the field as in :class:`scarl_sionna.ChannelErrors`.
    """

    strength: Complex
    tx_point: Array
    rx_point: Array
    tx_velocity: Array
    rx_velocity: Array
    inner_length: Array
    inner_rate: Array
    inner_acceleration: Array
    tx_origin: Array
    rx_origin: Array
    tx_array: Array
    rx_array: Array
    tx_factor: Complex
    rx_factor: Complex

    def changed(self, **values: npt.ArrayLike) -> PathParameters:
        """Return a copy with some values, broadcast to their shapes."""
        shaped = {
            name: np.array(
                np.broadcast_to(np.asarray(value, dtype=getattr(self, name).dtype), getattr(self, name).shape)
            )
            for name, value in values.items()
        }
        return self._replace(**shaped)

    def zeros(self) -> PathParameters:
        """Return zeros of the same shapes: a change of nothing."""
        return PathParameters._make(np.zeros_like(value) for value in self)


class _Pairs(NamedTuple):
    """One transmitter's paths: its leg, those to the receivers, and what amplitudes are made of, (num_rx, num_paths).

    `scale` is the amplitude without strength and channels; `fading` the rate of the strength's loss at the middle, over
    the strength there [1/s]; `later` the factor from the middle to the parabola's start.
    """

    out: Leg
    home: Leg
    scale: Array
    fading: Array
    later: Array


class PathModel:
    r"""Raw data of linear FMCW as a function of a path list, antenna positions and channels, with exact derivatives.

    About the middle of each transmitter's frame every pair's length is a parabola and its strength a line in time:
    that is where :func:`scarl_sionna.synthesize` has exact motion. The antenna pattern is that towards the array
    centres at the frame's start, where `synthesize` follows directions: with the default pattern the two differ by 1e-4
    over 0.6 ms at 12 m/s and 15 m, by -31 dB over a frame of 9.7 ms at 30 m/s and 3 m; not with isotropic antennas.

    Parameters
    ----------
    radar : RadarSpec
        As of :class:`BeatOperator`.
    paths : RadarPaths
        Where they start: :attr:`start`. What does not vary is taken from them: orientation and rotation of the radars,
        and which paths have motion.
    tolerance : float
        Largest error of the transforms over the peak of the raw data.

    Raises
    ------
    ParameterRangeError
        If the radar is another than linear FMCW, its antennas are described one by one or behind a radome, a path is of
        mirror reflections only, or its transfer follows the band.
    InputTypeError
        If the paths are none.
    """

    def __init__(self, radar: RadarSpec, paths: RadarPaths, tolerance: float = DEFAULT_TOLERANCE) -> None:
        expect("radar", radar, RadarSpec, HOW_TO_RADAR)
        expect("paths", paths, RadarPaths, "give ss.solve_paths(...), or ss.point_targets(...)")
        if paths.is_mirror_chain.any():
            number = int(np.flatnonzero(paths.is_mirror_chain)[0])
            remedy = "use paths.select(~paths.is_mirror_chain): synthesis is linear, the rest can be added as it is"
            raise ParameterRangeError("paths", f"path {number} of mirrors only", "paths with end points", remedy)
        if not radar.array.is_uniform:
            allowed, remedy = "one pattern for all, no radome", "leave tx_elements, rx_elements and radome out"
            raise ParameterRangeError("radar.array", "antennas described one by one, or a radome", allowed, remedy)
        if paths.over_band is not None:
            remedy = "solve with num_band_frequencies=1"
            raise ParameterRangeError("paths.over_band", "a transfer that follows the band", "None", remedy)
        self.operator, self.radar, self._paths = BeatOperator(radar, tolerance), radar, paths
        known = is_known(paths)
        self._kept = Kept(known, known & ~paths.filled("linear_motion"))
        self._times = [FrameGrid(radar).center_time(tx) for tx in range(radar.num_tx)]
        self.start = self._start()

    def _start(self) -> PathParameters:
        paths, radar = self._paths, self.radar
        entry = "VH".index(radar.array.polarization)
        reach = np.prod([np.linalg.norm(vector, axis=1) for vector in paths.end_vectors()], axis=0)
        known = self._kept.moves[:, None]
        velocities = [np.where(known, paths.filled(name), 0.0) for name in ("tx_velocity", "rx_velocity")]
        still = replace(paths, tx_velocity=velocities[0], rx_velocity=velocities[1])
        between = PathMotion.of(still, radar).between  # all of the rate where velocities are not known
        columns = (
            paths.a[:, entry, entry] * reach,
            paths.tx_point,
            paths.rx_point,
            *velocities,
            *between,
            paths.world_from_tx.position,
            paths.world_from_rx.position,
            radar.tx_array,
            radar.rx_array,
            np.ones(radar.num_tx, dtype=np.complex128),
            np.ones(radar.num_rx, dtype=np.complex128),
        )
        return PathParameters._make(np.array(column) for column in columns)

    parameters = PathParameters
    """What :meth:`value` takes."""

    def value(self, parameters: PathParameters) -> Complex:
        """Return the raw data [sqrt(W)], complex128 of shape (num_rx, num_chirps_total, num_samples)."""
        return self.operator.value(self.columns(parameters))

    def forward(self, parameters: PathParameters, change: PathParameters) -> Complex:
        """Return how the raw data changes, to first order, with a change of the parameters."""
        return self.operator.forward(self.columns(parameters), self.columns_forward(parameters, change))

    def reverse(self, parameters: PathParameters, gradient: npt.ArrayLike) -> PathParameters:
        """Return the gradient to the parameters from that to the raw data: the adjoint of :meth:`forward`."""
        above = np.asarray(gradient, dtype=np.complex128)
        return self.columns_reverse(parameters, self.operator.reverse(self.columns(parameters), above))

    def columns(self, parameters: PathParameters) -> Columns:
        """Return what the signal of every pair depends on, shape (num_tx, num_rx, num_paths)."""
        self._check(parameters)
        rows = []
        for tx in range(self.radar.num_tx):
            pairs = self._pairs(parameters, tx)
            out, home = (leg.at_start(leg.distance) for leg in (pairs.out, pairs.home))
            inner = (parameters.inner_length, parameters.inner_rate, self._kept_bend(parameters.inner_acceleration))
            lengths = [a[[tx]] + b + c for a, b, c in zip(out, home, inner, strict=True)]
            amplitude = np.conj(self._fields(parameters, tx)) * pairs.scale
            rows.append(Columns._make([amplitude, *lengths, -pairs.fading / pairs.later]))
        return Columns._make(np.stack(column) for column in zip(*rows, strict=True))

    def columns_forward(self, parameters: PathParameters, change: PathParameters) -> Columns:
        """Return how the columns change with the parameters, to first order."""
        self._check(change)
        rows, gain = [], self._gain_change(parameters, change)
        for tx in range(self.radar.num_tx):
            pairs = self._pairs(parameters, tx)
            moved = [leg.forward(_motion(change, end)) for leg, end in ((pairs.out, "tx"), (pairs.home, "rx"))]
            moved[0] = Distance._make(part[[tx]] for part in moved[0])
            out, home = (leg.at_start(part) for leg, part in zip((pairs.out, pairs.home), moved, strict=True))
            inner = (change.inner_length, change.inner_rate, self._kept_bend(change.inner_acceleration))
            lengths = [a + b + c for a, b, c in zip(out, home, inner, strict=True)]
            fading, relative = np.zeros_like(pairs.fading), gain
            for leg, part, row in ((pairs.out, moved[0], [tx]), (pairs.home, moved[1], slice(None))):
                value, rate = leg.distance.value[row], leg.distance.rate[row]
                fading = fading + self._kept.bends * (part.rate - rate * part.value / value) / value
                relative = relative - part.value / value
            relative = relative + pairs.out.time * fading / pairs.later
            fields = self._fields(parameters, tx) * relative + self._fields_change(parameters, change, tx)
            rows.append(Columns._make([np.conj(fields) * pairs.scale, *lengths, -fading / pairs.later**2]))
        return Columns._make(np.stack(column) for column in zip(*rows, strict=True))

    def columns_reverse(self, parameters: PathParameters, gradient: Columns) -> PathParameters:
        """Return the adjoint of :meth:`columns_forward`."""
        out = parameters.zeros()
        total = np.zeros(len(parameters.strength))
        for tx in range(self.radar.num_tx):
            pairs, above = self._pairs(parameters, tx), Columns._make(column[tx] for column in gradient)
            fields = self._fields(parameters, tx)
            relative = (np.conj(above.amplitude) * np.conj(fields) * pairs.scale).real
            total += relative.sum(axis=0)
            self._add_fields(out, parameters, tx, np.asarray(pairs.scale * np.conj(above.amplitude)))
            fading = relative * pairs.out.time / pairs.later - above.growth / pairs.later**2
            fading = self._kept.bends * fading
            lengths = Distance(above.length, above.rate, self._kept_bend(above.acceleration))
            for own, sums in zip(out[5:8], lengths, strict=True):
                own += sums.sum(axis=0)
            for leg, end in ((pairs.out, "tx"), (pairs.home, "rx")):
                row = [tx] if end == "tx" else slice(None)
                value, rate = leg.distance.value[row], leg.distance.rate[row]
                parts = list(leg.from_start(lengths))
                parts[0] = parts[0] - relative / value - fading * rate / value**2
                parts[1] = parts[1] + fading / value
                if end == "tx":  # of one transmitter, for all receivers
                    parts = [_row_of(part.sum(axis=0), tx, self.radar.num_tx) for part in parts]
                for name, part in zip(Motion._fields, leg.reverse(Distance(*parts)), strict=True):
                    own = getattr(out, f"{end}_{name}")
                    own += part
        self._add_gain(out, parameters, total)
        return out

    def _pairs(self, parameters: PathParameters, tx: int) -> _Pairs:
        paths, time = self._paths, self._times[tx]
        out = Leg(_motion(parameters, "tx"), paths.world_from_tx.rotation, paths.tx_twist.angular, self._kept, time)
        home = Leg(_motion(parameters, "rx"), paths.world_from_rx.rotation, paths.rx_twist.angular, self._kept, time)
        if not all(np.all(leg.distance.value > 0.0) for leg in (out, home)):
            raise ParameterRangeError("parameters", "a path that ends at an antenna", "end points away from antennas")
        ends = Distance._make(part[[tx]] for part in out.distance), home.distance
        fading = self._kept.bends * sum(end.rate / end.value for end in ends)
        later = 1.0 + out.time * fading
        scale = self._gain(parameters) * later / (ends[0].value * ends[1].value)
        return _Pairs(out, home, scale, np.asarray(fading, dtype=np.float64), later)

    def _kept_bend(self, acceleration: Array) -> Array:
        """Return accelerations, 0 where a path of known velocities keeps to first order."""
        return np.where(self._kept.moves & ~self._kept.bends, 0.0, acceleration)

    def _fields(self, parameters: PathParameters, tx: int) -> Complex:
        """Return strengths with the factors of the channels, shape (num_rx, num_paths)."""
        return parameters.tx_factor[tx] * np.multiply.outer(parameters.rx_factor, parameters.strength)

    def _fields_change(self, parameters: PathParameters, change: PathParameters, tx: int) -> Complex:
        sent, heard, strength = parameters.tx_factor[tx], parameters.rx_factor[:, None], parameters.strength
        own = heard * (change.tx_factor[tx] * strength + sent * change.strength)
        return np.asarray(own + sent * change.rx_factor[:, None] * strength)

    def _add_fields(self, out: PathParameters, parameters: PathParameters, tx: int, gradient: Complex) -> None:
        sent, heard, strength = (np.conj(parameters[index]) for index in (12, 13, 0))
        out.strength[:] += sent[tx] * (heard @ gradient)
        out.tx_factor[tx] += heard @ gradient @ strength
        out.rx_factor[:] += sent[tx] * (gradient @ strength)

    def _centers(self, parameters: PathParameters) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return vectors from the array centres to the ends, in the radar frames, and the rotations of these."""
        turns = self._paths.world_from_tx.rotation, self._paths.world_from_rx.rotation
        vectors = parameters.tx_point - parameters.tx_origin, parameters.rx_point - parameters.rx_origin
        return (vectors[0] @ turns[0], vectors[1] @ turns[1]), turns

    def _gain(self, parameters: PathParameters) -> Array:
        """Return the root of power and gains of the antennas [sqrt(W)], shape (num_paths,)."""
        pattern, (there, back) = self.radar.array.pattern, self._centers(parameters)[0]
        power = dbm_to_watt(self.radar.front_end.tx_power_dbm)
        return np.asarray(np.sqrt(power) * field_gain(pattern, there) * field_gain(pattern, back))

    def _gain_slopes(self, parameters: PathParameters) -> list[Array]:
        """Return the derivatives of the gain's logarithm to the vectors to both ends, (num_paths, 3) [1/m, world]."""
        vectors, turns = self._centers(parameters)
        pattern = self.radar.array.pattern
        return [field_gain_slope(pattern, vector) @ turn.T for vector, turn in zip(vectors, turns, strict=True)]

    def _gain_change(self, parameters: PathParameters, change: PathParameters) -> Array:
        there, back = self._gain_slopes(parameters)
        total = np.einsum("pi,pi->p", there, change.tx_point - change.tx_origin)
        return np.asarray(total + np.einsum("pi,pi->p", back, change.rx_point - change.rx_origin))

    def _add_gain(self, out: PathParameters, parameters: PathParameters, gradient: Array) -> None:
        there, back = (slope * gradient[:, None] for slope in self._gain_slopes(parameters))
        for point, origin, part in ((1, 8, there), (2, 9, back)):
            out[point][:] += part
            out[origin][:] -= part.sum(axis=0)

    def _check(self, parameters: PathParameters) -> None:
        for name, value, own in zip(parameters._fields, parameters, self.start, strict=True):
            if np.shape(value) != own.shape:
                raise ParameterRangeError(f"parameters.{name}", f"of shape {np.shape(value)}", f"shape {own.shape}")


def _motion(parameters: PathParameters, end: str) -> Motion:
    return Motion._make(getattr(parameters, f"{end}_{name}") for name in Motion._fields)


def _row_of(values: Array, row: int, count: int) -> Array:
    out = np.zeros((count, len(values)))
    out[row] = values
    return out
