"""Radar cross section of people: clothes on skin by layers, and bodies against measured means at 76 to 81 GHz."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.table import builtin_materials
from scarl_sionna.scene.motion.trajectory import StaticTrajectory
from tests.scenes import Thing, plane, write_scene

RADAR = RadarSpec(azimuth_fov_deg=80.0, elevation_fov_deg=80.0)
DISTANCE, HEIGHT = 3.4, 0.8
MEASURED = (-6.86, -3.51)
"""Least and largest mean over azimuth [dBsm] of two adults in four garments, VV, seen from there (Fortuny-Guasch and
Chareau, JRC EUR 25762 EN, 2013, secondary)."""


def dressed(cosine: float, count: int, rng: np.random.Generator) -> tuple[float, float]:
    """Return the mean power reflectance, TE and TM, of garments over air over skin, by Airy's sums from the inside."""
    wave = 2.0 * np.pi * 77e9 / 299_792_458.0
    cloth = rng.uniform(1.4, 2.2, count) * (1.0 - 0.03j)
    depth, gap = rng.uniform(0.2e-3, 3e-3, count), rng.uniform(0.0, 10e-3, count)
    media = [np.ones(count), cloth, np.ones(count), np.full(count, builtin_materials()["skin"].at(77e9))]
    normal = [np.sqrt(medium - (1.0 - cosine**2) + 0j) for medium in media]
    found = []
    for magnetic in (False, True):
        y = [q / medium if magnetic else q for q, medium in zip(normal, media, strict=True)]
        face = [(y[k] - y[k + 1]) / (y[k] + y[k + 1]) for k in range(3)]
        inner = face[2] * np.exp(-2j * wave * gap * normal[2])
        inner = (face[1] + inner) / (1.0 + face[1] * inner) * np.exp(-2j * wave * depth * normal[1])
        found.append(float(np.mean(np.abs((face[0] + inner) / (1.0 + face[0] * inner)) ** 2)))
    return found[0], found[1]


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 40.0, 60.0])
def test_clothed_skin_reflects_what_garments_off_the_skin_do(angle_deg) -> None:
    cosine = float(np.cos(np.radians(angle_deg)))
    expected = dressed(cosine, 20_000, np.random.default_rng(2))
    entry = power_reflectance(builtin_materials()["clothed_skin"], 77e9, cosine)
    assert np.abs(np.array(entry) - expected).max() < 0.04


def sections(folder, model: str, method: str, count: int) -> np.ndarray:
    """Return the RCS of a person who stands at some azimuths, VV [m2]."""
    speck = Thing("speck", plane(0.02, 0.02, centre=(0.0, 0.0, -500.0)), "Static", "steel")
    person = ss.StagedActor("it", model, StaticTrajectory(Pose()), detail="light")
    state = ss.stage(write_scene(folder, [speck]), [person]).at(0.0)
    settings = {"settings": SbrSettings(floor_db=None)} if method == "sbr" else {}
    power = []
    for angle in (np.arange(count) + 0.4) * 2.0 * np.pi / count:
        place = np.array([DISTANCE * np.cos(angle), DISTANCE * np.sin(angle), HEIGHT])
        paths = solve_paths(state, RADAR, Pose.from_euler(place, yaw=np.pi + angle), method=method, **settings)
        if method == "raycast":  # rough hits: powers add
            power.append(np.sum(np.abs(paths.a[:, 0, 0]) ** 2))
            continue
        length = sum(np.linalg.norm(point - place, axis=1) for point in (paths.tx_point, paths.rx_point))
        wave = 2.0 * np.pi * (RADAR.center_frequency + np.linspace(-1e9, 1e9, 9)) / 299_792_458.0
        power.append(np.mean(np.abs(np.exp(-1j * np.outer(wave, length)) @ paths.a[:, 0, 0]) ** 2))
    return np.array(power) * (4.0 * np.pi) ** 3 * DISTANCE**4 / RADAR.wavelength**2


def dbsm(section: float) -> float:
    return float(10.0 * np.log10(section))


@pytest.mark.parametrize("model", ["adult_man", "adult_woman", "standing_adult"])
def test_the_class_of_pedestrians_has_the_measured_mean(tmp_path, model) -> None:
    assert MEASURED[0] < dbsm(np.mean(sections(tmp_path, model, "raycast", 6))) < MEASURED[1]


@pytest.mark.slow
def test_meshes_of_adults_have_the_measured_mean_and_medians(tmp_path) -> None:
    """Mean and median of three adults; those of one alone are 0.2 dB off at most."""
    found = [sections(tmp_path / model, model, "sbr", 16) for model in ("adult_man", "adult_woman", "standing_adult")]
    for some, margin in ((found, 0.0), *((one, 0.3) for one in found)):
        for section in (np.mean(some), np.median(some)):
            assert MEASURED[0] - margin < dbsm(section) < MEASURED[1] + margin


@pytest.mark.parametrize("model", ["man_27", "woman_52"])
def test_people_of_all_ages_have_the_measured_mean_of_the_class(tmp_path, model) -> None:
    assert MEASURED[0] < dbsm(np.mean(sections(tmp_path, model, "raycast", 6))) < MEASURED[1]
