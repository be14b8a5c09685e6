"""What a scenario draws at random.

Within what is stated, the same for the same seed, and each draw apart from the others.
"""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scenario.randomize import FACTOR, PAINTS, draw_jitter, draw_look, draw_materials, material_ranges
from scarl_sionna.scenario.spec.actors import JitterSpec
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials

VARIANTS = {"blue": {"paint": (0.0, 0.0, 0.5)}, "red": {"paint": (0.5, 0.0, 0.0)}}
DRAWN = ("relative_permittivity", "conductivity", "thickness")


def test_every_built_in_material_has_a_range_that_holds_its_values() -> None:
    table, ranges = builtin_materials(), material_ranges()
    assert set(ranges) == set(table)
    for name, row in ranges.items():
        assert set(row) <= {*DRAWN, "together", "why"} and row["why"]
        for key in set(row) & set(DRAWN):
            lower, upper = row[key]
            assert lower <= getattr(table[name], key) <= upper and lower < upper


def test_materials_are_drawn_within_their_ranges_and_fill_them() -> None:
    table, ranges = builtin_materials(), material_ranges()
    drawn = [draw_materials(seed, table) for seed in range(100)]
    for name, row in ranges.items():
        for key in set(row) & set(DRAWN):
            lower, upper = row[key]
            values = np.array([getattr(one[name], key) for one in drawn])
            assert np.all((values >= lower * (1 - 1e-12)) & (values <= upper * (1 + 1e-12)))
            place = (values - lower) / (upper - lower)
            if key != "relative_permittivity":
                place = np.log(values / lower) / np.log(upper / lower)
            # mean of 100 even draws: 0.5 +- 0.0289; six sigma over some 70 values
            assert abs(place.mean() - 0.5) < 6 * 0.0289, (name, key)
        for key in ("roughness_rms", "lidar_reflectance"):
            nominal = getattr(table[name], key)
            most = 1.0 - table[name].lidar_transmittance if key == "lidar_reflectance" else np.inf
            values = np.array([getattr(one[name], key) for one in drawn])
            upper = min(nominal * FACTOR, most) * (1 + 1e-12)
            assert np.all((values >= nominal / FACTOR * (1 - 1e-12)) & (values <= upper))
        for key in ("source", "uncertainty", "permittivity_exponent", "frequency_range"):
            assert getattr(drawn[0][name], key) == getattr(table[name], key)


def test_a_dressed_persons_reflectance_stays_within_what_is_stated() -> None:
    def reflectance(permittivity: complex) -> float:
        root = np.sqrt(permittivity)
        return float(abs((1 - root) / (1 + root)) ** 2)

    nominal = reflectance(builtin_materials()["clothed_skin"].at(77e9))
    for seed in range(50):
        ratio = reflectance(draw_materials(seed, builtin_materials())["clothed_skin"].at(77e9)) / nominal
        # the range's ends stand with three digits: 1 % of the permittivity is below 1 % of the reflectance
        assert 0.9 - 0.01 < ratio < 1.35 + 0.01


def test_materials_of_a_user_without_a_range_stay() -> None:
    own = builtin_materials()["brick"].with_(name="my_brick")
    assert draw_materials(3, MaterialTable([own]))["my_brick"] == own


def test_the_same_seed_draws_the_same_whatever_else_is_drawn() -> None:
    table = builtin_materials()
    alone = draw_materials(3, MaterialTable([table["brick"]]))["brick"]
    assert alone == draw_materials(3, table)["brick"] != draw_materials(4, table)["brick"]
    assert draw_look(3, "a", VARIANTS, "vehicle") == draw_look(3, "a", VARIANTS, "vehicle")
    spec = JitterSpec()
    assert draw_jitter(3, "a", spec) == draw_jitter(3, "a", spec)
    assert len({draw_jitter(seed, name, spec, attempt) for seed in (0, 1) for name in "ab" for attempt in (0, 1)}) == 8


def test_looks_are_paints_of_their_shares() -> None:
    looks = [draw_look(seed, "a", VARIANTS, "vehicle") for seed in range(600)]
    assert {variant for variant, _ in looks} == {"blue", "red"}
    colors = np.array([colors["paint"] for _, colors in looks])
    assert np.all((colors >= 0.0) & (colors <= 1.0))
    palette = np.array([color for _, color in PAINTS])
    # a paint is its palette's colour times 0.85 to 1.15: the nearest one in log brightness and hue
    scaled = palette[None] * (np.linalg.norm(colors, axis=1)[:, None] / np.linalg.norm(palette, axis=1))[..., None]
    fit = np.linalg.norm(scaled - colors[:, None], axis=2) / np.linalg.norm(colors, axis=1)[:, None]
    factor = np.linalg.norm(colors, axis=1)[:, None] / np.linalg.norm(palette, axis=1)
    fit[(factor < 0.849) | (factor > 1.151)] = np.inf
    chosen = fit.argmin(axis=1)
    assert np.all(fit.min(axis=1) < 1e-3)
    for index, (share, _) in enumerate(PAINTS):
        sigma = np.sqrt(share * (1 - share) / 600)
        assert abs((chosen == index).mean() - share) < 5 * sigma


def test_jitter_is_even_between_its_bounds_and_off_without_a_specification() -> None:
    assert draw_jitter(0, "a", None) == draw_jitter(1, "b", None)
    spec = JitterSpec(along=3.0, lateral=0.4, yaw_deg=5.0)
    draws = np.array([[j.along, j.lateral, j.yaw_deg] for j in (draw_jitter(s, "a", spec) for s in range(400))])
    bounds = np.array([3.0, 0.4, 5.0])
    assert np.all(np.abs(draws) <= bounds)
    np.testing.assert_allclose(
        draws.var(axis=0), bounds**2 / 3.0, rtol=6 * np.sqrt(0.8 / 400)
    )  # var of the variance of even draws
    # of 400 even draws the mean is 0 +- bound / sqrt(1200)
    assert np.all(np.abs(draws.mean(axis=0)) < 6 * bounds / np.sqrt(1200))


@pytest.mark.parametrize("motion", ["vehicle", "walk"])
def test_a_model_without_variants_keeps_its_colours(motion) -> None:
    assert draw_look(0, "a", {}, motion) == (None, {})
