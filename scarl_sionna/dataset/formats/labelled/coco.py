"""Writes colour images with boxes and masks as a COCO folder.

References
----------
.. [1] T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", ECCV 2014; data format at cocodataset.org.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset.formats.output import whole_folder
from scarl_sionna.dataset.formats.pictures import encode_image
from scarl_sionna.dataset.formats.source import Convertible, OnProgress, as_source, no_progress

from .objects import COCO_CLASSES, ImageObject, labelled_images

FORMAT = "coco"


def export_coco(
    data: Convertible,
    out: str | Path,
    *,
    image_format: Literal["jpg", "png"] = "jpg",
    min_pixels: int = 16,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write colour images with boxes and masks of what can be seen.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. A camera with instance images has the place and lens of each colour camera.
    out : path
        Folder to make: ``images/train/...`` and ``annotations/instances_train.json`` for each split.
    image_format : str
        ``"jpg"`` or, without loss, ``"png"``.
    min_pixels : int
        Objects of which an image shows fewer are left out.
    overwrite : bool
    on_progress : callable

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
    source = as_source(data, "COCO", ("camera",))
    mark = {"format": FORMAT, "scenes": [scene.name for scene in source.scenes]}
    tables: dict[str, dict[str, list[Any]]] = {}
    number = 0
    with whole_folder(out, mark, overwrite) as folder:
        for shown in labelled_images(source, min_pixels, on_progress):
            table = tables.setdefault(shown.split, {"images": [], "annotations": []})
            name = f"{shown.stem}.{image_format}"
            place = folder / "images" / shown.split / name
            place.parent.mkdir(parents=True, exist_ok=True)
            assert shown.image.rgb is not None
            place.write_bytes(encode_image(shown.image.rgb, image_format))
            number += 1
            table["images"].append(
                {
                    "id": number,
                    "file_name": name,
                    "width": shown.image.spec.width,
                    "height": shown.image.spec.height,
                    "scarl_scene": shown.scene.name,
                    "scarl_camera": shown.camera,
                    "scarl_frame": shown.frame.index,
                    "scarl_timestamp_ns": shown.frame.timestamp_ns,
                }
            )
            for item in shown.objects:
                # the same over all splits: files of several splits can be put together
                identity = sum(len(other["annotations"]) for other in tables.values()) + 1
                table["annotations"].append({"id": identity, "image_id": number, **_annotation(item)})
        (folder / "annotations").mkdir()
        for split, table in tables.items():
            whole = {"info": {"description": f"scarl-sionna, rig {source.rig['name']}"}, "licenses": [], **table}
            text = json.dumps({**whole, "categories": _categories()})
            (folder / "annotations" / f"instances_{split}.json").write_text(text + "\n", encoding="utf-8")
    return Path(out)


def check_image_format(image_format: str) -> None:
    """Raise if images cannot be written so.

    Raises
    ------
    ParameterRangeError
    """
    if image_format not in ("jpg", "png"):
        raise ParameterRangeError("image_format", repr(image_format), "'jpg' or 'png'")


def _categories() -> list[dict[str, Any]]:
    """Return COCO's categories that we have, in the order of its numbers."""
    return [{"id": number, "name": name, "supercategory": ""} for number, name in sorted(set(COCO_CLASSES.values()))]


def _annotation(item: ImageObject) -> dict[str, Any]:
    left, top, right, bottom = item.box.tolist()
    return {
        "category_id": COCO_CLASSES[item.semantic_class][0],
        "bbox": [left, top, right - left, bottom - top],
        "area": item.num_pixels,
        "iscrowd": 0,
        "segmentation": {"size": list(item.mask.shape), "counts": run_lengths(item.mask)},
        "scarl_name": item.item.name,
        "scarl_instance": int(item.item.instance),
        "scarl_class": item.semantic_class,
        "scarl_occlusion": None if math.isnan(item.occlusion) else item.occlusion,
        "scarl_truncation": None if math.isnan(item.truncation) else item.truncation,
    }


def run_lengths(mask: npt.NDArray[np.bool_]) -> list[int]:
    """Return a mask as COCO's run lengths: columns one after the other, pixels outside first."""
    flat = mask.ravel(order="F")
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    edges = np.concatenate([[0] if not flat[0] else [0, 0], changes, [flat.size]])
    return [int(length) for length in np.diff(edges)]
