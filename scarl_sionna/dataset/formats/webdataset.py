"""Writes frames as WebDataset shards: TAR files in which the files of a sample follow each other.

References
----------
.. [1] A. Aizman, G. Maltby, T. Breuel, "High performance I/O for large scale deep learning", IEEE Big Data 2019; the
   layout is described at github.com/webdataset/webdataset.
"""

from __future__ import annotations

import io
import json
import re
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset.readers.samples import FrameSamples

from .output import whole_folder
from .pictures import encode_image
from .source import Convertible, FrameSource, OnProgress, SceneFrames, as_source, no_progress

FORMAT = "scarl-webdataset"
INFO = "dataset_info.json"
UNSPLIT = "all"
"""Begins the names of the shards of scenes that are in no split."""


def export_webdataset(
    data: Convertible,
    out: str | Path,
    items: Sequence[str] | Mapping[str, str] | None = None,
    *,
    frames_per_file: int = 64,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as WebDataset shards: one sample a frame, a file an item.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make: ``train-000000.tar`` and so on for each split, and `dataset_info.json`.
    items : sequence or mapping of str, optional
        See `FrameSamples`; left out: all that is there. An sRGB image is a PNG file, all else an NPY file; ``json``
        holds scene, frame and time.
    frames_per_file : int
        Samples in a shard.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    ParameterRangeError
        If a number is out of range, there are no frames, or two items have the same name in a file.
    UnknownNameError, OutputError
    """
    if frames_per_file < 1:
        raise ParameterRangeError("frames_per_file", frames_per_file, ">= 1")
    source = as_source(data)
    source.not_empty()
    shards: dict[str, list[str]] = {}
    names: dict[str, str] = {}
    done = 0
    mark = {"format": FORMAT, "scenes": [scene.name for scene in source.scenes]}
    with whole_folder(out, mark, overwrite) as folder:
        for split, scenes in _by_split(source).items():
            samples = _samples(scenes, items, names)
            count = sum(len(scene) for scene in scenes)
            shards[split] = [f"{split}-{number:06d}.tar" for number in range(-(-count // frames_per_file))]
            for name in shards[split]:
                size = min(frames_per_file, count)
                count -= size
                with tarfile.open(folder / name, "w", format=tarfile.PAX_FORMAT) as archive:
                    for _ in range(size):
                        key, files = next(samples)
                        for extension, content in files.items():
                            _add(archive, f"{key}.{extension}", content)
                        done += 1
                        on_progress(done, source.num_frames)
        info = {
            "format": FORMAT,
            "shards": shards,
            "items": names,
            "rig": source.rig,
            "splits": {name: list(found) for name, found in source.splits.items()},
        }
        (folder / INFO).write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8")
    return Path(out)


def _by_split(source: FrameSource) -> dict[str, list[SceneFrames]]:
    """Return the scenes with frames by split."""
    found: dict[str, list[SceneFrames]] = {}
    for scene in source.scenes:
        if len(scene):
            found.setdefault(source.split_of(scene.name) or UNSPLIT, []).append(scene)
    return found


def _samples(
    scenes: Sequence[SceneFrames], items: Sequence[str] | Mapping[str, str] | None, names: dict[str, str]
) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield the key and the files of every frame; `names` gets the name of each item in the files."""
    for scene in scenes:
        if "." in scene.name:
            raise ParameterRangeError("scene name", f"'{scene.name}'", "no '.', which ends the key of a sample")
        samples = FrameSamples(scene.frames, items)
        for index in range(len(scene)):
            files: dict[str, bytes] = {}
            for key, value in samples[index].items():
                extension, content = _file(key, samples.items[key], value)
                if extension in files:
                    raise ParameterRangeError("item", f"'{key}'", "a name of its own", f"'{extension}' is there")
                files[extension], names[key] = content, extension
            frame = samples.frames[index]
            about = {"scene": scene.name, "frame": frame.index, "timestamp_ns": frame.timestamp_ns}
            files["json"] = json.dumps(about).encode()
            yield f"{scene.name}/{frame.index:06d}", files


def _file(key: str, item: str, value: npt.NDArray[Any]) -> tuple[str, bytes]:
    """Return the extension and the content of an item's file; a dot would end the extension."""
    name = re.sub(r"[^A-Za-z0-9_\-]+", "_", key)
    if item.endswith(":rgb"):
        return f"{name}.png", encode_image(value, "png")
    content = io.BytesIO()
    np.save(content, value, allow_pickle=False)
    return f"{name}.npy", content.getvalue()


def _add(archive: tarfile.TarFile, name: str, content: bytes) -> None:
    """Add a file; the same frames give the same bytes, whoever writes them and when."""
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    archive.addfile(entry, io.BytesIO(content))
