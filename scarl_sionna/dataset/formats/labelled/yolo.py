"""Writes colour images with boxes as a YOLO folder: a text file of boxes beside each image."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Literal

import yaml

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.dataset.formats.output import whole_folder
from scarl_sionna.dataset.formats.pictures import encode_image
from scarl_sionna.dataset.formats.source import Convertible, OnProgress, as_source, no_progress

from .coco import check_image_format
from .objects import COCO_CLASSES, LabelledImage, labelled_images

FORMAT = "yolo"
NAMES = tuple(name for _, name in sorted(set(COCO_CLASSES.values())))
"""Class names; the index is the class of a label."""
INFO = "data.yaml"
_USES = {"train": "trained with", "val": "validated on", "test": "tested on"}
"""What becomes of a network by the images of a split."""


def export_yolo(
    data: Convertible,
    out: str | Path,
    *,
    image_format: Literal["jpg", "png"] = "jpg",
    min_pixels: int = 16,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write colour images with boxes of what can be seen.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. A camera with instance images has the place and lens of each colour camera.
    out : path
        Folder to make: ``images/train/...``, ``labels/train/...`` and ``data.yaml``, in the layout of Ultralytics. A
        trainer wants both ``train`` and ``val``: what the dataset lacks is the other one, else ``test``, with a
        warning.
    image_format : str
        ``"jpg"`` or, without loss, ``"png"``.
    min_pixels : int
        Objects of which an image shows fewer are left out.
    overwrite : bool
    on_progress : callable

    Warns
    -----
    ScarlWarning
        If no images are for training or none for validation.

    Raises
    ------
    ParameterRangeError
        If a parameter is out of range, or there are no frames or colour images.
    DatasetError
        If there is no instance image with the view of a colour camera.
    OutputError
        If the folder is there or cannot be written.
    """
    check_image_format(image_format)
    source = as_source(data, "YOLO", ("camera",))
    mark = {"format": FORMAT, "scenes": [scene.name for scene in source.scenes]}
    splits: dict[str, str] = {}
    with whole_folder(out, mark, overwrite) as folder:
        for shown in labelled_images(source, min_pixels, on_progress):
            splits[shown.split] = f"images/{shown.split}"  # relative to `INFO`
            images, labels = (folder / kind / shown.split for kind in ("images", "labels"))
            for place in (images, labels):
                place.mkdir(parents=True, exist_ok=True)
            assert shown.image.rgb is not None
            (images / f"{shown.stem}.{image_format}").write_bytes(encode_image(shown.image.rgb, image_format))
            (labels / f"{shown.stem}.txt").write_text("".join(_lines(shown)), encoding="utf-8")
        named = {}
        for name, other in (("train", "val"), ("val", "train")):
            used = min(splits, key=lambda split: (split != name, split != other, split == "test"))
            named[name] = splits[used]
            if used != name:
                leak = f", so that a network is {_USES[name]} what it is {_USES[used]}" if used in _USES else ""
                warnings.warn(
                    f"no images are of the split '{name}': {INFO} names those of {splits[used]} in its place{leak}; "
                    f"give drives to the split '{name}'",
                    ScarlWarning,
                    stacklevel=2,
                )
        about = {**named, **splits, "names": dict(enumerate(NAMES))}
        (folder / INFO).write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")
    return Path(out)


def _lines(shown: LabelledImage) -> list[str]:
    """Return a line an object: class, centre, width and height of its box as shares of the image."""
    width, height = shown.image.spec.width, shown.image.spec.height
    lines = []
    for item in shown.objects:
        left, top, right, bottom = item.box
        number = NAMES.index(COCO_CLASSES[item.semantic_class][1])
        place = ((left + right) / 2.0 / width, (top + bottom) / 2.0 / height)
        lines.append(
            f"{number} {place[0]:.6f} {place[1]:.6f} {(right - left) / width:.6f} {(bottom - top) / height:.6f}\n"
        )
    return lines
