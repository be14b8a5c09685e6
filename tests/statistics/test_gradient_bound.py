"""Pose and velocity of a car from its raw data by Gauss-Newton steps: at the Cramer-Rao bound."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.gradients import Body, BodyMotion, PointModel, PointParameters

RADAR = ss.RadarSpec().with_(num_chirps=24, num_samples=128, bandwidth=1e9)
PLACE = ss.Pose([0.0, 0.0, 0.5])
TRUTH = np.array([14.0, 2.5, 0.3, -8.0, 1.5])
"""Place x, y [m], yaw [rad], velocity x, y [m/s]."""
SPREAD = np.array([0.05, 0.05, 0.01, 0.1, 0.5])
"""How far from the truth a fit starts, as a coarse detection has it."""
CAR = Body([[2.1, 0.7, 0.1], [2.1, -0.7, 0.1], [0.2, 0.9, 0.3], [-1.9, 0.8, 0.2], [-2.0, -0.8, 0.4]])
RCS = np.array([4.0, 3.0, 1.0, 2.0, 2.0])
SNR = 10.0**1.5
"""Mean power of the car over that of the noise, in a sample: 15 dB."""
STEPS = 8
"""Most Gauss-Newton steps of a fit."""
ENOUGH = 1e-3
"""A fit ends when a step lowers the squared residual by less than this share of a sample's noise."""


class CarFit:
    """Pose, velocity and the unknown complex strength of every point of the car."""

    def __init__(self) -> None:
        self.model = PointModel(RADAR, PLACE, *CAR.value(motion_of(TRUTH)), RCS, 1e-8)

    def parameters(self, at: np.ndarray, strengths: np.ndarray) -> PointParameters:
        position, velocity = CAR.value(motion_of(at))
        return self.model.start._replace(position=position, velocity=velocity, reflection=strengths)

    def jacobian(self, at: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        """Return derivatives of the raw data, real parts over imaginary ones, a column an unknown."""
        point, columns = self.parameters(at, strengths), []
        for row in np.eye(len(at)):
            position, velocity = CAR.forward(motion_of(at), motion_of(row))
            change = point.zeros()._replace(position=position, velocity=velocity)
            columns.append(self.model.forward(point, change))
        for row in np.eye(len(strengths)):
            slope = self.model.forward(point, point.zeros()._replace(reflection=row.astype(complex)))
            columns += [slope, -1j * slope]  # the beat is the conjugate of the field
        stacked = np.stack([column.ravel() for column in columns], axis=1)
        return np.concatenate([stacked.real, stacked.imag])

    def gradient(self, at: np.ndarray, strengths: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the gradient of half the squared residual, by the adjoint."""
        back = self.model.reverse(self.parameters(at, strengths), residual)
        moved = CAR.reverse(motion_of(at), back.position, back.velocity)
        pose = [moved.place[0], moved.place[1], moved.yaw, moved.velocity[0], moved.velocity[1]]
        return np.concatenate([pose, np.stack([back.reflection.real, back.reflection.imag], axis=1).ravel()])

    def strengths(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the strengths that fit best at a pose: the raw data is linear in them."""
        point = self.parameters(at, np.ones(len(RCS), dtype=complex))
        rows = [point.zeros()._replace(reflection=row.astype(complex)) for row in np.eye(len(RCS))]
        columns = np.stack([self.model.forward(point, row).ravel() for row in rows], axis=1)
        return np.conj(np.linalg.lstsq(columns, data.ravel(), rcond=None)[0])

    def refine(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the pose and velocity that fit best, the strengths being the best for each."""
        strengths = self.strengths(data, at)
        residual = self.model.value(self.parameters(at, strengths)) - data
        for _ in range(STEPS):
            columns = self.jacobian(at, strengths)
            scale = np.linalg.norm(columns, axis=0)
            normal = (columns / scale).T @ (columns / scale)
            slope = self.gradient(at, strengths, residual)
            step = np.linalg.solve(normal, slope / scale) / scale
            before = np.sum(np.abs(residual) ** 2)
            for share in 0.5 ** np.arange(6):  # back until the residual is smaller
                new = at - share * step[: len(at)]
                turned = self.strengths(data, new)
                tried = self.model.value(self.parameters(new, turned)) - data
                if np.sum(np.abs(tried) ** 2) < before:
                    at, strengths, residual = new, turned, tried
                    break
            if slope @ step < ENOUGH * before / data.size:
                break
        return at


def motion_of(values: np.ndarray) -> BodyMotion:
    x, y, yaw, along, across = values
    return BodyMotion(np.array([x, y, 0.0]), np.array(yaw), np.array([along, across, 0.0]), np.zeros(()))


def errors_and_bound(num_draws: int) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of fits, shape (num_draws, 5), and the Cramer-Rao bounds of the five."""
    fit, rng = CarFit(), np.random.default_rng(11)
    strengths = np.exp(2j * np.pi * rng.random(len(RCS)))
    clean = fit.model.value(fit.parameters(TRUTH, strengths))
    noise = float(np.mean(np.abs(clean) ** 2)) / SNR
    columns = fit.jacobian(TRUTH, strengths)
    # complex white noise: Fisher information 2 / noise times Re J^H J
    bound = np.sqrt(np.diag(np.linalg.inv(2.0 / noise * columns.T @ columns)))[:5]
    errors = []
    for _ in range(num_draws):
        drawn = rng.standard_normal((2, *clean.shape)) * np.sqrt(noise / 2.0)
        start = TRUTH + SPREAD * rng.uniform(-1.0, 1.0, 5)
        errors.append(fit.refine(clean + drawn[0] + 1j * drawn[1], start) - TRUTH)
    return np.array(errors), bound


def test_a_fit_ends_within_the_bound() -> None:
    errors, bound = errors_and_bound(2)
    assert np.all(np.abs(errors) < 5.0 * bound)


@pytest.mark.slow
def test_pose_and_velocity_of_a_car_are_at_the_bound() -> None:
    errors, bound = errors_and_bound(100)
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / bound
    # issue 19: within 20 %; of 100 draws the root of the mean square is off by 1 / sqrt(200) = 7 % itself
    assert np.all(np.abs(ratio - 1.0) < 0.2), ratio
    assert np.all(np.abs(errors.mean(axis=0)) < 5.0 / np.sqrt(100) * bound)
