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
    # Chirp, corners, leakage, levels of the channels, image, noise behind the filters and full scale are fitted to
    # static captures of an AWR1642 (docs/front_end.md); power, noise figure and phase noise are as above
    "awr1642": {
        "waveform": Fmcw(bandwidth=29.982e12 * 25.6e-6, ramp_time=25.6e-6, num_samples=256, num_chirps=128),
        "array": AntennaArray(tx_positions=uniform_line(2, 4 * HALF_WAVE), rx_positions=uniform_line(4, HALF_WAVE)),
        "multiplexing": Tdm(),
        "front_end": FrontEnd(
            tx_power_dbm=12.0,
            noise_figure_db=15.0,
            phase_noise=_falling(-93.0),
            leakage=(Leakage(length=0.1, level_db=-45.5),),
            channels=ChannelErrors(rx_gain_db=(0.6, -0.4, 0.3, -0.9)),
            mixer=Mixer(iq_gain_db=0.08),
            filters=IfFilter(high_pass=(175e3, 350e3), low_pass=9.4e6, low_pass_order=1),
            dc_offset_dbm=-77.7,
        ),
        "adc": Adc(full_scale_dbm=-23.0, enob=11.4),
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
