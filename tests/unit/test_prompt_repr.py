"""Every public object and result shows itself in at most 20 lines, without dumps of arrays."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.prompt.describe import MAX_LINES, MAX_WIDTH, array_text, quantity, text_table
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.radar.points import PointScatterers
from scarl_sionna.radio.sensor import Radio
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.materials.table import load_materials
from tests.drive import RADAR, drive
from tests.frames import RIG, make_frame
from tests.lane_scene import lane_scene

FLOATS = re.compile(r"[0-9.e+-]+(?:[, ]+[0-9.e+-]+){12,}")
"""More than twelve numbers in a row: an array, not facts."""

SPREAD = {"range_offset": (-1.0, 0.0, 1.0), "range_response": ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0))}
NEEDED = {
    "Amplifier": {"p1db_dbm": -8.0},
    "ClosedRadarSpec": {"spread": SPREAD, "axes": {"range": (0.0, 1.0)}},
    "GridPattern": {"azimuth_deg": (0.0, 1.0), "elevation_deg": (0.0, 1.0), "gain_dbi": ((0.0, 1.0), (0.0, 1.0))},
    "Interferer": {"radar": "awr1843boost"},
    "Leakage": {"length": 0.1, "level_db": -40.0},
    "PhaseNoise": {"mask": ((1e6, -95.0),)},
    "Radome": {"layers": ({"thickness": 3e-3, "relative_permittivity": 2.35},)},
    "RadomeLayer": {"thickness": 3e-3, "relative_permittivity": 2.35},
    "PointSpread": SPREAD,
    "RadioSpec": {"stations": ({"name": "mast"},)},
    "RadioStation": {"name": "mast"},
}
"""What specifications need that two numbers do not make."""


def _defaults() -> dict[str, Any]:
    """Return an object of every public specification that can be made without arguments."""
    made = {}
    for name in ss.__all__:
        kind = getattr(ss, name)
        if isinstance(kind, type) and hasattr(kind, "model_fields"):
            required = [key for key, info in kind.model_fields.items() if info.is_required()]
            made[name] = kind(**NEEDED.get(name, dict.fromkeys(required, (0.0, 1.0))))
    return made


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return an object of every public class, and of every class that a public function returns."""
    folder = tmp_path_factory.mktemp("prompt")
    world = ss.load_scene(lane_scene(folder / "scene"))
    state = world.at(1.0)
    source = drive(num_frames=1)
    frame = source.scenes[0].frames[0]
    radar_frame = next(iter(frame.radars.values()))
    paths = ss.point_targets([[20.0, 1.0, 0.0]] * 30, [[1.0, 0.0, 0.0]] * 30, 1.0, RADAR, ss.Pose())
    rda = ss.range_doppler_angle(radar_frame)
    rd = rda.range_doppler
    points = ss.detect(rda)
    model = ss.read_actor_model("saloon")
    shape = (1, 30, 40, 2, 2)
    scatterers = ss.ScattererModel(
        np.zeros((40, 3)), np.linspace(-1, 1, 30), np.zeros(1), np.ones(shape), 77e9, 0.1, 3.0
    )
    write_dataset(folder / "data", RIG.to_dict(), {"street": [make_frame(0), make_frame(1)]})
    dataset = ss.open_dataset(folder / "data")
    convert(source, "dca1000", folder / "captures")
    capture = ss.read_capture(next((folder / "captures").glob("*/*/adc_data.json")).parent, "dca1000")
    network = ss.RadarNetwork(RADAR, (ss.Pose(), ss.Pose([0, 1, 0])))
    extra = [
        network,
        ss.NetworkFrame(network, {(0, 0): radar_frame.adc}),
        world,
        state,
        state.mount("ego", ss.Pose([2.0, 0.0, 0.8])),
        world.parts,
        world.actors[0],
        world.instances[1],
        world.document,
        world.document.lanes,
        world.mesh(0),
        world.materials,
        state.cast([0, 0, 5], [[0, 0, -1.0]]),
        state.boxes()[0],
        frame,
        radar_frame,
        rd,
        rda,
        points,
        ss.cluster(points),
        ss.track([ss.cluster(points, min_points=1)], [0.0], ss.Pose(), confirm=1),
        paths,
        *frame.images.values(),
        *frame.lidars.values(),
        ss.radome_effect(RADAR.with_(radome=ss.Radome(**NEEDED["Radome"])), np.linspace(-1.0, 1.0, 30)),
        ss.label_paths(paths),
        ss.label_cells(rd, paths),
        ss.label_points(points, paths, RADAR),
        scatterers,
        scatterers.amplitude,
        model,
        ss.Pose([1, 2, 3]),
        ss.Twist(),
        ss.ActorPose(ss.Pose([1, 2, 3]), ss.Twist(), "saloon"),
        ss.Session(world, RIG),
        ss.StagedActor("van", model, world.actors[0].trajectory),
        ss.Rig.scarl(),
        ss.Rig.scarl().sensors[0],
        Share("sbr"),
        ChannelPlan((Share("sbr"),), mirrors=("road",)),
        PointScatterers([[1, 2, 3]], [[0, 0, 0]], 1.0),
        _channels(),
        ss.scan_paths(ss.RadarPaths.empty(ss.Pose()), ss.ScanningRadarSpec()),
        dataset,
        capture,
        ss.ClosedRadarFrame(
            ss.ClosedRadarSpec(**NEEDED["ClosedRadarSpec"]), ss.Pose(), np.zeros((1, 2, 1), np.float32)
        ),
        ss.MapCapture("raddet", RADAR, ("000001",), ("a note",), lambda frame: rda),
        ss.point_table(dataset),
        ss.count_points(ss.point_table(dataset)),
        dataset.scene(dataset.scenes[0]),
        dataset[0],
        ss.dataset_statistics(dataset),
        dataset[0].results["radar"],
        dataset[0].radar,
        ScenarioSpec.preset("highway_cut_in") if "highway_cut_in" in _ready() else ScenarioSpec(),
        load_materials(),
    ]
    return {**_defaults(), **{f"{type(item).__name__}": item for item in extra}}


def _channels() -> ss.RadioChannels:
    radio = Radio(ss.RadioSpec(stations=({"name": "mast"},)))
    where = {"world_from_station": np.zeros((1, 7)), "station_velocity": np.zeros((1, 3))}
    cfr = np.zeros((1, 1, 1, 64), np.complex64)
    return ss.RadioChannels(radio.spec, ss.Pose(), **where, **radio._no_paths(), cfr=cfr)


def _ready() -> tuple[str, ...]:
    from scarl_sionna.scenario.spec.scenario import scenario_names

    return scenario_names()


def test_all_public_classes_are_looked_at(objects: dict[str, Any]) -> None:
    public = {name for name in ss.__all__ if isinstance(getattr(ss, name), type)}
    exceptions = {name for name in public if issubclass(getattr(ss, name), BaseException)}
    assert public - exceptions - set(objects) == set()


def test_every_object_shows_itself_in_a_few_lines(objects: dict[str, Any]) -> None:
    for name, item in objects.items():
        text = repr(item)
        lines = text.splitlines()
        assert 1 <= len(lines) <= 20, name
        assert max(map(len, lines)) <= MAX_WIDTH, name
        assert "array(" not in text and " object at 0x" not in text and not FLOATS.search(text), f"{name}: {text}"
        assert type(item).__name__ in text or name == "SuiteMapping", name


def test_every_table_is_html_too(objects: dict[str, Any]) -> None:
    for name, item in objects.items():
        if not hasattr(item, "_repr_html_"):
            assert "\n" not in repr(item), name
            continue
        page = item._repr_html_()
        assert page.count("<tr>") == page.count("</tr>") >= 1 and f"<b>{type(item).__name__}</b>" in page, name


def test_pictures_stand_where_there_are_some(objects: dict[str, Any]) -> None:
    assert '<img src="data:image/png;base64,' in objects["Frame"]._repr_html_()
    assert '<img src="data:image/png;base64,' in objects["ImageFrame"]._repr_html_()
    assert "<img" not in objects["LidarScan"]._repr_html_()


def test_shapes_units_and_key_facts_are_there(objects: dict[str, Any]) -> None:
    expected = {
        "World": ("ego", "0 to 4 s", "ahead"),
        "WorldState": ("actor ahead", "[32, 0, 0] m", "12 m/s"),  # 20 m + 12 m/s after 1 s
        "RangeDoppler": ("complex64 (12, 64, 128)", " m", " m/s", "dBm", "hann"),
        "RangeDopplerAngle": ("float32 (64, 128, ", "deg", "dBm"),
        "RadarPoints": ("num_points", "position", "[m]", "m/s", "m2"),
        "RadarPaths": ("30, of at most 1 interactions", "float64 (30, 3) [m]"),
        "RadarFrame": ("complex64 (4, 192, 128)", "sqrt(W)"),
        "LidarScan": ("float32", "[m]", "m/s"),
        "Rig": ("front_left/radar", "[2.36, 0.4, 0.8] m"),
        "Dataset": ("2 in 1 scenes", "front/camera"),
        "Pose": ("Pose(position=[1, 2, 3] m, yaw=0 deg)",),
    }
    for name, words in expected.items():
        for word in words:
            assert word in repr(objects[name]), f"{word}: {objects[name]!r}"


def test_long_tables_end_with_what_is_left_out() -> None:
    text = text_table("Thing", [(f"field_{number}", "1 m") for number in range(40)])
    assert len(text.splitlines()) == MAX_LINES and max(map(len, text.splitlines())) <= MAX_WIDTH
    assert "and 22 more: field_18 1 m, field_19 1 m" in text.splitlines()[-1]
    assert text_table("Thing", [("a", "1")]) == "Thing\n  a  1"


def test_numbers_have_their_units() -> None:
    assert [quantity(77e9, "Hz"), quantity(3e-5, "s"), quantity(0.0, "s"), quantity(-12.0, "dB"), quantity(7)] == [
        "77 GHz",
        "30 us",
        "0 s",
        "-12 dB",
        "7",
    ]
    assert array_text(np.arange(3.0), "m") == "[0, 1, 2] m"
    assert array_text(np.arange(512.0) / 2.0, "m") == "float64 (512,), 0 to 255.5 m"
    assert array_text(np.array([np.nan, 1.0, 2.0, 3.0, 4.0])) == "float64 (5,), 1 to 4"
    assert array_text(np.zeros((2, 3), np.float32), "m") == "float32 (2, 3) [m]"
    assert repr(RadarSpec()).count("\n") < MAX_LINES
