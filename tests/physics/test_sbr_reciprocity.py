"""Chains of bounces in both senses: what V sends and H hears is what H sends and V hears, in a scene."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.channel import ChannelPlan, Share
from scarl_sionna.radar.channel.sbr.last_bounce import further_db
from scarl_sionna.radar.channel.sbr.reciprocity import with_reverses
from scarl_sionna.radar.channel.sbr.shadows import shadows_db
from scarl_sionna.radar.optics.tubes.checks import Wrong
from tests.physics.test_rcs_shapes import two_plates
from tests.scenes import Thing, plane, write_scene

RADAR = ss.RadarSpec(elevation_fov_deg=120.0)
V, H = (ss.AntennaElement(polarization=name) for name in "VH")
KNOBS = SbrSettings(floor_db=None, diffuse=False, max_depth=3)
POSE = ss.Pose()


def crossed(sent: ss.AntennaElement, heard: ss.AntennaElement) -> ss.RadarSpec:
    """Return a radar with these antennas, the transmitters where another one has its receivers and so on."""
    both = RADAR.array.rx_positions
    array = RADAR.array.with_(tx_positions=both, rx_positions=both, tx_elements=(sent,), rx_elements=(heard,))
    return RADAR.with_(array=array, num_chirps=8, num_samples=128)


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """Two plates of one body and two of two bodies, rolled, 15 m ahead."""
    mesh = two_plates(75.0)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(130.0), (0, 0, 1)))
    mesh.apply_translation((15.0, 0.3, 0.2))
    upright = [plane(0.4, 0.3, (0, 0.2, 0), (-1, -1, 0)), plane(0.4, 0.3, (0, -0.2, 0), (-1, 1, 0))]
    things = [Thing("one", mesh, "Car", "steel")]
    for name, one in zip(("left", "right"), upright, strict=True):
        one.apply_transform(trimesh.transformations.rotation_matrix(0.4, (1, 0, 0)))
        one.apply_translation((19.0, -2.0, 0.4))
        things.append(Thing(name, one, "Static" if name == "left" else "Truck", "steel"))
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("senses"), things)).at(0.0)


def field(paths: ss.RadarPaths, receive: int, transmit: int, number: int) -> complex:
    """Return the field at the middle of the array of what meets an object."""
    own = paths.select((paths.instance == number).any(axis=1))
    wave = 2.0 * np.pi / 299_792_458.0 * RADAR.center_frequency
    return complex(np.sum(own.a[:, receive, transmit] * np.exp(-1j * wave * own.length)))


@pytest.mark.parametrize("method", ["sbr", "hybrid", "auto"])
def test_crossed_pairs_are_reciprocal(state, method: str) -> None:
    options = {
        "sbr": {"sbr": KNOBS},
        "hybrid": {"plan": ChannelPlan((Share("sbr", ("one", "left", "right"), KNOBS),))},
        "auto": {"channel_tolerance_db": 6.0},
    }[method]
    radar = crossed(V, H)
    paths = ss.solve_paths(state, radar, POSE, method, **options)
    assert paths.diagnostics["num_reverses"] > 0
    sizes = []
    for number in state.world.instances:
        there, back = field(paths, 1, 0, number), field(paths, 0, 1, number)
        sizes.append(abs(there))
        assert abs(there - back) <= 1e-9 * abs(there)
    assert np.count_nonzero(sizes) >= 2  # to `auto` one of them is too faint
    # antenna by antenna: i sends V and j hears H, or j sends H and i hears V
    one, other = (ss.synthesize(paths, each) for each in (radar, crossed(H, V)))
    count = radar.array.num_rx
    cubes = [ss.virtual_cube(adc, each) for adc, each in ((one, radar), (other, crossed(H, V)))]
    shape = (count, count, *np.shape(cubes[0])[1:])
    first, second = (np.asarray(cube).reshape(shape) for cube in cubes)
    assert np.abs(first - second.swapaxes(0, 1)).max() < 1e-3 * np.abs(first).max()


def test_antennas_of_one_polarisation_have_the_paths_as_traced(state, monkeypatch: pytest.MonkeyPatch) -> None:
    alike = [crossed(one, one) for one in (V, H)]
    found = [ss.solve_paths(state, radar, POSE, "sbr", settings=KNOBS) for radar in (*alike, crossed(V, H))]
    raw = ss.solve_paths(state, crossed(V, H), POSE, "sbr", settings=KNOBS.with_(reciprocal=False))
    assert raw.num_paths == found[0].num_paths == found[1].num_paths < found[2].num_paths
    for paths in found[:2]:
        assert "num_reverses" not in paths.diagnostics and paths.a.tobytes() == raw.a.tobytes()
    numbers = list(state.world.instances)
    apart = [abs(field(raw, 1, 0, number) / field(raw, 0, 1, number)) for number in numbers]
    assert max(np.abs(20.0 * np.log10(apart))) > 1.0  # by one sense alone
    for number in numbers:
        for entry in (0, 1):
            alone, both = (field(paths, entry, entry, number) for paths in (raw, found[2]))
            assert both == pytest.approx(alone, rel=1e-9)


def test_the_chains_of_a_share_have_reverses_as_its_own_settings_say(state) -> None:
    """In a plan, and in what `auto` plans; what other shares have is left alone."""
    numbers = {info.name: number for number, info in state.world.instances.items()}
    kept, traced = KNOBS, KNOBS.with_(reciprocal=False)
    found = {}
    for name, of_one, of_others in (("all", kept, kept), ("one", kept, traced), ("none", traced, traced)):
        plan = ChannelPlan((Share("sbr", ("one",), of_one), Share("sbr", ("left", "right"), of_others)))
        found[name] = ss.solve_paths(state, crossed(V, H), POSE, "hybrid", plan=plan)
    count = {name: paths.diagnostics.get("num_reverses", 0) for name, paths in found.items()}
    assert count["all"] >= count["one"] > count["none"] == 0
    assert np.isin(found["one"].instance[-count["one"] :], [-1, numbers["one"]]).all()
    own, raw = (found[name].select((found[name].instance != numbers["one"]).all(axis=1)) for name in ("one", "none"))
    assert own.num_paths and own.a.tobytes() == raw.a.tobytes()
    plain = ChannelPlan((Share("sbr", ("*",)),))
    for method, options in (("hybrid", {"plan": plain}), ("auto", {"channel_tolerance_db": 6.0})):
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "sbr.reciprocal")
            paths = ss.solve_paths(state, crossed(V, H), POSE, method, sbr=SbrSettings(reciprocal=False), **options)
        assert "num_reverses" not in paths.diagnostics and (paths.depth > 1).any()
    made = ss.plan_channel(state, crossed(V, H), POSE, channel_tolerance_db=6.0, reciprocal=False)
    assert [share.settings.reciprocal for share in made.shares if share.solver == "sbr"] == [False]


def test_what_has_its_reverse_stays(state) -> None:
    paths = ss.solve_paths(state, crossed(V, H), POSE, "sbr", settings=KNOBS)
    again = with_reverses(state, paths)
    assert again is paths or again.num_paths == paths.num_paths
    new = paths.select(slice(paths.num_paths - paths.diagnostics["num_reverses"], None))
    semantic = {number: info.semantic for number, info in state.world.instances.items()}
    last = new.instance[np.arange(new.num_paths), new.depth - 1]
    assert [semantic[int(number)] for number in last] == new.semantic.tolist()


@pytest.fixture(scope="module")
def dihedral(tmp_path_factory):
    """A dihedral rolled by 45 deg, 10 m ahead: V comes back as H, and the fields VV of both its ways cancel."""
    sides = [plane(0.2, 0.3, (0, y, 0), (-1, -np.sign(y), 0)) for y in (0.1 / np.sqrt(2.0), -0.1 / np.sqrt(2.0))]
    mesh = trimesh.util.concatenate(sides)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(45.0), (1, 0, 0)))
    mesh.apply_translation((10.0, 0.0, 0.0))
    return ss.load_scene(write_scene(tmp_path_factory.mktemp("dihedral"), [Thing("one", mesh, "Car", "steel")])).at(0.0)


def test_what_bounces_have_of_echoes_is_told_of_what_the_antennas_hear(dihedral) -> None:
    """All of VH is the second bounce, which one bounce alone does not have; VV is what is left where all cancels."""
    (number,) = dihedral.world.instances
    shares, beyond = {}, {}
    for sent, heard in ((V, V), (V, H), (H, V), (H, H)):
        radar, name = crossed(sent, heard), f"{heard.polarization}{sent.polarization}"
        one, two = (
            ss.solve_paths(dihedral, radar, POSE, "sbr", settings=KNOBS.with_(max_depth=depth)) for depth in (1, 2)
        )
        shares[name] = two.diagnostics["last_bounce_db"][number]
        beyond[name] = further_db(one, two, radar, 1)[number]
    assert shares["VH"] == shares["HV"] == pytest.approx(0.0, abs=0.1)
    assert abs(shares["VV"]) > 1.0
    assert beyond["VH"] == beyond["HV"] > beyond["VV"] + 20.0


def test_shadows_are_told_by_what_the_antennas_hear() -> None:
    """Patches whose fields cancel in VV and add up in HH; crossed antennas hear VH, which adds up, too."""
    a = np.zeros((8, 2, 2), dtype=np.complex128)
    a[:, 1, 1], a[:, 0, 1], a[:, 1, 0] = 1.0, 0.5, 0.5
    a[:, 0, 0] = np.where(np.arange(8) < 7, [1.0, -1.0] * 4, -0.9)
    columns = {
        "instance": np.full((8, 1), 3),
        "a": a,
        "length": np.full(8, 20.0),
        "depth": np.ones(8, dtype=np.int32),
    }
    told = {
        (sent, heard): shadows_db({3: Wrong(0.1, 2)}, columns, crossed(*ends))[3]
        for (sent, heard), ends in {"VV": (V, V), "HH": (H, H), "VH": (V, H), "HV": (H, V)}.items()
    }
    flash = pytest.approx(20.0 * np.log10(1.1), abs=0.01)
    assert told["H", "H"] == told["V", "H"] == told["H", "V"] == flash
    assert told["V", "V"] > 10.0
