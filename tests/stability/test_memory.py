"""Worlds that are no longer used leave nothing in the process."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.memory import release_memory, resident_bytes
from scarl_sionna.simulation import observe
from tests.exports import RIG
from tests.scenes import Thing, ball, box, plane, write_scene

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def test_loaded_and_dropped_worlds_leave_nothing() -> None:
    """With several loader threads Mitsuba 3.9 loses a texture of 1024 x 1024 x 3 floats at each load of this scene.

    12 MB.
    """
    taken = []
    for _ in range(5):
        load_scene("tunnel", detail="light")
        release_memory()
        taken.append(resident_bytes()[0])
    # Three loads after the second, when all kernels are there: 36 MB if one texture were lost, a few pages of the heap
    # if none
    assert taken[-1] - taken[1] < 20e6


HELD = """
import sys, threading
import numpy as np
from scarl_sionna.engine.memory import release_memory, resident_bytes, share_heaps

if sys.argv[1] == "share":
    share_heaps()
large = np.zeros(31 << 20, np.uint8)  # once freed, arrays of this size come from heaps
del large
before = resident_bytes()[0]
together = threading.Barrier(16)

def work():
    for _ in range(3):
        together.wait()
        array = np.ones(1 << 20, complex)
        together.wait()
        del array

threads = [threading.Thread(target=work) for _ in range(16)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
release_memory()
print(resident_bytes()[0] - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="an allocator of another kind")
def test_threads_that_share_heaps_leave_less() -> None:
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}  # as Dask sets them
    own, shared = (
        int(subprocess.run([sys.executable, "-c", HELD, how], capture_output=True, check=True, env=plain).stdout)
        for how in ("own", "share")
    )
    assert shared < 80e6  # one end of 64 MB, that of the heap that is not the first
    assert own > 120e6


def different_world(folder: Path, number: int) -> Path:
    """Write a scene whose shapes, their number and their sizes depend on a number."""
    rng = np.random.default_rng(number)
    things = [Thing("road", plane(100.0 + number, 40.0), "Roads", is_object=False)]
    for index in range(3 + number % 5):
        place = rng.uniform((10.0, -8.0, 1.0), (60.0, 8.0, 1.0))
        shape = (
            box(rng.uniform(0.5, 4.0, 3), place) if index % 2 else ball(rng.uniform(0.3, 1.0), place, 2 + number % 3)
        )
        things.append(Thing(f"thing_{index}", shape, "Car"))
    ego = Thing("ego", box([4.0, 1.6, 0.6], [0, 0, 0.4]), "Car", trajectory=EGO)
    return write_scene(folder / str(number), things, [ego], ego="ego")


EGO = {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [8.0, 0.0, 0.0]}


@pytest.mark.own_process("many")
@pytest.mark.parametrize("count", [6, pytest.param(200, marks=pytest.mark.slow)])
def test_different_worlds_loaded_observed_and_dropped(count: int, tmp_path) -> None:
    """Every world has its own shapes, light and seed, and is seen by a camera, a lidar and a radar."""
    taken = []
    for number in range(count):
        lighting = Lighting(sun_elevation_deg=10.0 + 0.3 * number, turbidity=2.0 + 0.02 * number)
        world = load_scene(different_world(tmp_path, number)).with_lighting(lighting)
        observe(world, RIG, 0.5, number, index=0)
        del world
        release_memory()
        taken.append(resident_bytes()[0])
    assert taken[-1] - taken[4] < 100e6, [round(value / 1e6) for value in taken[4 :: max(count // 20, 1)]]


@pytest.mark.own_process("many")
def test_release_gives_back_what_the_engine_keeps_for_later() -> None:
    size = 30_000_000
    with variant.optical() as mi:
        import drjit as dr

        array = dr.arange(mi.Float, size) + 1.0  # computed: an array of NumPy's may be wrapped, and is NumPy's to free
        dr.eval(array)
        dr.sync_thread()
        del array
    before = resident_bytes()[0]
    release_memory()
    # 120 MB of float32 that Dr.Jit keeps for the next array; what else is freed, or comes and goes meanwhile, is far
    # less
    assert before - resident_bytes()[0] > 0.8 * 4 * size
