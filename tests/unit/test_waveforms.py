"""Waveforms as parts of a radar: files, copies, tables, and who refuses what."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.waveforms import codes
from scarl_sionna.dataset.formats.dca1000 import _ramps
from scarl_sionna.dataset.store.manifest import _derived

WAVEFORMS = (
    ss.Fmcw(direction="down", adc_start_time=2e-6, chirp_jitter=1e-6),
    ss.SteppedFmcw(num_steps=2),
    ss.PcFmcw(code="zadoff_chu", code_length=64),
    ss.Ofdm(num_subcarriers=64, comb=2, comb_offset=1),
    ss.Pmcw(code="golay", code_length=64, prefix_chips=10),
    ss.Pmcw(code="own", code_length=2, code_phases_deg=(0.0, 180.0)),
)


@pytest.mark.parametrize("waveform", WAVEFORMS, ids=lambda item: item.kind)
def test_a_waveform_goes_through_files_copies_and_tables(waveform) -> None:
    radar = ss.RadarSpec(waveform=waveform)
    assert ss.RadarSpec(**radar.model_dump(mode="json")) == radar
    assert ss.RadarSpec.model_validate_json(radar.model_dump_json()) == radar
    assert ss.RadarSpec(waveform=waveform.model_dump(mode="json")) == radar
    changed = radar.with_(num_chirps=8, tx_power_dbm=3.0)
    assert changed.waveform == waveform.with_(num_chirps=8)
    assert ss.RadarSpec().merged(radar).waveform == waveform
    assert type(waveform).__name__ in repr(radar) and "range_resolution" in repr(radar)
    assert _derived(radar)["num_samples"] == radar.num_samples


def test_a_mapping_without_a_kind_is_of_ramps() -> None:
    assert ss.RadarSpec(waveform={"bandwidth": 1e9}).waveform == ss.Fmcw(bandwidth=1e9)
    with pytest.raises(ParameterRangeError, match=r"RadarSpec\.waveform\.chip_rate = "):
        ss.RadarSpec(waveform={"kind": "pmcw", "chip_rate": 3e9})


@pytest.mark.parametrize("waveform", [*WAVEFORMS, ss.Fmcw(frequency_step=1e6)], ids=lambda item: item.kind)
def test_captures_are_of_equal_ramps_only(waveform) -> None:
    with pytest.raises(ParameterRangeError, match="radar 'front' = .*leave the radar out"):
        _ramps("front", ss.RadarSpec(waveform=waveform))
    assert _ramps("front", ss.RadarSpec(waveform=ss.Fmcw(direction="down"))).chirp_slope < 0.0


def test_parts_of_a_frame_keep_what_each_chirp_has() -> None:
    ramps = ss.Fmcw(num_chirps=16, chirp_jitter=2e-6, frequency_step=1e6)
    part = ramps.chirps(4, 8)
    assert part.chirp_delays == ramps.chirp_delays[4:12]
    assert np.array_equal(
        np.asarray(part.chirp_frequencies) + part.sweep.start_frequency,
        np.asarray(ramps.chirp_frequencies)[4:12] + ramps.sweep.start_frequency,
    )
    coded = ss.PcFmcw(num_chirps=16, coding="across")
    assert np.array_equal(coded.chirps(4, 8).chirps(2, 3).by_chirp, coded.by_chirp[6:9])
    data = ss.Ofdm(num_chirps=16, num_subcarriers=8)
    assert np.array_equal(data.chirps(4, 8).chirps(2, 3).spectrum, data.spectrum[6:9])
    own = data.with_(data_phases_deg=tuple((float(row),) * 8 for row in range(16)))
    assert np.array_equal(own.chirps(4, 8).chirps(2, 3).spectrum, own.spectrum[6:9])
    with pytest.raises(ParameterRangeError, match="take turns"):
        WAVEFORMS[4].chirps(3, 4)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"num_steps": 3}, "multiple of num_steps"),
        ({"chirp_jitter": 1e-6}, "kind = 'fmcw'"),
        ({"frequency_step": 301e6}, "leave gaps"),
        ({"frequency_step": -1e6}, "leave gaps"),
    ],
)
def test_what_no_burst_can_be_is_refused(fields, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ss.SteppedFmcw(**fields)


def test_codes_within_ramps_fit_into_the_samples() -> None:
    with pytest.raises(ParameterRangeError, match="512 chips within a ramp"):
        ss.PcFmcw(code_length=1023)
    assert ss.PcFmcw(code_length=1023, coding="across").code_length == 1023


def test_bursts_trade_velocity_for_range() -> None:
    ramps, bursts = ss.RadarSpec(), ss.RadarSpec(waveform=ss.SteppedFmcw(num_steps=4))
    assert bursts.range_resolution == pytest.approx(ramps.range_resolution / 4)
    assert bursts.max_range == pytest.approx(ramps.max_range)
    assert bursts.unambiguous_velocity == pytest.approx(ramps.unambiguous_velocity / 4, rel=0.01)
    assert bursts.velocity_resolution == pytest.approx(ramps.velocity_resolution, rel=0.01)
    assert (bursts.num_doppler_bins, bursts.num_range_bins) == (64, 2048)


def autocorrelation(code):
    return np.fft.ifft(np.abs(np.fft.fft(code)) ** 2)


@pytest.mark.parametrize("length", [7, 127, 1023, 4095])
def test_an_m_sequence_has_one_level_beside_its_peak(length) -> None:
    assert np.allclose(autocorrelation(codes.m_sequence(length))[1:], -1.0)


@pytest.mark.parametrize("length", [31, 63, 127, 1023])
def test_gold_codes_have_three_levels_alone_and_together(length) -> None:
    bits = length.bit_length()
    most = 2 ** ((bits + 2) // 2)
    levels = {-1, -1 - most, -1 + most}
    one, other = codes.gold(length, 3), codes.gold(length, 8)
    assert {int(value) for value in np.rint(autocorrelation(one).real[1:])} <= levels
    cross = np.fft.ifft(np.fft.fft(one) * np.conj(np.fft.fft(other))).real
    assert {int(value) for value in np.rint(cross)} <= levels


@pytest.mark.parametrize("length", [8, 12, 16, 24, 256, 1020, 2044])
def test_almost_perfect_codes_have_one_sidelobe(length) -> None:
    code = codes.almost_perfect(length)
    assert set(np.unique(code.real)) == {-1.0, 1.0}
    found = autocorrelation(code).real
    assert found[length // 2] == pytest.approx(4.0 - length)
    assert np.abs(np.delete(found, [0, length // 2])).max() < 1e-9


@pytest.mark.parametrize(("length", "root"), [(64, 1), (127, 5), (512, 3)])
def test_zadoff_chu_sequences_are_perfect(length, root) -> None:
    code = codes.zadoff_chu(length, root)
    assert np.allclose(np.abs(code), 1.0) and np.abs(autocorrelation(code)[1:]).max() < 1e-9


@pytest.mark.parametrize("length", [2, 64, 1024])
def test_golay_pairs_are_perfect_together(length) -> None:
    first, second = codes.golay(length)
    assert np.abs((autocorrelation(first) + autocorrelation(second))[1:]).max() < 1e-9
