"""A street canyon with three materials and reflectors of known RCS, whose radar maps a calibration can use."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scarl_sionna.calibration import CalibrationProblem, ForwardModel, FreeParameter, PointTarget, RadarMap
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from tests.scenes import Material, Thing, box, plane, write_scene

RADAR = RadarSpec().with_(
    bandwidth=600e6,
    num_chirps=1,
    num_samples=128,
    pattern=IsotropicPattern(),
    tx_positions=((0.0, 0.0, 0.0),),
    rx_positions=((0.0, 0.0, 0.0), (0.0, 0.003, 0.002), (0.0, -0.004, 0.005)),
)
TARGETS = (
    PointTarget(position=(8.0, 0.6, 0.7), rcs=5.0),
    PointTarget(position=(12.0, -1.2, 1.3), rcs=8.0),
    PointTarget(position=(16.0, 1.0, 0.4), rcs=10.0),
)
TRUTH = np.array([3.6, 0.9, 5.6, 1.6, 4.2, 0.5])
PARAMETERS = tuple(
    FreeParameter(name=f"{material}.{field}", lower=lower, upper=upper)
    for material in ("asphalt", "concrete", "brick")
    for field, lower, upper in (("relative_permittivity", 2.0, 8.0), ("conductivity", 0.0, 5.0))
)


def street(folder: Path) -> Path:
    """Write the scene: road, wall on the left and on the right."""
    looks = {name: Material(radio=name) for name in ("asphalt", "concrete", "brick")}
    things = (
        Thing("road", plane(60.0, 20.0, (15, 0, 0), (0, 0, 1)), "Ground", "asphalt"),
        Thing("left", box((60.0, 0.2, 8.0), (15, 4.1, 4)), "Wall", "concrete"),
        Thing("right", box((60.0, 0.2, 8.0), (15, -5.1, 4)), "Wall", "brick"),
    )
    return write_scene(folder, things, materials=looks)


def street_problem(scene: Path, noise: float, max_depth: int = 2, **changes: object) -> CalibrationProblem:
    """Return the problem with a map of zeros in place of the measurement."""
    spec = RadarMap(
        name="map",
        scene=str(scene),
        position=(0.0, 0.0, 1.0),
        targets=TARGETS,
        radar=RADAR,
        noise=noise,
        num_samples=20_000,
        max_depth=max_depth,
        values=(0.0,) * (3 * 128),
        values_imag=(0.0,) * (3 * 128),
    )
    return CalibrationProblem(**{"parameters": PARAMETERS, "measurements": (spec,), "num_starts": 1, **changes})


def noisy(model: ForwardModel, truth: np.ndarray, rng: np.random.Generator) -> None:
    """Replace the data of all measurements by the model's prediction and noise."""
    for channel in model.channels:
        clean = model.predict(channel, truth)
        channel.data[:] = clean + channel.sigma * rng.normal(size=clean.shape)
