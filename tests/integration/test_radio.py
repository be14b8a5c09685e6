"""A radio in the rig: channels of the frame's instant, stored and read back, and nothing else of the frame changes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.channels import INTERACTIONS, RadioChannels
from scarl_sionna.core.errors import ParameterRangeError, PlacementError, ScarlWarning, UnknownNameError
from scarl_sionna.core.prompt.profiles import plot_profiles
from scarl_sionna.dataset import StoreOptions, schema, write_dataset
from scarl_sionna.dataset.encoding import encode_frame
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.dataset.verify import verify
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths import links
from scarl_sionna.engine.paths.tracing import PathBufferOverflowError
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.radio.sensor import Radio
from scarl_sionna.scenario.compose import build_world
from tests.scenes import Material, Thing, box, plane, write_scene

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
EGO = {"kind": "constant_twist", "position": [0, 0, 0], "velocity": [12, 0, 0]}
AHEAD = {"kind": "constant_twist", "position": [25, 3, 0], "velocity": [8, 0, 0]}
NOSE, TAIL = ss.Pose([2.2, 0.0, 1.6]), ss.Pose([-2.2, 0.0, 1.6])
STATIONS = (
    {"name": "mast", "position": (60.0, -8.0, 6.0), "quaternion": (0.0, 0.0, 0.0, 1.0)},
    {"name": "car ahead", "actor": "ahead", "position": tuple(TAIL.position.tolist())},
)
SPEC = ss.RadioSpec(
    stations=STATIONS, num_subcarriers=33, array=ss.RadioArray(num_columns=2), station_array={"polarization": "VH"}
)
SETTINGS = ss.RadioSettings(solver={"max_depth": 2, "num_samples": 20_000}, max_paths=3)
SMALL = {"width": 48, "height": 27, "samples_per_pixel": 1, "denoise": False, "images": ("rgb", "depth", "instance")}
RADAR = ss.RadarSpec.preset("awr1843boost").with_(num_chirps=8, num_samples=64)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    path = write_scene(
        tmp_path_factory.mktemp("street"),
        [
            Thing("ground", plane(400.0, 400.0), "Roads", "road", is_object=False),
            Thing("house", box((80.0, 6.0, 9.0), (40.0, 15.0, 4.5)), "Building"),
        ],
        [
            Thing("ego", box((4.0, 1.8, 1.5), (0.0, 0.0, 0.8)), "Car", "steel", EGO),
            Thing("ahead", box((4.0, 1.8, 1.5), (0.0, 0.0, 0.8)), "Car", "steel", AHEAD),
        ],
        {"road": Material(radio="asphalt")},
        ego="ego",
    )
    return load_scene(path)


def mounts(with_radio: bool) -> Rig:
    front = ss.Pose([2.3, 0.0, 0.8])
    others = (
        SensorMount("front/camera", "camera", ss.CameraSpec(**SMALL), front),
        SensorMount("front/sionna", "radar", RADAR, front, ss.RadarSettings.of("sionna", num_samples=20_000)),
        SensorMount("front/radar", "radar", RADAR, front, ss.RadarSettings.of("raycast", num_rays=5_000)),
    )
    radio = SensorMount("radio", "radio", SPEC, NOSE, SETTINGS)
    return Rig("street", (radio, *others) if with_radio else others)


@pytest.fixture(scope="module")
def frame(world: ss.World) -> ss.Frame:
    return ss.observe(world, mounts(True), 0.25, seed=3)


@pytest.fixture(scope="module")
def channels(frame: ss.Frame) -> RadioChannels:
    return frame.radios["radio"]


def encoded(frame: ss.Frame) -> dict[str, bytes]:
    with ThreadPoolExecutor(1) as pool:
        found = encode_frame(frame, StoreOptions(), pool)
    return {**found.chunks, **found.files}


def test_camera_and_radars_give_the_same_bytes_with_and_without_a_radio(world, frame) -> None:
    without = encoded(ss.observe(world, mounts(False), 0.25, seed=3))
    found = encoded(frame)
    assert any("rgb" in name for name in without) and any("adc" in name for name in without)
    assert {name: found[name] for name in without} == without
    assert {name.split("/")[0] for name in found.keys() - without.keys()} == {"radio"}


def test_paths_are_those_of_the_frames_instant_and_name_what_they_touch(world, frame, channels) -> None:
    time = 0.25
    assert channels.world_from_sensor.position == pytest.approx([12.0 * time + 2.2, 0.0, 1.6])
    assert channels.world_from_station[:, :3] == pytest.approx(np.array([[60, -8, 6], [25 + 8 * time - 2.2, 3, 1.6]]))
    assert channels.station_velocity.tolist() == [[0, 0, 0], [8, 0, 0]]
    ids = {info.name: number for number, info in world.instances.items()}
    way = channels.world_from_station[:, :3] - channels.world_from_sensor.position
    for station in range(2):
        direct = int(np.flatnonzero(channels.valid[station] & ~channels.interaction[station].any(axis=1))[0])
        distance = np.linalg.norm(way[station])
        assert channels.tau[station, direct] * 299_792_458.0 == pytest.approx(distance, rel=1e-12)
        closing = (np.array([12.0, 0, 0]) - channels.station_velocity[station]) @ way[station] / distance
        assert channels.doppler[station, direct] == pytest.approx(closing / SPEC.wavelength, rel=1e-5)
        single = channels.valid[station] & (np.count_nonzero(channels.interaction[station], axis=1) == 1)
        touched = {int(one) for one in channels.instance[station, single, 0]}
        assert {ids["ground"], ids["house"]} <= touched and set(channels.interaction[station, single, 0]) == {1}
        assert np.all(np.diff((np.abs(channels.a[station]) ** 2).mean(axis=(0, 1))) <= 0.0)
    assert set(np.unique(channels.interaction)) - {0} <= set(INTERACTIONS)
    assert not channels.a[..., ~channels.valid[0]][0].any() and not channels.tau[~channels.valid].any()


def test_a_station_with_a_velocity_goes_straight_on_from_its_place_at_time_zero(world) -> None:
    drone = {"name": "drone", "position": (60.0, -8.0, 6.0), "velocity": (-20.0, 4.0, 0.0)}
    radio = Radio(ss.RadioSpec(stations=(drone,), num_subcarriers=2), ss.RadioSettings(solver={"max_depth": 0}))
    mount = ss.Mount(ss.Pose([2.2, 0.0, 1.6]))
    for time in (0.0, 0.5):
        found = radio.observe(world.at(time), mount, np.random.default_rng(0))
        there = np.array([60.0 - 20.0 * time, -8.0 + 4.0 * time, 6.0])
        assert found.world_from_station[0, :3] == pytest.approx(there)
        way = np.linalg.norm(there - mount.pose.position)
        assert found.tau[0, 0] * 299_792_458.0 == pytest.approx(way, rel=1e-12)


def test_responses_are_those_that_sionna_rt_itself_gives(world, channels) -> None:
    """Sionna's own are float32: at 5.9 GHz and 60 m their phase is right to 1e-3."""
    state = world.at(0.25)
    settings = ss.RadioSettings(solver=SETTINGS.solver)
    radio = Radio(SPEC, settings)
    mount = state.mount("ego", NOSE)
    found = radio.observe(state, mount, np.random.default_rng(0))
    stations = [ss.Mount(SPEC.stations[0].pose), state.mount("ahead", TAIL)]
    with variant.radio() as mi:
        import sionna.rt as rt

        scene = state.radio_scene()
        with links._tuned(state, scene, SPEC.frequency, False):
            scene.tx_array = rt.PlanarArray(num_rows=1, num_cols=2, pattern="iso", polarization="V")
            scene.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="VH")
            scene.add(rt.Transmitter("t", **links._placed(mi, mount)))
            for number, station in enumerate(stations):
                scene.add(rt.Receiver(f"r{number}", **links._placed(mi, station)))
            try:
                paths = rt.PathSolver(deterministic=True)(
                    scene, max_depth=2, samples_per_src=20_000, refraction=False, diffuse_reflection=False
                )
                own = paths.cfr(
                    mi.Float(SPEC.subcarrier_frequencies),
                    normalize_delays=False,
                    num_time_steps=3,
                    out_type="numpy",
                    sampling_frequency=1e3,
                )
            finally:
                for name in ("t", "r0", "r1"):
                    scene.remove(name)
    own = own[:, :, 0]  # station, station antenna, antenna, time, subcarrier
    scale = np.abs(own).max(axis=(1, 2, 3, 4), keepdims=True)
    ours = ss.frequency_response(found, times=[0.0, 1e-3, 2e-3])
    assert np.abs(ours / scale - own / scale).max() < 5e-3
    assert np.abs(found.cfr / scale[..., 0, :] - own[..., 0, :] / scale[..., 0, :]).max() < 5e-3
    # the kept paths of the frame are the strongest of these
    assert found.num_paths.tolist() == channels.num_paths.tolist() and (found.num_paths > 3).any()
    np.testing.assert_array_equal(found.a[..., :3], channels.a)
    np.testing.assert_allclose(channels.gain + channels.gain_left_out, found.gain, rtol=1e-5)
    assert (found.gain_left_out == 0.0).all() and (channels.gain_left_out[channels.num_paths > 3] > 0.0).all()


def test_channels_come_back_from_a_dataset_as_they_were(tmp_path, frame, channels) -> None:
    out = write_dataset(tmp_path / "out", mounts(True).to_dict(), {"street": [frame]})
    dataset = ss.open_dataset(out)
    stored = dataset[0].radio["radio"]
    again = dataset[0].to_frame().results["radio"]
    assert type(again) is RadioChannels and again.spec == SPEC and dataset.rig == mounts(True).to_dict()
    for name in channels.__dataclass_fields__:
        value = getattr(channels, name)
        if isinstance(value, np.ndarray):
            for found in (getattr(stored, name), getattr(again, name)):
                assert found.dtype == value.dtype and found.shape == value.shape, name
                assert found.tobytes() == value.tobytes(), name
    told = {name: value for name, value in channels.diagnostics.items() if name != "seconds"}
    assert dict(again.diagnostics) == told and told["borrowed_materials"] == {} and told["absent_stations"] == []
    assert again.world_from_sensor.position.tolist() == channels.world_from_sensor.position.tolist()
    np.testing.assert_array_equal(ss.frequency_response(stored), ss.frequency_response(channels))
    item = FrameSamples(dataset)[0]
    np.testing.assert_array_equal(item["radio:cfr"], channels.cfr)
    assert FrameSamples(dataset, ["radio:instance"]).signature()["radio:instance"].shape == channels.instance.shape
    assert ss.Rig.from_dict(mounts(True).to_dict()).to_dict() == mounts(True).to_dict()


def test_a_dataset_from_before_small_mirrors_were_stored_is_read(tmp_path, frame, monkeypatch) -> None:
    older = tuple(item for item in schema.RADIO if item.name != "small_mirror")
    with monkeypatch.context() as patch:
        patch.setattr(schema, "RADIO", older)
        patch.setattr(schema, "TABLES", {**schema.TABLES, "radio": older})
        patch.setattr(schema, "_NOT_STORED", schema._NOT_STORED | {"small_mirror"})
        out = write_dataset(tmp_path / "out", mounts(True).to_dict(), {"street": [frame]})
    assert verify(out).complete and "small_mirror" not in ss.open_dataset(out).manifest["schema"]["radio"]
    again = ss.open_dataset(out)[0]
    assert again.radio["radio"].small_mirror is None and again.to_frame().radios["radio"].small_mirror is None
    assert "radio:small_mirror" not in FrameSamples(ss.open_dataset(out))[0]


@pytest.mark.parametrize("kind", ["hdf5", "mcap"])
def test_other_formats_hold_channels_or_leave_them_out(tmp_path, frame, channels, kind) -> None:
    out = write_dataset(tmp_path / "out", mounts(True).to_dict(), {"street": [frame]})
    convert(out, kind, tmp_path / f"street.{kind}")
    if kind == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "street.hdf5") as file:
            np.testing.assert_array_equal(file["street/radio/cfr"][0], channels.cfr)


def test_a_dataset_without_a_radio_says_nothing_of_one() -> None:
    from scarl_sionna.dataset.schema import TABLES, tables_of

    assert "radio" not in tables_of(mounts(False).to_dict())
    assert tables_of(mounts(True).to_dict())["radio"] == TABLES["radio"]


def test_a_frame_shows_its_radios_and_draws_their_profiles(frame, channels) -> None:
    assert "radios" in repr(frame) and "mast, car ahead" in repr(channels)
    axis = channels.plot()
    heights = np.concatenate([line.get_ydata() for line in axis.lines])
    gain = (np.abs(channels.a) ** 2).mean(axis=(1, 2))[channels.valid]
    assert sorted(heights) == pytest.approx(sorted(10.0 * np.log10(gain)))
    counts = np.count_nonzero(channels.valid, axis=1)
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        f"{name}: {count}" for name, count in zip(("mast", "car ahead"), counts, strict=True)
    ]
    plot_profiles(channels, axis)
    frame.plot("front")  # the contact sheet, which has no place for them


def test_an_absent_station_a_full_buffer_and_bad_places(world, monkeypatch) -> None:
    state = world.at(0.25)
    mount = state.mount("ego", NOSE)

    def observed(settings=SETTINGS, **station) -> RadioChannels:
        spec = SPEC.with_(stations=({"name": "it", **station},))
        return Radio(spec, settings).observe(state, mount, np.random.default_rng(0))

    with pytest.raises(PlacementError, match="station 'it' at .* is inside 'house'"):
        observed(position=(40.0, 15.0, 4.0))
    with pytest.raises(UnknownNameError, match="did you mean 'ahead'"):
        observed(actor="ahed")
    few = SETTINGS.solver.with_(max_num_paths=1)
    with pytest.raises(PathBufferOverflowError, match="max_num_paths = 1"):
        observed(SETTINGS.with_(solver=few), position=(60.0, -8.0, 6.0))
    with pytest.warns(ScarlWarning, match="max_num_paths = 1"):
        observed(SETTINGS.with_(solver=few.with_(on_overflow="warn")), position=(60.0, -8.0, 6.0))
    monkeypatch.setattr("scarl_sionna.engine.world.is_present", lambda trajectory, time: False)
    gone = observed(actor="ahead", position=(0.0, 0.0, 1.7))
    assert gone.diagnostics["absent_stations"] == ["it"] and not gone.valid.any() and not gone.cfr.any()
    assert np.isnan(gone.world_from_station).all() and np.isnan(gone.station_velocity).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stations": ()}, "stations"),
        ({"stations": ({"name": "a"}, {"name": "a"})}, "'a' stands there more than once"),
        ({"stations": ({"name": "a", "actor": "b", "velocity": (1, 0, 0)},)}, "no velocity beside actor"),
        ({"stations": ({"name": "a", "quaternion": (0, 0, 0, 0)},)}, "not all zero"),
        ({"frequency": 1e9, "num_subcarriers": 2000, "subcarrier_spacing": 1e6}, "above zero frequency"),
    ],
)
def test_wrong_radios_are_refused(change, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        SPEC.with_(**change)
    with pytest.raises(ParameterRangeError, match="double_bounce"):
        ss.RadioSettings(solver={"double_bounce": True})


def test_the_example_rig_is_read() -> None:
    rig = Rig.load(EXAMPLES / "talking_rig.yaml")
    world = build_world(ss.ScenarioSpec.preset("oncoming_lorry"))
    named = {station.actor for one in rig.sensors if one.kind == "radio" for station in one.spec.stations} - {None}
    assert named and named <= {actor.name for actor in world.actors}


@pytest.mark.slow  # gains of lines of sight and behind bodies: tests/physics/test_radio_links.py
def test_the_example_rig_sees_the_car_when_the_lorry_is_past() -> None:
    """In the scenario that it is made for: Friis' gain of 4.2 m, within what the ground adds, once it is free."""
    rig = Rig.load(EXAMPLES / "talking_rig.yaml")
    world = build_world(ss.ScenarioSpec.preset("oncoming_lorry"))
    radio = "roof/radio_28"
    behind, free = (ss.observe(world, rig, time=t, seed=0, only=(radio,)).radios[radio] for t in (3.6, 5.2))
    friis = 20.0 * np.log10(free.spec.wavelength / (4.0 * np.pi * 4.196))
    assert 10.0 * np.log10(free.gain[1]) == pytest.approx(friis, abs=1.0)
    assert behind.gain[1] < 0.1 * free.gain[1]
