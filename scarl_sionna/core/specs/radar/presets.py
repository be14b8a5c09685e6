"""Named radars, as the parts in which they differ from the defaults."""

from __future__ import annotations

from collections.abc import Mapping

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .array import HALF_WAVE, AntennaArray, uniform_line
from .converter import Adc
from .front_end import FrontEnd
from .impairments import Amplifier, ChannelErrors, IfFilter, Leakage, Mixer, PhaseNoise
from .multiplexing import Ddm, Tdm
from .waveform import Fmcw
from .waveforms.coded import Pmcw

BOARD_3D = AntennaArray(
    tx_positions=((0.0, -2 * HALF_WAVE, 0.0), (0.0, 0.0, HALF_WAVE), (0.0, 2 * HALF_WAVE, 0.0)),
    rx_positions=uniform_line(4, HALF_WAVE),
)
"""TI AWR1843BOOST user's guide (SPRUIM4): Rx in a row at half a wavelength; Tx1 and Tx3 two wavelengths apart, Tx2
between them and half a wavelength higher."""


def _falling(level: float) -> PhaseNoise:
    """Return the mask of which data sheets give one point, at 1 MHz [dBc/Hz].

    Beyond it falls with 20 dB a decade, as a free oscillator's does (Leeson, Proc. IEEE 54(2), 1966); below it is held.
    """
    return PhaseNoise(mask=((1e6, level), (1e8, level - 40.0)))


CASCADE_HALF_WAVE = SPEED_OF_LIGHT / 76.8e9 / 2.0
"""Half a wavelength at the frequency that the cascade board is designed for [m]."""

PMCW_HALF_WAVE = SPEED_OF_LIGHT / 79e9 / 2.0
"""Half a wavelength at 79 GHz [m]."""

CASCADE = AntennaArray(
    tx_positions=tuple(
        (0.0, (azimuth - 16.0) * CASCADE_HALF_WAVE, elevation * CASCADE_HALF_WAVE)
        for azimuth, elevation in zip(
            (11, 10, 9, 32, 28, 24, 20, 16, 12, 8, 4, 0), (6, 4, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0), strict=True
        )
    ),
    rx_positions=tuple(
        (0.0, (first + offset - 26.5) * CASCADE_HALF_WAVE, 0.0) for first in (11, 50, 46, 0) for offset in range(4)
    ),
)
"""TI MMWCAS-RF-EVM: places in half wavelengths from TI's processing scripts (TI_Cascade_TX_position_azi and so on)."""

RADIAL_RANGE = 103.0
"""Range of the radar of the RADIal dataset [m]: 512 bins (rpl.py: RangeBin / numSamplePerChirp * 103)."""

AWR1642_RESPONSE = tuple(
    (number / 256, gain)
    for number, gain in (
        (0, -0.2), (2, 0.0), (5, 1.2), (10, 1.5), (15, 1.5), (20, 2.2), (25, 1.1), (28, 1.0), (32, 1.1),
        (36, 0.5), (40, 0.3), (44, 0.5), (48, 0.5), (52, -0.1), (56, 0.0), (60, 0.3), (64, 0.0), (68, -0.2),
        (72, 0.2), (76, 0.1), (80, -0.3), (84, 0.0), (88, 0.2), (92, -0.1), (96, -0.4), (100, 0.1), (104, 0.1),
        (108, -0.3), (112, 0.0), (116, 0.1), (120, -0.3), (124, -0.3), (128, 0.3), (132, -0.1), (136, -0.2),
        (140, 0.0), (144, 0.2), (148, -0.1), (152, -0.1), (156, 0.3), (160, 0.0), (164, -0.1), (168, 0.2),
        (172, 0.2), (176, -0.3), (180, 0.0), (184, 0.3), (188, -0.1), (192, -0.2), (196, 0.2), (200, 0.3),
        (204, -0.2), (208, -0.1), (212, 0.2), (216, 0.0), (220, -0.4), (224, -0.1), (228, -0.2), (232, -1.3),
        (235, -3.1), (238, -5.5), (240, -7.3), (242, -8.3), (244, -7.5), (246, -5.5), (248, -3.6), (250, -1.8),
        (253, -1.2),
    )
)  # fmt: skip # a table
"""What the band of an AWR1642 has beyond its high passes [dB], by range bin of 256: noise floors of three captures
(benchmarks/validation/captures.py --fit). The notch lies between positive and negative beat frequencies."""

PRESETS: Mapping[str, Mapping[str, Spec]] = {
    # Table 1 of SCaRL: the defaults of all parts
    "awr1843boost": {},
    "awr1843boost_3d": {"array": BOARD_3D, "multiplexing": Tdm()},
    # TI IWR1843 data sheet (SWRS228A), section 8.7, typical values at 77 to 81 GHz: 12 dBm, 15 dB, -93 dBc/Hz at 1 MHz,
    # compression -8 dBm, high passes of 175 and 350 kHz (the lowest choice), 10 MHz of IF, 12 bits
    "iwr1843boost": {
        "array": BOARD_3D,
        "multiplexing": Tdm(),
        "front_end": FrontEnd(
            tx_power_dbm=12.0,
            noise_figure_db=15.0,
            phase_noise=_falling(-93.0),
            amplifier=Amplifier(p1db_dbm=-8.0),
            filters=IfFilter(high_pass=(175e3, 350e3), low_pass=10e6),
        ),
        "adc": Adc(bits=12),
    },
    # Chirp, corners, leakage, levels of the channels, image, noise behind the filters, full scale and the response of
    # the band are fitted to static captures of an AWR1642 (docs/front_end.md); power, noise figure and phase noise are
    # as above
    "awr1642": {
        "waveform": Fmcw(bandwidth=29.982e12 * 25.6e-6, ramp_time=25.6e-6, num_samples=256, num_chirps=128),
        "array": AntennaArray(tx_positions=uniform_line(2, 4 * HALF_WAVE), rx_positions=uniform_line(4, HALF_WAVE)),
        "multiplexing": Tdm(),
        "front_end": FrontEnd(
            tx_power_dbm=12.0,
            noise_figure_db=15.0,
            phase_noise=_falling(-93.0),
            leakage=(Leakage(length=0.1, level_db=-43.7),),
            channels=ChannelErrors(rx_gain_db=(0.6, -0.4, 0.3, -0.9)),
            mixer=Mixer(iq_gain_db=0.08),
            filters=IfFilter(high_pass=(175e3, 350e3), low_pass=9.4e6, low_pass_order=1),
            dc_offset_dbm=-75.9,
        ),
        "adc": Adc(full_scale_dbm=-23.1, enob=11.4, response=AWR1642_RESPONSE),
    },
    # TI MMWCAS-RF-EVM: four AWR2243 with one oscillator; AWR2243 data sheet: 13 dBm, 12 dB, -94 dBc/Hz at 1 MHz,
    # 77 to 81 GHz
    "awr2243_cascade": {
        "array": CASCADE,
        "multiplexing": Tdm(),
        "front_end": FrontEnd(tx_power_dbm=13.0, noise_figure_db=12.0, phase_noise=_falling(-94.0)),
    },
    # Radar of the RADIal dataset (github.com/valeoai/RADIal): 12 Tx, 16 Rx on four chips, 256 chirps of 512 complex
    # samples, 16 Doppler bands of which 12 are sent, 103 m, 0.1 m/s. Carrier, ramp and places are this project's
    # assumptions: nothing that was found says them; the places are those of the cascade board, of as many antennas
    "radial_hd": {
        "waveform": Fmcw(
            start_frequency=76e9,
            bandwidth=512 * SPEED_OF_LIGHT / (2.0 * RADIAL_RANGE),
            ramp_time=64e-6,
            idle_time=12e-6,
            num_chirps=256,
            num_samples=512,
        ),
        "array": CASCADE,
        "multiplexing": Ddm(num_empty_bands=4),
    },
    # D. Guermandi et al., "A 79 GHz 2x2 MIMO PMCW radar SoC in 28 nm CMOS", IEEE J. Solid-State Circuits 52(10), 2017,
    # abstract: 79 GHz, two transmitters, two receivers, code domain, 7.5 cm. Code, its length and repetitions, chirps,
    # codes of the transmitters and places are this project's assumptions
    "pmcw_79ghz": {
        "waveform": Pmcw(
            carrier_frequency=79e9,
            chip_rate=SPEED_OF_LIGHT / (2.0 * 0.075),
            code="m_sequence",
            code_length=511,
            repetitions=100,
            num_chirps=256,
        ),
        "array": AntennaArray(
            tx_positions=uniform_line(2, 2.0 * PMCW_HALF_WAVE), rx_positions=uniform_line(2, PMCW_HALF_WAVE)
        ),
        "multiplexing": Ddm(num_empty_bands=2),
    },
}
