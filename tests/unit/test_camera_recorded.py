"""Images by recorded kernels are those of Mitsuba's own render call, wherever things and the camera went meanwhile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar.camera.ray_sensor import ray_sensor
from camera_lidar.camera.render import _launched, _trace, _View, integrator_dict
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.light.haze import haze_integrator
from scarl_sionna.engine.light.recorded import may_record
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from tests.scenes import Thing, ball, box, plane, write_scene

SPEC = CameraSpec(width=48, height=32, samples_per_pixel=4, horizontal_fov_deg=60.0)
BACKEND_RECORDS = "the engine runs on CUDA, where images are not recorded"


def street(folder: Path, speed: float = 5.0) -> World:
    """Return ground, a wall, and a box and a ball (with normals at its corners) that pass the camera."""
    folder.mkdir(exist_ok=True)
    things = [
        Thing("ground", plane(100.0, 100.0), "Roads", is_object=False),
        Thing("wall", box((1.0, 4.0, 3.0), (10.5, 0.0, 1.5)), "Wall", "white"),
    ]
    motions = [
        {"kind": "constant_twist", "position": (8.0, y, 1.0), "velocity": (0.0, y / 2.0 * speed, 0.0)}
        for y in (-2.0, 2.0)
    ]
    actors = [
        Thing("cube", box((1.0, 1.0, 1.0)), "Car", "white", trajectory=motions[0]),
        Thing("globe", ball(0.7), "Car", "white", trajectory=motions[1]),
    ]
    return load_scene(write_scene(folder, things, actors))


def plain(world: World, time: float, view: _View) -> np.ndarray:
    """Return the same image by a call of Mitsuba that records anew."""
    state = world.at(time)
    scene, lighting = state.optical_scene(), world.lighting
    with variant.optical() as mi:
        integrator = mi.load_dict(integrator_dict(view.spec))
        if lighting is not None:
            from scarl_sionna.engine.light.haze import Haze

            integrator = haze_integrator(mi, integrator, Haze.of(lighting.visibility, state.airlight))
        sensor = ray_sensor(mi, view.spec, view.pose, view.samples)
        return np.array(mi.render(scene, sensor=sensor, integrator=integrator, seed=view.seed, spp=view.samples))


@pytest.mark.parametrize("lighting", [None, Lighting(visibility=60.0)], ids=["clear", "haze"])
def test_recorded_images_are_those_of_the_engine(tmp_path: Path, lighting: Lighting | None) -> None:
    """Things move, the camera moves, another world comes in between: the same bytes, and nothing is recorded again."""
    world, other = street(tmp_path / "one"), street(tmp_path / "two", -5.0)
    if lighting is not None:
        world, other = world.with_lighting(lighting), other.with_lighting(lighting)
    counts = []
    for number in range(6):
        time = 0.1 * number
        view = _View(SPEC, Pose([0.2 * number, 0.1, 1.5]), 7 + number, 4)
        image = _trace(world.at(time), view)
        np.testing.assert_array_equal(image, plain(world, time, view).astype(np.float64))
        if number % 2:
            np.testing.assert_array_equal(_trace(other.at(time), view), plain(other, time, view).astype(np.float64))
        counts.append([kept.render.n_recordings for kept in world.twin("optical").recordings.values()])
    if not counts[0]:
        pytest.skip(BACKEND_RECORDS)
    assert len(counts[0]) == 1
    assert counts[-1] == counts[2]  # the first image records, and the second, which knows what changes


def test_a_scene_with_a_lamp_in_it_is_not_recorded(tmp_path: Path) -> None:
    world = street(tmp_path / "day")
    with variant.optical() as mi:
        assert may_record(mi, world.at(0.0).optical_scene()) == mi.variant().startswith("llvm")
        lamp = {"type": "sphere", "emitter": {"type": "area"}}
        assert not may_record(mi, mi.load_dict({"type": "scene", "sky": {"type": "constant"}, "lamp": lamp}))


def test_another_size_of_the_scene_is_another_recording(tmp_path: Path) -> None:
    """Mitsuba's sky keeps the ball around the scene: here the box drives out of what was the scene's box."""
    world = street(tmp_path / "far", 400.0)
    view = _View(SPEC, Pose([0.0, 0.0, 1.5]), 3, 4)
    for time in (0.0, 0.1, 0.2, 0.3):
        np.testing.assert_array_equal(_trace(world.at(time), view), plain(world, time, view).astype(np.float64))


def test_samples_of_several_launches_are_recorded_apart(tmp_path: Path) -> None:
    """12 samples are launches of 8 and of 4: their mean is that of the two images."""
    world = street(tmp_path / "both")
    state, view = world.at(0.0), _View(SPEC, Pose([0.0, 0.0, 1.5]), 3, 12)
    image = _trace(state, view)
    parts = [plain(world, 0.0, _View(SPEC, view.pose, 3 + 104729 * n, count)) for n, count in enumerate((8, 4))]
    np.testing.assert_allclose(image, (8.0 * parts[0] + 4.0 * parts[1]) / 12.0, rtol=1e-6, atol=1e-7)
    with variant.optical() as mi:
        integrator = mi.load_dict(integrator_dict(SPEC))
        unrecorded = _launched(mi, state.optical_scene(), integrator, view, 3)
    np.testing.assert_array_equal(image, unrecorded)
