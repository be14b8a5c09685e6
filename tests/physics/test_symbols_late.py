"""Symbols that come after the prefix, by transforms and single samples, against the plain sum over all samples."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis import _of_symbols, codes_of
from scarl_sionna.radar.synthesis.coded import late, symbols

SMALL = {"num_subcarriers": 64, "subcarrier_spacing": 600e3, "num_chirps": 8, "cyclic_prefix": 0.2e-6}
WAVEFORMS = {
    "pause": ss.Ofdm(**SMALL, idle_time=30e-6),
    "no pause": ss.Ofdm(**SMALL, idle_time=0.0, comb=2, comb_offset=1),
    "no prefix": ss.Ofdm(**{**SMALL, "cyclic_prefix": 0.0}, idle_time=0.1e-6),
    "golay": ss.Pmcw(code="golay", code_length=64, chip_rate=60e6, prefix_chips=12, repetitions=2, num_chirps=8),
}
ENDS = {"tx_positions": ((0.0, -0.008, 0.0), (0.0, 0.008, 0.0)), "rx_positions": ((0.0, -0.003, 0.0), (0.0, 0.03, 0.0))}
FLOOR = 1e-7
"""What transforms have of the phases of 77 GHz, whatever their tolerance: 4e-8 of paths within the prefix, too."""


def scene(radar, far):
    """Return points near and far that cross, seen by a radar that moves and turns."""
    rng, count = np.random.default_rng(0), 8
    distance, azimuth = rng.uniform(20.0, far, count), rng.uniform(-1.0, 1.0, count)
    points = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    mount = Mount(Pose(), Twist([10.0, 1.0, 0.0], [0.02, -0.03, 0.6]))
    return ss.point_targets(points, rng.normal(0.0, 40.0, (count, 3)), 1e-3 * distance**4, radar, mount)


def summed(signals, radar):
    out = np.zeros((radar.num_tx, radar.num_rx, radar.num_chirps, radar.num_samples), dtype=complex)
    for first, signal in signals:
        for tx in range(radar.num_tx):
            for rx in range(radar.num_rx):
                values = signal(tx, rx)
                out[tx, rx, first : first + len(values)] += values
    return out


@pytest.mark.some(4)
@pytest.mark.filterwarnings("ignore:.*longer than the prefix")
@pytest.mark.parametrize("far", [300.0, 1500.0])
@pytest.mark.parametrize("cost", [0, late.GROUP_COST])
@pytest.mark.parametrize("kind", ["ideal", "bpm", "tdm"])
@pytest.mark.parametrize("name", WAVEFORMS)
def test_late_paths_are_the_plain_sum(monkeypatch, name, kind, cost, far) -> None:
    radar = ss.RadarSpec(waveform=WAVEFORMS[name]).with_(multiplexing=kind, **ENDS)
    paths, codes, plain = scene(radar, far), codes_of(radar), symbols.plain
    radar = radar.separated
    wanted = summed([(0, plain(paths, radar, radar.waveform, 1e-9, codes))], radar)
    in_turn = late.alone_in_turn(paths, radar, radar.waveform)
    assert kind == "tdm" or in_turn.all()

    def counted(some, *others):
        assert some.num_paths == (~in_turn).sum()  # the others are not summed plainly
        return plain(some, *others)

    monkeypatch.setattr(symbols, "plain", counted)
    monkeypatch.setattr(late, "GROUP_COST", cost)
    found = summed(_of_symbols(paths, radar, 1e-11, 1e-9, codes), radar)
    assert (~symbols.within_prefix(paths, radar, radar.waveform)).sum() >= 5
    assert np.abs(found - wanted).max() < FLOOR * np.abs(wanted).max()


def test_the_default_prefix_holds_all_ranges_that_are_told_apart() -> None:
    radar = ss.RadarSpec(waveform=ss.Ofdm())
    assert radar.waveform.prefix_time * SPEED_OF_LIGHT > 2.0 * radar.max_range + 4.0
    small = radar.with_(num_chirps=4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.synthesize(ss.point_targets([[249.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, small, Pose()), small)


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("pause", "ideal", "up to 31 of the 64 samples of their windows are empty; a longer prefix spares it$"),
        ("no pause", "ideal", "up to 31 of the 64 samples .* hold symbols before theirs, or nothing"),
        ("no pause", "tdm", r"1 bring the symbol of another transmitter, .* some 0\.00\d+ s of a core"),
    ],
)
def test_what_is_said_of_late_paths_is_so(name, kind, text) -> None:
    radar = ss.RadarSpec(waveform=WAVEFORMS[name]).with_(multiplexing=kind, **ENDS)
    paths = ss.point_targets([[150.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    with pytest.warns(ss.ScarlWarning, match=text):
        adc = ss.synthesize(paths, radar)
    windows = np.abs(adc).max(axis=0)
    assert (windows[-1, :30] == 0.0).all() == (name == "pause") and windows[-1, 31:].all()
