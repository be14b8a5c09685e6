"""Calibration: typed errors, convergence, identifiability, material entries, report and command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scarl_sionna.calibration import (
    CalibrationError,
    CalibrationProblem,
    ConvergenceError,
    ForwardModel,
    FreeParameter,
    Lobe,
    LobedTarget,
    RadarMap,
    RcsPattern,
    SlabMeasurement,
    UnusedParameterError,
    calibrate,
    save_materials,
    write_report,
)
from scarl_sionna.calibration.spec import SceneGeometry
from scarl_sionna.cli import app
from scarl_sionna.core.errors import MaterialRangeError, ParameterRangeError, SceneError, SpecError, UnknownNameError
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.scene.materials.rough import sigma0
from scarl_sionna.scene.materials.table import UnknownMaterialError, load_materials
from tests.calibration_street import RADAR, TARGETS, noisy, street

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ANGLES = tuple(np.linspace(0.0, 75.0, 16))
PERMITTIVITY = FreeParameter(name="asphalt.relative_permittivity", lower=1.5, upper=9.0)
CONDUCTIVITY = FreeParameter(name="asphalt.conductivity", lower=0.0, upper=8.0)


def bench(name: str = "bench", **changes: object) -> SlabMeasurement:
    start = {"material": "asphalt", "angle_deg": ANGLES, "values": (-10.0,) * 16, "noise": 0.3}
    return SlabMeasurement(**{"name": name, **start, **changes})


def simulated(problem: CalibrationProblem, truth: list[float], seed: int = 0) -> CalibrationProblem:
    """Return the problem with data of the model and noise."""
    model = ForwardModel(problem)
    noisy(model, np.array(truth), np.random.default_rng(seed))
    return problem.with_(measurements=[item.spec.with_(values=tuple(item.data.tolist())) for item in model.channels])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": None}, "noise"),
        ({"noise": -0.1}, "noise"),
        ({"noise": (0.1, 0.2)}, "noise"),
        ({"values": (float("nan"),) * 16}, "finite"),
        ({"values": (float("inf"),) * 16}, "finite"),
        ({"angle_deg": (0.0, 10.0)}, "angle_deg"),
        ({"angle_deg": 90.0}, "angle_deg"),
        ({"values_imag": (0.0,) * 16}, "values_imag"),
        ({"form": "complex"}, "values_imag"),
    ],
)
def test_bad_measurements(changes: dict, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        bench(**changes)


def test_the_solver_of_a_scene_looks_for_what_that_of_frames_does() -> None:
    frames = SionnaSettings()
    for name in ("max_depth", "num_samples", "refraction"):
        assert SceneGeometry.model_fields[name].default == getattr(frames, name), name


def test_reversed_bounds_and_half_a_prior() -> None:
    with pytest.raises(ParameterRangeError, match="lower < upper.*5 and 2"):
        FreeParameter(name="asphalt.conductivity", lower=5.0, upper=2.0)
    with pytest.raises(ParameterRangeError, match="prior_std"):
        FreeParameter(name="asphalt.conductivity", lower=0.0, upper=2.0, prior_mean=1.0)
    with pytest.raises(ParameterRangeError, match="0 to 1"):
        calibrate(
            CalibrationProblem(
                parameters=[FreeParameter(name="asphalt.scattering_coefficient", lower=0.0, upper=2.0)],
                measurements=[bench()],
            )
        )


def test_unknown_names_list_what_there_is() -> None:
    with pytest.raises(UnknownMaterialError, match="asphalt"):
        ForwardModel(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench(material="asfalt")]))
    for name, error, hint in (
        ("asfalt.conductivity", UnknownMaterialError, "did you mean 'asphalt'"),
        ("asphalt.permitivity", UnknownNameError, "relative_permittivity"),
        ("bench.offset", UnknownNameError, "gain_db"),
        ("car.peak", UnknownNameError, "side.peak_dbsm"),
        ("cart.gloss", UnknownNameError, "did you mean 'car'"),
    ):
        free = FreeParameter(name=name, lower=0.0, upper=1.0)
        target = LobedTarget(floor_dbsm=0.0, lobes={"side": Lobe(center_deg=90, width_deg=20, peak_dbsm=10)})
        with pytest.raises(error, match=hint):
            ForwardModel(CalibrationProblem(parameters=[free], measurements=[bench()], targets={"car": target}))
    pattern = RcsPattern(name="cut", target="lorry", aspect_deg=(0.0,), values=(1.0,), noise=1.0)
    with pytest.raises(UnknownNameError, match="target 'lorry'"):
        ForwardModel(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench(), pattern]))


def test_frequency_out_of_the_entrys_range() -> None:
    with pytest.raises(MaterialRangeError, match="asphalt"):
        calibrate(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench(frequency=24e9)]))


def test_a_parameter_that_nothing_depends_on() -> None:
    wall = FreeParameter(name="brick.conductivity", lower=0.0, upper=2.0)
    with pytest.raises(UnusedParameterError, match=r"brick\.conductivity") as caught:
        calibrate(CalibrationProblem(parameters=[PERMITTIVITY, wall], measurements=[bench()]))
    assert caught.value.names == ["brick.conductivity"]
    crossed = FreeParameter(name="asphalt.xpd_coefficient", lower=0.0, upper=0.5)
    with pytest.raises(UnusedParameterError, match="xpd"):
        calibrate(CalibrationProblem(parameters=[PERMITTIVITY, crossed], measurements=[bench()]))


def test_problems_as_a_whole() -> None:
    with pytest.raises(ParameterRangeError, match="there twice"):
        CalibrationProblem(parameters=[PERMITTIVITY, PERMITTIVITY], measurements=[bench()])
    with pytest.raises(ParameterRangeError, match="not held out"):
        CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench(held_out=True)])


def test_maps_with_a_wrong_shape_nan_or_no_file(tmp_path: Path) -> None:
    scene = street(tmp_path)

    def problem(path: Path) -> CalibrationProblem:
        spec = RadarMap(
            name="map",
            scene=str(scene),
            position=(0, 0, 1),
            targets=TARGETS,
            radar=RADAR,
            noise=1e-9,
            file=str(path),
            num_samples=5000,
            max_depth=1,
        )
        return CalibrationProblem(parameters=[PERMITTIVITY], measurements=[spec])

    with pytest.raises(SceneError, match=r"numpy\.save"):
        ForwardModel(problem(tmp_path / "none.npy"))
    np.save(tmp_path / "short.npy", np.zeros((3, 1, 5), np.complex64))
    with pytest.raises(ParameterRangeError, match="shape"):
        ForwardModel(problem(tmp_path / "short.npy"))
    np.save(tmp_path / "nan.npy", np.full((3, 1, 128), np.nan, np.complex64))
    with pytest.raises(ParameterRangeError, match="NaN"):
        ForwardModel(problem(tmp_path / "nan.npy"))


def test_too_few_evaluations_is_said() -> None:
    problem = CalibrationProblem(
        parameters=[PERMITTIVITY, CONDUCTIVITY],
        measurements=[bench(), bench("tm", polarization="TM")],
        max_evaluations=1,
        num_starts=1,
    )
    result = calibrate(simulated(problem, [6.0, 3.0]))
    assert not result.converged and "max_evaluations" in result.reason
    with pytest.raises(ConvergenceError, match="max_evaluations"):
        result.require_converged()


def test_an_estimate_on_a_bound_is_said() -> None:
    narrow = PERMITTIVITY.with_(upper=4.0)
    problem = simulated(CalibrationProblem(parameters=[PERMITTIVITY], measurements=[bench()]), [6.0])
    result = calibrate(problem.with_(parameters=[narrow]))
    assert result.at_bound == ["asphalt.relative_permittivity"] and not result.converged and "bound" in result.reason


@pytest.mark.parametrize(
    ("optimizer", "start"), [("least_squares", 0.0), ("least_squares", 1.0), ("adam", 0.0), ("adam", 1.0)]
)
def test_a_search_may_start_on_a_bound_where_there_is_no_slope(optimizer: str, start: float) -> None:
    """The mirror reflection goes with sqrt(1 - S^2): flat at S = 0, and without a derivative at 1, where it ends."""
    free = FreeParameter(name="asphalt.scattering_coefficient", lower=0.0, upper=1.0, start=start)
    given = simulated(
        CalibrationProblem(parameters=[free], measurements=[bench()], num_starts=1, optimizer=optimizer), [0.6]
    )
    result = calibrate(given)
    if (optimizer, start) == ("adam", 1.0):  # Adam long remembers the first slope, some 250 times that at 0.6
        assert result.starts[0][1] > 10.0 * result.chi_square  # so another round finds it
    assert result.converged, result.reason
    assert result.values[0] == pytest.approx(0.6, abs=4.0 * result.std[0]) and result.std[0] < 0.05


def test_thickness_from_one_angle_has_several_minima() -> None:
    pane = FreeParameter(name="glass.thickness", lower=2e-3, upper=6e-3)
    one = bench(material="glass", angle_deg=0.0, values=(-8.0,), noise=0.1, form="power_db")
    result = calibrate(CalibrationProblem(parameters=[pane], measurements=[one], num_starts=12))
    assert not result.converged and "equally good" in result.reason and len(result.other_minima) >= 2


def test_planted_pair_is_flagged_and_a_prior_removes_it() -> None:
    """The gain of the instrument and the coherent share sqrt(1 - S^2) multiply the same power."""
    share = FreeParameter(name="asphalt.scattering_coefficient", lower=0.0, upper=0.9)
    gain = FreeParameter(name="bench.gain_db", lower=-5.0, upper=5.0)
    problem = simulated(
        CalibrationProblem(parameters=[PERMITTIVITY, share, gain], measurements=[bench()], num_starts=2),
        [4.0, 0.5, 0.0],
    )
    result = calibrate(problem)
    assert not result.converged
    (weak,) = result.weak
    assert set(weak.weights) == {"asphalt.scattering_coefficient", "bench.gain_db"}
    known = gain.with_(prior_mean=0.0, prior_std=0.05)
    fixed = calibrate(problem.with_(parameters=[PERMITTIVITY, share, known]))
    assert fixed.converged, fixed.reason
    assert fixed["asphalt.scattering_coefficient"] == pytest.approx(0.5, abs=3 * fixed.std[1])
    assert [set(item.weights) for item in fixed.weak] == [set(weak.weights)]  # by the data alone it still is


def test_backscatter_tells_scattering_and_cross_polarisation_apart() -> None:
    free = [
        FreeParameter(name=f"asphalt.{name}", lower=0.01, upper=0.95)
        for name in ("scattering_coefficient", "xpd_coefficient")
    ]
    specs = [bench(), bench("co", quantity="backscatter"), bench("cross", quantity="cross_backscatter")]
    result = calibrate(simulated(CalibrationProblem(parameters=free, measurements=specs), [0.35, 0.2]))
    assert result.converged and not result.weak
    np.testing.assert_allclose(result.values, [0.35, 0.2], atol=4.0 * result.std.max())


def test_roughness_from_two_frequencies() -> None:
    free = FreeParameter(name="concrete.roughness_rms", lower=0.0, upper=5e-4)
    frequency = tuple(np.repeat([28e9, 77e9], 8))
    spec = bench(material="concrete", frequency=frequency, angle_deg=tuple(np.tile(np.linspace(0, 70, 8), 2)))
    result = calibrate(simulated(CalibrationProblem(parameters=[free], measurements=[spec]), [2.5e-4]))
    assert result.converged and result.values[0] == pytest.approx(2.5e-4, abs=4.0 * result.std[0])


def test_frames_read_the_backscatter_that_was_calibrated(tmp_path: Path) -> None:
    """The saved entry has, by the frames' law, what the bench measured; one of reflections alone keeps its albedo."""
    free = FreeParameter(name="asphalt.roughness_rms", lower=1e-5, upper=4e-4)
    specs = [bench("co", quantity="backscatter", angle_deg=(30.0, 50.0, 70.0), values=(-20.0,) * 3, noise=0.05)]
    problem = simulated(CalibrationProblem(parameters=[free], measurements=specs), [2e-4])
    entry = load_materials([save_materials(calibrate(problem), tmp_path / "mine.toml")])["asphalt"]
    frames = sigma0(entry, 77e9, np.radians([60.0, 40.0, 20.0]), "VV")
    np.testing.assert_allclose(10.0 * np.log10(frames), problem.measurements[0].values, atol=0.2)
    mirror = simulated(CalibrationProblem(parameters=[free], measurements=[bench()]), [2e-4])
    kept = load_materials([save_materials(calibrate(mirror), tmp_path / "other.toml")])["asphalt"]
    assert kept.diffuse_albedo == load_materials()["asphalt"].diffuse_albedo


@pytest.mark.parametrize("material", ["asphalt", "grass", "concrete"])
def test_bench_scatters_as_frames_do(material: str) -> None:
    """An albedo that the entry states, of a rough surface or of a deep layer, is what the bench sees as well."""
    angles = (10.0, 40.0, 70.0)
    entry = load_materials()[material].with_(xpd_coefficient=0.2)
    free = [FreeParameter(name=f"{material}.xpd_coefficient", lower=0.0, upper=1.0)]
    for quantity, channel in (("backscatter", "VV"), ("cross_backscatter", "HV")):
        spec = bench("ground", material=material, quantity=quantity, angle_deg=angles, values=(0.0,) * 3, noise=0.1)
        model = ForwardModel(CalibrationProblem(parameters=free, measurements=[spec]))
        expected = 10.0 * np.log10(sigma0(entry, 77e9, np.radians(90.0 - np.array(angles)), channel))
        np.testing.assert_allclose(model.predict(model.channels[0], np.array([0.2])), expected, atol=1e-9)


def test_a_stated_albedo_tells_of_no_permittivity() -> None:
    spec = bench("ground", quantity="backscatter", angle_deg=(10.0, 40.0), values=(-10.0, -12.0), noise=0.1)
    problem = CalibrationProblem(parameters=[PERMITTIVITY], measurements=[spec])
    with pytest.raises(UnusedParameterError, match="states its albedo"):
        calibrate(problem)
    with pytest.raises(SpecError, match="no phase of its own"):
        spec.with_(form="complex", values_imag=(0.0, 0.0))


def test_entry_is_saved_and_loaded(tmp_path: Path) -> None:
    problem = CalibrationProblem(
        parameters=[PERMITTIVITY, CONDUCTIVITY],
        measurements=[bench(), bench("tm", polarization="TM")],
        source='a "bench"',
    )
    result = calibrate(simulated(problem, [4.3, 2.0]))
    entry = load_materials([save_materials(result, tmp_path / "mine.toml")])["asphalt"]
    assert entry.relative_permittivity == result["asphalt.relative_permittivity"]
    assert entry.conductivity == result["asphalt.conductivity"]
    assert entry.roughness_rms == load_materials()["asphalt"].roughness_rms
    assert (
        'calibrated: a "bench"' in entry.source
        and "relative_permittivity 4." in entry.uncertainty
        and "+-" in entry.uncertainty
    )
    gain_only = CalibrationProblem(
        parameters=[FreeParameter(name="bench.gain_db", lower=-40, upper=40)], measurements=[bench()]
    )
    with pytest.raises(CalibrationError, match="no parameter of a material"):
        save_materials(calibrate(gain_only), tmp_path / "none.toml")


def test_command_writes_the_report(tmp_path: Path) -> None:
    out = tmp_path / "report"
    done = CliRunner().invoke(app, ["calibrate", str(EXAMPLES / "calibration_rexolite.yaml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "rexolite.relative_permittivity" in done.output and "held out" in done.output
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64") == 5 and 'src="http' not in page
    numbers = json.loads((out / "estimate.json").read_text())
    assert numbers["converged"] and numbers["measurements"]["S11"]["num_values"] == 23
    assert "rexolite" in load_materials([out / "materials.toml"])


def test_command_says_what_is_wrong(tmp_path: Path) -> None:
    out = ["--out", str(tmp_path / "report")]
    undetermined = CliRunner().invoke(app, ["calibrate", str(EXAMPLES / "calibration_drywall.yaml"), *out])
    assert undetermined.exit_code == 1 and "not converged" in undetermined.output
    assert "Not identified" in (tmp_path / "report" / "report.html").read_text()
    for text, message in (
        ("[1, 2", "not a valid YAML"),
        ("just words", "no calibration problem"),
        ("parameters: []\nmeasurements: []", "parameters"),
        ("measurements: [{kind: slab, table: none.csv}]", "cannot be read"),
    ):
        bad = tmp_path / "bad.yaml"
        bad.write_text(text)
        done = CliRunner().invoke(app, ["calibrate", str(bad), *out])
        assert done.exit_code == 2 and message in done.output, done.output
    assert CliRunner().invoke(app, ["calibrate", str(tmp_path / "none.yaml"), *out]).exit_code == 2


def test_report_of_an_undetermined_estimate_has_no_infinities(tmp_path: Path) -> None:
    free = [
        FreeParameter(name="bench.gain_db", lower=-40, upper=40),
        FreeParameter(name="asphalt.scattering_coefficient", lower=0, upper=0.9),
    ]
    write_report(calibrate(CalibrationProblem(parameters=free, measurements=[bench()], num_starts=1)), tmp_path)
    assert "Infinity" not in (tmp_path / "estimate.json").read_text()


def test_the_example_of_the_documentation_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (EXAMPLES.parent / "docs" / "calibration.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(page.split("```python\n")[1].split("```")[0], names)
    assert names["result"].converged and names["result"].p_value > 0.01
    assert names["table"]["asphalt"].relative_permittivity == names["result"]["asphalt.relative_permittivity"]
    text = page.split("```yaml\n")[1].split("```")[0]
    (tmp_path / "problem.yaml").write_text(text)
    problem = CalibrationProblem.load(tmp_path / "problem.yaml")
    assert problem.measurements[0].kind == "map" and problem.measurements[0].radar.num_samples == 128


def test_car_study_without_its_prior_is_flagged() -> None:
    problem = CalibrationProblem.load(EXAMPLES / "calibration_car_rcs.yaml")
    free = [
        item.with_(prior_mean=None, prior_std=None) if item.field == "side.width_deg" else item
        for item in problem.parameters
    ]
    result = calibrate(problem.with_(parameters=free))
    assert [name for item in result.weak for name in item.weights] == ["car.side.width_deg"] and not result.converged
    assert calibrate(problem).converged
