"""Chains of bounces in both senses: what V sends and H hears is what H sends and V hears, in a scene."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.channel import ChannelPlan, Share
from scarl_sionna.radar.channel.sbr.reciprocity import with_reverses
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


def test_what_has_its_reverse_stays(state) -> None:
    paths = ss.solve_paths(state, crossed(V, H), POSE, "sbr", settings=KNOBS)
    again = with_reverses(state, paths)
    assert again is paths or again.num_paths == paths.num_paths
    new = paths.select(slice(paths.num_paths - paths.diagnostics["num_reverses"], None))
    semantic = {number: info.semantic for number, info in state.world.instances.items()}
    last = new.instance[np.arange(new.num_paths), new.depth - 1]
    assert [semantic[int(number)] for number in last] == new.semantic.tolist()
