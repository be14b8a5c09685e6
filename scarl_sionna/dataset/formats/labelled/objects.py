"""Which objects a camera's image shows, and where: what COCO, YOLO and KITTI have in common."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, ParameterRangeError
from scarl_sionna.core.results import Frame, ImageFrame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset.derived.boxes import is_ego
from scarl_sionna.dataset.formats.source import FrameSource, OnProgress, SceneFrames

UNSPLIT = "all"
"""Stands for the split of scenes that are in none."""

COCO_CLASSES: Mapping[str, tuple[int, str]] = {
    "Pedestrian": (1, "person"),
    "Rider": (1, "person"),
    "Bicycle": (2, "bicycle"),
    "Car": (3, "car"),
    "Motorcycle": (4, "motorcycle"),
    "Bus": (6, "bus"),
    "Train": (7, "train"),
    "Truck": (8, "truck"),
    "TrafficLight": (10, "traffic light"),
}
"""COCO's number and name of our semantic classes that it has."""


@dataclass(frozen=True, eq=False)
class ImageObject:
    """An object that an image shows.

    Attributes
    ----------
    item : ObjectState
    mask : ndarray of bool, shape (height, width)
        Pixels that show it.
    box : ndarray of float64, shape (4,)
        Left, top, right, bottom of the mask [px]; the image begins at (0, 0).
    occlusion, truncation : float
        Share that is hidden, and that is outside of the image; nan where the dataset does not tell it.
    """

    item: ObjectState
    mask: npt.NDArray[np.bool_]
    box: npt.NDArray[np.float64]
    occlusion: float
    truncation: float

    @property
    def semantic_class(self) -> str:
        """Name of its semantic class."""
        return SEMANTIC_CLASSES[self.item.semantic]

    @property
    def num_pixels(self) -> int:
        """Pixels of the mask."""
        return int(np.count_nonzero(self.mask))


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """A colour image with its objects; `stem` names its files, `split` the part of the dataset."""

    split: str
    stem: str
    scene: SceneFrames
    frame: Frame
    camera: str
    image: ImageFrame
    objects: tuple[ImageObject, ...]


def labelled_images(
    source: FrameSource, min_pixels: int, on_progress: OnProgress, classes: Mapping[str, object] = COCO_CLASSES
) -> Iterator[LabelledImage]:
    """Yield every colour image of every frame, with the objects of some classes of which it shows enough.

    Raises
    ------
    ParameterRangeError
        If there are no frames, no colour images, or `min_pixels` is below 1.
    DatasetError
        If there is no instance image of the same view.
    """
    check_images(source, min_pixels)
    done = 0
    for scene in source.scenes:
        split = source.split_of(scene.name) or UNSPLIT
        for frame in scene:
            for camera, image in frame.images.items():
                if image.rgb is not None:
                    stem = f"{scene.name}__{camera.replace('/', '_')}__{frame.index:06d}"
                    found = (
                        item
                        for item in image_objects(frame, camera)
                        if item.semantic_class in classes and item.num_pixels >= min_pixels
                    )
                    yield LabelledImage(split, stem, scene, frame, camera, image, tuple(found))
            done += 1
            on_progress(done, source.num_frames)


def check_images(source: FrameSource, min_pixels: int = 1) -> None:
    """Raise if a source has no frames or no camera, or the number of pixels is below 1.

    Raises
    ------
    ParameterRangeError
    """
    if min_pixels < 1:
        raise ParameterRangeError("min_pixels", min_pixels, ">= 1")
    source.not_empty()
    first = next(scene for scene in source.scenes if len(scene))
    if not any(image.rgb is not None for image in first.frames[0].images.values()):
        raise ParameterRangeError("dataset", "without RGB camera", "at least one", "choose another export format")


def image_objects(frame: Frame, camera: str) -> list[ImageObject]:
    """Return all objects of which a camera's image shows a pixel, without the vehicle that carries it.

    Raises
    ------
    DatasetError
        If there is no instance image of the same view.
    """
    shown = _instance_image(frame, camera)
    assert shown.instance is not None
    present = set(np.unique(shown.instance).tolist())
    found = []
    for number, item in enumerate(frame.objects):
        if item.instance not in present or is_ego(frame, item):
            continue
        mask = shown.instance == item.instance
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        box = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], np.float64)
        hidden, outside = (
            math.nan if values is None else float(values[number])
            for values in (shown.object_occlusion, shown.object_truncation)
        )
        found.append(ImageObject(item, mask, box, hidden, outside))
    return found


def _instance_image(frame: Frame, camera: str) -> ImageFrame:
    """Return the camera's own instance image, or that of another camera with the same view."""
    own: ImageFrame = frame.images[camera]
    for image in (own, *frame.images.values()):
        if image.instance is not None and _same_view(image, own):
            return image
    raise DatasetError(
        f"frame {frame.index} has no instance image with the view of {camera}, so which pixels are an object's is not "
        "known",
        None,
        "give the rig a camera with 'instance' at the same place",
    )


def _same_view(one: ImageFrame, other: ImageFrame) -> bool:
    """Return whether two cameras have the same place and project to the same pixels."""
    a, b = one.spec, other.spec
    return bool(
        (a.width, a.height, a.lens) == (b.width, b.height, b.lens)
        and np.array_equal(a.intrinsics, b.intrinsics)
        and np.array_equal(one.world_from_sensor.position, other.world_from_sensor.position)
        and np.array_equal(one.world_from_sensor.quaternion, other.world_from_sensor.quaternion)
    )
