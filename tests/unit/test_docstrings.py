"""Public docstrings state shapes, units, errors and sources; what is missing is listed by kind."""

from __future__ import annotations

from collections import Counter
from importlib import import_module

import numpy as np
import numpy.typing as npt
import pytest

import camera_lidar
import scarl_sionna
from tests.docstrings import Need, needs_of_function, needs_of_module

PHYSICS = (
    "scarl_sionna.signal", "scarl_sionna.radar", "scarl_sionna.calibration", "scarl_sionna.engine.light",
    "scarl_sionna.scene.materials", "camera_lidar.lidar", "scarl_sionna.core.units",
    "scarl_sionna.core.specs.atmosphere",
    "scarl_sionna.core.specs.drop_sizes", "scarl_sionna.core.specs.weather",
)  # fmt: skip # a table
"""Packages of physics: their public functions name a source, or say that they are exact by geometry or definition."""
FURTHER = (
    "scarl_sionna.core.units", "scarl_sionna.core.specs.drop_sizes",
    "scarl_sionna.signal.link", "scarl_sionna.signal.noise", "scarl_sionna.signal.windows",
    "scarl_sionna.signal.antenna", "scarl_sionna.signal.peaks", "scarl_sionna.radar.link", "scarl_sionna.radar.antenna",
    "scarl_sionna.radar.micro_doppler", "scarl_sionna.calibration.physics", "scarl_sionna.calibration.estimate",
    "scarl_sionna.calibration.forward", "scarl_sionna.engine.light.sky", "scarl_sionna.engine.light.lamps",
    "scarl_sionna.engine.light.haze", "scarl_sionna.engine.light.look", "scarl_sionna.scene.materials.fresnel",
    "scarl_sionna.scene.materials.dielectrics", "scarl_sionna.scene.materials.wet", "scarl_sionna.scene.lanes",
    "scarl_sionna.scene.motion.trajectory", "scarl_sionna.scene.materials.table", "scarl_sionna.radar.weather.clutter",
    "camera_lidar.lidar.heterodyne.link", "camera_lidar.lidar.heterodyne.detection", "camera_lidar.lidar.returns",
    "camera_lidar.lidar.heterodyne.statistical", "camera_lidar.lidar.heterodyne.air", "camera_lidar.lidar.beam",
    "camera_lidar.lidar.heterodyne.tones", "camera_lidar.lidar.heterodyne.beat", "camera_lidar.lidar.spray",
)  # fmt: skip # a table
"""Modules that users call by their own name."""
LEAST = 0.9
"""Share of the needs of each kind that is met over all modules."""


def public_modules() -> list[str]:
    homes = {getattr(scarl_sionna, name).__module__ for name in scarl_sionna.__all__}
    homes |= {getattr(camera_lidar, name).__module__ for name in camera_lidar.__all__}
    return sorted(homes | set(FURTHER))


@pytest.fixture(scope="module")
def needs() -> list[Need]:
    return [
        need for name in public_modules() for need in needs_of_module(import_module(name), name.startswith(PHYSICS))
    ]


def planted(speed: float, values: npt.NDArray[np.float64]) -> float:
    """Return a thing of `speed` and `values`, see there."""
    if speed < 0.0:
        raise ValueError("speed")
    return speed * float(values.sum())


def complete(speed: float, values: npt.NDArray[np.float64]) -> float:
    """Return a thing [m/s].

    Parameters
    ----------
    speed : float
        [m/s].
    values : ndarray of float64, shape (num_values,)
        Dimensionless.

    Raises
    ------
    ValueError
        If the speed is negative.

    Notes
    -----
    J. Doe, *A Book*, 1999, Eq. (3).
    """
    if speed < 0.0:
        raise ValueError("speed")
    return speed * float(values.sum())


def test_the_gate_sees_what_is_missing() -> None:
    missing = {(need.kind, need.what) for need in needs_of_function(planted, "planted", True) if not need.met}
    units = {("unit", "speed"), ("unit", "values"), ("unit", "return")}
    assert missing == units | {("shape", "values"), ("raises", ""), ("source", "")}
    assert all(need.met for need in needs_of_function(complete, "complete", True))


@pytest.mark.parametrize("kind", ["shape", "unit", "raises", "source"])
def test_public_docstrings_are_complete(needs: list[Need], kind: str) -> None:
    asked = [need for need in needs if need.kind == kind]
    missing = [need for need in asked if not need.met]
    per_module = Counter(need.where.rpartition(".")[0] for need in missing)
    report = "\n".join(f"{need.where} {need.what}" for need in missing)
    assert len(asked) > 30
    assert len(missing) <= (1.0 - LEAST) * len(asked), f"{len(missing)} of {len(asked)}: {per_module}\n{report}"
