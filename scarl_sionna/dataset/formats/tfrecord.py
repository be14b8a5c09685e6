"""Writes frames as TFRecord files, and reads them as a `tf.data.Dataset` without any other package of ours."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from scarl_sionna.core.errors import DatasetError, ParameterRangeError
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.dataset.readers.tf_data import tensorflow

from .output import whole_folder
from .source import Convertible, OnProgress, as_source, no_progress

if TYPE_CHECKING:
    import tensorflow as tf
    from tensorflow import Tensor

FORMAT, FORMAT_VERSION = "scarl-tfrecord", 1
INFO = "dataset_info.json"


def export_tfrecord(
    data: Convertible,
    out: str | Path,
    items: Sequence[str] | Mapping[str, str] | None = None,
    *,
    frames_per_file: int = 64,
    compression: Literal["", "GZIP"] = "",
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as TFRecord files: one `tf.train.Example` a frame.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make: ``scene-00000-of-00002.tfrecord`` and so on, and `dataset_info.json` with the type of every
        item.
    items : sequence or mapping of str, optional
        See `FrameSamples`; left out: all that is there.
    frames_per_file : int
    compression : {"", "GZIP"}
    overwrite : bool
    on_progress : callable

    Raises
    ------
    MissingPackageError
        If TensorFlow is not installed.
    ParameterRangeError, UnknownNameError, OutputError
    DatasetError
        If scenes differ in the items, their types or shapes.
    """
    if frames_per_file < 1:
        raise ParameterRangeError("frames_per_file", frames_per_file, ">= 1")
    if compression not in ("", "GZIP"):
        raise ParameterRangeError("compression", repr(compression), "'' or 'GZIP'")
    source = as_source(data)
    source.not_empty()
    tf = tensorflow()
    signature: dict[str, dict[str, Any]] | None = None
    files: dict[str, list[str]] = {}
    done = 0
    mark = {"format": FORMAT, "scenes": [scene.name for scene in source.scenes]}
    with whole_folder(out, mark, overwrite) as folder:
        for scene in source.scenes:
            if not len(scene):
                continue
            samples = FrameSamples(scene.frames, items)
            found = {key: {"dtype": s.dtype.name, "shape": list(s.shape)} for key, s in samples.signature().items()}
            signature = found if signature is None else signature
            _check_same(signature, found, scene.name)
            count = -(-len(scene) // frames_per_file)
            files[scene.name] = [f"{scene.name}-{k:05d}-of-{count:05d}.tfrecord" for k in range(count)]
            for number, name in enumerate(files[scene.name]):
                with tf.io.TFRecordWriter(str(folder / name), compression) as writer:
                    for index in range(number * frames_per_file, min((number + 1) * frames_per_file, len(scene))):
                        writer.write(_example(tf, samples[index]))
                        done += 1
                        on_progress(done, source.num_frames)
        info = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "compression": compression,
            "items": signature,
            "files": files,
            "encoding": "each item is a bytes feature: tf.io.serialize_tensor of an array of this type and shape",
            "rig": source.rig,
            "splits": {name: list(scenes) for name, scenes in source.splits.items()},
        }
        (folder / INFO).write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8")
    return Path(out)


def _check_same(first: Mapping[str, Mapping[str, Any]], found: Mapping[str, Mapping[str, Any]], scene: str) -> None:
    """Raise if a scene's items are not those of the first scene, and name the first that is not."""
    for key in sorted({*first, *found}):
        if found.get(key) != first.get(key):
            here, before = (
                f"{item['dtype']} {tuple(item['shape'])}" if item else "nothing"
                for item in (found.get(key), first.get(key))
            )
            raise DatasetError(
                f"scene {scene} has {here} as '{key}', the scenes before {before}", None, "convert it alone"
            )


def read_tfrecord(
    folder: str | Path,
    scenes: Sequence[str] = (),
    *,
    batch_size: int | None = None,
    num_threads: int = 4,
    prefetch: int = 4,
) -> tf.data.Dataset:
    """Return the frames of an exported folder as a `tf.data.Dataset` of dictionaries, in order.

    Parameters
    ----------
    folder : path
    scenes : sequence of str
        None given: all.
    batch_size : int, optional
        Items of different lengths become ragged then.
    num_threads, prefetch : int
        Frames parsed at once, and elements kept ready.

    Raises
    ------
    DatasetError
        If the folder is not such an export, of a newer version, or a file is missing.
    """
    folder = Path(folder)
    info = _info(folder)
    unknown = [name for name in scenes if name not in info["files"]]
    if unknown:
        raise DatasetError(f"no scene '{unknown[0]}' (there: {', '.join(info['files'])})", folder)
    names = [name for scene in (scenes or info["files"]) for name in info["files"][scene]]
    for name in names:
        if not (folder / name).is_file():
            raise DatasetError(f"{name} is not there", folder, "export it again")
    tf = tensorflow()
    items = info["items"]
    features = {key: tf.io.FixedLenFeature([], tf.string) for key in items}

    def parse(record: Tensor) -> dict[str, Any]:
        raw = tf.io.parse_single_example(record, features)
        out = {}
        for key, item in items.items():
            tensor = tf.io.parse_tensor(raw[key], tf.as_dtype(item["dtype"]))
            out[key] = tf.ensure_shape(tensor, item["shape"])
        return out

    dataset = tf.data.TFRecordDataset([str(folder / name) for name in names], info["compression"])
    dataset = dataset.map(parse, num_parallel_calls=num_threads, deterministic=True)
    if batch_size is not None:
        ragged = any(None in item["shape"] for item in items.values())
        dataset = dataset.ragged_batch(batch_size) if ragged else dataset.batch(batch_size)
    return dataset.prefetch(prefetch)


def _info(folder: Path) -> dict[str, Any]:
    try:
        info = json.loads((folder / INFO).read_text(encoding="utf-8"))
        if info["format"] != FORMAT:
            raise ValueError(f"format '{info['format']}'")
        version = int(info["format_version"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"no {INFO} of a TFRecord export: {error}", folder, "give the folder of the export"
        ) from error
    if version > FORMAT_VERSION:
        raise DatasetError(f"format version {version} is newer than {FORMAT_VERSION}", folder, "update scarl-sionna")
    return info  # type: ignore[no-any-return]


def _example(tf: ModuleType, sample: Mapping[str, Any]) -> bytes:
    features = {}
    for key, value in sample.items():
        data = tf.io.serialize_tensor(tf.constant(np.asarray(value))).numpy()
        features[key] = tf.train.Feature(bytes_list=tf.train.BytesList(value=[data]))
    return tf.train.Example(features=tf.train.Features(feature=features)).SerializeToString()  # type: ignore[no-any-return]
