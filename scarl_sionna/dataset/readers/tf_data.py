"""Frames as a `tf.data.Dataset`: read by several threads, prefetched, ragged where lengths differ."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import EngineError, ParameterRangeError
from scarl_sionna.core.packages import require

from .samples import Array, FrameData, FrameSamples, ItemSpec

if TYPE_CHECKING:
    import tensorflow as tf
    from tensorflow import Tensor


def tensorflow() -> ModuleType:
    """Return TensorFlow, imported after Dr.Jit where that is usable: the other way round crashes the process later.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    if "tensorflow" not in sys.modules:
        from scarl_sionna.engine.backend.bootstrap import ensure_engine

        with suppress(
            EngineError
        ):  # without ray tracing in this process nothing is to be protected: reading needs none
            ensure_engine()
    return require("tensorflow", "tensorflow")


def tf_dataset(
    data: FrameData,
    items: Sequence[str] | Mapping[str, str] | None = None,
    *,
    batch_size: int | None = None,
    shuffle_seed: int | None = None,
    repeat: bool = False,
    num_threads: int = 4,
    prefetch: int = 4,
) -> tf.data.Dataset:
    """Return a `tf.data.Dataset` of dictionaries of tensors.

    Parameters
    ----------
    data, items
        See `FrameSamples`.
    batch_size : int, optional
        Frames a batch; items whose length differs from frame to frame (lidar, boxes) become ragged tensors then. Left
        out: one frame an element.
    shuffle_seed : int, optional
        Read the frames in random order, another one in every epoch; left out: in their order.
    repeat : bool
        Begin again at the end.
    num_threads : int
        Frames that are read at once.
    prefetch : int
        Elements that are kept ready.

    Raises
    ------
    MissingPackageError
        If TensorFlow is not installed.
    ParameterRangeError, UnknownNameError
        As `FrameSamples`, or if a number is below 1.
    """
    for name, value in (("batch_size", batch_size), ("num_threads", num_threads), ("prefetch", prefetch)):
        if value is not None and value < 1:
            raise ParameterRangeError(name, value, ">= 1")
    tf = tensorflow()
    samples = FrameSamples(data, items)
    signature = samples.signature()
    dataset = tf.data.Dataset.range(len(samples))
    if shuffle_seed is not None:
        dataset = dataset.shuffle(len(samples), seed=shuffle_seed, reshuffle_each_iteration=True)
    if repeat:
        dataset = dataset.repeat()
    dataset = dataset.map(_reader(tf, samples, signature), num_parallel_calls=num_threads, deterministic=True)
    if batch_size is not None:
        ragged = any(None in spec.shape for spec in signature.values())
        dataset = dataset.ragged_batch(batch_size) if ragged else dataset.batch(batch_size)
    return dataset.prefetch(prefetch)


def _reader(
    tf: ModuleType, samples: FrameSamples, signature: Mapping[str, ItemSpec]
) -> Callable[[Tensor], dict[str, Tensor]]:
    """Return the function from an index tensor to a dictionary of tensors with their static shapes."""
    types = [tf.as_dtype(spec.dtype) for spec in signature.values()]

    def read(index: npt.NDArray[np.int64]) -> list[Array]:
        return [np.asarray(value, order="C") for value in samples[int(index)].values()]

    def element(index: Tensor) -> dict[str, Tensor]:
        tensors = tf.numpy_function(read, [index], types)
        for tensor, spec in zip(tensors, signature.values(), strict=True):
            tensor.set_shape(spec.shape)
        return dict(zip(signature, tensors, strict=True))

    return element
