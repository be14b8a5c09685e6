"""Exporters to common formats, one a file, and a table of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from scarl_sionna.core.errors import UnknownNameError

from .source import Convertible, FrameSource, SceneFrames, as_source

__all__ = ["FORMATS", "Format", "FrameSource", "SceneFrames", "as_source", "convert"]


@dataclass(frozen=True)
class Format:
    """A format that a dataset can be converted to."""

    module: str
    function: str
    is_folder: bool
    description: str


FORMATS: Mapping[str, Format] = {
    "nuscenes": Format("nuscenes", "export_nuscenes", True, "nuScenes tables and files for nuscenes-devkit"),
    "tfrecord": Format("tfrecord", "export_tfrecord", True, "TFRecord files for TensorFlow"),
    "webdataset": Format("webdataset", "export_webdataset", True, "WebDataset shards, TAR files of samples"),
    "hdf5": Format("hdf5", "export_hdf5", False, "one HDF5 file with every field"),
    "mcap": Format("mcap", "export_mcap", False, "MCAP recording for Foxglove"),
    "coco": Format("labelled.coco", "export_coco", True, "COCO images with boxes and masks"),
    "yolo": Format("labelled.yolo", "export_yolo", True, "YOLO images with boxes"),
    "kitti": Format("labelled.kitti", "export_kitti", True, "KITTI's object data, with radar points"),
    "openlabel": Format("labelled.openlabel", "export_openlabel", True, "ASAM OpenLABEL: boxes, calibration, images"),
    "rosbag": Format("rosbag", "export_rosbag", True, "ROS 2 bag with the standard messages"),
    "dca1000": Format("dca1000", "export_dca1000", True, "raw radar captures as TI's DCA1000 writes them"),
    "rerun": Format("rerun", "export_rerun", False, ".rrd recording for the Rerun viewer"),
}
"""Formats by name."""


def convert(data: Convertible, form: str, out: str | Path, **options: object) -> Path:
    """Write a dataset in another format.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    form : str
        One of `FORMATS`.
    out : path
        Folder or file to write.
    **options
        Of the exporter: ``overwrite``, ``on_progress`` and its own.

    Raises
    ------
    UnknownNameError
        If the format is unknown.
    MissingPackageError, OutputError, ParameterRangeError
        See the exporter.
    """
    if form not in FORMATS:
        raise UnknownNameError("format", form, FORMATS)
    module = import_module(f".{FORMATS[form].module}", __name__)
    result: Path = getattr(module, FORMATS[form].function)(data, out, **options)
    return result
