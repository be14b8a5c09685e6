"""Two targets at one range and velocity, told apart by the array from a single snapshot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.labels.labels import label_points
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.direction.manifold import Manifold
from scarl_sionna.signal.direction.several import pursue
from scarl_sionna.signal.processing import virtual_cube

LINE = RadarSpec().with_(num_chirps=32, num_samples=64)
HALF = 0.5 * LINE.wavelength
SPARSE = LINE.with_(
    tx_positions=((0, 0, 0),), rx_positions=tuple((0, HALF * place, 0) for place in (0, 1, 4, 10, 12, 17, 22, 25))
)
DRAWS = 200


def manifold(radar: RadarSpec) -> Manifold:
    return Manifold.of(radar, np.arcsin(np.linspace(-1.0, 1.0, 257)), None)


def beamwidth(radar: RadarSpec) -> float:
    """Width at half the power, measured on the array's own beam, as a sine."""
    grid = manifold(radar)
    sines = np.stack([np.linspace(0.0, 0.3, 3001), np.zeros(3001)], axis=1)
    start = grid.phasors(np.zeros((1, 2)), np.inf)
    power = grid.power(np.repeat(start, 3001, axis=0), sines, np.full(3001, np.inf))
    return float(2.0 * sines[np.argmax(power < 0.5), 0])


@pytest.mark.parametrize(("radar", "least"), [(LINE, 0.95), (SPARSE, 0.9)], ids=["line", "sparse"])
def test_two_targets_one_and_a_half_beamwidths_apart_are_resolved(radar: RadarSpec, least: float) -> None:
    """20 dB each after beamforming, any phases; resolved: two directions, each within half a beamwidth of its own.

    From the issue: 95 %, by one method; eight sparse elements have sidelobes of half the amplitude, which costs some.
    """
    rng, grid, width = np.random.default_rng(4), manifold(radar), beamwidth(radar)
    snapshots, places = [], []
    for _ in range(DRAWS):
        first = rng.uniform(-0.6, 0.6)
        true = np.array([[first, 0.0], [first + 1.5 * width, 0.0]])
        beams = grid.phasors(true, np.inf)
        noise = np.sqrt(0.5) * (rng.normal(size=radar.num_virtual) + 1j * rng.normal(size=radar.num_virtual))
        amplitude = np.sqrt(100.0 / radar.num_virtual) * np.exp(2j * np.pi * rng.random(2))
        snapshots.append(amplitude @ beams + noise)
        places.append(true[:, 0])
    found = pursue(grid, np.array(snapshots), np.full(DRAWS, np.inf), 1.0, 3)
    resolved = 0
    for draw, true in enumerate(places):
        sines = np.sort(found.sines[found.cell == draw, 0])
        resolved += len(sines) == 2 and bool((np.abs(sines - true) < 0.5 * width).all())
    assert resolved >= least * DRAWS


def test_one_target_stays_one_and_noise_makes_none() -> None:
    rng, grid = np.random.default_rng(5), manifold(LINE)
    beams = grid.phasors(np.stack([rng.uniform(-0.8, 0.8, 1000), np.zeros(1000)], axis=1), np.inf)
    noise = np.sqrt(0.5) * (rng.normal(size=beams.shape) + 1j * rng.normal(size=beams.shape))
    found = pursue(grid, 10.0 * beams + noise, np.full(1000, np.inf), 1.0, 3)
    # one false direction in a thousand cells on a grid of its own; refinement and finer grid find up to ten times more
    assert len(found.sines) <= 1010


def test_detection_gives_a_point_for_each_of_two_targets_in_a_cell() -> None:
    radar, azimuth = LINE, np.radians([-12.0, 18.0])
    places = 14.3 * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(2)], axis=1)
    paths = point_targets(places, np.zeros((2, 3)), [1.0, 2.0], radar, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(1)), radar), radar)
    points = detect(rda)
    near = np.flatnonzero(np.abs(points.range - 14.3) < 0.5 * radar.range_resolution)
    assert len(near) == 2
    order = near[np.argsort(points.azimuth[near])]
    assert np.degrees(points.azimuth[order]) == pytest.approx([-12.0, 18.0], abs=0.3)
    assert points.rcs[order] == pytest.approx([1.0, 2.0], rel=0.1)
    assert detect(rda, most_directions=1).num_points < points.num_points


def test_the_weaker_target_of_a_cell_has_its_own_label() -> None:
    """It stands in the first sidelobe of one that is 18 dB stronger, which the plain beam there sees better than it."""
    radar, sines = LINE, np.array([0.0, 1.43 * 2.0 / LINE.num_virtual])
    places = 14.3 * np.stack([np.sqrt(1.0 - sines**2), sines, np.zeros(2)], axis=1)
    paths = point_targets(places, np.zeros((2, 3)), [60.0, 1.0], radar, Pose())
    paths = replace(paths, instance=np.array([[7], [9]], dtype=np.int32))
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(1)), radar), radar)
    points = detect(rda)
    labels = label_points(points, paths, radar)
    for sine, instance in zip(sines, (7, 9), strict=True):
        row = np.abs(np.sin(points.azimuth) - sine).argmin()
        assert np.sin(points.azimuth[row]) == pytest.approx(sine, abs=0.02)
        assert labels.instance[row] == instance
        assert labels.explained[row] == pytest.approx(1.0, abs=0.3)
