"""Images whose kernel was recorded have the bytes of those that are traced anew."""

from __future__ import annotations

import gc
import signal
import time
import weakref
from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.light import recording
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from tests.scenes import Material, Thing, box, plane, write_scene

SPEC = CameraSpec(width=48, height=27, samples_per_pixel=4, images=("rgb",), denoise=False)
HAZE = Lighting(sun_elevation_deg=30.0, visibility=300.0)


def street(folder: Path, lighting: Lighting) -> World:
    """Write a road on which a red box crosses the view."""
    motion = {"kind": "constant_twist", "position": (12.0, -6.0, 1.0), "velocity": (0.0, 12.0, 0.0)}
    car = Thing("car", box((2.0, 3.0, 2.0)), "Car", "red", trajectory=motion)
    road = Thing("road", plane(200.0, 60.0, (90.0, 0.0, 0.0)), "Roads", is_object=False)
    folder.mkdir()
    path = write_scene(folder, [road], [car], {"red": Material((0.7, 0.05, 0.05))})
    return load_scene(path).with_lighting(lighting)


def shot(world: World, number: int) -> np.ndarray:
    """Return an image of its own time, place and seed."""
    pose = Pose([0.1 * number, 0.0, 1.5])
    image = Camera(SPEC).observe(world.at(0.1 * number), pose, np.random.default_rng(number)).rgb
    assert image is not None
    return image


def test_recorded_images_have_the_bytes_of_new_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two streets in turn, while everything in them moves and garbage is collected: three images of each."""
    worlds = [street(tmp_path / "clear", HAZE.with_(visibility=None)), street(tmp_path / "hazy", HAZE)]
    runs: list[bool] = []
    found = recording._recorded

    def counted(*given: object) -> object:
        kept = found(*given)  # type: ignore[arg-type]
        runs.append(kept is not None)
        return kept

    with monkeypatch.context() as counting:
        counting.setattr(recording, "_recorded", counted)
        recorded = []
        for number in range(3):
            recorded += [shot(world, number) for world in worlds]
            gc.collect()
    assert sum(runs) == len(runs) - 2  # all but the first of each
    for world in worlds:
        kinds = recording._RECORDED[world.twin("optical")]
        assert [kept._render.n_recordings <= 3 for kept in kinds.values() if kept is not None] == [True]
    monkeypatch.setattr(recording, "_recorded", lambda *_: None)
    traced = [shot(world, number) for number in range(3) for world in worlds]
    assert all(np.array_equal(*pair) for pair in zip(recorded, traced, strict=True))
    assert len({image.tobytes() for image in traced}) == 6


def test_a_recording_goes_with_its_world(tmp_path: Path) -> None:
    world = street(tmp_path / "street", HAZE)
    for number in range(2):
        shot(world, number)
    twin, kinds = weakref.ref(world.twin("optical")), weakref.ref(recording._RECORDED[world.twin("optical")])
    del world
    gc.collect()
    assert twin() is None and kinds() is None


def test_another_number_of_threads_is_another_kind(tmp_path: Path) -> None:
    """Sums over pixels have a copy for each thread: what two threads recorded would write beyond them with three."""
    from scarl_sionna.engine.threads import limit_threads

    world = street(tmp_path / "street", HAZE)
    images = []
    for count in (2, 3, 2):
        limit_threads(count)
        images.append([shot(world, number).tobytes() for number in range(2)])
    limit_threads(2)
    assert images[0] == images[1] == images[2]
    assert [key[-1] for key in recording._RECORDED[world.twin("optical")]] == [3, 2]  # the last used at the end


def test_a_signal_waits_for_the_end_of_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while an image is recorded, then while it is run again: raised behind it, and the next image is right."""
    world = street(tmp_path / "street", HAZE)
    expected = shot(world, 5)
    made, pressed = recording.ray_table_sensor, []

    def pressing(*given: object) -> object:
        sensor = made(*given)  # type: ignore[arg-type]
        taken = sensor.take

        def take(*rays: object) -> None:
            pressed.append(True)
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.001)  # Python runs handlers between two of its steps
            taken(*rays)

        sensor.take = take
        return sensor

    with monkeypatch.context() as pressing_while_recorded:
        pressing_while_recorded.setattr(recording, "ray_table_sensor", pressing)
        with pytest.raises(KeyboardInterrupt):
            shot(world, 1)
    assert pressed
    handler = signal.getsignal(signal.SIGINT)
    assert handler is signal.default_int_handler
    with pytest.raises(KeyboardInterrupt), recording.signals_wait():
        signal.raise_signal(signal.SIGINT)
        done = True
    assert done and signal.getsignal(signal.SIGINT) is handler
    recording._RECORDED.clear()
    assert np.array_equal(shot(world, 5), expected)
