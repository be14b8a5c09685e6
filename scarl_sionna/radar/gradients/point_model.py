"""Raw data as a function of point targets, of where the radar is, and of its antennas and channels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.signal.link import spreading

from .operator import DEFAULT_TOLERANCE
from .path_model import PathModel, PathParameters

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_PER_DB, _PER_DEG = np.log(10.0) / 20.0, 1j * np.pi / 180.0
"""Derivatives of the logarithm of a field to a gain in dB and to a phase in degrees."""


class PointParameters(NamedTuple):
    """What the raw data of point targets depends on; also a change of it, and a gradient to it.

    Attributes
    ----------
    position, velocity : ndarray of float64, shape (num_points, 3)
        [m], [m/s], world.
    rcs : ndarray of float64, shape (num_points,)
        [m2].
    reflection : ndarray of complex128, shape (num_points,)
        What else a point's field is multiplied with: the coefficient of a surface on its way, an unknown phase.
    radar_position, radar_velocity : ndarray of float64, shape (3,)
        [m], [m/s], world.
    tx_array, rx_array : ndarray of float64, shape (num_tx, 3) and (num_rx, 3)
        Antennas [m, radar frame].
    tx_gain_db, tx_phase_deg : ndarray of float64, shape (num_tx,)
        Of each transmitter [dB], [deg], as in :class:`scarl_sionna.ChannelErrors`.
    rx_gain_db, rx_phase_deg : ndarray of float64, shape (num_rx,)
        Of each receiver [dB], [deg].
    """

    position: Array
    velocity: Array
    rcs: Array
    reflection: Complex
    radar_position: Array
    radar_velocity: Array
    tx_array: Array
    rx_array: Array
    tx_gain_db: Array
    tx_phase_deg: Array
    rx_gain_db: Array
    rx_phase_deg: Array

    def changed(self, **values: npt.ArrayLike) -> PointParameters:
        """Return a copy with some values, broadcast to their shapes."""
        out = {name: np.empty_like(getattr(self, name)) for name in values}
        for name, value in values.items():
            out[name][...] = value
        return self._replace(**out)

    def zeros(self) -> PointParameters:
        """Return zeros of the same shapes: a change of nothing."""
        return PointParameters._make(np.zeros_like(value) for value in self)


class PointModel:
    r"""Raw data of linear FMCW as a function of point targets, the radar's place, antennas and channels.

    Parameters
    ----------
    radar : RadarSpec
        As of :class:`BeatOperator`.
    mount : Mount or Pose
        Of the radar at the frame's start. Its orientation and rotation do not vary.
    positions, velocities : array_like of float, shape (num_points, 3)
        [m], [m/s], world: where the parameters start.
    rcs : array_like of float, shape (num_points,)
        [m2], > 0. A scalar holds for all.
    tolerance : float
        Largest error of the transforms over the peak of the raw data.

    Raises
    ------
    ParameterRangeError
        As :func:`scarl_sionna.point_targets` and :class:`BeatOperator`; if an RCS is not positive (the field is its
        root, which has no derivative at 0).
    """

    def __init__(
        self,
        radar: RadarSpec,
        mount: Mount | Pose,
        positions: npt.ArrayLike,
        velocities: npt.ArrayLike,
        rcs: npt.ArrayLike,
        tolerance: float = DEFAULT_TOLERANCE,
    ) -> None:
        place = Mount.of(mount)
        points = point_targets(positions, velocities, rcs, radar, place)
        self.of_paths, self.radar = PathModel(radar, points, tolerance), radar
        zeros = [np.zeros(radar.num_tx)] * 2 + [np.zeros(radar.num_rx)] * 2
        columns = (
            np.asarray(positions, dtype=np.float64),
            np.asarray(velocities, dtype=np.float64),
            np.broadcast_to(np.asarray(rcs, dtype=np.float64), (points.num_paths,)),
            np.ones(points.num_paths, dtype=np.complex128),
            place.pose.position,
            place.twist.linear,
            radar.tx_array,
            radar.rx_array,
            *zeros,
        )
        self.start = PointParameters._make(np.array(column) for column in columns)
        self.paths(self.start)

    parameters = PointParameters
    """What :meth:`value` takes."""

    def value(self, parameters: PointParameters) -> Complex:
        """Return the raw data [sqrt(W)], complex128 of shape (num_rx, num_chirps_total, num_samples)."""
        return self.of_paths.value(self.paths(parameters))

    def forward(self, parameters: PointParameters, change: PointParameters) -> Complex:
        """Return how the raw data changes, to first order, with a change of the parameters."""
        return self.of_paths.forward(self.paths(parameters), self.paths_forward(parameters, change))

    def reverse(self, parameters: PointParameters, gradient: npt.ArrayLike) -> PointParameters:
        """Return the gradient to the parameters from that to the raw data: the adjoint of :meth:`forward`."""
        return self.paths_reverse(parameters, self.of_paths.reverse(self.paths(parameters), gradient))

    def paths(self, parameters: PointParameters) -> PathParameters:
        """Return the path list of the points."""
        if not np.all(parameters.rcs > 0.0):
            raise ParameterRangeError("rcs", f"{np.min(parameters.rcs):g} m2", "> 0", "leave such points out")
        relative = parameters.velocity - parameters.radar_velocity
        return self.of_paths.start._replace(
            strength=self._unit * np.sqrt(parameters.rcs) * parameters.reflection,
            tx_point=parameters.position,
            rx_point=parameters.position,
            tx_velocity=relative,
            rx_velocity=relative,
            tx_origin=parameters.radar_position,
            rx_origin=parameters.radar_position,
            tx_array=parameters.tx_array,
            rx_array=parameters.rx_array,
            tx_factor=np.exp(_PER_DB * parameters.tx_gain_db + _PER_DEG * parameters.tx_phase_deg),
            rx_factor=np.exp(_PER_DB * parameters.rx_gain_db + _PER_DEG * parameters.rx_phase_deg),
        )

    def paths_forward(self, parameters: PointParameters, change: PointParameters) -> PathParameters:
        """Return how the path list changes with the parameters, to first order."""
        paths = self.paths(parameters)
        root = self._unit * np.sqrt(parameters.rcs)
        relative = change.velocity - change.radar_velocity
        return paths.zeros()._replace(
            strength=root * change.reflection + 0.5 * paths.strength / parameters.rcs * change.rcs,
            tx_point=change.position,
            rx_point=change.position,
            tx_velocity=relative,
            rx_velocity=relative,
            tx_origin=change.radar_position,
            rx_origin=change.radar_position,
            tx_array=change.tx_array,
            rx_array=change.rx_array,
            tx_factor=paths.tx_factor * (_PER_DB * change.tx_gain_db + _PER_DEG * change.tx_phase_deg),
            rx_factor=paths.rx_factor * (_PER_DB * change.rx_gain_db + _PER_DEG * change.rx_phase_deg),
        )

    def paths_reverse(self, parameters: PointParameters, gradient: PathParameters) -> PointParameters:
        """Return the adjoint of :meth:`paths_forward`."""
        paths = self.paths(parameters)
        velocity = gradient.tx_velocity + gradient.rx_velocity
        sent, heard = np.conj(paths.tx_factor) * gradient.tx_factor, np.conj(paths.rx_factor) * gradient.rx_factor
        return PointParameters(
            position=gradient.tx_point + gradient.rx_point,
            velocity=velocity,
            rcs=0.5 * (np.conj(paths.strength) * gradient.strength).real / parameters.rcs,
            reflection=self._unit * np.sqrt(parameters.rcs) * gradient.strength,
            radar_position=gradient.tx_origin + gradient.rx_origin,
            radar_velocity=-velocity.sum(axis=0),
            tx_array=gradient.tx_array,
            rx_array=gradient.rx_array,
            tx_gain_db=_PER_DB * sent.real,
            tx_phase_deg=(np.conj(_PER_DEG) * sent).real,
            rx_gain_db=_PER_DB * heard.real,
            rx_phase_deg=(np.conj(_PER_DEG) * heard).real,
        )

    @property
    def _unit(self) -> float:
        """Strength of 1 m2 [m2], by :func:`~scarl_sionna.signal.link.spreading`."""
        return float(spreading(self.radar.wavelength, 1.0, 1.0) / np.sqrt(4.0 * np.pi))
