"""What SCaRL's post-processing does to ideal returns (section 2.2): drop-out, range noise and velocity noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar_receiver import ScarlReceiver

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Received:
    """Returns after the receiver.

    Attributes
    ----------
    kept : ndarray of int64, shape (num_kept,)
        Rows of the ideal returns that were detected, rising.
    distance : ndarray of float64, shape (num_kept,)
        Measured [m].
    radial_velocity : ndarray of float64, shape (num_kept,)
        Measured [m/s].
    """

    kept: npt.NDArray[np.int64]
    distance: Array
    radial_velocity: Array


def receive(
    receiver: ScarlReceiver,
    num_slots: int,
    slot: npt.NDArray[np.integer],
    distance: Array,
    radial_velocity: Array,
    intensity: Array,
    rng: np.random.Generator,
) -> Received:
    r"""Apply drop-out and noise to ideal returns.

    Parameters
    ----------
    receiver : ScarlReceiver
        A zero in `drop_out_intensity`, `range_noise_variance_per_metre` or `velocity_noise_std` switches that effect off exactly.
    num_slots : int
        Places for returns of the scan, taken or not: shots times returns a shot.
    slot : ndarray of int, shape (num_returns,)
        Which one each return takes.
    distance, radial_velocity, intensity : ndarray of float64, shape (num_returns,)
        Ideal values [m], [m/s], [relative].
    rng : numpy.random.Generator
        Gives every effect a stream of its own with one draw a slot, so that neither switching an effect nor a return more or
        less changes the noise of the others.

    Returns
    -------
    Received

    Notes
    -----
    Drop-out: kept with probability :math:`P = 1 - e^{-I / I_0}` with :math:`I_0` = `drop_out_intensity`, independently; the number
    kept has mean :math:`\sum P` and variance :math:`\sum P (1 - P)`.
    Distance: normal, mean d, variance `range_noise_variance_per_metre` * d; a negative outcome, which takes noise as large as the
    distance itself, becomes 0. Radial velocity: normal, mean v_r, standard deviation `velocity_noise_std`.

    References
    ----------
    .. [1] A. Nittur Ramesh, A. Correas-Serrano, M. Gonzalez-Huici, "SCaRL - A Synthetic Multi-Modal Dataset for Autonomous
       Driving", section 2.2: annihilation by intensity, AWGN with variance proportional to distance.
    """
    seeds = rng.integers(2**63, size=3)  # always drawn: the streams do not depend on what is switched on
    drop_out, range_noise, velocity_noise = (np.random.Generator(np.random.PCG64(int(seed))) for seed in seeds)

    kept = np.arange(distance.shape[0])
    if receiver.drop_out_intensity > 0.0:
        probability = -np.expm1(-intensity / receiver.drop_out_intensity)
        kept = np.flatnonzero(drop_out.random(num_slots)[slot] < probability)
    measured_distance = distance[kept]
    if receiver.range_noise_variance_per_metre > 0.0:
        std = np.sqrt(receiver.range_noise_variance_per_metre * measured_distance)
        measured_distance = measured_distance + std * range_noise.standard_normal(num_slots)[slot[kept]]
        measured_distance = np.maximum(measured_distance, 0.0)
    measured_velocity = radial_velocity[kept]
    if receiver.velocity_noise_std > 0.0:
        noise = velocity_noise.standard_normal(num_slots)[slot[kept]]
        measured_velocity = measured_velocity + receiver.velocity_noise_std * noise
    return Received(kept, measured_distance, measured_velocity)
