"""Parts of a radar: copies by field names, misplaced and misspelt names, and timing of the multiplexing."""

from __future__ import annotations

import copy
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, ScarlError, UnknownFieldError
from scarl_sionna.core.prompt.refusals import parts_of
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.radar.multiplexing import KINDS, Multiplexing
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.waveform import Waveform
from scarl_sionna.core.units import SPEED_OF_LIGHT

ONE = ((0.0, 0.0, 0.0),)


class Tone(Spec):
    """A waveform that is no ramp: codes of `num_samples` chips, sent without a pause."""

    kind: Literal["tone"] = "tone"
    carrier_frequency: float = 79e9
    chip_rate: float = Field(1e9, gt=0.0)
    num_chirps: int = 16
    num_samples: int = 1000

    @property
    def center_frequency(self) -> float:
        return self.carrier_frequency

    @property
    def sample_rate(self) -> float:
        return self.chip_rate

    @property
    def sampled_bandwidth(self) -> float:
        return self.chip_rate

    @property
    def num_range_bins(self) -> int:
        return self.num_samples

    @property
    def burst(self) -> int:
        return 1

    @property
    def chirp_delays(self) -> None:
        return None

    @property
    def chirp_frequencies(self) -> None:
        return None

    @property
    def chirp_interval(self) -> float:
        return self.num_samples / self.chip_rate


class OtherRadar(ss.RadarSpec):
    """A radar that may have the other waveform."""

    waveform: Annotated[ss.Fmcw | Tone, Field(discriminator="kind")] = ss.Fmcw()


def test_no_two_fields_have_one_name_so_that_the_short_form_is_clear() -> None:
    names = [
        field
        for kinds in parts_of(ss.RadarSpec).values()
        for field in {name for kind in kinds for name in kind.model_fields}
    ]
    names = [name for name in names if name != "kind"] + list(ss.RadarSpec.model_fields)
    assert len(names) == len(set(names))


def test_the_short_form_of_a_copy_is_the_long_one() -> None:
    short = ss.RadarSpec().with_(
        num_chirps=64,
        bandwidth=1e9,
        tx_positions=ONE,
        pattern=IsotropicPattern(),
        tx_power_dbm=10,
        bits=12,
        azimuth_fov_deg=90,
    )
    assert short == ss.RadarSpec(
        waveform=ss.Fmcw(num_chirps=64, bandwidth=1e9),
        array=ss.AntennaArray(tx_positions=ONE, pattern=IsotropicPattern()),
        front_end=ss.FrontEnd(tx_power_dbm=10),
        adc=ss.Adc(bits=12),
        azimuth_fov_deg=90,
    )
    assert short != ss.RadarSpec() and short.with_() == short


def test_a_part_and_its_fields_may_change_together() -> None:
    radar = ss.RadarSpec().with_(waveform=ss.Fmcw(bandwidth=1e9), num_chirps=3, multiplexing="tdm", front_end={})
    assert radar.waveform == ss.Fmcw(bandwidth=1e9, num_chirps=3)
    assert radar.multiplexing == ss.Tdm()
    assert ss.RadarSpec().with_(waveform={"bandwidth": 1e9}, num_chirps=3).waveform == radar.waveform


def test_other_parts_stay_as_they_are() -> None:
    base = ss.RadarSpec.preset("awr1843boost_3d").with_(tx_power_dbm=3.0)
    changed = base.with_(num_chirps=5)
    assert changed.with_(num_chirps=base.num_chirps) == base
    assert (changed.array, changed.multiplexing, changed.front_end) == (base.array, base.multiplexing, base.front_end)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (
            "num_chirps",
            64,
            r"in its part `waveform`.*RadarSpec\(waveform=Fmcw\(num_chirps=64\)\) or "
            r"RadarSpec\(\)\.with_\(num_chirps=64\)",
        ),
        ("tx_power_dbm", 10, r"RadarSpec\(front_end=FrontEnd\(tx_power_dbm=10\)\)"),
        ("tx_positions", ONE, r"RadarSpec\(array=AntennaArray\(tx_positions=\(\(0.0, 0.0, 0.0\),\)\)\)"),
        ("adc_bits", 8, r"RadarSpec\(adc=Adc\(bits=8\)\) or RadarSpec\(\)\.with_\(bits=8\)"),
        ("bandwith", 1e9, r"did you mean 'bandwidth'\? write RadarSpec\(waveform=Fmcw\(bandwidth=1000000000.0\)\)"),
        ("num_sample", 3, "a field of RadarSpec or of one of its parts waveform, multiplexing, array, front_end, adc"),
        ("num_rays", 3, r"in the settings.*RadarSettings\.of\(num_rays=3\)"),
    ],
)
def test_a_name_that_stands_elsewhere_or_nowhere_is_refused_with_its_place(name, value, message) -> None:
    with pytest.raises(ParameterRangeError, match=rf"RadarSpec\.{name} = .*{message}") as caught:
        ss.RadarSpec(**{name: value})
    assert isinstance(caught.value, ScarlError) and caught.value.name == f"RadarSpec.{name}"
    assert (caught.value.model, caught.value.path) == (ss.RadarSpec, (name,))


@pytest.mark.parametrize(
    ("name", "hint"), [("azimuth_fov", "; did you mean 'azimuth_fov_deg'?"), ("zzz", ""), ("kind", "")]
)
def test_a_name_of_no_part_is_an_unknown_field(name, hint) -> None:
    for make in (ss.RadarSpec, ss.RadarSpec().with_):
        with pytest.raises(UnknownFieldError) as caught:
            make(**{name: 3})
        assert caught.value.path == (name,) and str(caught.value).endswith(f"waveform){hint}")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_chirp": 3}, r"RadarSpec\.num_chirp = 3 .*did you mean 'num_chirps'\? write RadarSpec\(waveform=Fmcw"),
        ({"adc_bits": 3}, r"in its part `adc`.*with_\(bits=3\)"),
        ({"kind": "pmcw"}, r"RadarSpec\.kind is an unknown field of RadarSpec"),
        ({"noise_figure_db": -1.0}, r"RadarSpec\.front_end\.noise_figure_db = -1\.0"),
        ({"num_samples": 0}, r"RadarSpec\.waveform\.num_samples = 0"),
        ({"sampling_frequency": 1e6}, r"RadarSpec\.waveform = .*512 samples at 1 MHz take 512 us, the ramp 30 us"),
        ({"waveform": 3}, r"RadarSpec\.waveform = 3"),
        ({"waveform": 3, "num_chirps": 4}, r"RadarSpec\.waveform = 3"),
        ({"waveform": {"kind": "pmcv"}}, r"RadarSpec\.waveform\.kind = 'pmcv'.*did you mean 'pmcw'"),
        ({"multiplexing": "pdm"}, r"RadarSpec\.multiplexing = 'pdm' .*'ideal' or 'tdm'"),
    ],
)
def test_a_copy_refuses_what_the_constructor_refuses(change, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ss.RadarSpec().with_(**change)


def test_reading_a_field_of_a_part_says_where_it_is() -> None:
    radar = ss.RadarSpec()
    with pytest.raises(AttributeError, match=r"RadarSpec has no 'bandwidth'; read waveform\.bandwidth"):
        radar.bandwidth  # noqa: B018
    with pytest.raises(AttributeError, match=r"read adc\.bits"):
        radar.adc_bits  # noqa: B018
    with pytest.raises(AttributeError, match="colour"):
        radar.colour  # noqa: B018
    assert not hasattr(radar, "pattern")


def test_model_copy_checks_and_forgets_what_was_computed() -> None:
    radar = ss.RadarSpec()
    assert radar.tx_array.shape == (3, 3)  # computed and kept
    other = radar.model_copy(update={"array": ss.AntennaArray(tx_positions=((0.0, 0.1, 0.0), (0.0, 0.2, 0.0)))})
    np.testing.assert_array_equal(other.tx_array, [[0.0, 0.1, 0.0], [0.0, 0.2, 0.0]])
    array = radar.array.model_copy(update={"tx_positions": ONE}, deep=True)
    np.testing.assert_array_equal(array.tx_array, ONE)
    assert radar.array.tx_array.shape == (3, 3)
    with pytest.raises(ParameterRangeError, match=r"AntennaArray.*within 1\.0 m"):
        radar.array.model_copy(update={"rx_positions": ((0.0, 3.0, 0.0),)})
    with pytest.raises(ParameterRangeError, match=r"RadarSpec\.azimuth_fov_deg"):
        radar.model_copy(update={"azimuth_fov_deg": -1.0})
    with pytest.raises(ParameterRangeError, match="did you mean 'num_chirps'"):
        radar.model_copy(update={"num_chirp": 3})
    assert radar.model_copy() == radar == radar.model_copy(deep=True) == copy.deepcopy(radar)


def test_equality_and_hash_are_of_the_fields() -> None:
    one, two, other = ss.RadarSpec(), ss.RadarSpec(), ss.RadarSpec().with_(tx_positions=ONE)
    for radar in (one, two, other):
        assert radar.tx_array.size  # arrays that are kept with a specification have no truth value
    assert one == two and hash(one) == hash(two) and one.array == two.array
    assert one != other and one.array != other.array
    assert ss.IdealMimo() != ss.Tdm() and ss.RadarSpec() != 3


def test_positions_kept_with_a_specification_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        ss.RadarSpec().rx_array[0] = 1.0


def test_every_multiplexing_is_found_by_its_name() -> None:
    assert KINDS == ("ideal", "tdm", "ddm", "bpm", "cdm", "fdm")
    fields = {"ddm": {"num_empty_bands": 1}, "bpm": {"block_length": None}, "cdm": {"code_seed": 0, "phases_deg": None}}
    fields["fdm"] = {"is_summed": True}
    for kind in KINDS:
        waveform = ss.Ofdm(num_subcarriers=96) if kind == "fdm" else ss.Fmcw()
        radar = ss.RadarSpec(waveform=waveform, multiplexing=kind)
        assert radar.multiplexing.kind == kind
        assert radar.model_dump(mode="json")["multiplexing"] == {"kind": kind, **fields.get(kind, {})}
        assert ss.RadarSpec(**radar.model_dump(mode="json")) == radar


def test_times_of_transmitters() -> None:
    ideal: Multiplexing = ss.IdealMimo()
    tdm: Multiplexing = ss.Tdm()
    assert [ideal.tx_delay(tx, 38e-6) for tx in range(3)] == [0.0, 0.0, 0.0]
    assert [tdm.tx_delay(tx, 38e-6) for tx in range(3)] == [0.0, 38e-6, 2 * 38e-6]
    assert (ideal.doppler_interval(38e-6, 3), tdm.doppler_interval(38e-6, 3)) == (38e-6, 3 * 38e-6)
    # a turn of all transmitters is over when the first one sends again
    assert tdm.tx_delay(3, 38e-6) == tdm.doppler_interval(38e-6, 3)
    assert ideal.num_rows(256, 3) == tdm.num_rows(256, 3) == 768
    radar = ss.RadarSpec(multiplexing=ss.Tdm())
    assert (radar.tx_delay(2), radar.frame_time, radar.num_chirps_total) == (76e-6, 38e-6 * 3 * 256, 768)


def test_what_a_waveform_says_is_what_the_radar_says() -> None:
    waveform: Waveform = ss.Fmcw(num_samples=300, num_chirps=7, sampling_frequency=20e6)
    radar = ss.RadarSpec(waveform=waveform)
    for name in (
        "carrier_frequency",
        "center_frequency",
        "num_chirps",
        "num_samples",
        "sample_rate",
        "sampled_bandwidth",
        "chirp_interval",
    ):
        assert getattr(radar, name) == getattr(waveform, name)
    # 300 samples at 20 MHz are half of the ramp
    assert radar.sampled_bandwidth == pytest.approx(150e6, rel=1e-15)
    assert radar.carrier_frequency == 77e9


def test_a_radar_of_another_waveform_needs_nothing_else() -> None:
    waveform: Waveform = Tone()
    radar = OtherRadar(waveform=waveform, multiplexing="tdm")
    # chips of 1 ns: bins of 15 cm, 1000 of them in a code of 1 us; 3 transmitters in turn
    assert radar.range_resolution == pytest.approx(SPEED_OF_LIGHT / 2e9, rel=1e-15)
    assert radar.max_range == pytest.approx(SPEED_OF_LIGHT * 1e-6 / 2, rel=1e-15)
    assert radar.doppler_interval == pytest.approx(3e-6, rel=1e-15)
    assert radar.frame_time == pytest.approx(48e-6, rel=1e-15)
    assert radar.wavelength == SPEED_OF_LIGHT / 79e9
    assert (radar.num_chirps_total, radar.num_samples) == (48, 1000)
    assert radar.with_(chip_rate=2e9, num_chirps=4).waveform == Tone(chip_rate=2e9, num_chirps=4)
    assert OtherRadar(**radar.model_dump(mode="json")) == radar
    with pytest.raises(ParameterRangeError, match=r"OtherRadar\.bandwidth"):
        radar.with_(bandwidth=1e9)  # this waveform has none
    assert OtherRadar().with_(waveform=Tone(), chip_rate=3e9).waveform == Tone(chip_rate=3e9)
