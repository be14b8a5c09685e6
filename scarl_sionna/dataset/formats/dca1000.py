"""Writes raw radar data as a Texas Instruments DCA1000 capture (``adc_data.bin``), as radar tools read it.

References
----------
.. [1] Texas Instruments, *Mmwave Radar Device ADC Raw Data Capture*, SWRA581B, 2018: xWR16xx, xWR18xx and xWR68xx,
   complex or real, 2 LVDS lanes, receivers not interleaved.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.results import RadarFrame
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.radar.waveform import Fmcw
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw
from scarl_sionna.dataset.captures.lvds import Order, decode
from scarl_sionna.dataset.store.manifest import hash_of

from .output import whole_folder
from .source import Convertible, FrameSource, OnProgress, as_source, no_progress

FORMAT = "dca1000"
CAPTURE, DESCRIPTION = "adc_data.bin", "adc_data.json"
LAYOUT = "frame, chirp (transmitters in turn), receiver, pair of samples: I0 I1 Q0 Q1; int16 little-endian"
LAYOUT_REAL = "frame, chirp (transmitters in turn), receiver, sample; int16 little-endian"


def encode_dca1000(adc_int: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    """Return the raw data of a frame in the order of a capture.

    Parameters
    ----------
    adc_int : ndarray of int16, shape (num_rx, num_chirps_total, num_samples, 2)
        I and Q, see `RadarFrame`.

    Returns
    -------
    ndarray of int16, shape (num_rx * num_chirps_total * num_samples * 2,)
        Chirp after chirp, in each one receiver after receiver, in each the samples as I0 I1 Q0 Q1, I2 I3 Q2 Q3, ...

    Raises
    ------
    ParameterRangeError
        If the number of samples is odd: the two lanes carry samples in pairs.
    """
    num_rx, num_chirps, num_samples, parts = adc_int.shape
    if num_samples % 2 or parts != 2:
        raise ParameterRangeError("num_samples", num_samples, "an even number", "the two lanes carry samples in pairs")
    by_chirp = adc_int.transpose(1, 0, 2, 3).reshape(num_chirps, num_rx, num_samples // 2, 2, 2)
    return np.ascontiguousarray(by_chirp.swapaxes(-1, -2), dtype="<i2").reshape(-1)


def decode_dca1000(
    raw: npt.NDArray[np.int16], num_rx: int, num_chirps_total: int, num_samples: int
) -> npt.NDArray[np.int16]:
    """Return one frame of a capture as `adc_int`, the opposite of :func:`encode_dca1000`.

    Raises
    ------
    ParameterRangeError
        If the length is not that of a frame.
    """
    return decode(raw, (num_rx, num_chirps_total, num_samples))


def encode_real(adc_int: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    """Return the raw data of a frame without Q in the order of a capture.

    Parameters
    ----------
    adc_int : ndarray of int16, shape (num_rx, num_chirps_total, num_samples, 2)
        I, and Q of 0.

    Returns
    -------
    ndarray of int16, shape (num_rx * num_chirps_total * num_samples,)
        Chirp after chirp, in each one receiver after receiver, in each the samples.

    Raises
    ------
    ParameterRangeError
        If the number of samples is odd: the two lanes carry samples in pairs.
    """
    if adc_int.shape[2] % 2:
        raise ParameterRangeError("num_samples", adc_int.shape[2], "an even number", "the two lanes carry pairs")
    return np.ascontiguousarray(adc_int[..., 0].transpose(1, 0, 2), dtype="<i2").reshape(-1)


def decode_real(
    raw: npt.NDArray[np.int16], num_rx: int, num_chirps_total: int, num_samples: int
) -> npt.NDArray[np.int16]:
    """Return one frame of a real capture as `adc_int` with a Q of 0, the opposite of :func:`encode_real`.

    Raises
    ------
    ParameterRangeError
        If the length is not that of a frame.
    """
    return decode(raw, (num_rx, num_chirps_total, num_samples), Order(is_real=True))


def read_dca1000(folder: str | Path, frame: int = 0) -> npt.NDArray[np.int16]:
    """Return the raw data of a frame of an exported capture, as `adc_int`.

    Raises
    ------
    DatasetError
        If the folder holds no capture of this exporter, or the file is shorter than its description says.
    """
    folder = Path(folder)
    try:
        text = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        shape = (text["num_rx"], text["num_chirps_total"], text["num_samples"])
        is_real = text.get("is_real", False)
        length = int(np.prod(shape)) * (1 if is_real else 2)
        if not 0 <= frame < text["num_frames"]:
            raise DatasetError(f"no frame {frame} of {text['num_frames']}", folder)
        raw = np.fromfile(folder / CAPTURE, "<i2", length, offset=2 * frame * length)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"no capture with {CAPTURE} and {DESCRIPTION}: {error}", folder, "export it again"
        ) from error
    if raw.size != length:
        raise DatasetError(f"{CAPTURE} ends within frame {frame}", folder, "export it again")
    return decode_real(raw, *shape) if is_real else decode_dca1000(raw, *shape)


def export_dca1000(
    data: Convertible,
    out: str | Path,
    *,
    radars: Sequence[str] = (),
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write the raw data of radars as captures, one a scene and radar: ``out/scene/front_left_radar/adc_data.bin``.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make.
    radars : sequence of str
        Names of radars; none given: all.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    ParameterRangeError
        If there are no frames or no radar, a radar has an odd number of samples or sends anything but equal ramps, or
        the scale changes between frames.
    UnknownNameError
        If there is no radar of a name.
    OutputError
        If the folder is there or cannot be written.
    """
    source = as_source(data, "DCA1000", ("radar",)).not_empty()
    chosen = _radars(source, radars)
    mark = {"format": FORMAT, "layout": LAYOUT, "radars": chosen, "scenes": [scene.name for scene in source.scenes]}
    done = 0
    with whole_folder(out, mark, overwrite) as folder:
        for scene in source.scenes:
            with ExitStack() as stack:
                captures: dict[str, _Capture] = {}
                for frame in scene:
                    for name, radar in frame.radars.items():
                        if name not in chosen:
                            continue
                        if name not in captures:
                            place = folder / scene.name / name.replace("/", "_")
                            captures[name] = _Capture(stack, place, name, radar)
                        captures[name].add(frame.timestamp_ns, radar)
                    done += 1
                    on_progress(done, source.num_frames)
                for capture in captures.values():
                    capture.describe()
    return Path(out)


def _radars(source: FrameSource, asked: Sequence[str]) -> list[str]:
    known = [name for name, mount in source.mounts.items() if mount["kind"] == "radar"]
    if not known:
        raise ParameterRangeError("rig", f"'{source.rig['name']}' without a radar", "a rig with a radar")
    for name in asked:
        if name not in known:
            raise UnknownNameError("radar", name, known)
    return list(asked) or known


def _ramps(name: str, spec: RadarSpec) -> Fmcw:
    """Return the waveform of a radar that such a board can have: equal ramps."""
    waveform = spec.waveform
    if not isinstance(waveform, Fmcw) or isinstance(waveform, PcFmcw):
        raise ParameterRangeError(
            f"radar '{name}'",
            f"a waveform of kind '{waveform.kind}'",
            "'fmcw': captures of the DCA1000 are of de-chirped ramps",
            "leave the radar out with radars=[...], or read its raw data from the dataset",
        )
    if waveform.chirp_frequencies is not None or waveform.chirp_delays is not None:
        raise ParameterRangeError(
            f"radar '{name}'",
            "chirps with carriers or starts of their own",
            "equal chirps: the description of a capture has one start frequency and one interval",
            "leave the radar out with radars=[...], or read its raw data from the dataset",
        )
    return waveform


class _Capture:
    """A capture that is being written."""

    def __init__(self, stack: ExitStack, folder: Path, name: str, radar: RadarFrame) -> None:
        self.waveform = _ramps(name, radar.spec)
        folder.mkdir(parents=True)
        self.folder, self.name, self.first = folder, name, radar
        self.file: IO[bytes] = stack.enter_context((folder / CAPTURE).open("wb"))
        self.times: list[int] = []

    def add(self, timestamp_ns: int, radar: RadarFrame) -> None:
        if radar.adc_scale != self.first.adc_scale or hash_of(radar.spec.model_dump(mode="json")) != hash_of(
            self.first.spec.model_dump(mode="json")
        ):
            raise ParameterRangeError(
                f"radar '{self.name}'", "another scale or waveform in a later frame", "one a scene"
            )
        encode = encode_real if radar.spec.adc.is_real else encode_dca1000
        self.file.write(encode(radar.adc_int).tobytes())
        self.times.append(timestamp_ns)

    def describe(self) -> None:
        """Write what a reader has to know."""
        spec = self.first.spec
        data = {
            "format": FORMAT,
            "layout": LAYOUT_REAL if spec.adc.is_real else LAYOUT,
            "is_real": spec.adc.is_real,
            "sensor": self.name,
            "num_frames": len(self.times),
            "num_rx": spec.num_rx,
            "num_tx": spec.num_tx,
            "num_chirps": spec.num_chirps,
            "num_chirps_total": spec.num_chirps_total,
            "num_samples": spec.num_samples,
            "bytes_per_frame": int(self.first.adc_int.nbytes) // (2 if spec.adc.is_real else 1),
            "scale": float(self.first.adc_scale),
            "scale_unit": "sqrt(W)",
            "timestamp_ns": self.times,
            "start_frequency": self.waveform.start_frequency,
            "chirp_slope": self.waveform.chirp_slope,
            "sample_rate": spec.sample_rate,
            "doppler_interval": spec.doppler_interval,
            "range_resolution": spec.range_resolution,
            "velocity_resolution": spec.velocity_resolution,
            "spec": spec.model_dump(mode="json"),
        }
        (self.folder / DESCRIPTION).write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
