"""The networks: three ways into one small convolutional head, which answers heat maps and offsets on a polar grid.

References
----------
.. [1] X. Zhou, D. Wang, P. Krähenbühl, "Objects as Points", 2019: the head and its starting bias.
.. [2] A. H. Lang et al., "PointPillars", CVPR 2019: points to a grid by a small network and a maximum.
.. [3] T. Roddick, A. Kendall, R. Cipolla, "Orthographic Feature Transform", BMVC 2019: image features at places on the
   ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.dataset.readers.tf_data import tensorflow

from .data import GRID, INPUTS, MOST_POINTS, POINT_FEATURES, VELOCITY_BINS
from .grid import CLASSES, PolarGrid

if TYPE_CHECKING:
    import tensorflow as tf
else:
    tf = tensorflow()  # after Dr.Jit: see docs/install.md

STRIDE = 2
"""Cells of the input's grid in one of the answer's, along range and sine."""
START_BIAS = -4.0
"""Of the heat map's logits: a network that has learned nothing says 2 % everywhere."""
CAMERA_HEIGHT = 0.8
"""Of the rig's camera over the ground [m]."""
HEIGHTS = (0.0, 1.2)
"""Over the ground, at which every cell is looked up in the image [m]."""


def detector(inputs: str, image_size: tuple[int, int], width: int = 24) -> tf.keras.Model:
    """Return an untrained network.

    Parameters
    ----------
    inputs : str
        One of `INPUTS`. The network takes a dictionary with ``"map"`` (B, num_range, num_sine, num_velocity_groups),
        ``"points"`` (B, MOST_POINTS, num_features) or ``"map"`` and ``"image"`` (B, height, width, 3) of 0 to 1.
    image_size : (int, int)
        Height and width [px] of a camera with 90 deg of field of view.
    width : int
        Channels of the hidden layers.

    Returns
    -------
    tf.keras.Model
        Its answer is (B, num_range / 2, num_sine / 2, num_classes + 2): logits of the heat map, and offsets.
    """
    if inputs not in INPUTS:
        raise UnknownNameError("inputs", inputs, INPUTS)
    layers = tf.keras.layers
    fed: dict[str, tf.Tensor] = {}
    if inputs == "points":
        fed["points"] = tf.keras.Input((MOST_POINTS, len(POINT_FEATURES)), name="points")
        features = PointsOnGrid(GRID, width)(fed["points"])
    else:
        fed["map"] = tf.keras.Input((*GRID.shape, len(VELOCITY_BINS)), name="map")
        features = fed["map"]
    features = WithPlace(GRID)(features)
    features = _convolution(features, width, strides=STRIDE)
    if inputs == "camera and map":
        fed["image"] = tf.keras.Input((*image_size, 3), name="image")
        seen = _convolution(fed["image"], 12, strides=2)
        seen = _convolution(seen, 16, strides=2)
        seen = _convolution(seen, 16)
        features = layers.Concatenate()([features, ImageOnGrid(GRID.coarser(STRIDE))(seen)])
        features = _convolution(features, width)
    for dilation in (1, 2, 1):
        features = layers.Add()([_convolution(features, width, dilation_rate=dilation), _skip(features, width)])
    bias = tf.keras.initializers.Constant([START_BIAS] * len(CLASSES) + [0.5, 0.5])
    answer = layers.Conv2D(len(CLASSES) + 2, 1, bias_initializer=bias)(features)
    return tf.keras.Model(fed, answer)


def _convolution(features: tf.Tensor, width: int, **options: int) -> tf.Tensor:
    layers = tf.keras.layers
    features = layers.Conv2D(width, 3, padding="same", use_bias=False, **options)(features)
    return layers.ReLU()(layers.BatchNormalization(momentum=0.9)(features))


def _skip(features: tf.Tensor, width: int) -> tf.Tensor:
    return features if features.shape[-1] == width else tf.keras.layers.Conv2D(width, 1)(features)


class WithPlace(tf.keras.layers.Layer):
    """Adds each cell's range and sine of azimuth squared as channels (the same to the left and to the right)."""

    def __init__(self, grid: PolarGrid) -> None:
        super().__init__()
        across = np.linspace(-1.0, 1.0, grid.num_sine) ** 2
        self.place = np.stack(np.meshgrid(np.linspace(0.0, 1.0, grid.num_range), across, indexing="ij"), axis=-1)

    def call(self, features: tf.Tensor) -> tf.Tensor:
        """Return the features with two more channels."""
        place = tf.cast(self.place[None], features.dtype)
        return tf.concat([features, tf.tile(place, [tf.shape(features)[0], 1, 1, 1])], axis=-1)


class PointsOnGrid(tf.keras.layers.Layer):
    """A small network for each point, and in each cell of the grid the maximum over its points, or 0."""

    def __init__(self, grid: PolarGrid, width: int) -> None:
        super().__init__()
        self.grid, self.width = grid, width
        self.hidden = [tf.keras.layers.Dense(width, activation="relu") for _ in range(2)]

    def call(self, points: tf.Tensor) -> tf.Tensor:
        """Return (B, num_range, num_sine, width) of points (B, N, num_features); rows of nan are no points."""
        there = tf.reduce_all(tf.math.is_finite(points), axis=-1)
        points = tf.where(there[..., None], points, tf.zeros_like(points))
        row = tf.cast(points[..., 0] * self.grid.num_range, tf.int32)
        column = tf.cast((points[..., 1] + self.grid.max_sine) / self.grid.sine_step, tf.int32)
        features = points
        for layer in self.hidden:
            features = layer(features)
        batch, cells = tf.shape(points)[0], self.grid.num_range * self.grid.num_sine
        cell = tf.range(batch)[:, None] * cells + row * self.grid.num_sine + column
        cell = tf.where(there, cell, batch * cells)  # one cell more, for what is no point
        summed = tf.math.unsorted_segment_max(
            tf.reshape(features, (-1, self.width)), tf.reshape(cell, (-1,)), batch * cells + 1
        )
        return tf.reshape(tf.maximum(summed[:-1], 0.0), (batch, *self.grid.shape, self.width))


class ImageOnGrid(tf.keras.layers.Layer):
    """Looks the cells of a grid up in image features, at some heights over the ground; 0 outside of the image."""

    def __init__(self, grid: PolarGrid, heights: Sequence[float] = HEIGHTS) -> None:
        super().__init__()
        self.grid, self.heights = grid, tuple(heights)

    def build(self, shape: tuple[int, ...]) -> None:
        """Compute where each cell lies in the image."""
        tables = [pixel_weights(self.grid, height, (shape[1], shape[2])) for height in self.heights]
        self.pixels = np.stack([pixels for pixels, _ in tables])
        self.weights_of_pixels = np.stack([weights for _, weights in tables])

    def call(self, seen: tf.Tensor) -> tf.Tensor:
        """Return (B, num_range, num_sine, num_heights * C) of image features (B, rows, columns, C)."""
        shape, channels = tf.shape(seen), seen.shape[-1]
        flat = tf.reshape(seen, (shape[0], shape[1] * shape[2], channels))
        parts = []
        for pixels, weights in zip(self.pixels, self.weights_of_pixels, strict=True):
            found = tf.reshape(tf.gather(flat, pixels.ravel(), axis=1), (shape[0], *pixels.shape, channels))
            parts.append(tf.reduce_sum(found * tf.cast(weights[None, ..., None], seen.dtype), axis=-2))
        return tf.reshape(tf.concat(parts, axis=-1), (shape[0], *self.grid.shape, len(parts) * channels))


def pixel_weights(
    grid: PolarGrid, height: float, size: tuple[int, int]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Return where the middle of every cell lies in an image: four pixels each and their bilinear weights.

    Parameters
    ----------
    grid : PolarGrid
    height : float
        Over the ground [m].
    size : (int, int)
        Rows and columns of the image; the camera is the rig's, at the radar's place, with a field of view of 90 deg.

    Returns
    -------
    pixels : ndarray of int32, shape (num_cells, 4)
        Row times columns plus column.
    weights : ndarray of float32, shape (num_cells, 4)
        Their sum is 1 inside of the image, and 0 where the cell is outside.
    """
    rows, columns = size
    x, y = grid.centers().reshape(-1, 2).T
    focal = columns / 2.0
    across = columns / 2.0 - focal * y / x - 0.5
    down = rows / 2.0 - focal * (height - CAMERA_HEIGHT) / x - 0.5
    inside = (across > -0.5) & (across < columns - 0.5) & (down > -0.5) & (down < rows - 0.5)
    left, top = np.floor(across).astype(int), np.floor(down).astype(int)
    pixels, weights = [], []
    for step_down in (0, 1):
        for step_across in (0, 1):
            row, column = np.clip(top + step_down, 0, rows - 1), np.clip(left + step_across, 0, columns - 1)
            share = (1.0 - np.abs(down - top - step_down)) * (1.0 - np.abs(across - left - step_across))
            pixels.append(row * columns + column)
            weights.append(np.where(inside, share, 0.0))
    return np.stack(pixels, axis=1).astype(np.int32), np.stack(weights, axis=1).astype(np.float32)
