"""What a MIMO radar is: waveform, multiplexing, array, front end, converter and field of view."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.prompt.describe import Row
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import REFERENCE_TEMPERATURE, SPEED_OF_LIGHT, Degrees

from .ambiguity import Positions, doppler_span, intervals_told_apart
from .array import AntennaArray
from .converter import Adc
from .front_end import FrontEnd
from .multiplexing import AnyMultiplexing, Fdm, IdealMimo
from .parts import into_parts, misplaced, place_of
from .presets import PRESETS
from .together import check_real, check_together
from .waveform import Fmcw, Waveform
from .waveforms.kinds import AnyWaveform

RadarT = TypeVar("RadarT", bound="RadarSpec")


class RadarSpec(Spec):
    """A MIMO radar, in parts. Positions are in the radar frame: x boresight, y left, z up.

    The defaults are Table 1 of SCaRL. Amplitudes: the beat signal is in sqrt(W), so abs(sample)**2 is received power.
    Transmitters count before chirps: chirp m of transmitter i is row ``m * num_tx + i`` of the raw data. With a coded
    multiplexing (:class:`Ddm`, :class:`Bpm`, :class:`Cdm`, :class:`Tdm` in random order) rows are chirps in time.

    What every radar has can be read here, whatever its waveform; what only one waveform has, in its part
    (``radar.waveform.chirp_slope``). :meth:`with_` takes the names of fields inside the parts as a short form.

    Raises
    ------
    ParameterRangeError
        If a value is outside its range, or a name is unknown or stands in a part; the error says in which.

    Examples
    --------
    >>> radar = RadarSpec(waveform=Fmcw(bandwidth=1e9), front_end=FrontEnd(tx_power_dbm=10.0))
    >>> radar == RadarSpec().with_(bandwidth=1e9, tx_power_dbm=10.0)
    True
    """

    waveform: AnyWaveform = Field(Fmcw(), description="what is sent and sampled")
    multiplexing: AnyMultiplexing = Field(IdealMimo(), description="how the transmitters share a frame")
    array: AntennaArray = Field(AntennaArray(), description="positions, pattern and polarisation of the antennas")
    front_end: FrontEnd = Field(FrontEnd(), description="power and noise")
    adc: Adc = Field(Adc(), description="converter")
    azimuth_fov_deg: Degrees = Field(120.0, gt=0.0, le=180.0, description="full width that rays are sent over [deg]")
    elevation_fov_deg: Degrees = Field(30.0, gt=0.0, le=180.0, description="full height that rays are sent over [deg]")

    _derived = (
        ("range_resolution", "m"),
        ("max_range", "m"),
        ("velocity_resolution", "m/s"),
        ("unambiguous_velocity", "m/s"),
        ("num_virtual", ""),
    )

    @model_validator(mode="before")
    @classmethod
    def _refuse_misplaced(cls, data: object) -> object:
        if isinstance(data, Mapping):
            for name, value in data.items():
                if name not in cls.model_fields:
                    raise misplaced(cls, str(name), value)
        return data

    @model_validator(mode="after")
    def _check(self) -> RadarSpec:
        self.multiplexing.check(self.num_chirps, self.num_tx)
        self.front_end.check(self.num_tx, self.num_rx)
        check_together(type(self), self.waveform, self.multiplexing, self.front_end, self.array)
        check_real(type(self), self.waveform, self.adc)
        return self

    @classmethod
    def preset(cls, name: str) -> RadarSpec:
        """Return a named radar.

        ``"awr1843boost"``: Table 1 of SCaRL, an ideal 12-element virtual line in azimuth.
        ``"awr1843boost_3d"``: the board's own layout, Tx 2 raised by half a wavelength, with time multiplexing.
        ``"iwr1843boost"``: that layout with the front end of the data sheet.
        ``"awr1642"``: 2 x 4 antennas, its front end fitted to measured captures.
        ``"awr2243_cascade"``: four chips, 12 x 16 antennas, time multiplexing.
        ``"radial_hd"``: 4D imaging radar of the RADIal dataset, 12 x 16 antennas, Doppler division.
        ``"pmcw_79ghz"``: a published 2 x 2 chip with phase codes of 2 GHz.

        Raises
        ------
        UnknownNameError
            If there is no radar of this name.
        """
        if name not in PRESETS:
            raise UnknownNameError("radar preset", name, PRESETS)
        return cls(**PRESETS[name])

    def with_(self: RadarT, **changes: object) -> RadarT:
        """Return a copy with some parts or fields changed; the copy is validated again.

        Parameters
        ----------
        **changes
            New values by name of a field; the name of a field inside a part changes the part:
            ``radar.with_(num_chirps=64, tx_power_dbm=10.0)``.

        Raises
        ------
        ParameterRangeError
            If a value is outside its range, or no field has a name; the error suggests one.
        """
        return super().with_(**into_parts(self, changes))

    if not TYPE_CHECKING:  # a type checker reports names that are not there by itself

        def __getattr__(self, name: str) -> object:
            """Say where a field is that stands in a part."""
            place = place_of(type(self), name)
            if place is None:
                return super().__getattr__(name)
            raise AttributeError(f"{type(self).__name__} has no '{name}'; read {place}", name=name, obj=self)

    def _facts(self) -> Iterable[Row]:
        """Return a row for every field of the waveform, and one for each other part."""
        for name, text in super()._facts():
            part = getattr(self, name)
            if not isinstance(part, Spec):
                yield name, text
            elif name == "waveform":
                yield name, type(part).__name__
                yield from (row for row in part._facts() if row[0] != "kind")
            else:
                yield name, ", ".join(item if label == "kind" else f"{label} {item}" for label, item in part._facts())

    @property
    def num_tx(self) -> int:
        """Number of transmit antennas."""
        return self.array.num_tx

    @property
    def num_rx(self) -> int:
        """Number of receive antennas."""
        return self.array.num_rx

    @property
    def num_virtual(self) -> int:
        """Number of transmit-receive pairs; pair (i, j) is channel ``i * num_rx + j``."""
        return self.array.num_virtual

    @property
    def tx_array(self) -> npt.NDArray[np.float64]:
        """Transmit positions, shape (num_tx, 3) [m, radar frame]."""
        return self.array.tx_array

    @property
    def rx_array(self) -> npt.NDArray[np.float64]:
        """Receive positions, shape (num_rx, 3) [m, radar frame]."""
        return self.array.rx_array

    @property
    def num_chirps(self) -> int:
        """Chirps of each transmitter in a frame."""
        return self.waveform.num_chirps

    @property
    def num_samples(self) -> int:
        """Samples a chirp, complex or real."""
        return self.waveform.num_samples

    @property
    def num_range_bins(self) -> int:
        """Bins of range without zero padding."""
        bins = self.waveform_of(0).num_range_bins
        return bins // 2 if self.adc.is_real else bins

    @property
    def num_doppler_bins(self) -> int:
        """Bins of Doppler without zero padding: the samples of slow time."""
        return self.num_slow_chirps // self.waveform.burst

    @property
    def num_slow_chirps(self) -> int:
        """Chirps of a channel once un-multiplexed: all rows where each is the sum of coded transmitters."""
        return self.num_chirps_total if self.multiplexing.is_coded else self.num_chirps

    @property
    def slow_interval(self) -> float:
        """Time from one sample of slow time to the next [s]."""
        return self.doppler_interval * self.waveform.burst

    @property
    def num_chirps_total(self) -> int:
        """Rows of the raw data of one receiver."""
        return self.multiplexing.num_rows(self.num_chirps, self.num_tx)

    @property
    def sample_rate(self) -> float:
        """Complex sampling frequency [Hz]."""
        return self.waveform.sample_rate

    @property
    def chirp_interval(self) -> float:
        """Time from the start of a chirp to the start of the next one, of any transmitter [s]."""
        return self.waveform.chirp_interval

    @property
    def doppler_interval(self) -> float:
        """Time between two chirps of the same transmitter [s]; of a random order between two rows of slow time."""
        return self.multiplexing.doppler_interval(self.chirp_interval, self.num_tx)

    def tx_delay(self, tx: int) -> float:
        """Return the start of a transmitter's chirps after the first transmitter's [s]."""
        return self.multiplexing.tx_delay(tx, self.chirp_interval)

    def tx_frequency(self, tx: int) -> float:
        """Return how much higher than the first transmitter another sends [Hz]; 0 but in frequency division."""
        return self.multiplexing.tx_frequency(self.waveform, tx)

    def waveform_of(self, tx: int) -> Waveform:
        """Return what one transmitter sends: the waveform, in frequency division its subcarriers of it."""
        return self.multiplexing.waveform_of(self.waveform, tx, self.num_tx)

    @property
    def frame_time(self) -> float:
        """Time from the first chirp's start to the end of the last interval [s]."""
        return self.doppler_interval * self.num_slow_chirps

    @property
    def separated(self) -> RadarSpec:
        """The radar whose channels are those of this one once un-multiplexed.

        This radar itself where rows hold one transmitter each; else one with :class:`IdealMimo` and as many chirps as
        there are rows, or in frequency division with the same subcarriers in rows of their own. In a random order of
        time division that is `num_tx` times as many, and the noise figure is higher by what the silent rows of a
        channel cost.
        """
        if not self.multiplexing.is_coded:
            return self
        if isinstance(self.multiplexing, Fdm):
            return self.with_(multiplexing=self.multiplexing.with_(is_summed=False))
        parts: dict[str, object] = {"multiplexing": IdealMimo()}
        silent = self.num_chirps_total / self.num_chirps
        if silent != 1.0:
            parts |= {"num_chirps": self.num_chirps_total, "noise_figure_db": self._noise_figure_db(silent)}
        return self.with_(**parts)

    def _noise_figure_db(self, times: float) -> float:
        """Return the noise figure at which a receiver has `times` the noise of this one [dB]."""
        front = self.front_end
        excess = 10.0 ** (front.noise_figure_db / 10.0) - 1.0 + front.source_temperature / REFERENCE_TEMPERATURE
        factor = 1.0 + times * excess - front.source_temperature / REFERENCE_TEMPERATURE
        return 10.0 * float(np.log10(factor))

    @property
    def with_quadrature(self) -> RadarSpec:
        """The radar with a Q and twice the noise; this radar itself where there is one.

        Twice a real sample is what its I receives, plus an image at the opposite frequency.
        """
        if not self.adc.is_real:
            return self
        return self.with_(sampling="complex", noise_figure_db=self._noise_figure_db(2.0))

    @property
    def one_sided(self) -> RadarSpec:
        """The radar that samples I and Q half as fast and has the maps of this one; this radar itself if it has a Q.

        Real samples tell beat frequencies from 0 to half of their rate apart, and the noise of both signs is there.
        """
        if not self.adc.is_real:
            return self
        half = {"num_samples": self.num_samples // 2, "sampling_frequency": self.sample_rate / 2.0}
        return self.with_quadrature.with_(**half)

    @property
    def carrier_frequency(self) -> float:
        """Frequency of the radar equation and of array spacings [Hz]."""
        return self.waveform.carrier_frequency

    @property
    def wavelength(self) -> float:
        """Wavelength at the carrier frequency [m]: the one of the radar equation and of array spacings."""
        return SPEED_OF_LIGHT / self.carrier_frequency

    @property
    def center_frequency(self) -> float:
        """Frequency in the middle of what is sampled [Hz]: of materials, Doppler and angles after a range transform."""
        return self.waveform.center_frequency

    @property
    def sampled_bandwidth(self) -> float:
        """Bandwidth that the samples cover [Hz]."""
        return self.waveform.sampled_bandwidth

    @property
    def range_resolution(self) -> float:
        """Width of a range bin without zero padding [m]."""
        return SPEED_OF_LIGHT / (2.0 * self.sampled_bandwidth)

    @property
    def max_range(self) -> float:
        """Unambiguous range [m]."""
        return self.range_resolution * self.num_range_bins

    @property
    def unambiguous_velocity(self) -> float:
        """Radial velocities within +- this value are told apart by maps: half their axis [m/s]."""
        return SPEED_OF_LIGHT / self.center_frequency / (4.0 * self.slow_interval)

    @property
    def num_turns(self) -> int:
        """Different times at which the transmitters' chirps start in an interval of slow time; 1 if all at once."""
        return len(np.unique(np.round(self._turns, 6)))

    @property
    def _turns(self) -> tuple[float, ...]:
        """Starts of the transmitters' chirps in an interval of slow time [intervals]."""
        return tuple(self.tx_delay(tx) / self.doppler_interval % 1.0 for tx in range(self.num_tx))

    @property
    def _places(self) -> tuple[Positions, Positions]:
        """Positions (y, z) of transmitters and of receivers [wavelengths]."""
        scale = self.center_frequency / SPEED_OF_LIGHT
        send, receive = (tuple(map(tuple, (scale * at[:, 1:]).tolist())) for at in (self.tx_array, self.rx_array))
        return send, receive

    @property
    def num_intervals(self) -> int:
        """Intervals of velocity that the phases between transmitters tell apart; 1 if all send at once.

        At most `num_turns`; less where a wrong velocity looks like another direction, because transmitters lie as close
        as receivers, or receivers are few or fill the space between transmitters that are many: by the array factor
        (:func:`~scarl_sionna.core.specs.radar.ambiguity.intervals_told_apart`).
        """
        return intervals_told_apart(self._turns, self.num_turns, *self._places)

    @property
    def unfolded_velocity(self) -> float:
        """Radial velocities within +- this value are told apart by :func:`detect` [m/s].

        Beyond those of the maps where transmitters take turns and their array tells it (`num_intervals`), and where
        chirps start at uneven times.
        """
        waveform, within = self.waveform, self.unambiguous_velocity
        if waveform.burst > 1 or waveform.chirp_frequencies is not None:
            return within
        if waveform.chirp_delays is None:
            return within * self.num_intervals
        starts = np.arange(self.num_chirps) * self.doppler_interval + np.asarray(waveform.chirp_delays)
        delays = tuple(self.tx_delay(tx) for tx in range(self.num_tx))
        span = doppler_span(tuple(starts.tolist()), delays, self.center_frequency, *self._places)
        return max(within * self.num_intervals, SPEED_OF_LIGHT / self.center_frequency / 4.0 * span)

    @property
    def velocity_resolution(self) -> float:
        """Width of a Doppler bin [m/s]."""
        return 2.0 * self.unambiguous_velocity / self.num_doppler_bins
