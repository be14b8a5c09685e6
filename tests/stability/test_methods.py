"""The same awkward geometry for every channel solver.

What must not change the echo does not, what is out of reach is reported.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import MeshError, ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.scatterers.model import ScattererModel
from scarl_sionna.radar.sensor import Radar
from tests.scenes import Material, Thing, box, plane, write_scene

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6, elevation_fov_deg=30.0)
WAVENUMBER = 2.0 * np.pi * RADAR.center_frequency / 299_792_458.0
OPTIONS = {
    "raycast": {"hits_per_cell": None, "num_rays": 200_000},
    "sionna": {"num_samples": 50_000, "max_depth": 1},
    "sbr": {},
}
METHODS = tuple(OPTIONS)
REPO = Path(__file__).resolve().parents[2]


def solve(folder, mesh: trimesh.Trimesh, method: str, pose: Pose | None = None, **options):
    state = load_scene(write_scene(folder, [Thing("thing", mesh, "Static", "steel")])).at(0.0)
    return solve_paths(state, RADAR, pose or Pose(), method, **{**OPTIONS[method], **options})


def power(paths, method: str) -> float:
    """Received over transmitted power, VV: of the coherent sum, or the sum of powers of unresolved hits."""
    if method == "raycast":
        return float(np.sum(np.abs(paths.a[:, 0, 0]) ** 2))
    length = PathGeometry.of(paths, RADAR).center_length()
    return float(np.abs(np.sum(paths.a[:, 0, 0] * np.exp(-1j * WAVENUMBER * length))) ** 2)


def plate(size: float = 1.0, distance: float = 5.0) -> trimesh.Trimesh:
    return plane(size, size, (distance, 0.0, 0.0), (-1, 0, 0))


def made_of(vertices, faces) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.asarray(vertices, dtype=np.float64), faces, process=False)


def _flipped() -> trimesh.Trimesh:
    mesh = plate()
    return made_of(mesh.vertices, np.asarray(mesh.faces)[:, ::-1])


def _half_flipped() -> trimesh.Trimesh:
    mesh = plate()
    faces = np.asarray(mesh.faces).copy()
    faces[1] = faces[1, ::-1]
    return made_of(mesh.vertices, faces)


def _tessellated() -> trimesh.Trimesh:
    mesh = plate()
    for _ in range(4):
        mesh = mesh.subdivide()
    return made_of(mesh.vertices, mesh.faces)


def _doubled() -> trimesh.Trimesh:
    mesh = plate()
    return made_of(mesh.vertices, np.concatenate([mesh.faces, np.asarray(mesh.faces)[:, ::-1]]))


def _with_degenerate_faces() -> trimesh.Trimesh:
    mesh = plate()
    return made_of(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 1], [2, 2, 2], [0, 1, 0]]]))


def _t_junction() -> trimesh.Trimesh:
    """The left half in one rectangle, the right half in two: a vertex in the middle of a long edge."""
    y, z = 0.5, 0.5
    corners = [(-y, -z), (0, -z), (0, z), (-y, z), (0, 0), (y, 0), (y, -z), (y, z)]
    faces = [(0, 1, 2), (0, 2, 3), (1, 6, 5), (1, 5, 4), (4, 5, 7), (4, 7, 2)]
    return made_of([(5.0, *corner) for corner in corners], faces)


def _sliver() -> trimesh.Trimesh:
    """Cut into a fan of triangles from one corner, some of 0.1 mm width."""
    y = np.concatenate([[-0.5, -0.4999], np.linspace(-0.3, 0.4999, 5), [0.5]])
    top = [(5.0, value, 0.5) for value in y]
    vertices = [(5.0, -0.5, -0.5), (5.0, 0.5, -0.5), *top]
    faces = [(0, 2 + k, 3 + k) for k in range(len(y) - 1)] + [(0, 1 + len(y), 1)]
    return made_of(vertices, faces)


AWKWARD = {
    "flipped": _flipped,
    "half flipped": _half_flipped,
    "tessellated": _tessellated,
    "doubled": _doubled,
    "degenerate faces": _with_degenerate_faces,
    "T-junction": _t_junction,
    "slivers": _sliver,
}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    return {method: power(solve(folder / method, plate(), method), method) for method in METHODS}


@pytest.mark.some(7)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", AWKWARD)
def test_what_the_mesh_looks_like_does_not_matter(tmp_path, reference, kind: str, method: str) -> None:
    """A plate of 1 m at 5 m, open and one-sided as it is, however it is cut into triangles."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(degenerate|zero area|no area).*")
        found = power(solve(tmp_path, AWKWARD[kind](), method), method)
    # sionna: one mirror path, rounding. raycast: the same rays hit the same plane, but for one at a border. sbr: other
    # patches, each within the phase allowed, 0.05 dB.
    bound = {"sionna": 1e-9, "raycast": 0.02, "sbr": 0.05}[method]
    assert 10 * np.log10(found / reference[method]) == pytest.approx(0.0, abs=bound)


@pytest.mark.parametrize("method", METHODS)
def test_an_open_plate_is_seen_from_behind(tmp_path, reference, method: str) -> None:
    found = power(solve(tmp_path, plate(), method, Pose.from_euler([10.0, 0, 0], yaw=np.pi)), method)
    assert 10 * np.log10(found / reference[method]) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_meshes_without_a_surface_are_refused(tmp_path, method: str) -> None:
    with pytest.raises(MeshError, match="not finite|no faces|cannot be loaded"):
        solve(tmp_path, made_of([(5, 0, 0), (5, 1, 0), (5, 0, np.nan)], [(0, 1, 2)]), method)


@pytest.mark.parametrize("method", METHODS)
def test_no_target_is_no_path_and_a_silent_frame(tmp_path, method: str) -> None:
    state = load_scene(write_scene(tmp_path, [Thing("hut", box((2, 2, 2), (-30, 0, 0)), "Building", "steel")])).at(0.0)
    paths = solve_paths(state, RADAR, Pose(), method, **{**OPTIONS[method], "max_distance": 20.0})
    assert paths.num_paths == 0 and paths.a.shape == (0, 2, 2) and paths.tx_point.shape == (0, 3)
    radar = Radar(
        RADAR.with_(num_chirps=2), RadarSettings.of(method, noise=False, **OPTIONS[method], max_distance=20.0)
    )
    frame = radar.observe(state, Pose(), np.random.default_rng(0))
    assert frame.num_paths == 0 and not frame.adc_int.any()


@pytest.mark.some(3)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("distance", [0.5, 300.0])
def test_very_near_and_very_far(tmp_path, method: str, distance: float) -> None:
    """The nearest path has the distance of the plate, its amplitude is finite; coherent levels are those of theory."""
    size = 1.0 if distance < 1.0 else (0.35 if method == "sbr" else 4.0)
    options = {"num_samples": 400_000} if method == "sionna" and distance > 1 else {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(Fresnel zone|smaller than the distance between rays).*")
        paths = solve(tmp_path, plate(size, distance), method, **options)
    length = PathGeometry.of(paths, RADAR).center_length()
    # float32 holds 0.5 exactly and 300 m to 1.5e-5 m; hits and patches are on the plate, not always at its nearest
    # point
    assert length.min() / 2 == pytest.approx(
        distance, abs={"sionna": 2e-5, "sbr": 2e-4, "raycast": 0.02 * distance}[method]
    )
    assert np.isfinite(paths.a).all()
    wavelength = RADAR.wavelength
    if method == "sbr":
        mirror = (wavelength / (4 * np.pi * 2 * distance)) ** 2
        far = 4 * np.pi * size**4 / wavelength**2 * wavelength**2 / ((4 * np.pi) ** 3 * distance**4)
        # Near: the image, with the ripple of four edges 5 Fresnel zones away, some 0.5 dB. Far: 2 D^2 / lambda = 63 m.
        expected, bound = (mirror, 1.0) if distance < 1.0 else (far, 0.15)
        assert 10 * np.log10(power(paths, method) / expected) == pytest.approx(0.0, abs=bound)


@pytest.mark.parametrize("method", METHODS)
def test_a_target_smaller_than_the_rays_spacing_is_found_or_told(tmp_path, method: str) -> None:
    """A plate of 4 cm at 60 m, where rays of the default grids are 9 cm and more apart."""
    small = plate(0.04, 60.0)
    if method == "sbr":
        found = power(solve(tmp_path, small, method), method)
        wavelength = RADAR.wavelength
        expected = 4 * np.pi * 0.04**4 / wavelength**2 * wavelength**2 / ((4 * np.pi) ** 3 * 60.0**4)
        assert 10 * np.log10(found / expected) == pytest.approx(0.0, abs=0.1)
    else:
        with pytest.warns(ScarlWarning, match="smaller than the distance between rays.*'thing'"):
            solve(tmp_path, small, method)


@pytest.mark.parametrize("method", METHODS)
def test_grazing_incidence_is_finite_and_weak_or_told(tmp_path, method: str) -> None:
    """A plate at 0.3 deg from edge-on: no NaN, no blow-up."""
    tilt = np.radians(0.3)
    mesh = plane(1.0, 1.0, (5.0, 0.0, -0.05), (-np.sin(tilt), 0.0, np.cos(tilt)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        paths = solve(tmp_path, mesh, method)
    assert np.isfinite(paths.a).all()
    total = power(paths, method) if paths.num_paths else 0.0
    # No more than a tenth of what the plate sends back at right angles as a mirror
    assert total < 0.1 * (RADAR.wavelength / (4 * np.pi * 10.0)) ** 2
    if method == "sbr" and paths.num_paths:
        assert any("grazing" in str(warning.message) for warning in caught)


@pytest.mark.parametrize("method", ["raycast", "sbr"])
def test_a_radar_behind_glass_is_told(tmp_path, method: str) -> None:
    """Nothing passes a pane but with the solver sionna and refraction=True (tests/physics/test_refraction.py), and with
    sbr unless its pane_loss_db is None (tests/physics/test_sbr_panes.py).
    """
    things = [
        Thing("screen", plane(2.0, 2.0, (0.3, 0, 0), (-1, 0, 0)), "Car", "pane"),
        Thing("target", plate(), "Static", "steel"),
    ]
    path = write_scene(tmp_path / "shut", things, materials={"pane": Material(radio="car_glass")})
    settings = RadarSettings.of(method, **OPTIONS[method])
    shut = {"settings": settings.changed(**({"pane_loss_db": None} if method == "sbr" else {}))}
    with pytest.warns(ScarlWarning, match="'car_glass' .'screen'.* covers .* refraction=True"):
        solve_paths(load_scene(path).at(0.0), RADAR, Pose(), **shut)
    aside = [Thing("side", plane(2.0, 2.0, (0.0, 0.5, 0), (0, -1, 0)), "Car", "pane"), things[1]]
    path = write_scene(tmp_path / "aside", aside, materials={"pane": Material(radio="car_glass")})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solve_paths(load_scene(path).at(0.0), RADAR, Pose.from_euler([0, 0, 0], yaw=-0.6), **shut)
    assert not any("pane" in str(warning.message) for warning in caught)


def digest(paths) -> str:
    names = ("tx_point", "rx_point", "inner_length", "a", "length_rate", "instance", "interaction", "depth", "semantic")
    return hashlib.sha256(b"".join(np.ascontiguousarray(getattr(paths, name)).tobytes() for name in names)).hexdigest()


def street(path: Path) -> list[str]:
    """Solve one small street with two methods, for two processes.

    `sionna` and `sbr` have such a test in their own files.
    """
    state = load_scene(path).at(0.0)
    options = {"raycast": {"num_rays": 100_000}, "scatterers": {"models": {"car": ScattererModel.tr38901("car")}}}
    return [digest(solve_paths(state, RADAR, Pose([0, 0, 0.5]), method, **more)) for method, more in options.items()]


@pytest.mark.slow  # of all methods: test_determinism.py
def test_same_bytes_twice_and_in_another_process(tmp_path) -> None:
    things = [
        Thing("ground", plane(128.0, 128.0), "Roads", "steel", is_object=False),
        Thing("car", box((4, 1.8, 1.4), (20, 2, 0.9)), "Car", "steel"),
    ]
    path = write_scene(tmp_path, things)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        first, second = street(path), street(path)
    code = (
        "import warnings; warnings.simplefilter('ignore')\n"
        "from pathlib import Path\nfrom tests.stability.test_methods import street\n"
        f"print(*street(Path({str(path)!r})))"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=REPO
    ).stdout.split()
    assert first == second == other[-2:]


def test_scattering_centres_in_small_steps_have_no_doppler_floor(tmp_path) -> None:
    """A car's centres from a moving radar at 100 m, chirp by chirp.

    No centre flickers, one line, nothing else above -60 dB.
    """
    car = Thing("car", box((4, 1.8, 1.4), (102, 0, 0.9)), "Car", "steel")
    state = load_scene(write_scene(tmp_path, [car])).at(0.0)
    options = {"models": {"car": ScattererModel.tr38901("car")}, "placements": {"car": Pose([102.0, 0, 0.9])}}
    step, count = RADAR.wavelength / 20, 48
    chirps, numbers = [], set()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        for index in range(count):
            paths = solve_paths(state, RADAR, Pose([-index * step, 0, 0.5]), "scatterers", **options)
            numbers.add(paths.num_paths)
            length = PathGeometry.of(paths, RADAR).center_length()
            chirps.append(np.sum(paths.a[:, 0, 0] * np.exp(-1j * WAVENUMBER * length)))
    assert len(numbers) == 1 and numbers.pop() > 0
    assert _floor(chirps) < -60.0


def _floor(chirps) -> float:
    """Highest level beyond 6 bins from the line of a windowed Doppler spectrum [dB].

    The window is at -58 dB there and falls.
    """
    count = len(chirps)
    spectrum = np.abs(np.fft.fft(np.array(chirps) * np.blackman(count)))
    level = np.roll(20 * np.log10(spectrum / spectrum.max()), count // 2 - int(spectrum.argmax()))
    return float(np.delete(level, np.arange(count // 2 - 6, count // 2 + 7)).max())


@pytest.mark.slow
@pytest.mark.parametrize("moving", ["target", pytest.param("radar", marks=pytest.mark.slow)])
def test_retraced_mirror_chirps_have_no_doppler_floor(tmp_path, moving: str) -> None:
    """Echo of a wall at 100 m, traced anew for each chirp of a twentieth of a wavelength.

    One line, nothing else above -60 dB.
    """
    wall = Thing(
        "wall",
        plane(16.0, 16.0, (0, 0, 0), (-1, 0, 0)),
        "Wall",
        "steel",
        {"kind": "constant_twist", "position": [100.0, 0, 0], "velocity": [1.0, 0, 0]},
    )
    world = load_scene(write_scene(tmp_path, actors=[wall]))
    step, count = RADAR.wavelength / 20, 48
    chirps = []
    for index in range(count):
        moved = index * step
        state, x = (world.at(moved), 0.0) if moving == "target" else (world.at(0.0), -moved)
        paths = solve_paths(state, RADAR, Pose([x, 0, 0.05]), "sionna", **OPTIONS["sionna"])
        assert paths.num_paths == 1
        length = PathGeometry.of(paths, RADAR).center_length()[0]
        chirps.append(paths.a[0, 0, 0] * np.exp(-1j * WAVENUMBER * length))
    assert _floor(chirps) < -60.0  # steps of lambda / 20, both ways: a line at a tenth of a turn a chirp
