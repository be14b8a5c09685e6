"""Parts of the tracker that Stone Soup makes: filter, association, initiation, deletion."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.stats
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator, SimpleMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.base import ReversibleModel
from stonesoup.models.measurement.nonlinear import CartesianToBearingRangeRate2D
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.angle import Bearing
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater

Array = npt.NDArray[np.float64]

EPOCH = datetime(2000, 1, 1, tzinfo=timezone.utc)
"""Time 0: the library counts in dates, to a microsecond."""
ORDER = [0, 2, 1, 3]
"""Rows of x, y, vx, vy in the library's state x, vx, y, vy."""


class Motion(NamedTuple):
    """What is assumed of objects, and when a track begins and ends; see :func:`ss.track`."""

    acceleration: float
    initial_speed: float
    gate: float
    confirm: int
    max_missed: int


class RadarModel(CartesianToBearingRangeRate2D, ReversibleModel):  # type: ignore[misc]  # the library has no types
    """Bearing, range and range rate over ground plan, from a moving sensor.

    Exact geometry. The library's model of three dimensions has the inverse, that of two has not.
    """

    def inverse_function(self, detection: Detection, **_: object) -> StateVector:
        """Return the state (x, vx, y, vy) of an object without motion across the line of sight."""
        bearing, distance, rate = (float(value) for value in detection.state_vector)
        ahead = np.array([np.cos(bearing), np.sin(bearing)])
        state = np.zeros(4)
        state[list(self.mapping)] = np.ravel(self.translation_offset) + distance * ahead
        own = np.ravel(self.velocity)
        state[list(self.velocity_mapping)] = (own @ ahead + rate) * ahead
        return StateVector(state)


class Parts(NamedTuple):
    """The parts of a tracker."""

    associator: GNNWith2DAssignment
    updater: ExtendedKalmanUpdater
    deleter: UpdateTimeStepsDeleter
    initiator: MultiMeasurementInitiator | SimpleMeasurementInitiator


def parts(motion: Motion) -> Parts:
    """Return filter, association, deletion and initiation; global nearest neighbour by Mahalanobis distance.

    References
    ----------
    .. [1] Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
       ch. 6.2 (motion), 10.3 (extended filter).
    .. [2] S. Blackman, R. Popoli, *Design and Analysis of Modern Tracking Systems*, 1999, ch. 6 (association).
    """
    moves = CombinedLinearGaussianTransitionModel([ConstantVelocity(motion.acceleration)] * 2)
    updater = ExtendedKalmanUpdater()
    limit = float(np.sqrt(scipy.stats.chi2.ppf(motion.gate, 3)))
    near = DistanceHypothesiser(KalmanPredictor(moves), updater, Mahalanobis(), missed_distance=limit)
    associator = GNNWith2DAssignment(near)
    deleter = UpdateTimeStepsDeleter(motion.max_missed + 1)
    speed = motion.initial_speed**2
    prior = GaussianState(np.zeros((4, 1)), np.diag([0.0, speed, 0.0, speed]))
    begin = SimpleMeasurementInitiator(prior)
    if motion.confirm > 1:  # the other holds tracks until the next frame at least
        begin = MultiMeasurementInitiator(
            prior,
            deleter=deleter,
            data_associator=associator,
            updater=updater,
            min_points=motion.confirm,
            initiator=begin,
        )
    return Parts(associator, updater, deleter, begin)


def stamp(time: float) -> datetime:
    """Return a time [s] as a date; by definition."""
    return EPOCH + timedelta(seconds=time)


def measurement(time: float, value: Array, deviation: Array, sensor: tuple[Array, Array], row: int) -> Detection:
    """Return a measured bearing [rad], range [m] and range rate [m/s], shape (3,), with its standard deviations.

    `sensor` is the sensor's position [m] and velocity [m/s] over ground, each (2,). By definition.
    """
    model = RadarModel(
        ndim_state=4,
        mapping=(0, 2),
        velocity_mapping=(1, 3),
        noise_covar=np.diag(deviation**2),
        translation_offset=StateVector(sensor[0]),
        velocity=StateVector(sensor[1]),
    )
    vector = StateVector([Bearing(value[0]), value[1], value[2]])
    return Detection(vector, timestamp=stamp(time), measurement_model=model, metadata={"cluster": row})
