"""What a description of a Texas Instruments radar says, whichever file it stands in, and the radar that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import InputFileError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.converter import Adc
from scarl_sionna.core.specs.radar.multiplexing import Tdm
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw

BOARDS = {
    "awr1642boost": "awr1642",
    "awr1843boost": "awr1843boost_3d",
    "iwr1843boost": "awr1843boost_3d",
    "mmwcas": "awr2243_cascade",
}
"""Evaluation boards whose antennas are known, and the preset that has them."""
DEVICES = {"awr1642": "awr1642boost", "xwr16xx": "awr1642boost", "awr1843": "awr1843boost", "xwr18xx": "awr1843boost"}
"""Boards that a description's name of the chip stands for."""
MOST_CHIRPS = 512
"""Chirps that a device can be told in a loop."""


@dataclass(frozen=True)
class Profile:
    """A chirp profile.

    Attributes
    ----------
    start_frequency : float
        [Hz].
    slope : float
        [Hz/s], negative of a ramp that falls.
    idle_time, adc_start_time, ramp_time : float
        Before the ramp, from its start to the first sample, of the ramp [s].
    num_samples : int
    sample_rate : float
        [Hz].
    """

    start_frequency: float
    slope: float
    idle_time: float
    adc_start_time: float
    ramp_time: float
    num_samples: int
    sample_rate: float


@dataclass(frozen=True)
class Setup:
    """What a description says of a capture.

    Attributes
    ----------
    profile : Profile
        Of all chirps.
    transmitters : tuple of int
        Which one sends each chirp of a loop, from 0.
    receivers : tuple of int
        Which ones are on, from 0.
    num_loops : int
    frame_period : float
        From frame to frame [s].
    is_real : bool
        Whether there is no Q.
    has_image_band : bool
        Whether the image band was not filtered away (complex 2x): it lies in the second half of the range axis.
    num_bits : int
        Of a sample.
    q_first : bool
        Whether Q stands before I.
    is_interleaved : bool
        Whether the receivers' samples alternate, as those of the xWR12xx and xWR14xx do.
    num_lanes : int
        Lanes that the samples were sent over, 2 or 4.
    device : str
        Name of the chip, empty if the file has none.
    """

    profile: Profile
    transmitters: tuple[int, ...]
    receivers: tuple[int, ...]
    num_loops: int
    frame_period: float
    is_real: bool = False
    has_image_band: bool = False
    num_bits: int = 16
    q_first: bool = False
    is_interleaved: bool = False
    num_lanes: int = 2
    device: str = ""

    @property
    def order(self) -> tuple[int, ...]:
        """The transmitters in the order of their turns."""
        return tuple(dict.fromkeys(self.transmitters))


def bits(mask: int) -> tuple[int, ...]:
    """Return the numbers of the bits that are set, from 0."""
    return tuple(number for number in range(mask.bit_length()) if mask >> number & 1)


def sender(mask: int, path: Path) -> int:
    """Return the transmitter of a chirp.

    Raises
    ------
    InputFileError
        If none sends, or several at once: phases of theirs are in no description that is read.
    """
    found = bits(mask)
    if len(found) != 1:
        raise InputFileError(
            f"has a chirp of {len(found)} transmitters at once", path, "captures of time division are read"
        )
    return found[0]


def samples(output: float, bits: float, path: Path) -> dict[str, Any]:
    """Return what two codes of the converter say, as fields of a `Setup`.

    Parameters
    ----------
    output : float
        0: real, 1: complex, image band filtered (1x), 2: complex with it (2x).
    bits : float
        0, 1, 2: 12, 14, 16 bits.
    path : Path
        The description, for errors.

    Raises
    ------
    InputFileError
        If there is no such code; 3, "pseudo real", is not read.
    """
    if output not in (0, 1, 2) or bits not in (0, 1, 2):
        raise InputFileError(
            f"has samples of form {output:g} and of bits {bits:g}",
            path,
            "captures of real (0) and complex samples (1, 2) of 12, 14 and 16 bits (0, 1, 2) are read",
        )
    return {"is_real": output == 0, "has_image_band": output == 2, "num_bits": 12 + 2 * int(bits)}


def array_of(setup: Setup, path: Path, board: str | None, array: AntennaArray | None) -> AntennaArray:
    """Return the antennas that are on, transmitters in the order of their turns.

    Parameters
    ----------
    setup : Setup
    path : Path
        The description, for errors.
    board : str or None
        One of `BOARDS`; None: by the description's name of the chip.
    array : AntennaArray or None
        The antennas themselves, all of the device's; instead of a board.

    Raises
    ------
    UnknownNameError
        If there is no such board.
    InputFileError
        If neither is given and the description does not tell.
    ParameterRangeError
        If an antenna is on that the array does not have.
    """
    if array is None:
        name = board or next((found for chip, found in DEVICES.items() if setup.device.lower().startswith(chip)), None)
        if name is None:
            known = ", ".join(sorted(BOARDS))
            raise InputFileError("does not tell the antennas", path, f"give board= (known: {known}) or array=")
        if name not in BOARDS:
            raise UnknownNameError("board", name, BOARDS, "or give array=AntennaArray(...)")
        array = RadarSpec.preset(BOARDS[name]).array
    for kind, used, there in (
        ("transmitter", setup.order, array.num_tx),
        ("receiver", setup.receivers, array.num_rx),
    ):
        if max(used) >= there:
            raise ParameterRangeError(
                "array", f"{there} {kind}s", f"as {path.name} has it: {kind} {max(used) + 1} is on", "give array="
            )
    return array.with_(
        tx_positions=tuple(array.tx_positions[k] for k in setup.order),
        rx_positions=tuple(array.rx_positions[k] for k in setup.receivers),
    )


def radar_of(setup: Setup, path: Path, array: AntennaArray, full_scale_dbm: float | None = None) -> RadarSpec:
    """Return the radar of a description.

    Parameters
    ----------
    setup : Setup
    path : Path
        The description, for errors.
    array : AntennaArray
        The antennas that are on.
    full_scale_dbm : float, optional
        Power at the antenna that a full-scale tone stands for [dBm]; left out: that of the defaults.

    Raises
    ------
    InputFileError
        If the transmitters do not take equal turns, or a value is none that a radar can have.
    """
    one, chirps = setup.profile, len(setup.transmitters)
    if chirps % len(setup.order) or setup.transmitters != setup.order * (chirps // len(setup.order)):
        turns = " ".join(str(k + 1) for k in setup.transmitters[:12])
        raise InputFileError(f"has transmitters that do not take equal turns ({turns})", path)
    try:
        return RadarSpec(
            waveform=Fmcw(
                start_frequency=one.start_frequency,
                bandwidth=abs(one.slope) * one.ramp_time,
                direction="up" if one.slope > 0.0 else "down",
                ramp_time=one.ramp_time,
                idle_time=one.idle_time,
                num_chirps=setup.num_loops * (chirps // len(setup.order)),
                num_samples=one.num_samples,
                sampling_frequency=one.sample_rate,
                adc_start_time=one.adc_start_time,
            ),
            multiplexing=Tdm(),
            array=array,
            adc=Adc(
                bits=setup.num_bits,
                sampling="real" if setup.is_real else "complex",
                **({} if full_scale_dbm is None else {"full_scale_dbm": full_scale_dbm}),
            ),
        )
    except ParameterRangeError as error:
        raise InputFileError(f"describes no radar: {error}", path, "correct the description") from error


def one_profile(used: Sequence[int], profiles: dict[int, Profile], path: Path) -> Profile:
    """Return the profile of all chirps.

    Raises
    ------
    InputFileError
        If chirps have different ones, or it is not there.
    """
    if len(set(used)) != 1:
        raise InputFileError(f"has chirps of {len(set(used))} profiles in a loop", path, "captures of one are read")
    if used[0] not in profiles:
        raise InputFileError(f"has no profile {used[0]}, which its chirps use", path)
    return profiles[used[0]]
