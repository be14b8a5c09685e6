"""Waveforms, multiplexing and front ends together: what works is right, what does not is refused."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlError

SMALL = {"num_chirps": 64, "num_samples": 128}
DISTANCE, SPEED = 30.0, 4.0


def peak(radar: ss.RadarSpec) -> tuple[float, float, float]:
    """Return range [m], velocity [m/s] and power over that received [dB] of the strongest cell of a point."""
    where, how = np.array([[DISTANCE, 0.0, 0.0]]), np.array([[SPEED, 0.0, 0.0]])
    paths = ss.point_targets(where, how, np.array([10.0]), radar, ss.Pose())
    cube = ss.virtual_cube(ss.synthesize(paths, radar), radar)
    found = ss.range_doppler(cube, radar, window="blackman")
    row, column = np.unravel_index(int(found.power.argmax()), found.power.shape)
    return float(found.range[column]), float(found.radial_velocity[row]), float(found.power[row, column])


WAVEFORMS = [
    ss.Fmcw(**SMALL),
    ss.Fmcw(direction="down", **SMALL),
    ss.Fmcw(ramp_time=40e-6, adc_start_time=5e-6, sampling_frequency=4e6, **SMALL),
    ss.PcFmcw(**SMALL),
    ss.Pmcw(code_length=127, chip_rate=300e6, repetitions=8, num_chirps=64, prefix_chips=127),
    ss.Ofdm(num_subcarriers=128, num_chirps=64),
]


@pytest.mark.parametrize("waveform", WAVEFORMS, ids=lambda waveform: f"{waveform.kind}")
@pytest.mark.parametrize("kind", ["ddm", "bpm", "cdm"])
def test_coded_transmitters_of_any_waveform_see_a_point_as_ideal_ones_do(waveform, kind: str) -> None:
    ideal = ss.RadarSpec(waveform=waveform, multiplexing="ideal")
    coded = ss.RadarSpec(waveform=waveform, multiplexing=kind)
    place, speed, power = peak(ideal)
    assert place == pytest.approx(DISTANCE, abs=ideal.range_resolution)
    found = peak(coded)
    assert found[:2] == pytest.approx((place, speed))
    # codes over slow time leave of each of the two others an amplitude of about 1 / sqrt(64 chirps)
    others = 2.0 / 8.0 if kind == "cdm" else 0.03
    assert abs(10.0 * np.log10(found[2] / power)) < 20.0 * np.log10(1.0 + others)


@pytest.mark.parametrize(
    ("waveform", "parts", "message"),
    [
        (ss.SteppedFmcw(num_steps=4, **SMALL), {"multiplexing": "ddm"}, "'ddm' with 'stepped_fmcw'"),
        (ss.Fmcw(chirp_jitter=1e-6, **SMALL), {"multiplexing": "bpm"}, "regular times"),
        (ss.Fmcw(frequency_step=1e6, **SMALL), {"multiplexing": "ddm"}, "one carrier"),
        (ss.Ofdm(num_chirps=64), {"multiplexing": ss.Tdm(order_seed=1)}, "order_seed = 1 .*beside 'ofdm'.*equal ramps"),
        (
            ss.Fmcw(chirp_jitter=1e-6, **SMALL),
            {"multiplexing": ss.Tdm(order_seed=4)},
            "order_seed = 4 .*: none beside chirp_jitter: .*; leave order_seed out, or chirp_jitter",
        ),
        (
            ss.Ofdm(num_chirps=64),
            {"front_end": ss.FrontEnd(chirp_errors=ss.ChirpErrors(start_jitter=1e-9))},
            "chirp_errors.*ramps without a code",
        ),
    ],
)
def test_parts_that_do_not_go_together_are_refused(waveform, parts, message: str) -> None:
    with pytest.raises(ScarlError, match=message):
        ss.RadarSpec(waveform=waveform, **parts)
