"""Point spreads from maps of reflectors: planted responses are found again, and maps that show more are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import scarl_sionna as ss
from scarl_sionna.calibration.device import PointMap, PointSpreadFit, fit_point_spread
from scarl_sionna.calibration.errors import CalibrationError
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.signal.windows import window_values
from tests.closed_radars import RADAR, apart_db, points, processed

COUNT = 12


def places(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(8.0, 20.0, COUNT), rng.uniform(-40.0, 40.0, COUNT)


def reflector(distance: float, azimuth: float, rng: np.random.Generator | None, rcs: float = 10.0) -> PointMap:
    return PointMap.of(processed(points(distance, azimuth, 0.0, rcs * (distance / 10.0) ** 4), rng=rng))


@pytest.fixture(scope="module")
def maps() -> list[PointMap]:
    rng = np.random.default_rng(0)
    return [reflector(*where, rng) for where in zip(*places(0), strict=True)]


@pytest.fixture(scope="module")
def fit(maps) -> PointSpreadFit:
    return fit_point_spread(maps)


def true_power(axis: str, offset: np.ndarray) -> np.ndarray:
    """Return the response of the known radar to a point, by the transforms of its windows."""
    spread = ss.closed_radar_of(processed(points(10.0, 0.0)), 16, 64).spread
    number = spread.axes.index(axis)
    own = spread.offsets[number]
    return np.abs(CubicSpline(own, spread.factors[number])(np.clip(offset, own[0], own[-1]))) ** 2


@pytest.mark.parametrize(("axis", "bar_db"), [("range", 0.1), ("velocity", 0.05), ("azimuth", 0.3)])
def test_the_response_is_that_of_the_windows(fit, axis, bar_db) -> None:
    number = fit.spread.axes.index(axis)
    offset, found = fit.spread.offsets[number], fit.spread.factors[number].real
    true = true_power(axis, offset)
    lobe = true > 0.01
    assert lobe.sum() > (2 if axis == "velocity" else 6)  # at rest all velocities stand at the same place in a cell
    assert np.abs(10.0 * np.log10(found[lobe] / true[lobe])).max() < bar_db
    inner = np.abs(offset) < 0.6 * offset[-1]
    assert np.abs(found - true)[inner].max() < 8e-3


def test_places_are_those_of_the_reflectors(fit) -> None:
    distance, azimuth = places(0)
    assert np.abs(fit.places[:, 0] - distance).max() < 0.01 * RADAR.range_resolution
    assert np.abs(fit.places[:, 1]).max() < 0.01 * RADAR.velocity_resolution
    assert np.abs(fit.places[:, 2] - np.sin(np.radians(azimuth))).max() < 2e-3
    levels = fit.levels_db - fit.levels_db.mean()
    gain = [40.0 * np.log10(_gain(angle)) for angle in np.radians(azimuth)]
    assert np.allclose(levels, np.subtract(gain, np.mean(gain)), atol=0.1)


def _gain(azimuth: float) -> float:
    from scarl_sionna.signal.antenna import field_gain

    return float(field_gain(RADAR.array.pattern, np.array([np.cos(azimuth), np.sin(azimuth), 0.0])))


def test_a_held_out_map_is_predicted(fit) -> None:
    paths = points(14.37, -17.0, 0.0, 10.0)
    true = processed(paths)
    axes = ss.MapAxes.of_arrays(true.range, true.radial_velocity, true.azimuth)
    device = ss.ClosedRadarSpec(radar=RADAR, spread=fit.spread, axes=axes, compensates_motion=False, sine_period=2.0)
    assert apart_db(true, ss.map_of_paths(paths, device)) < -35.0
    assert fit.noise_power == pytest.approx(true.noise_power, rel=0.05)


def test_errors_are_as_large_as_the_noise_says() -> None:
    """Weaker reflectors: what the table is off by in its main lobe is a few of the standard deviations stated."""
    rng = np.random.default_rng(7)
    weak = [reflector(*where, rng, 0.02) for where in zip(*places(3), strict=True)]
    found = fit_point_spread(weak)
    assert all(-45.0 < floor < -25.0 for floor in found.floor_db[:1])
    offset, values = found.spread.offsets[0], found.spread.factors[0].real
    off = np.abs(values - true_power("range", offset))[true_power("range", offset) > 0.01]
    assert off.max() < 8.0 * 10.0 ** (found.floor_db[0] / 10.0) + 0.02
    assert found.spread.range_offset[-1] < 20.0  # sidelobes of Hann's below the noise are cut, not kept


def test_complex_maps_keep_their_phases() -> None:
    """Ramps bent by a quadratic phase over fast time: the planted response is complex, and told with its phases."""
    rng, out = np.random.default_rng(2), []
    fast = (np.arange(128) - 63.5) / 128.0
    bent = np.exp(8j * fast**2)
    for distance in (9.1, 10.37, 11.63, 12.9, 14.2, 15.46, 16.7, 18.0, 9.75, 10.99, 12.21, 13.43):
        adc = ss.synthesize(points(distance, 0.0, 0.0, 30.0), RADAR, rng=rng) * bent
        rd = ss.range_doppler(ss.virtual_cube(adc, RADAR), RADAR, compensate_motion=False)
        out.append(PointMap(rd.data[0][:, :, None], rd.range, rd.radial_velocity, np.zeros(1)))
    found = fit_point_spread(out).spread
    assert found.kind == "amplitude" and found.axes == ("range", "velocity")
    offset = found.offsets[0]
    cells = offset[np.abs(offset) < 3.0 * RADAR.range_resolution] / RADAR.range_resolution
    weights = window_values("hann", 128) * bent
    true = np.exp(-2j * np.pi * np.outer(cells, fast)) @ weights / weights.sum()
    values = found.factors[0][np.abs(offset) < 3.0 * RADAR.range_resolution]
    assert np.abs(values - true).max() < 0.06
    assert np.abs(np.abs(values) - true).max() > 0.2  # without the phases it would not be


def test_another_target_in_a_map_is_named(maps) -> None:
    both = points([12.0, 16.0], [0.0, 12.0], [0.0, 0.0], [10.0 * 1.2**4, 3.0 * 1.6**4])
    other = PointMap.of(processed(both, rng=np.random.default_rng(5)), "garage")
    with pytest.raises(
        CalibrationError, match=r"maps\[12\] \(garage\) has -\d\.\d dB of its peak at range 1[56]\.\d* m"
    ):
        fit_point_spread([*maps, other])


def test_a_response_that_depends_on_the_place_is_named(maps) -> None:
    near = maps[4]
    blurred = near.data.copy()
    blurred[:, :, 1:-1] = (near.data[:, :, :-2] + near.data[:, :, 1:-1] + near.data[:, :, 2:]) / 3.0
    blurred[:, :, 2:-2] = (blurred[:, :, :-4] + blurred[:, :, 2:-2] + blurred[:, :, 4:]) / 3.0
    with pytest.raises(CalibrationError, match=r"maps\[4\].*depends on the place"):
        fit_point_spread([*maps[:4], replace(near, data=blurred), *maps[5:]])


def test_saturated_weak_and_cut_peaks_are_refused(maps) -> None:
    item = maps[0]
    cut = replace(item, data=np.minimum(item.data, 0.5 * item.data.max()))
    with pytest.raises(CalibrationError, match="share the highest value: it is saturated"):
        fit_point_spread([*maps[1:], cut])
    rng = np.random.default_rng(0)
    weak = replace(item, data=rng.exponential(1.0, item.data.shape))
    with pytest.raises(CalibrationError, match=r"maps\[1\].*dB over the noise \(needed: 20 dB\)"):
        fit_point_spread([item, weak])
    first = int(np.argmax(item.data.max(axis=(0, 2))))
    with pytest.raises(CalibrationError, match="at an end of the axis over range"):
        fit_point_spread([item, replace(item, data=item.data[:, first:], range=item.range[first:])])


def test_one_map_is_not_enough_to_tell(maps) -> None:
    with pytest.warns(ScarlWarning, match="one map cannot tell sidelobes"):
        found = fit_point_spread(maps[:1])
    assert found.spread.shape[0] <= 65  # a value a cell: nothing is known between them


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"data": np.zeros((3, 3, 3))}, r"maps\[1\].data = of shape \(3, 3, 3\)"),
        ({"data": np.nan}, "NaN or infinity"),
        ({"data": -1.0}, "is it in dB"),
        ({"data": 1.0 + 1.0j}, "complex128"),
        ({"range": 2.0}, "axis of range = cells"),
        ({"range": -1.0}, "at least 5, rising"),
    ],
)
def test_maps_that_are_none_are_refused(maps, change, match) -> None:
    (name, value), good = next(iter(change.items())), maps[0]
    if name == "data":
        wrong = replace(good, data=value if np.ndim(value) else np.full(good.data.shape, value))
    else:
        wrong = replace(good, range=good.range * value)
    with pytest.raises(ParameterRangeError, match=match):
        fit_point_spread([good, wrong])
    with pytest.raises(ParameterRangeError, match="maps = none"):
        fit_point_spread([])
