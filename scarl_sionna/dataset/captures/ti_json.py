"""Files of Texas Instruments' mmWave Studio (``.mmwave.json``, ``.setup.json``), as the description of a capture.

References
----------
.. [1] Texas Instruments, *mmWave Studio User's Guide*, chapter on the JSON files; names of fields are those of the
   structures of mmWaveLink (``rlProfileCfg_t``), in the units that their names end with.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BeforeValidator, Field

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.checked import Number, Table, Text, checked
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text
from scarl_sionna.core.untrusted.json_text import PlainData, parse_json

from .ti_setup import MOST_CHIRPS, Profile, Setup, bits, one_profile, samples, sender

LARGEST = 16 * MEGABYTE
NUM_CHIPS = 4
"""Of a cascade board."""
ModelT = TypeVar("ModelT", bound=Table)


def _number(value: object) -> object:
    """Return the number of a text such as ``"0xF"``; anything else stays, for the model to judge."""
    if isinstance(value, str) and len(value) < 20:
        try:
            return int(value, 0)
        except ValueError:
            return value
    return value


Count = Annotated[int, BeforeValidator(_number), Field(ge=0, le=2**31)]


class _ProfileCfg(Table):
    profileId: Count
    startFreqConst_GHz: Number
    idleTimeConst_usec: Number
    adcStartTimeConst_usec: Number
    rampEndTime_usec: Number
    freqSlopeConst_MHz_usec: Number
    numAdcSamples: Count
    digOutSampleRate: Number  # ksps


class _ChirpCfg(Table):
    chirpStartIdx: Count
    chirpEndIdx: Count
    profileId: Count
    startFreqVar_MHz: Number = 0.0
    freqSlopeVar_KHz_usec: Number = 0.0
    idleTimeVar_usec: Number = 0.0
    adcStartTimeVar_usec: Number = 0.0
    txEnable: Count


class _FrameCfg(Table):
    chirpStartIdx: Count
    chirpEndIdx: Count
    numLoops: Count
    framePeriodicity_msec: Number


class _ChanCfg(Table):
    rxChannelEn: Count


class _Format(Table):
    b2AdcOutFmt: Count
    b2AdcBits: Count = 2


class _AdcOutCfg(Table):
    fmt: _Format


class _OneProfile(Table):
    rlProfileCfg_t: _ProfileCfg


class _OneChirp(Table):
    rlChirpCfg_t: _ChirpCfg


class _RfConfig(Table):
    rlChanCfg_t: _ChanCfg
    rlAdcOutCfg_t: _AdcOutCfg
    rlProfiles: Annotated[list[_OneProfile], Field(min_length=1, max_length=MOST_CHIRPS)]
    rlChirps: Annotated[list[_OneChirp], Field(min_length=1, max_length=MOST_CHIRPS)]
    rlFrameCfg_t: _FrameCfg


class _DataFmt(Table):
    iqSwapSel: Count = 0
    chInterleave: Count = 1


class _Lanes(Table):
    laneEn: Count = 3


class _DataPath(Table):
    transferFmtPkt0: Count = 1


class _RawCapture(Table):
    rlDevDataFmtCfg_t: _DataFmt = _DataFmt()
    rlDevDataPathCfg_t: _DataPath = _DataPath()
    rlDevLaneEnable_t: _Lanes = _Lanes()


class _Device(Table):
    mmWaveDeviceId: Count = 0
    rfConfig: _RfConfig
    rawDataCaptureConfig: _RawCapture = _RawCapture()


class _Studio(Table):
    mmWaveDevices: Annotated[list[_Device], Field(min_length=1, max_length=4)]


class _CapturedFile(Table):
    processedFileName: Text


class _CapturedFiles(Table):
    files: Annotated[list[_CapturedFile], Field(min_length=1, max_length=1000)]


class _Setup(Table):
    mmWaveDevice: Text = ""
    configUsed: Text = ""
    capturedFiles: _CapturedFiles | None = None


def read_studio(path: Path, device: str = "") -> Setup:
    """Return what an ``.mmwave.json`` file says of its first device.

    Parameters
    ----------
    path : Path
    device : str
        Name of the chip, which the file does not tell.

    Raises
    ------
    InputFileError
        If it is no such file, or describes what is not read, see :func:`.ti_cfg.read_cfg`.
    """
    one = _checked(_Studio, path).mmWaveDevices[0]
    senders = tuple(sender(chirp.txEnable, path) for chirp in _loop(one.rfConfig, path))
    return _setup(one, senders, path, device)


def read_cascade(path: Path) -> Setup:
    """Return what an ``.mmwave.json`` file says of four chips that work as one radar.

    Transmitters are counted over the chips, three each, and receivers, four each: master, then slaves 1 to 3.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputFileError
        If it is no such file, the chips do not sample alike, a receiver is off, or as :func:`read_studio`.
    """
    chips = sorted(_checked(_Studio, path).mmWaveDevices, key=lambda chip: chip.mmWaveDeviceId)
    if [chip.mmWaveDeviceId for chip in chips] != list(range(NUM_CHIPS)):
        raise InputFileError(f"describes {len(chips)} chips, a cascade of {NUM_CHIPS} (0 to 3) is read", path)
    loops = [_loop(chip.rfConfig, path) for chip in chips]
    if len({len(loop) for loop in loops}) != 1:
        raise InputFileError("has chips with different numbers of chirps", path)
    masks = [
        sum((chirp.txEnable & 7) << 3 * chip for chip, chirp in enumerate(turn)) for turn in zip(*loops, strict=True)
    ]
    senders = tuple(sender(mask, path) for mask in masks)
    setups = [_setup(chip, senders, path, "") for chip in chips]
    first = setups[0]
    if any(replace(other, receivers=first.receivers) != first for other in setups):
        raise InputFileError("has chips that do not sample alike", path)
    if any(len(other.receivers) != 4 for other in setups):
        raise InputFileError("has receivers that are off, recordings of all 16 are read", path)
    return replace(first, receivers=tuple(range(4 * NUM_CHIPS)))


def _setup(one: _Device, senders: tuple[int, ...], path: Path, device: str) -> Setup:
    """Return what a chip's description says, with the transmitter of each chirp as it is told."""
    chirps = _loop(one.rfConfig, path)
    profiles = {item.rlProfileCfg_t.profileId: _profile(item.rlProfileCfg_t) for item in one.rfConfig.rlProfiles}
    sent = one.rawDataCaptureConfig
    form, packet, lanes = sent.rlDevDataFmtCfg_t, sent.rlDevDataPathCfg_t, bits(sent.rlDevLaneEnable_t.laneEn & 15)
    if len(lanes) not in (2, 4):
        raise InputFileError(f"has {len(lanes)} lanes, captures of 2 and 4 are read", path)
    if packet.transferFmtPkt0 != 1:
        raise InputFileError(
            f"has transferFmtPkt0 {packet.transferFmtPkt0:#x}", path, "captures of samples alone (0x1) are read"
        )
    form_of_adc = one.rfConfig.rlAdcOutCfg_t.fmt
    receivers = bits(one.rfConfig.rlChanCfg_t.rxChannelEn & 15)
    if not receivers:
        raise InputFileError("has no receiver switched on", path)
    return Setup(
        profile=one_profile([chirp.profileId for chirp in chirps], profiles, path),
        transmitters=senders,
        receivers=receivers,
        num_loops=one.rfConfig.rlFrameCfg_t.numLoops,
        frame_period=one.rfConfig.rlFrameCfg_t.framePeriodicity_msec / 1e3,
        **samples(form_of_adc.b2AdcOutFmt, form_of_adc.b2AdcBits, path),
        q_first=form.iqSwapSel == 1,
        is_interleaved=form.chInterleave == 0,
        num_lanes=len(lanes),
        device=device,
    )


def read_setup(path: Path) -> tuple[str, str, list[str]]:
    """Return the name of the chip, of the ``.mmwave.json`` file and of the captured files in a ``.setup.json`` file."""
    found = _checked(_Setup, path)
    files = [item.processedFileName for item in found.capturedFiles.files] if found.capturedFiles else []
    return found.mmWaveDevice, _last(found.configUsed), [_last(name) for name in files]


def _last(name: str) -> str:
    """Return a file's name without its folder, which is of the machine that captured."""
    return name.replace("\\", "/").rsplit("/", 1)[-1]


def _checked(model: type[ModelT], path: Path) -> ModelT:
    try:
        data: PlainData = parse_json(read_text(path, LARGEST))
        return checked(model, data)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    except ValueError as error:
        raise InputFileError(f"is no file of mmWave Studio ({error})", path) from error


def _loop(config: _RfConfig, path: Path) -> list[_ChirpCfg]:
    """Return the configuration of each chirp of a loop."""
    first, last = config.rlFrameCfg_t.chirpStartIdx, config.rlFrameCfg_t.chirpEndIdx
    if not first <= last < MOST_CHIRPS:
        raise InputFileError(f"has a frame with chirps {first} to {last} of {MOST_CHIRPS}", path)
    commands = [item.rlChirpCfg_t for item in config.rlChirps]
    chirps = []
    for number in range(first, last + 1):
        one = next((item for item in commands if item.chirpStartIdx <= number <= item.chirpEndIdx), None)
        if one is None:
            raise InputFileError(f"has no rlChirpCfg_t for chirp {number}", path)
        if any((one.startFreqVar_MHz, one.freqSlopeVar_KHz_usec, one.idleTimeVar_usec, one.adcStartTimeVar_usec)):
            raise InputFileError(f"has a chirp that varies the profile (chirp {number})", path)
        chirps.append(one)
    return chirps


def _profile(item: _ProfileCfg) -> Profile:
    return Profile(
        start_frequency=item.startFreqConst_GHz * 1e9,
        slope=item.freqSlopeConst_MHz_usec * 1e12,
        idle_time=item.idleTimeConst_usec / 1e6,
        adc_start_time=item.adcStartTimeConst_usec / 1e6,
        ramp_time=item.rampEndTime_usec / 1e6,
        num_samples=item.numAdcSamples,
        sample_rate=item.digOutSampleRate * 1e3,
    )
