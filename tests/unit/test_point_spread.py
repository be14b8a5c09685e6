"""Point-spread tables: what is accepted, files of both kinds, and errors that name what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import InputFileError, OutputError, SpecError

OFFSET = np.linspace(-2.0, 2.0, 41)
LOBE = np.sinc(OFFSET)
PHASE = np.exp(0.3j * OFFSET)
SPREAD = ss.PointSpread.of_arrays(OFFSET, LOBE * PHASE, (3.0 * OFFSET, LOBE), (10.0 * OFFSET, LOBE**2))


def test_factors_multiply_to_the_table() -> None:
    assert SPREAD.axes == ("range", "velocity", "azimuth") and SPREAD.shape == (41, 41, 41)
    assert np.allclose(SPREAD.values[10, 20, 30], LOBE[10] * PHASE[10] * LOBE[20] * LOBE[30] ** 2)
    assert np.allclose(SPREAD.offsets[2], np.sin(np.radians(10.0 * OFFSET)))
    whole = ss.PointSpread.of_arrays(OFFSET, SPREAD.values, (3.0 * OFFSET, ()), (10.0 * OFFSET, ()))
    assert not whole.is_separable and np.array_equal(whole.values, SPREAD.values)


def test_sheared_factors_give_the_table_that_they_stand_for(tmp_path) -> None:
    lobe = np.exp(-0.5 * (OFFSET / 0.5) ** 2)
    sheared = ss.PointSpread.of_arrays(OFFSET, lobe, (OFFSET, lobe), range_per_velocity=0.25)
    exact = np.exp(-0.5 * ((OFFSET[:, None] + 0.25 * OFFSET) / 0.5) ** 2) * lobe
    inside = np.abs(OFFSET[:, None] + 0.25 * OFFSET) <= 2.0
    assert np.allclose(sheared.values, np.where(inside, exact, 0.0), atol=1e-4)
    assert ss.read_point_spread(ss.write_point_spread(sheared, tmp_path / "sheared.npz")) == sheared
    with pytest.raises(SpecError, match="factors over range and velocity only"):
        ss.PointSpread.of_arrays(OFFSET, LOBE, range_per_velocity=0.25)


def test_a_table_too_large_is_refused_before_it_takes_memory() -> None:
    axis = np.linspace(-1.0, 1.0, 201)
    with pytest.raises(SpecError, match=r"201 x 201 x 201 = 8120601 values.*at most 4000000"):
        ss.PointSpread.of_arrays(axis, np.broadcast_to(1.0, (201, 201, 201)), (axis, ()), (axis, ()))


@pytest.mark.parametrize("whole", [False, True])
def test_npz_files_give_the_table_again(tmp_path, whole) -> None:
    spread = SPREAD
    if whole:
        offsets = OFFSET, (3.0 * OFFSET, ()), (10.0 * OFFSET, ())
        spread = ss.PointSpread.of_arrays(offsets[0], SPREAD.values, *offsets[1:], azimuth_scale="angle")
    file = ss.write_point_spread(spread, tmp_path / "radar.npz")
    assert ss.read_point_spread(file) == spread
    with pytest.raises(OutputError, match="cannot be written"):
        ss.write_point_spread(spread, tmp_path / "no" / "radar.npz")


def csv(name: str, phase: bool = True, unit: str = "") -> str:
    level = 20.0 * np.log10(np.maximum(np.abs(LOBE), 1e-6))
    angle = np.degrees(np.angle(LOBE * PHASE))
    head = f"{name}{unit},level_db" + (",phase_deg" if phase else "")
    rows = (f"{a:.6f},{b:.6f}" + (f",{c:.6f}" if phase else "") for a, b, c in zip(OFFSET, level, angle, strict=True))
    return "\n".join([head, *rows])


def test_a_folder_of_csv_files_is_read(tmp_path) -> None:
    (tmp_path / "range.csv").write_text(csv("range_offset_m"))
    (tmp_path / "velocity.csv").write_text(csv("velocity_offset_mps"))
    found = ss.read_point_spread(tmp_path)
    assert found.kind == "amplitude" and found.axes == ("range", "velocity")
    assert np.allclose(found.factors[0], LOBE * PHASE, atol=2e-6)
    for name in ("range", "velocity"):
        (tmp_path / f"{name}.csv").write_text(csv({"range": "range_offset_m"}.get(name, "velocity_offset_mps"), False))
    power = ss.read_point_spread(tmp_path, interpolation="linear")
    assert power.kind == "power" and power.interpolation == "linear"
    assert np.allclose(power.factors[0], LOBE**2, atol=1e-5)
    (tmp_path / "velocity.csv").write_text(csv("velocity_offset_mps"))
    with pytest.raises(InputFileError, match="phase_deg in some tables only"):
        ss.read_point_spread(tmp_path)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"range_offset": tuple(OFFSET[::-1])}, "strictly rising"),
        ({"range_offset": tuple(OFFSET + 5.0)}, "from below 0 to above 0"),
        ({"range_offset": (float("nan"), *OFFSET[1:])}, "range_offset"),
        ({"range_offset": tuple(OFFSET[1:])}, "range_response of 40 values, not 41"),
        ({"range_response": tuple((value, float("inf")) for value in LOBE)}, "range_response"),
        ({"range_response": tuple((0.5 * value, 0.0) for value in LOBE)}, "peak, 1, at offset 0: it has 0.5 there"),
        ({"range_response": tuple((value, 0.0) for value in np.sinc(OFFSET - 1.0))}, "peak, 1, at offset 0"),
        ({"range_response": tuple((20.0 * value, 0.0) for value in LOBE)}, "at most 1"),
        ({"kind": "power"}, "of powers: real, at least 0"),
        ({"azimuth_offset_deg": tuple(60.0 * OFFSET)}, "within -90 to 90 deg"),
        ({"response": ((1.0, 0.0),)}, "either response, or range_response"),
        ({"velocity_offset": ()}, "velocity_response of 0 values, not 41"),
    ],
)
def test_bad_tables_are_refused(change, match) -> None:
    with pytest.raises(SpecError, match=match):
        SPREAD.with_(**change)


@pytest.mark.parametrize(
    ("arrays", "match"),
    [
        ({"range_offset_cm": OFFSET, "range_response": LOBE}, "range_offset_cm is not read; give range_offset_m"),
        ({"range_response": LOBE}, "range_offset_m is missing"),
        ({"range_offset_m": OFFSET, "response": np.ones((41, 2))}, r"shape \(41, 2\), its axes \(41,\)"),
        ({"range_offset_m": OFFSET[None], "range_response": LOBE}, "has 2 axes, not one"),
        ({"range_offset_m": OFFSET, "range_response": LOBE, "color": OFFSET}, "color is not read"),
    ],
)
def test_bad_files_are_refused(tmp_path, arrays, match) -> None:
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(InputFileError, match=match):
        ss.read_point_spread(tmp_path / "bad.npz")


def test_files_that_are_none_are_refused(tmp_path) -> None:
    (tmp_path / "text.npz").write_text("no archive")
    for name in ("text.npz", "missing.npz"):
        with pytest.raises(InputFileError, match=name):
            ss.read_point_spread(tmp_path / name)
    np.savez(tmp_path / "nan.npz", range_offset_m=OFFSET, range_response=np.where(OFFSET == 2.0, np.nan, LOBE))
    with pytest.raises(SpecError, match="range_response"):
        ss.read_point_spread(tmp_path / "nan.npz")
    (tmp_path / "range.csv").write_text(csv("range_offset", unit="_km"))
    with pytest.raises(InputFileError, match=r"range_offset_km is not read; give range_offset_m"):
        ss.read_point_spread(tmp_path)
    (tmp_path / "range.csv").write_text("range_offset_m,level_db\n0.0,high\n")
    with pytest.raises(InputFileError, match="line 2 holds 'high'"):
        ss.read_point_spread(tmp_path)


def test_map_axes_rise_and_are_not_too_many() -> None:
    with pytest.raises(SpecError, match="range strictly rising"):
        ss.MapAxes(range=(1.0, 1.0))
    with pytest.raises(SpecError, match="azimuth_deg within"):
        ss.MapAxes(range=(1.0,), azimuth_deg=(-100.0, 0.0))
    with pytest.raises(SpecError, match="at most 100000000 cells"):
        ss.MapAxes(range=tuple(range(20000)), radial_velocity=tuple(range(20000)))
