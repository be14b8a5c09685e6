"""What SCaRL's post-processing does to ideal returns (section 2.2): drop-out, range noise and velocity noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.receiver import ScarlReceiver

from .returns import Echoes

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Slots:
    """Places for the returns of a scan.

    Attributes
    ----------
    number : int
        Of all places, taken or not: shots times returns a shot.
    taken : ndarray of int, shape (num_returns,)
        Which one each return takes.
    """

    number: int
    taken: npt.NDArray[np.integer]


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


def receive(receiver: ScarlReceiver, slots: Slots, returns: Echoes, rng: np.random.Generator) -> Received:
    r"""Apply drop-out and noise to ideal returns.

    Parameters
    ----------
    receiver : ScarlReceiver
        A zero in `drop_out_intensity`, `range_noise_variance_per_metre` or `velocity_noise_std` switches that effect
        off exactly.
    slots : Slots
    returns : Echoes
        Ideal ones; distance [m], radial velocity [m/s] and intensity [relative] are looked at.
    rng : numpy.random.Generator
        Gives every effect a stream of its own with one draw a slot, so that neither switching an effect nor a return
        more or less changes the noise of the others.

    Returns
    -------
    Received

    Notes
    -----
    Drop-out: kept with probability :math:`P = 1 - e^{-I / I_0}` with :math:`I_0` = `drop_out_intensity`, independently;
    the number kept has mean :math:`\sum P` and variance :math:`\sum P (1 - P)`.
    Distance: normal, mean d, variance `range_noise_variance_per_metre` * d; a negative outcome, which takes noise as
    large as the distance itself, becomes 0. Radial velocity: normal, mean v_r, standard deviation `velocity_noise_std`.

    References
    ----------
    .. [1] A. Nittur Ramesh, A. Correas-Serrano, M. Gonzalez-Huici, "SCaRL - A Synthetic Multi-Modal Dataset for
       Autonomous Driving", section 2.2: annihilation by intensity, AWGN with variance proportional to distance.
    """
    seeds = rng.integers(2**63, size=3)  # always drawn: the streams do not depend on what is switched on
    drop_out, range_noise, velocity_noise = (np.random.Generator(np.random.PCG64(int(seed))) for seed in seeds)

    kept = np.arange(returns.number)
    if receiver.drop_out_intensity > 0.0:
        probability = -np.expm1(-returns.intensity / receiver.drop_out_intensity)
        kept = np.flatnonzero(drop_out.random(slots.number)[slots.taken] < probability)
    measured_distance = returns.distance[kept]
    if receiver.range_noise_variance_per_metre > 0.0:
        std = np.sqrt(receiver.range_noise_variance_per_metre * measured_distance)
        measured_distance = measured_distance + std * range_noise.standard_normal(slots.number)[slots.taken[kept]]
        measured_distance = np.maximum(measured_distance, 0.0)
    measured_velocity = returns.radial_velocity[kept]
    if receiver.velocity_noise_std > 0.0:
        noise = velocity_noise.standard_normal(slots.number)[slots.taken[kept]]
        measured_velocity = measured_velocity + receiver.velocity_noise_std * noise
    return Received(kept, measured_distance, measured_velocity)
