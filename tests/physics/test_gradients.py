"""Raw data as an operator: values against the plain sum, derivatives against differences, adjoints by dot products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.pattern import CosinePattern, IsotropicPattern, TablePattern, Tr38901Pattern
from scarl_sionna.core.units import SPEED_OF_LIGHT, VACUUM_PERMITTIVITY
from scarl_sionna.radar.gradients import BeatOperator, Body, BodyMotion, Columns, PathModel, PointModel, operator
from scarl_sionna.radar.synthesis import direct
from scarl_sionna.scene.materials.fresnel import halfspace_reflection, halfspace_reflection_slopes
from scarl_sionna.signal.antenna import field_gain, field_gain_slope

RADAR = ss.RadarSpec().with_(num_chirps=15, num_samples=32, bandwidth=150e6)
TOLERANCE = 1e-12
"""Of the raw data: differences over phases of 0.1 rad then show 1e-10 at best."""
BAR = 1e-6
"""Largest difference from central differences of fourth order, over the derivative."""
STEPS = (1.0, 0.1, 0.01)
"""Shares of a change of about 0.1 to 1 rad; the best of three has little truncation and little rounding."""


@pytest.fixture(params=["plain", "series"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways to the raw data: which one is cheaper does not count here."""
    monkeypatch.setattr(operator, "DIRECT_COST", np.inf if request.param == "series" else 0.0)
    return str(request.param)


def columns_of(radar: ss.RadarSpec, growth: float, num_paths: int = 6) -> Columns:
    rng, shape = np.random.default_rng(3), (radar.num_tx, radar.num_rx, num_paths)

    def about(low: float, high: float, spread: float) -> np.ndarray:
        return rng.uniform(low, high, num_paths) + rng.uniform(-spread, spread, shape)

    amplitude = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    return Columns(
        amplitude, about(20, 60, 0.01), about(-50, 50, 0.1), about(-5, 40, 0.1), growth * about(-0.5, 0.5, 0.1)
    )


def drawn(like: Any, rng: np.random.Generator, scales: dict[str, float]) -> Any:
    """Return a random change of columns or parameters."""
    values = {}
    for name, value in zip(like._fields, like, strict=True):
        values[name] = scales[name] * rng.standard_normal(value.shape)
        if np.iscomplexobj(value):
            values[name] = values[name] + 1j * scales[name] * rng.standard_normal(value.shape)
    return type(like)(**values)


def alone(change: Any, name: str) -> Any:
    return type(change)(*(v if n == name else np.zeros_like(v) for n, v in zip(change._fields, change, strict=True)))


def distance_from_differences(value: Callable[[Any], np.ndarray], at: Any, change: Any, slope: np.ndarray) -> float:
    """Return the least relative distance of a derivative from central differences of fourth order."""

    def moved(step: float) -> np.ndarray:
        return value(type(at)(*(own + step * more for own, more in zip(at, change, strict=True))))

    def numeric(h: float) -> np.ndarray:
        return (moved(-2 * h) - 8.0 * moved(-h) + 8.0 * moved(h) - moved(2 * h)) / (12.0 * h)

    return min(float(np.linalg.norm(numeric(h) - slope) / np.linalg.norm(slope)) for h in STEPS)


def dot_error(forward: np.ndarray, data: np.ndarray, change: Any, gradient: Any) -> float:
    """Return how far <J d, y> is from <d, J* y>, over it."""
    left = np.vdot(data, forward).real
    right = sum(np.vdot(own, more).real for own, more in zip(gradient, change, strict=True))
    return float(abs(left - right) / abs(left))


OF_COLUMNS = {"amplitude": 1.0, "length": 1e-4, "rate": 0.2, "acceleration": 500.0, "growth": 1.0}


@pytest.mark.parametrize("growth", [0.0, 3.0])
@pytest.mark.parametrize("tolerance", [1e-3, TOLERANCE])
def test_reverse_is_the_adjoint_of_forward(way: str, tolerance: float, growth: float) -> None:
    columns, rng = columns_of(RADAR, growth), np.random.default_rng(0)
    beat = BeatOperator(RADAR, tolerance)
    change, data = drawn(columns, rng, OF_COLUMNS), rng.standard_normal((2, *beat.shape))
    seen = data[0] + 1j * data[1]
    error = dot_error(beat.forward(columns, change), seen, change, beat.reverse(columns, seen))
    assert error < 1e-10  # both use the same transforms: rounding alone


@pytest.mark.parametrize("tx_counts", [(15, 32), (16, 33)], ids=["odd_even", "even_odd"])
def test_values_are_the_plain_sum(way: str, tx_counts: tuple[int, int]) -> None:
    radar = RADAR.with_(num_chirps=tx_counts[0], num_samples=tx_counts[1])
    columns, beat = columns_of(radar, 0.0), BeatOperator(radar, TOLERANCE)
    found = beat.value(columns)
    for tx in range(radar.num_tx):
        for rx in range(radar.num_rx):
            exact = direct.sum_paths(*(column[tx, rx] for column in columns[:4]), radar, tx)
            # what the expansion leaves of the bend: 4e-8 cycles of a delay that bends by 40 m/s2 over a long frame
            assert np.abs(found[rx, tx :: radar.num_tx] - exact).max() < 3e-9 * np.abs(exact).max()


@pytest.mark.some(6)
@pytest.mark.parametrize("name", OF_COLUMNS)
@pytest.mark.parametrize("growth", [0.0, 3.0])
def test_derivatives_to_columns(way: str, growth: float, name: str) -> None:
    columns, beat = columns_of(RADAR, growth), BeatOperator(RADAR, TOLERANCE)
    change = alone(drawn(columns, np.random.default_rng(1), OF_COLUMNS), name)
    assert distance_from_differences(beat.value, columns, change, beat.forward(columns, change)) < BAR


OF_PATHS = {
    "strength": 1e-3,
    "tx_point": 1e-4,
    "rx_point": 1e-4,
    "tx_velocity": 0.2,
    "rx_velocity": 0.2,
    "inner_length": 1e-4,
    "inner_rate": 0.2,
    "inner_acceleration": 500.0,
    "tx_origin": 1e-4,
    "rx_origin": 1e-4,
    "tx_array": 1e-4,
    "rx_array": 1e-4,
    "tx_factor": 1.0,
    "rx_factor": 1.0,
}


def street(turns: bool = False, linear: bool = False) -> ss.RadarPaths:
    """Return paths of points that cross in front of a radar that may turn; one of unknown velocity if it does not."""
    rng = np.random.default_rng(5)
    place = np.column_stack([rng.uniform(12, 28, 5), rng.uniform(-8, 8, 5), rng.uniform(-1, 2, 5)])
    twist = ss.Twist([8.0, 0.5, 0.0], [0.0, 0.0, 0.6 * turns])
    mount = ss.Mount(ss.Pose([0.3, -0.2, 0.6], [np.cos(0.1), 0.0, 0.0, np.sin(0.1)]), twist)
    paths = ss.point_targets(place, rng.uniform(-12, 12, (5, 3)), rng.uniform(0.1, 5.0, 5), RADAR, mount)
    columns = {name: np.array(getattr(paths, name)) for name in ("tx_velocity", "rx_velocity")}
    if not turns:
        columns["rx_velocity"][4] = np.nan
    fields = {name: getattr(paths, name) for name in paths.__dataclass_fields__}
    return ss.RadarPaths(**(fields | columns | {"linear_motion": np.arange(5) < 2 * linear}))


@pytest.mark.some(8)
@pytest.mark.parametrize(("turns", "linear"), [(False, True), (True, False)], ids=["kept", "turning"])
@pytest.mark.parametrize("name", OF_PATHS)
def test_derivatives_through_the_path_list(name: str, turns: bool, linear: bool) -> None:
    model = PathModel(RADAR, street(turns, linear), TOLERANCE)
    change = alone(drawn(model.start, np.random.default_rng(2), OF_PATHS), name)
    assert distance_from_differences(model.value, model.start, change, model.forward(model.start, change)) < BAR


@pytest.mark.parametrize(("turns", "linear"), [(False, True), (True, False)], ids=["kept", "turning"])
def test_adjoint_through_the_path_list(turns: bool, linear: bool) -> None:
    model, rng = PathModel(RADAR, street(turns, linear)), np.random.default_rng(4)
    start, change = model.start, drawn(model.start, rng, OF_PATHS)
    data = rng.standard_normal((2, *model.operator.shape))
    seen = data[0] + 1j * data[1]
    assert dot_error(model.forward(start, change), seen, change, model.reverse(start, seen)) < 1e-10


@pytest.mark.parametrize(("turns", "linear"), [(False, True), (True, False)], ids=["kept", "turning"])
def test_values_are_those_of_synthesize(turns: bool, linear: bool) -> None:
    paths = street(turns, linear)
    default = ss.synthesize(paths, RADAR, accuracy=ss.Accuracy(motion_tolerance=1e-9), method="direct")
    kept = PathModel(RADAR, paths).value(PathModel(RADAR, paths).start)
    assert np.abs(kept - default).max() < 1e-3 * np.abs(default).max()  # gains are those of the frame's start
    radar = RADAR.with_(pattern=IsotropicPattern())
    exact = ss.synthesize(paths, radar, accuracy=ss.Accuracy(motion_tolerance=1e-9), method="direct")
    found = PathModel(radar, paths).value(PathModel(radar, paths).start)
    # third derivative of the length: 60 m/s3 over half a frame of 0.5 ms is 2e-8 rad; what is left is complex64
    assert np.abs(found - exact).max() < 3e-6 * np.abs(exact).max()


@pytest.mark.parametrize(
    "pattern",
    [
        IsotropicPattern(gain_dbi=3.0),
        CosinePattern(),
        Tr38901Pattern(),
        TablePattern(
            azimuth_deg=(-60, 0, 60),
            azimuth_gain_dbi=(0, 9, 1),
            elevation_deg=(-30, 5, 30),
            elevation_gain_dbi=(2, 9, 0),
        ),
    ],
    ids=lambda pattern: pattern.kind,
)
def test_slopes_of_antenna_patterns(pattern: Any) -> None:
    rng = np.random.default_rng(0)
    vectors = np.column_stack([rng.uniform(5, 9, 40), rng.uniform(-6, 6, 40), rng.uniform(-4, 4, 40)])
    step = 1e-5 * rng.standard_normal(vectors.shape)
    numeric = np.log(field_gain(pattern, vectors + step) / field_gain(pattern, vectors - step))
    assert np.allclose(numeric, 2.0 * np.einsum("pi,pi->p", step, field_gain_slope(pattern, vectors)), atol=1e-12)


@pytest.mark.parametrize(
    ("radar", "words"),
    [
        (RADAR.with_(waveform=ss.Ofdm()), "linear FMCW"),
        (RADAR.with_(chirp_jitter=1e-6), "chirp_jitter"),
        (RADAR.with_(num_chirps=16).with_(multiplexing=ss.Ddm()), "tdm"),
        (RADAR.with_(dc_offset_dbm=-60.0), "front_end.ideal"),
    ],
    ids=["ofdm", "jitter", "ddm", "front_end"],
)
def test_radars_without_derivatives_are_refused(radar: ss.RadarSpec, words: str) -> None:
    with pytest.raises(ParameterRangeError, match=words):
        BeatOperator(radar)


def test_bad_columns_and_parameters_are_refused() -> None:
    columns, beat = columns_of(RADAR, 0.0), BeatOperator(RADAR)
    with pytest.raises(ParameterRangeError, match="unambiguous range"):
        beat.value(columns._replace(length=columns.length + 2.0 * RADAR.max_range))
    with pytest.raises(ParameterRangeError, match="NaN"):
        beat.value(columns._replace(rate=columns.rate * np.nan))
    with pytest.raises(ParameterRangeError, match="of shape"):
        beat.reverse(columns, np.zeros(3))
    model = PathModel(RADAR, street())
    with pytest.raises(ParameterRangeError, match="rx_array"):
        model.value(model.start._replace(rx_array=np.zeros((2, 3))))
    with pytest.raises(ParameterRangeError, match="tolerance"):
        BeatOperator(RADAR, 1e-20)


def test_no_path_gives_no_signal() -> None:
    model = PathModel(RADAR, ss.RadarPaths.empty(ss.Pose()))
    assert not model.value(model.start).any()
    assert model.reverse(model.start, np.ones(model.operator.shape)).tx_array.shape == (RADAR.num_tx, 3)


OF_POINTS = {
    "position": 1e-4,
    "velocity": 0.2,
    "rcs": 0.1,
    "reflection": 0.3,
    "radar_position": 1e-4,
    "radar_velocity": 0.2,
    "tx_array": 1e-4,
    "rx_array": 1e-4,
    "tx_gain_db": 1.0,
    "tx_phase_deg": 5.0,
    "rx_gain_db": 1.0,
    "rx_phase_deg": 5.0,
}


def point_model(radar: ss.RadarSpec = RADAR) -> PointModel:
    rng = np.random.default_rng(6)
    place = np.column_stack([rng.uniform(12, 28, 4), rng.uniform(-8, 8, 4), rng.uniform(-1, 2, 4)])
    mount = ss.Mount(ss.Pose([0.3, -0.2, 0.6], [np.cos(0.1), 0.0, 0.0, np.sin(0.1)]), ss.Twist([5.0, 0.0, 0.0]))
    return PointModel(radar, mount, place, rng.uniform(-12, 12, (4, 3)), rng.uniform(0.5, 5.0, 4), TOLERANCE)


@pytest.mark.some(5)
@pytest.mark.parametrize("name", OF_POINTS)
def test_derivatives_of_point_targets(name: str) -> None:
    model = point_model()
    change = alone(drawn(model.start, np.random.default_rng(7), OF_POINTS), name)
    assert distance_from_differences(model.value, model.start, change, model.forward(model.start, change)) < BAR


def test_points_are_those_of_point_targets_and_their_adjoint_holds() -> None:
    radar = RADAR.with_(pattern=IsotropicPattern())  # gains of another pattern are those of the frame's start
    model, rng = point_model(radar), np.random.default_rng(8)
    points, place = model.start, ss.Mount(ss.Pose([0.3, -0.2, 0.6], [np.cos(0.1), 0.0, 0.0, np.sin(0.1)]))
    errors = ss.ChannelErrors(rx_gain_db=(0.0, 1.0, 0.0, 0.0), tx_phase_deg=(0.0, 0.0, 30.0))
    moved = points.changed(radar_velocity=0.0, rx_gain_db=errors.rx_gain_db, tx_phase_deg=errors.tx_phase_deg)
    paths = ss.point_targets(points.position, points.velocity, points.rcs, radar, place)
    exact = ss.synthesize(paths, radar.with_(channels=errors), accuracy=ss.Accuracy(motion_tolerance=1e-9))
    # complex64, and the default tolerance of 1e-4 of the transforms, which the plain sum of few paths does not use
    assert np.abs(model.value(moved) - exact).max() < 1e-5 * np.abs(exact).max()
    change, data = drawn(points, rng, OF_POINTS), rng.standard_normal((2, *exact.shape))
    seen = data[0] + 1j * data[1]
    assert dot_error(model.forward(points, change), seen, change, model.reverse(points, seen)) < 1e-10


def test_body_moves_its_points() -> None:
    body, rng = Body(np.random.default_rng(0).uniform(-2, 2, (6, 3))), np.random.default_rng(1)
    motion = BodyMotion(np.array([20.0, 2.0, 0.0]), np.array(0.4), np.array([8.0, -1.0, 0.0]), np.array(0.5))
    scales = dict.fromkeys(BodyMotion._fields, 1e-2)
    change, seen = drawn(motion, rng, scales), (rng.standard_normal((6, 3)), rng.standard_normal((6, 3)))
    slope = np.stack(body.forward(motion, change))
    assert distance_from_differences(lambda at: np.stack(body.value(at)), motion, change, slope) < 1e-8
    assert dot_error(slope, np.stack(seen), change, body.reverse(motion, *seen)) < 1e-12


@pytest.mark.parametrize("name", ["permittivity", "conductivity"])
def test_material_of_a_reflection(name: str) -> None:
    """Two-ray ground: paths by the image of the target carry the ground's coefficient; its material changes."""
    cosine, frequency = np.array([0.06]), RADAR.wavelength**-1 * SPEED_OF_LIGHT
    loss = -1j / (2.0 * np.pi * frequency * VACUUM_PERMITTIVITY)
    paths = ss.point_targets([[20.0, 0.0, 0.5]], [[-8.0, 0.0, 0.0]], 2.0, RADAR, ss.Pose([0.0, 0.0, 0.6]))
    image = replace(paths, rx_point=paths.rx_point * [1, 1, -1])
    model = PathModel(RADAR, image, TOLERANCE)
    ground = np.array([3.2, 0.4])

    def value(at: tuple[np.ndarray, ...]) -> np.ndarray:
        te = halfspace_reflection(at[0][0] + loss * at[0][1], cosine)[0]
        return model.value(model.start.changed(strength=model.start.strength * te))

    to_complex = {"permittivity": 1.0, "conductivity": loss}[name]
    slope = halfspace_reflection_slopes(complex(ground[0] + loss * ground[1]), cosine)[0] * to_complex
    start = model.start.changed(strength=model.start.strength)
    change = model.start.zeros().changed(strength=model.start.strength * slope)
    step = np.array([name == "permittivity", name == "conductivity"], dtype=float)

    def moved(h: float) -> np.ndarray:
        return value((ground + h * step,))

    h = 1e-2
    numeric = (moved(-2 * h) - 8.0 * moved(-h) + 8.0 * moved(h) - moved(2 * h)) / (12.0 * h)
    analytic = model.forward(start, change)
    assert np.linalg.norm(numeric - analytic) < BAR * np.linalg.norm(analytic)


@pytest.mark.parametrize("cosine", [0.05, 0.5, 1.0])
def test_slopes_of_reflection_coefficients(cosine: float) -> None:
    for at, way in ((3.2 - 0.5j, 1.0), (6.0 - 2.0j, -1j)):
        ahead, behind = (halfspace_reflection(at + s * 1e-5 * way, cosine) for s in (1, -1))
        for found, high, low in zip(halfspace_reflection_slopes(at, cosine), ahead, behind, strict=True):
            assert np.isclose(found * way, (high - low) / 2e-5, rtol=1e-8)


def test_points_without_an_echo_are_refused() -> None:
    with pytest.raises(ParameterRangeError, match="rcs"):
        PointModel(RADAR, ss.Pose(), [[20.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 0.0)
