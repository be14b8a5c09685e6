"""All methods for directions: exact without noise, against the Cramer-Rao bound, and what they resolve."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.direction.manifold import Manifold
from scarl_sionna.signal.direction.several import METHODS, Method, pursue
from scarl_sionna.signal.direction.subspace import esprit, most_directions, music, smoothed, subarray
from scarl_sionna.signal.processing import virtual_cube
from tests.oracles.directions import direction_bound

LINE = RadarSpec().with_(num_chirps=32, num_samples=64)
HALF = 0.5 * LINE.wavelength
GRID = Manifold.of(LINE, np.arcsin(np.linspace(-1.0, 1.0, 65)), None)
PLACES = GRID.positions[:, 1] / LINE.wavelength
WIDTH = 0.886 / 6.0
"""Beamwidth at half the power of twelve elements half a wavelength apart, as a sine."""


def draws(count: int, apart: float, snr_db: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return snapshots of targets in noise of power 1, their sines and amplitudes; SNR after beamforming."""
    rng = np.random.default_rng(seed)
    first = rng.uniform(-0.6, 0.3, count)
    sines = np.stack([first, first + apart * WIDTH], axis=1)[:, : 2 if apart else 1]
    amplitude = np.sqrt(10.0 ** (snr_db / 10.0) / 12.0) * np.exp(2j * np.pi * rng.random(sines.shape))
    noise = np.sqrt(0.5) * (rng.normal(size=(count, 12)) + 1j * rng.normal(size=(count, 12)))
    beams = np.exp(-2j * np.pi * sines[:, :, None] * PLACES)
    return np.einsum("nk,nkc->nc", amplitude, beams) + noise, sines, amplitude


@pytest.mark.parametrize(("method", "least"), [("relax", 0.95), ("music", 0.95), ("esprit", 0.95), ("omp", 0.85)])
def test_two_targets_are_resolved_and_errors_are_near_the_bound(method: Method, least: float) -> None:
    """From the issue: 1.5 beamwidths apart at 20 dB, in 95 %. The likelihood's maximum is at the bound, others above.

    Smoothing costs a third of the aperture: standard deviations up to 1.5 of the bound.
    """
    count = 150
    snapshot, true, amplitude = draws(count, 1.5, 20.0, 4)
    found = pursue(GRID, snapshot, np.full(count, np.inf), 1.0, 3, method)
    ratios, errors = [], []
    for draw in range(count):
        sines = np.sort(found.sines[found.cell == draw, 0])
        if len(sines) == 2 and (np.abs(sines - true[draw]) < 0.5 * WIDTH).all():
            bound = direction_bound(PLACES, true[draw], amplitude[draw], 1.0)
            ratios.append((sines - true[draw]) ** 2 / bound)
            errors.append((sines - true[draw]) / np.sqrt(bound))
    assert len(ratios) >= least * count
    spread = np.sqrt(np.mean(ratios))
    scatter = 5.0 / np.sqrt(2.0 * 2.0 * len(ratios))  # five sigma of a standard deviation of so many errors
    highest = {"relax": 1.0, "music": 1.5, "esprit": 1.3, "omp": 1.7}[method]
    assert 1.0 - scatter < spread < highest + scatter
    if method != "omp":  # which leaves each target where the other one drew it
        assert np.abs(np.mean(errors, axis=0)).max() < 5.0 * highest / np.sqrt(len(errors))


@pytest.mark.parametrize("method", METHODS)
def test_a_lone_target_has_one_direction_near_the_bound(method: Method) -> None:
    count = 300
    snapshot, true, amplitude = draws(count, 0.0, 25.0, 6)
    found = pursue(GRID, snapshot, np.full(count, np.inf), 1.0, 3, method)
    assert len(found.cell) <= count + 3  # one false direction in a thousand
    first = found.sines[np.unique(found.cell, return_index=True)[1], 0]
    bound = direction_bound(PLACES, np.zeros(1), amplitude[0, :1], 1.0)[0]
    spread = np.sqrt(np.mean((first - true[:, 0]) ** 2) / bound)
    # 300 errors: sigma 4 %; subspaces of two thirds of the aperture lose up to a quarter
    assert 0.8 < spread < (1.5 if method in ("music", "esprit") else 1.2)


@pytest.mark.parametrize("kind", [music, esprit])
@pytest.mark.parametrize("count", [1, 2, 4])
def test_subspaces_are_exact_without_noise(kind: object, count: int) -> None:
    """Coherent targets, since there is one snapshot: smoothing alone makes as many dimensions as directions."""
    true = np.sort(np.random.default_rng(count).uniform(-2.5, 2.5, (20, count)), axis=1)
    true[:, 1:] += 0.3 * np.arange(1, count)
    snapshot = np.exp(1j * true[:, :, None] * np.arange(12)).sum(axis=1)
    _, vectors = np.linalg.eigh(smoothed(snapshot))
    assert callable(kind)
    found = np.sort(np.mod(kind(vectors, count) + np.pi, 2.0 * np.pi), axis=1)
    assert found == pytest.approx(np.sort(np.mod(true + np.pi, 2.0 * np.pi), axis=1), abs=1e-5)


def test_subarrays_tell_no_more_directions_than_they_can() -> None:
    assert [subarray(count) for count in (3, 4, 8, 12)] == [2, 3, 6, 8]
    assert [most_directions(count) for count in (3, 4, 8, 12)] == [1, 2, 5, 7]


def test_methods_that_an_array_does_not_allow_are_refused() -> None:
    sparse = LINE.with_(tx_positions=((0, 0, 0),), rx_positions=tuple((0, HALF * i, 0) for i in (0, 1, 4, 6)))
    pair = LINE.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0), (0, HALF, 0)))
    for radar in (sparse, pair):
        rda = range_doppler_angle(np.ones((radar.num_virtual, 32, 64), np.complex64), radar)
        for method in ("music", "esprit"):
            with pytest.raises(ParameterRangeError, match="no uniform line"):
                detect(rda, direction=method)
    with pytest.raises(ParameterRangeError, match="'capon'"):
        detect(rda, direction="capon")


@pytest.mark.parametrize("method", METHODS)
def test_detection_gives_a_point_for_each_of_two_targets_in_a_cell(method: Method) -> None:
    azimuth = np.radians([-12.0, 18.0])
    places = 14.3 * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(2)], axis=1)
    paths = point_targets(places, np.zeros((2, 3)), [1.0, 2.0], LINE, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, LINE, rng=np.random.default_rng(1)), LINE), LINE)
    points = detect(rda, direction=method)
    near = np.flatnonzero(np.abs(points.range - 14.3) < 0.5 * LINE.range_resolution)
    order = near[np.argsort(points.azimuth[near])]
    if method in ("omp", "bartlett"):  # where the other target draws them to, and what is left there
        away = np.abs(np.degrees(points.azimuth[near])[:, None] - [-12.0, 18.0])
        assert len(near) >= 2 and (away.min(axis=0) < 2.0).all()
        return
    assert np.degrees(points.azimuth[order]) == pytest.approx([-12.0, 18.0], abs=0.5)
    assert points.rcs[order] == pytest.approx([1.0, 2.0], rel=0.15)
