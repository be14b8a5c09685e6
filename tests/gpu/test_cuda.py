"""Every solver, camera and lidar on CUDA, beside the processor: `make test-gpu`, which skips where no device is.

Each backend works in a process of its own. Rays are traced by OptiX in place of Embree, in single precision both, so
that a ray along an edge may meet the neighbour; geometry behind that is float64 on both. So counts and labels may
depart by some rays, and powers by what these bring.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.engine.backend.cuda import cuda_device
from tests.gpu.work import LIDARS, SOLVERS

REPO = Path(__file__).resolve().parents[2]
OTHERS = 5e-3
"""Share of rays, pixels or points that may meet the neighbour: those within a float32 step of an edge are far fewer."""
DECIBELS = 0.2
"""By which those may change the power of all paths [dB]; and what `auto` chooses by its own look at the scene."""


def numbers(backend: str, folder: Path) -> dict[str, Any]:
    """Return the numbers of :mod:`.work` on a backend."""
    file = folder / f"{backend}-{len(list(folder.iterdir()))}.npz"
    command = [sys.executable, "-m", "tests.gpu.work", str(file)]
    done = subprocess.run(
        command, cwd=REPO, env=os.environ | {"SCARL_BACKEND": backend}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    with np.load(file) as found:
        return {name: found[name] for name in found.files}


def agree(one: dict[str, Any], other: dict[str, Any]) -> None:
    """Assert that the numbers of two backends are those of the same scene."""
    for method in SOLVERS:
        count, power, lengths = (f"{method}.{name}" for name in ("count", "power", "lengths"))
        assert one[count] > 0
        assert abs(int(one[count]) - int(other[count])) <= 2 + OTHERS * one[count], method
        assert abs(10.0 * np.log10(float(other[power] / one[power]))) < DECIBELS, method
        nearest = np.abs(one[lengths][:, None] - other[lengths]).min(axis=1)
        assert np.mean(nearest > 1e-6) <= 0.1, method  # of the strongest, 1e-6 m is 0.1 deg of phase
    assert np.mean(one["camera.instance"] != other["camera.instance"]) <= OTHERS
    both = np.isfinite(one["camera.depth"]) & np.isfinite(other["camera.depth"])
    assert np.mean(both != np.isfinite(one["camera.depth"])) <= OTHERS
    apart = np.abs(one["camera.depth"][both] / other["camera.depth"][both] - 1.0) > 1e-5
    assert np.mean(apart) <= OTHERS
    np.testing.assert_allclose(one["camera.rgb"], other["camera.rgb"], rtol=0.02)
    for name in LIDARS:
        first, second = one[f"{name}.distance"], other[f"{name}.distance"]
        assert abs(len(first) - len(second)) <= OTHERS * len(first)
        quantiles = np.linspace(0.05, 0.95, 19)
        np.testing.assert_allclose(np.quantile(first, quantiles), np.quantile(second, quantiles), rtol=0.01)


@pytest.mark.gpu
def test_all_that_casts_rays_runs_on_cuda(tmp_path: Path) -> None:
    device = cuda_device()
    if device is None:
        pytest.skip("no CUDA device that Dr.Jit can use; scarl-sionna info tells why")
    found = numbers("cuda", tmp_path)
    assert found["backend"] == "cuda"
    agree(numbers("llvm", tmp_path), found)


@pytest.mark.slow
def test_the_processor_agrees_with_itself(tmp_path: Path) -> None:
    """What is compared is there, and is the same twice where no other device is in it."""
    one, other = (numbers("llvm", tmp_path) for _ in range(2))
    agree(one, other)
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    weaker = other | {"sbr.power": 0.9 * other["sbr.power"]}
    with pytest.raises(AssertionError):
        agree(one, weaker)
