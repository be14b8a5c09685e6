"""Thin layers over wide bands: the transfer of a path follows the frequency, from the solvers to the samples."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.radar.gradients.path_model import PathModel
from scarl_sionna.radar.paths import RadarPaths, band_nodes
from scarl_sionna.radar.tuned import band_of, tuned_to
from scarl_sionna.scene.materials.fresnel import reflection, transmission
from scarl_sionna.scene.materials.table import builtin_materials
from tests.scenes import Material, Thing, plane, write_scene

PLASTIC = builtin_materials()["plastic"]  # 3 mm
ONE = {"tx_positions": ((0.0, 0.0, 0.0),), "rx_positions": ((0.0, 0.0, 0.0),)}
RAMPS = {"num_chirps": 4, "num_samples": 256}
WAVEFORMS = {
    "up": ss.Fmcw(bandwidth=4e9, **RAMPS),
    "down": ss.Fmcw(bandwidth=4e9, direction="down", start_frequency=81e9, adc_start_time=3e-6, **RAMPS),
    "hops": ss.Fmcw(bandwidth=1e9, frequency_step=1e9, **RAMPS),
    "across": ss.PcFmcw(bandwidth=4e9, coding="across", code="zadoff_chu", code_length=4, **RAMPS),
    "ofdm": ss.Ofdm(
        carrier_frequency=78e9, num_subcarriers=256, subcarrier_spacing=8e6, cyclic_prefix=0.2e-6, num_chirps=4
    ),
    "pmcw": ss.Pmcw(carrier_frequency=78e9, chip_rate=2e9, code_length=255, repetitions=2, num_chirps=4),
}


def radar_of(name: str) -> ss.RadarSpec:
    return ss.RadarSpec(waveform=WAVEFORMS[name]).with_(**ONE)


def slab(frequency) -> np.ndarray:
    """By the formula of a slab (ITU-R P.2040-3, eq. 43), with the permittivity of the table at each frequency."""
    out = []
    for value in np.ravel(frequency):
        root = np.sqrt(PLASTIC.at(float(value)))
        gamma = (1.0 - root) / (1.0 + root)
        turn = np.exp(-4j * np.pi * value / 299792458.0 * PLASTIC.thickness * root)
        out.append(gamma * (1.0 - turn) / (1.0 - gamma**2 * turn))
    return np.reshape(out, np.shape(frequency))


def of_sheet(paths: RadarPaths, radar, count: int) -> RadarPaths:
    """Paths of points that reflect as the sheet does, at so many frequencies."""
    band = band_of(radar)
    middle = slab(0.5 * sum(band))
    factor = np.tile(slab(band_nodes(band, count)) / middle, (paths.num_paths, 1))
    return replace(paths, a=paths.a * middle, over_band=factor, band=band)


def frequencies(radar) -> np.ndarray:
    """Of the samples of ramps, or of what a receiver of symbols makes, (num_chirps or 1, num_samples) [Hz]."""
    wave = radar.waveform
    if wave.kind in ("ofdm", "pmcw"):
        return wave.carrier_frequency + wave.spacing * (np.arange(wave.num_samples) - wave.num_samples // 2)[None]
    sign = 1.0 if wave.direction == "up" else -1.0
    time = wave.adc_start_time + np.arange(wave.num_samples) / wave.sample_rate
    steps = wave.frequency_step * np.arange(wave.num_chirps)
    return wave.start_frequency + steps[:, None] + sign * wave.bandwidth / wave.ramp_time * time


def channel(adc, radar):
    """The transfer at those frequencies, with the sign of a beat signal."""
    from scarl_sionna.signal.receivers import channel_of

    return channel_of(ss.virtual_cube(adc, radar)[0], radar)


@pytest.mark.parametrize("name", WAVEFORMS)
def test_samples_have_the_sheets_reflection_at_their_frequency(name) -> None:
    """A point at rest: the signal of constant transfer times the exact reflection, as conj in the beat signal."""
    radar = radar_of(name)
    paths = ss.point_targets([[6.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, radar, ss.Pose())
    plain = channel(ss.synthesize(paths, radar), radar)
    wanted = plain * np.conj(slab(frequencies(radar)))
    error = {}
    for count in (1, 3, 5):
        found = channel(ss.synthesize(of_sheet(paths, radar, count), radar), radar)
        error[count] = 20.0 * np.log10(np.abs(found - wanted).max() / np.abs(wanted).max())
    wide = band_of(radar)[1] - band_of(radar)[0]
    assert error[1] > (-16.0 if wide > 3e9 else -22.0)  # what one transfer for all misses
    assert error[3] < -60.0 + (1.0 if wide > 3e9 else 0.0)
    assert error[5] < -75.0  # the transforms' own tolerance


def test_many_moving_paths_are_the_direct_sum() -> None:
    radar, rng, count = radar_of("up").with_(num_samples=128), np.random.default_rng(2), 24
    distance = rng.uniform(2.0, 4.0, count)
    points = np.stack([distance, rng.uniform(-2.0, 2.0, count), np.zeros(count)], axis=1)
    paths = ss.point_targets(points, rng.normal(0.0, 10.0, (count, 3)), distance**4, radar, ss.Pose())
    paths = RadarPaths.concatenate([paths, of_sheet(paths, radar, 3)])
    assert paths.over_band.shape == (2 * count, 3) and (paths.over_band[:count] == 1.0).all()
    chosen = paths.select(np.arange(2 * count)[::-1])
    fast, exact = (ss.synthesize(chosen, radar, method=method) for method in ("nufft", "direct"))
    assert np.abs(fast - exact).max() < 1.1e-3 * np.abs(exact).max()
    halves = [ss.synthesize(chosen.select(part), radar) for part in (slice(0, count), slice(count, None))]
    assert np.abs(fast - sum(halves)).max() < 1e-3 * np.abs(exact).max()


MATERIALS = {"sheet": Material(radio="plastic")}
WALL = Thing("wall", plane(8.0, 8.0, (10, 0, 0), (-1, 0, 0)), "Wall", "sheet", is_object=False)
STEEL = Thing("target", plane(0.1, 0.1, (10, 0, 0), (-1, 0, 0)), "Static", "steel")
PANE = Thing("pane", plane(2.0, 2.0, (5, 0, 0), (-1, 0, 0)), "Static", "sheet")
SOLVED = {
    "mirror": ([WALL], {"method": "sionna", "num_samples": 2_000}, lambda f: reflection(PLASTIC, f, 1.0)[0]),
    "chains": ([WALL], {"method": "auto"}, lambda f: reflection(PLASTIC, f, 1.0)[0]),
    "pane": (
        [STEEL, PANE],
        {"method": "sbr", "instances": ["target"]},
        lambda f: transmission(PLASTIC, f, 1.0)[0] ** 2,
    ),
}


@pytest.mark.parametrize("name", [pytest.param("mirror", marks=pytest.mark.slow), "chains", "pane"])
def test_solvers_give_the_layers_transfer(tmp_path, name) -> None:
    things, how, law = SOLVED[name]
    radar = radar_of("up").with_(num_samples=512, elevation_fov_deg=60.0)
    state = ss.load_scene(write_scene(tmp_path, things, materials=MATERIALS)).at(0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        paths = ss.solve_paths(state, radar, ss.Pose(), num_band_frequencies=3, **how)
        edge = ss.solve_paths(state, tuned_to(radar, 77.5e9), ss.Pose(), **how)
    best = int(np.abs(paths.a[:, 0, 0]).argmax())
    nodes = band_nodes(band_of(radar), 3)
    wanted = np.array([complex(law(float(value))) for value in nodes])
    # the strongest path of a plate is met at up to 0.3 deg
    assert paths.over_band[best] == pytest.approx(wanted / wanted[1], abs=2e-3)
    assert paths.diagnostics["band_unmatched"] < 1e-2 and paths.diagnostics["band_error"] < 3e-3
    between = np.polynomial.chebyshev.Chebyshev.fit(nodes, paths.over_band[best], 2, domain=list(band_of(radar)))
    there = int(np.abs(edge.length - paths.length[best]).argmin())
    assert paths.a[best, 0, 0] * between(77.5e9) == pytest.approx(edge.a[there, 0, 0], rel=2e-3)


@pytest.mark.parametrize(
    "how",
    [
        {"method": "sionna", "num_samples": 2_000, "diffuse": True},
        {"method": "auto"},
        {"method": "raycast", "num_rays": 1_000},
        {"method": "sbr"},
    ],
    ids=lambda how: how["method"],
)
def test_all_solvers_meet_materials_in_the_middle_of_the_band(tmp_path, how) -> None:
    """Between start and middle of this band the sheet's reflection changes by 0.5 dB."""
    radar = radar_of("up").with_(num_samples=512, elevation_fov_deg=60.0)
    state = ss.load_scene(write_scene(tmp_path, [replace(WALL, is_object=True)], materials=MATERIALS)).at(0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        plain, middle, start = (
            ss.solve_paths(state, item, ss.Pose(), **how)
            for item in (radar, tuned_to(radar, radar.center_frequency), tuned_to(radar, radar.carrier_frequency))
        )
    np.testing.assert_array_equal(plain.a, middle.a)
    change = np.sum(np.abs(start.a) ** 2) / np.sum(np.abs(plain.a) ** 2)
    law = [abs(reflection(PLASTIC, value, 1.0)[0]) ** 2 for value in (radar.carrier_frequency, radar.center_frequency)]
    assert change == pytest.approx(law[0] / law[1], rel=0.1) and abs(change - 1.0) > 0.05


def test_a_sheets_echo_comes_from_within_it(tmp_path) -> None:
    """By 2.1 mm, 0.06 bins: the group delay of a slab's reflection; with one transfer it stands at the front."""
    radar = radar_of("up").with_(num_samples=1024)
    at_front = ss.point_targets([[6.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, radar, ss.Pose())
    low, high = 78.9e9, 79.1e9
    delay = -np.angle(slab(high) / slab(low)) / (2.0 * np.pi * (high - low))
    place = []
    for paths in (of_sheet(at_front, radar, 1), of_sheet(at_front, radar, 3)):
        rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar), radar), radar, num_range_bins=65536)
        place.append(rd.range[rd.power[2].argmax()])
    assert place[1] - place[0] == pytest.approx(0.5 * 299792458.0 * delay, abs=3e-4)
    assert place[1] - place[0] > 0.05 * radar.range_resolution


def test_warnings_have_numbers(tmp_path) -> None:
    state = ss.load_scene(write_scene(tmp_path, [WALL], materials=MATERIALS)).at(0.0)
    wide, how = radar_of("up").with_(num_samples=512, elevation_fov_deg=60.0), {"method": "raycast", "num_rays": 1000}
    with pytest.warns(ScarlWarning, match="band of 4 GHz the reflection of 'plastic' differs by up to"):
        ss.solve_paths(state, wide, ss.Pose(), **how)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        narrow = ss.solve_paths(state, wide.with_(bandwidth=1e9), ss.Pose(), **how)
        assert narrow.over_band is None and narrow.band is None
    with pytest.warns(ScarlWarning, match=r"at 3 frequencies is off by about 0\.00"):
        ss.solve_paths(state, wide, ss.Pose(), num_band_frequencies=3, **how)


def test_what_does_not_go_is_refused() -> None:
    radar = radar_of("up")
    paths = of_sheet(ss.point_targets([[6.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, ss.Pose()), radar, 3)
    with pytest.raises(ParameterRangeError, match="within 76.9922 to 80.9922 GHz, for which the paths were solved"):
        ss.synthesize(paths, radar.with_(start_frequency=76e9))
    symbols = radar_of("ofdm")
    with pytest.raises(ParameterRangeError, match="over_band"):
        ss.synthesize(replace(paths, band=band_of(symbols)), symbols, method="direct")
    with pytest.raises(ParameterRangeError, match="over_band.*num_band_frequencies=1"):
        PathModel(radar, paths)
    with pytest.raises(ParameterRangeError, match="several bands"):
        RadarPaths.concatenate([paths, replace(paths, band=(1e9, 2e9))])


def test_settings_without_it_are_those_of_older_files() -> None:
    assert "num_band_frequencies" not in ss.RadarSettings().model_dump()
    asked = ss.RadarSettings(num_band_frequencies=3)
    assert ss.RadarSettings(**asked.model_dump(mode="json")) == asked
