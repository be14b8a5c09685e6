"""Trains a network on some frames of a dataset and lets it answer on others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError

from .data import GRID, Samples
from .grid import CLASSES, Objects, decode, encode
from .model import STRIDE, detector, tf

OUT_GRID = GRID.coarser(STRIDE)
Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class TrainingSettings:
    """How a network is trained.

    Parameters
    ----------
    num_steps : int
        Batches, however many frames there are: a small dataset is gone through more often.
    batch_size : int
    learning_rate : float
        Of Adam at its highest; it rises over the first tenth and falls to 0 as a cosine.
    width : int
        Channels of the network.
    seed : int
        Of the network's first weights and of the order of frames.
    """

    num_steps: int = 300
    batch_size: int = 8
    learning_rate: float = 4e-3
    width: int = 24
    seed: int = 0


def train(
    samples: Samples, rows: npt.NDArray[np.intp], inputs: str, method: str, settings: TrainingSettings
) -> tf.keras.Model:
    """Return a network that was trained on frames of a dataset.

    Parameters
    ----------
    samples : Samples
    rows : ndarray of int, shape (N,)
        Frames to train on.
    inputs : str
        What it sees: one of `INPUTS`.
    method : str
        Whose radar: one of `METHODS`.
    settings : TrainingSettings

    Raises
    ------
    ParameterRangeError
        If there is no frame.
    """
    if not len(rows):
        raise ParameterRangeError("rows", "none", "at least one frame to train on", "make more drives")
    tf.keras.utils.set_random_seed(settings.seed)
    network = detector(inputs, samples.images.shape[1:3], settings.width)
    rising = max(settings.num_steps // 10, 1)
    rate = tf.keras.optimizers.schedules.CosineDecay(
        0.0, max(settings.num_steps - rising, 1), warmup_target=settings.learning_rate, warmup_steps=rising
    )
    network.compile(tf.keras.optimizers.Adam(rate, clipnorm=5.0), loss=detection_loss)
    for fed, wanted in batches(samples, rows, inputs, method, settings):
        network.train_on_batch(fed, wanted)
    return network


def batches(
    samples: Samples, rows: npt.NDArray[np.intp], inputs: str, method: str, settings: TrainingSettings
) -> Iterator[tuple[dict[str, Array], Array]]:
    """Yield batches of a training: frames in random order, half of them mirrored (left and right exchanged)."""
    rng = np.random.default_rng(settings.seed)
    order: list[int] = []
    targets = {row: target(samples.objects[row]) for row in rows}
    for _ in range(settings.num_steps):
        while len(order) < settings.batch_size:
            order += rng.permutation(rows).tolist()
        taken, order = order[: settings.batch_size], order[settings.batch_size :]
        fed = network_inputs(samples, taken, inputs, method)
        wanted = np.stack([targets[row] for row in taken])
        for number in np.flatnonzero(rng.random(len(taken)) < 0.5):
            mirror(fed, wanted, int(number))
        yield fed, wanted


def network_inputs(samples: Samples, rows: npt.ArrayLike, inputs: str, method: str) -> dict[str, Array]:
    """Return what a network is fed with, for frames by number."""
    rows = np.asarray(rows, int)
    if inputs == "points":
        return {"points": samples.points[method][rows].copy()}
    fed = {"map": samples.maps[method][rows].astype(np.float32)}
    if inputs == "camera and map":
        fed["image"] = samples.images[rows].astype(np.float32) / 255.0
    return fed


def target(objects: Objects) -> Array:
    """Return heat, offsets and which cells hold a centre as one array (num_range, num_sine, num_classes + 3)."""
    heat, offset, holds = encode(OUT_GRID, objects)
    return np.concatenate([heat, offset, holds[..., None]], axis=-1)


def mirror(fed: dict[str, Array], wanted: Array, number: int) -> None:
    """Exchange left and right of one frame of a batch, in place."""
    for name, values in fed.items():
        if name == "points":
            values[number, :, 1] *= -1.0
        else:
            values[number] = values[number, :, ::-1].copy()
    wanted[number] = wanted[number, :, ::-1].copy()
    across = wanted[number, ..., len(CLASSES) + 1]
    across[wanted[number, ..., -1] > 0] = 1.0 - across[wanted[number, ..., -1] > 0]


def detection_loss(wanted: tf.Tensor, answer: tf.Tensor) -> tf.Tensor:
    """Return the focal loss of heat maps and the distance of offsets, by objects (Objects as Points, Eq. 1)."""
    heat, offset, holds = wanted[..., : len(CLASSES)], wanted[..., len(CLASSES) : -1], wanted[..., -1:]
    logits = answer[..., : len(CLASSES)]
    said = tf.sigmoid(logits)
    is_center = tf.cast(heat >= 1.0, answer.dtype)
    hit = is_center * (1.0 - said) ** 2 * tf.nn.softplus(-logits)
    miss = (1.0 - is_center) * (1.0 - heat) ** 4 * said**2 * tf.nn.softplus(logits)
    away = tf.abs(offset - answer[..., len(CLASSES) :]) * holds
    return (tf.reduce_sum(hit + miss) + tf.reduce_sum(away)) / tf.maximum(tf.reduce_sum(is_center), 1.0)


def detections(
    network: tf.keras.Model, samples: Samples, rows: npt.NDArray[np.intp], inputs: str, method: str
) -> list[Objects]:
    """Return what a network finds in frames of a dataset."""
    found = []
    for start in range(0, len(rows), 16):
        fed = network_inputs(samples, rows[start : start + 16], inputs, method)
        for answer in network(fed, training=False).numpy():
            heat = 1.0 / (1.0 + np.exp(-answer[..., : len(CLASSES)]))
            found.append(decode(OUT_GRID, heat, answer[..., len(CLASSES) :]))
    return found
