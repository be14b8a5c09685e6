"""Radio links at three carriers against closed forms: Friis, two-ray by image theory, Doppler; nothing stays behind."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import EngineError, MaterialRangeError, SmallMirrorWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.radio import RadioSettings
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.core.specs.radio import RadioArray, RadioSpec, RadioStation
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths import links, tracing
from scarl_sionna.engine.paths.links import trace_links
from scarl_sionna.radio.sensor import Radio
from scarl_sionna.scene.materials.carrier import at_carrier
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.kernels import kernels
from tests.oracles.link import friis, two_ray
from tests.scenes import Material, Thing, plane, write_scene

CARRIERS = (5.9e9, 28e9, 77e9)
FEW = RadioSettings(solver=SionnaSettings(max_depth=1, num_samples=20_000))
MANY = RadioSettings(solver=SionnaSettings(max_depth=1, num_samples=1_000_000))
V, VH = RadioArray(), RadioArray(polarization="VH")
SENDER = Mount(Pose([0.0, 0.0, 1.6]))
CAR = {"kind": "constant_twist", "position": [0, 40, 0], "velocity": [0, -30, 0]}
"""A plate beside the link that comes nearer at 30 m/s."""


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Return a state with an endless ground and a steel plate that moves, which is 37 m to the left."""
    path = write_scene(
        tmp_path_factory.mktemp("street"),
        [Thing("ground", plane(2000.0, 2000.0), "Roads", "road")],
        [Thing("plate", plane(300.0, 300.0, (0, 0, 0), (0, -1, 0)), "Car", "steel", CAR)],
        {"road": Material(radio="asphalt")},
    )
    return load_scene(path).at(0.1)


def solve(state, frequency, receivers, arrays=(V, V), settings=FEW, sender=SENDER):
    return trace_links(state, frequency, (sender, receivers), arrays, settings)


def baseband(found, frequency) -> np.ndarray:
    return found.a * np.exp(-2j * np.pi * frequency * found.length / SPEED_OF_LIGHT)[:, None, None]


@pytest.mark.parametrize("frequency", CARRIERS)
def test_free_space_is_friis_in_amplitude_and_phase(street, frequency) -> None:
    places = [[3.0, 1.0, 2.0], [70.0, -11.0, 6.0], [200.0, 20.0, 1.5], [500.0, -3.0, 25.0]]
    found = solve(street, frequency, [Mount(Pose(place)) for place in places])
    direct = np.flatnonzero(found.kind[:, 0] == 0)
    assert found.receiver[direct].tolist() == [0, 1, 2, 3]
    exact = friis(frequency, np.linalg.norm(np.array(places) - SENDER.pose.position, axis=1))
    assert np.abs(baseband(found, frequency)[direct, 0, 0] / exact - 1.0).max() < 1e-5


@pytest.mark.parametrize("frequency", CARRIERS)
def test_two_rays_are_those_of_image_theory_with_the_material_at_the_carrier(street, frequency) -> None:
    material = at_carrier(builtin_materials()["asphalt"], frequency)
    ranges, heights = np.array([5.0, 23.0, 60.0, 150.0, 400.0]), (1.6, 5.0)
    found = solve(street, frequency, [Mount(Pose([x, 0.0, heights[1]])) for x in ranges], (VH, VH))
    keep = found.part[:, 0] < 1  # without the plate
    exact = two_ray(frequency, ranges, heights, material.at(frequency), material.coherence)
    for polarization, sign in enumerate(
        (1.0, -1.0)
    ):  # H is along the azimuth, which runs the other way at the other end
        paths = sign * baseband(found, frequency)[:, polarization, polarization]
        total = np.array([paths[keep & (found.receiver == index)].sum() for index in range(len(ranges))])
        # coefficients of the engine in float32: 1e-6 each, where the two rays cancel to a fiftieth
        assert np.abs(total / exact[polarization] - 1.0).max() < 5e-5, polarization


@pytest.mark.parametrize("frequency", CARRIERS)
def test_doppler_is_the_change_of_the_length_in_wavelengths(street, frequency) -> None:
    velocity = np.array([13.0, -4.0, 0.0])
    sender = Mount(SENDER.pose, Twist(velocity))
    station = np.array([90.0, 5.0, 6.0])
    found = solve(street, frequency, [Mount(Pose(station))], sender=sender)

    def length(start, mirror):
        image = station.copy()
        if mirror == "ground":
            image[2] *= -1.0
        elif mirror == "plate":
            image[1] = 2.0 * mirror_y - image[1]
        return np.linalg.norm(image - start)

    for part, mirror in ((-1, "none"), (0, "ground"), (1, "plate")):
        row = int(np.flatnonzero(found.part[:, 0] == part)[0])
        change = 0.0
        for sign in (1.0, -1.0):
            step = sign * 1e-4
            mirror_y = 37.0 + step * CAR["velocity"][1]
            change += sign * length(SENDER.pose.position + step * velocity, mirror) / 2e-4
        exact = -change * frequency / SPEED_OF_LIGHT
        assert abs(found.doppler[row] - exact) < 2e-5 * abs(exact), mirror
    assert found.doppler[found.part[:, 0] == 1][0] > 0.9 * 13.0 * frequency / SPEED_OF_LIGHT


def test_delays_are_right_to_float64_over_an_oblique_mirror(tmp_path) -> None:
    wall = Thing("wall", plane(900.0, 900.0, (211.3, 77.7, 0.0), (-0.31, -1.0, 0.07)), "Wall", "steel")
    state = load_scene(write_scene(tmp_path, [wall])).at(0.0)
    places = np.stack([np.linspace(100.0, 400.0, 20), np.zeros(20), np.full(20, 6.0)], axis=1)
    found = solve(state, 77e9, [Mount(Pose(place)) for place in places])
    mirrored = np.flatnonzero(found.part[:, 0] == 0)
    assert len(mirrored) == 20
    mesh = state.world.mesh(0)
    corner, first, second = mesh.vertices[mesh.faces[0]]
    normal = np.cross(first - corner, second - corner)
    normal /= np.linalg.norm(normal)
    images = places - 2.0 * ((places - corner) @ normal)[:, None] * normal
    exact = np.linalg.norm(images - SENDER.pose.position, axis=1)[found.receiver[mirrored]]
    # planes of the two triangles differ by the rounding of their corners, 1e-5 m: half of the paths are on the other
    error = np.abs(found.length[mirrored] - exact)
    assert np.count_nonzero(error < 1e-9) >= 9 and error.max() < 1e-5, error


def test_other_carriers_take_the_same_kernels(street) -> None:
    """Values at a carrier are inputs of a kernel: as constants in it each carrier took a second of compiling."""
    receivers = [Mount(Pose([x, 0.0, 5.0])) for x in (5.0, 60.0)]
    with kernels() as found:
        seen = []
        for frequency in (*CARRIERS, 79e9):
            solve(street, frequency, receivers, (VH, VH))
            seen.append(found())
    assert seen[1] and seen[2] <= seen[1] and seen[3] <= seen[1]


def test_what_radars_see_is_put_back_also_after_an_error(street, monkeypatch) -> None:
    def seen() -> tuple[object, ...]:
        materials = street.radio_scene().radio_materials
        radio = materials["radio-road"], materials["radio-steel"]
        fields = "relative_permittivity", "conductivity", "thickness", "scattering_coefficient", "xpd_coefficient"
        values = [float(getattr(one, field)[0]) for one in radio for field in fields]
        scene = street.radio_scene()
        return *values, float(scene.frequency[0]), len(scene.transmitters), len(scene.receivers)

    def traced() -> bytes:
        found = tracing.trace_paths(street, [0, 0, 1.0], [[30.0, 2.0, 2.0]], FEW.solver)
        return b"".join(np.ascontiguousarray(value).tobytes() for value in (found.a, found.vertex, found.part))

    before, paths = seen(), traced()
    solve(street, 5.9e9, [Mount(Pose([60.0, 0.0, 5.0]))])
    assert seen() == before and traced() == paths

    def failing(*_) -> None:
        assert seen() != before  # tuned
        raise EngineError("full")

    monkeypatch.setattr(links, "solve", failing)
    with pytest.raises(EngineError):
        solve(street, 5.9e9, [Mount(Pose([60.0, 0.0, 5.0]))])
    assert seen() == before and traced() == paths


def test_a_half_space_neither_lets_through_nor_sends_back_from_its_rear(street) -> None:
    through = FEW.with_(solver=FEW.solver.with_(refraction=True))
    found = solve(street, 5.9e9, [Mount(Pose([20.0, 0.0, -3.0]))], settings=through)
    assert not np.abs(found.a).any()


def test_a_material_without_data_is_an_error_that_names_it_or_borrows(tmp_path) -> None:
    own = builtin_materials()["asphalt"].with_(name="special")
    table = MaterialTable([*builtin_materials().values(), own])
    ground = Thing("ground", plane(200.0, 200.0), "Roads", "road")
    state = load_scene(write_scene(tmp_path, [ground], (), {"road": Material(radio="special")}), table).at(0.0)
    station = [Mount(Pose([20.0, 0.0, 5.0]))]
    with pytest.raises(MaterialRangeError, match="'special' has no data at 28 GHz"):
        solve(state, 28e9, station)
    found = solve(state, 28e9, station, settings=FEW.with_(without_data="nearest"))
    assert found.borrowed == {"special": 76e9} and len(found.receiver) == 2


def test_arrays_are_turned_and_steered_as_their_mounts_are(street) -> None:
    sector, row = RadioArray(pattern="tr38901"), RadioArray(num_columns=4)
    way = np.array([40.0, 30.0, 0.0])
    heading = np.arctan2(way[1], way[0])
    towards, away = (Mount(Pose.from_euler(SENDER.pose.position, yaw=yaw)) for yaw in (heading, heading + np.pi))
    station = [Mount(Pose(SENDER.pose.position + way))]
    strong, weak = (np.abs(solve(street, 28e9, station, (sector, V), sender=one).a[0, 0, 0]) for one in (towards, away))
    assert 20.0 * np.log10(strong / abs(friis(28e9, 50.0))) == pytest.approx(8.0, abs=0.01)  # its gain [dBi]
    assert 20.0 * np.log10(strong / weak) == pytest.approx(30.0, abs=0.01)  # its front-to-back ratio
    flat = solve(street, 28e9, station, (row, V), sender=towards).a[0, 0]
    assert np.abs(np.angle(flat / flat[0])).max() < 1e-3  # broadside
    steered = solve(street, 28e9, station, (row, V)).a[0, 0]
    assert np.allclose(np.angle(steered[1:] / steered[:-1]), np.pi * np.sin(heading), atol=1e-3)


def facade(width: float, centre: float = 0.0, step: float = 0.0) -> Thing:
    """Return a wall of steel beside the link, 10 m aside and as high as it is wide."""
    name = f"wall_{centre:.0f}_{step * 1e6:.0f}"
    return Thing(name, plane(width, width, (centre, 10.0 - step, 2.0), (0, -1, 0)), "Building", "steel")


def beside(folder, *walls: Thing):
    return load_scene(write_scene(folder, list(walls), [])).at(0.0)


RECEIVER = Mount(Pose([40.0, 0.0, 2.0]))
TOWARDS = Mount(Pose([-40.0, 0.0, 2.0]))


@pytest.mark.some(2)
@pytest.mark.parametrize("frequency", CARRIERS)
def test_mirrors_smaller_than_their_fresnel_zone_are_marked(tmp_path, frequency) -> None:
    # half-way between the ends the zone is sqrt(wavelength * way) wide
    zone = np.sqrt(SPEED_OF_LIGHT / frequency * 2.0 * np.hypot(4.0, 10.0))
    for factor, is_small in ((0.9, True), (1.1, False)):
        state = beside(tmp_path / f"{factor}", facade(factor * zone))
        ends = [Mount(Pose([4.0, 0.0, 2.0]))], Mount(Pose([-4.0, 0.0, 2.0]))
        found = solve(state, frequency, ends[0], sender=ends[1], settings=MANY)
        assert found.kind[:, 0].tolist() == [0, tracing.SPECULAR]
        assert found.small_mirror.tolist() == [False, is_small]


def test_the_radio_says_how_much_comes_over_small_mirrors(tmp_path) -> None:
    spec = RadioSpec(frequency=5.9e9, stations=(RadioStation(name="mast", pose=Pose([4.0, 0.0, 2.0])),))
    radio, rng = Radio(spec, MANY), np.random.default_rng(0)
    with pytest.warns(SmallMirrorWarning, match="12 % of the gain comes by 1 of 2 paths"):
        found = radio.observe(beside(tmp_path / "small", facade(0.5)), Mount(Pose([-4.0, 0.0, 2.0])), rng)
    assert found.diagnostics["small_mirror_share"] == pytest.approx(64.0 / (64.0 + 464.0), rel=1e-3)  # steel, 1/r**2
    assert found.interaction[0, :2, 0].tolist() == [0, 1] and found.small_mirror[0].tolist()[:2] == [False, True]
    assert found.small_mirror.shape == found.valid.shape and not found.small_mirror[~found.valid].any()
    large = radio.observe(beside(tmp_path / "large", facade(5.0)), Mount(Pose([-4.0, 0.0, 2.0])), rng)
    assert large.diagnostics["small_mirror_share"] == 0.0 and not large.small_mirror.any() and large.valid.sum() == 2


def test_marked_paths_have_the_share_of_the_diagnostics(tmp_path) -> None:
    """Of three stations and a wall for each, two of them smaller than their zones; all paths are kept."""
    walls = [facade(width, centre) for width, centre in ((0.3, 0.0), (0.6, 8.0), (5.0, 20.0))]
    stations = tuple(RadioStation(name=f"{x:g}", pose=Pose([x, 0.0, 2.0])) for x in (4.0, 20.0, 44.0))
    radio = Radio(RadioSpec(frequency=5.9e9, stations=stations, array=VH), MANY)
    with pytest.warns(SmallMirrorWarning):
        found = radio.observe(beside(tmp_path, *walls), Mount(Pose([-4.0, 0.0, 2.0])), np.random.default_rng(0))
    assert not found.gain_left_out.any() and found.small_mirror.any(axis=1).tolist() == [True, True, False]
    mirrored = found.valid & (found.interaction[..., 0] == tracing.SPECULAR)
    assert mirrored.any(axis=1).all()
    gain = (np.abs(found.a.astype(np.complex128)) ** 2).sum(axis=(1, 2))
    share = gain[found.small_mirror].sum() / gain.sum()
    assert share == pytest.approx(found.diagnostics["small_mirror_share"], rel=1e-6)  # coefficients are complex64


def test_surfaces_within_a_millimetre_give_one_path(tmp_path) -> None:
    one = solve(beside(tmp_path / "one", facade(30.0)), 28e9, [RECEIVER], sender=TOWARDS)
    sheets = beside(tmp_path / "sheets", facade(30.0), facade(30.0, step=4e-4))
    found = solve(sheets, 28e9, [RECEIVER], sender=TOWARDS)
    assert len(found.length) == len(one.length) == 2
    assert 0.0 < one.length[1] - found.length[1] < 1e-3  # that over the sheet in front
    apart = solve(beside(tmp_path / "apart", facade(30.0), facade(30.0, step=0.3)), 28e9, [RECEIVER], sender=TOWARDS)
    assert len(apart.length) == 2  # the one behind is hidden


def test_facets_that_nearly_are_one_plane_give_one_path(tmp_path) -> None:
    """A wall in two halves that lean towards the link by 0.02 deg each has two images of the sender for one mirror."""
    slope = np.radians(0.02)
    halves = []
    for side in (-1.0, 1.0):
        centre, normal = (15.0 * side, 10.0 - 15.0 * slope, 2.0), (-side * slope, -1, 0)
        halves.append(Thing(f"half_{side > 0}", plane(30.0, 30.0, centre, normal), "Building", "steel"))
    found = solve(beside(tmp_path / "halves", *halves), 28e9, [RECEIVER], sender=TOWARDS)
    one = solve(beside(tmp_path / "one", facade(60.0)), 28e9, [RECEIVER], sender=TOWARDS)
    assert len(found.length) == len(one.length) == 2
    assert abs(found.length[1] - one.length[1]) < 0.01
