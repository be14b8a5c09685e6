"""Captures as Texas Instruments' tools write them: from their documents, value by value, with no reader in sight.

Order of the samples: SWRA581B; commands: MMWAVE SDK User Guide 3.5, 3.4; JSON: files of mmWave Studio.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

PROFILE = {
    "start_ghz": 77.0,
    "idle_us": 7.0,
    "adc_start_us": 5.0,
    "ramp_us": 40.0,
    "slope_mhz_us": 30.0,
    "samples": 128,
    "rate_ksps": 4000.0,
}
"""Numbers of a profile in the units of TI's files."""


def sample_order(adc: np.ndarray, lanes: int = 2, interleaved: bool = False, q_first: bool = False) -> list[int]:
    """Return I and Q in the order of a file, from (num_rx, num_chirps, num_samples, 2)."""
    num_rx, num_chirps, num_samples, _ = adc.shape
    out: list[int] = []
    for chirp in range(num_chirps):
        if interleaved:
            sequence = [adc[rx, chirp, sample] for sample in range(num_samples) for rx in range(num_rx)]
        else:
            sequence = [adc[rx, chirp, sample] for rx in range(num_rx) for sample in range(num_samples)]
        for start in range(0, len(sequence), lanes):
            together = sequence[start : start + lanes]
            first, second = (1, 0) if q_first else (0, 1)
            out += [int(value[first]) for value in together] + [int(value[second]) for value in together]
    return out


def write_bin(path: Path, adc: np.ndarray, is_real: bool = False, **order: Any) -> None:
    """Append one frame to a capture."""
    if is_real:
        num_rx, num_chirps, num_samples, _ = adc.shape
        places = [(rx, chirp, k, 0) for chirp in range(num_chirps) for rx in range(num_rx) for k in range(num_samples)]
        values = [int(adc[place]) for place in places]
    else:
        values = sample_order(adc, **order)
    with path.open("ab") as file:
        file.write(struct.pack(f"<{len(values)}h", *values))


def cfg_text(
    senders: tuple[int, ...],
    loops: int,
    rx_mask: int = 15,
    q_first: bool = False,
    is_real: bool = False,
    **change: float,
) -> str:
    """Return the commands of the SDK's demo for chirps that one transmitter sends each."""
    one = {**PROFILE, **change}
    tx_mask = sum(1 << sender for sender in set(senders))
    lines = [
        "% ***************************************************************",
        "% Created for SDK ver:03.05",
        "% Platform:xWR18xx",
        "sensorStop",
        "flushCfg",
        "dfeDataOutputMode 1",
        f"channelCfg {rx_mask} {tx_mask} 0",
        f"adcCfg 2 {0 if is_real else 1}",
        f"adcbufCfg -1 {1 if is_real else 0} {int(q_first)} 1 1",
        f"profileCfg 0 {one['start_ghz']:g} {one['idle_us']:g} {one['adc_start_us']:g} {one['ramp_us']:g} 0 0 "
        f"{one['slope_mhz_us']:g} 1 {one['samples']} {one['rate_ksps']:g} 0 0 30",
        *(f"chirpCfg {k} {k} 0 0 0 0 0 {1 << sender}" for k, sender in enumerate(senders)),
        f"frameCfg 0 {len(senders) - 1} {loops} 0 50 1 0",
        "lowPower 0 0",
        "guiMonitor -1 1 1 0 0 0 1",
        "lvdsStreamCfg -1 0 1 0",
        "sensorStart",
    ]
    return "\n".join(lines) + "\n"


def studio(
    senders: tuple[int, ...], loops: int, q_first: bool = False, lanes: int = 2, interleaved: bool = False
) -> dict:
    """Return what mmWave Studio writes as ``.mmwave.json``, as far as a capture of raw data needs it."""
    one = PROFILE
    return {
        "configGenerator": {
            "createdBy": "mmWaveStudio",
            "createdOn": "2020-01-01T00:00:00.0Z",
            "isConfigIntermediate": 1,
        },
        "currentVersion": {"jsonCfgVersion": {"major": 0, "minor": 4, "patch": 0}},
        "mmWaveDevices": [
            {
                "mmWaveDeviceId": 0,
                "rfConfig": {
                    "waveformType": "legacyFrameChirp",
                    "rlChanCfg_t": {"rxChannelEn": "0xF", "txChannelEn": "0x7", "cascading": 0},
                    "rlAdcOutCfg_t": {"fmt": {"b2AdcBits": 2, "b8FullScaleReducFctr": 0, "b2AdcOutFmt": 1}},
                    "rlProfiles": [
                        {
                            "rlProfileCfg_t": {
                                "profileId": 0,
                                "pfVcoSelect": "0x2",
                                "startFreqConst_GHz": one["start_ghz"],
                                "idleTimeConst_usec": one["idle_us"],
                                "adcStartTimeConst_usec": one["adc_start_us"],
                                "rampEndTime_usec": one["ramp_us"],
                                "txOutPowerBackoffCode": "0x0",
                                "txPhaseShifter": "0x0",
                                "freqSlopeConst_MHz_usec": one["slope_mhz_us"],
                                "txStartTime_usec": 0.0,
                                "numAdcSamples": one["samples"],
                                "digOutSampleRate": one["rate_ksps"],
                                "hpfCornerFreq1": 0,
                                "hpfCornerFreq2": 0,
                                "rxGain_dB": "0x1E",
                            }
                        }
                    ],
                    "rlChirps": [
                        {
                            "rlChirpCfg_t": {
                                "chirpStartIdx": k,
                                "chirpEndIdx": k,
                                "profileId": 0,
                                "startFreqVar_MHz": 0.0,
                                "freqSlopeVar_KHz_usec": 0.0,
                                "idleTimeVar_usec": 0.0,
                                "adcStartTimeVar_usec": 0.0,
                                "txEnable": hex(1 << sender),
                            }
                        }
                        for k, sender in enumerate(senders)
                    ],
                    "rlFrameCfg_t": {
                        "chirpStartIdx": 0,
                        "chirpEndIdx": len(senders) - 1,
                        "numLoops": loops,
                        "numFrames": 8,
                        "numAdcSamples": 2 * int(one["samples"]),
                        "framePeriodicity_msec": 50.0,
                        "triggerSelect": 1,
                    },
                },
                "rawDataCaptureConfig": {
                    "rlDevDataFmtCfg_t": {"iqSwapSel": int(q_first), "chInterleave": 0 if interleaved else 1},
                    "rlDevDataPathCfg_t": {"intfSel": 1, "transferFmtPkt0": "0x1", "transferFmtPkt1": "0x0"},
                    "rlDevLaneEnable_t": {"laneEn": hex((1 << lanes) - 1)},
                },
            }
        ],
    }


def write_studio(folder: Path, senders: tuple[int, ...], loops: int, files: list[str], **options: Any) -> None:
    """Write ``radar.mmwave.json`` and the ``radar.setup.json`` that names it and the captured files."""
    (folder / "radar.mmwave.json").write_text(json.dumps(studio(senders, loops, **options), indent=2))
    setup = {
        "createdByVersion": "2.1.1.0",
        "captureHardware": "DCA1000",
        "mmWaveDevice": "awr1843",
        "operatingFreq": 77,
        "configUsed": "C:\\ti\\captures\\radar.mmwave.json",
        "capturedFiles": {
            "numFilesCollected": len(files),
            "fileBasePath": "C:\\ti\\captures",
            "files": [{"processedFileName": name, "rawFileName": name} for name in files],
        },
    }
    (folder / "radar.setup.json").write_text(json.dumps(setup, indent=2))


def log_text(
    senders: tuple[int, ...], loops: int, frames: int = 8, chip: str = "AR1843", period_ms: float = 50.0
) -> str:
    """Return mmWave Studio's log of a session: another profile first, the one of `PROFILE` when the sensor starts last.

    Numbers are those that the device gets: steps of 3.6 GHz / 2^26 (2.7 GHz / 2^26 of 60 GHz chips), 10 ns and 5 ns.
    """
    one, reference = PROFILE, 2.7e9 if chip[2] == "6" else 3.6e9
    start = round(one["start_ghz"] * 1e9 * 2**26 / reference)
    slope = round(one["slope_mhz_us"] * 1e12 * 2**26 / (reference * 900e6))
    times = [round(one[key] * 100) for key in ("idle_us", "adc_start_us", "ramp_us")]
    profile = (
        f"0,{start},{times[0]},{times[1]},{times[2]},0,0,{slope},0,{one['samples']},{one['rate_ksps']:.0f},0,0,30,0"
    )
    calls = [
        "IsFPGA:,0,0",
        "API:select_capture_device,DCA1000,0",
        f"API:select_chip_version,{chip},0",
        "API:ChannelConfig,7,15,0",
        "API:AdcOutConfig,2,1,0",
        "API:DataFmtConfig,15,2,1,0,1,0",
        "API:DataPathConfig,1,1,0,2,0",
        "API:LaneConfig,3,0",
        "TSW1400 Sampling rate : 600000000 7500000,0",
        "API:ProfileConfig,0,1435384036,10000,600,6000,0,0,621,0,256,5000,0,0,30,0",
        "API:ChirpConfig,0,9,0,0,0,0,0,1,0",
        "API:FrameConfig,0,0,8,128,8000000,0,512,0",
        "API:SensorStart,0",
        f"API:ProfileConfig,{profile}",
        *(f"API:ChirpConfig,{k},{k},0,0,0,0,0,{1 << sender},0" for k, sender in enumerate(senders)),
        f"API:FrameConfig,0,{len(senders) - 1},{frames},{loops},{round(period_ms * 200_000)},0,256,0",
        "API:AdvancedFrameConfig,1,0,0,0,1,1,200000,0,1,1,200000,0,0,0,0",
        "API:SensorStart,0",
        f"API:update_num_adc_files_and_frames,1,{frames},1,0",
    ]
    return "".join(f"02-Jan-2026 17:15:04: {call},\n" for call in calls)
