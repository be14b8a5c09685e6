"""The models of this package as functions of TensorFlow and of PyTorch, which carry gradients through them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MissingPackageError
from scarl_sionna.engine.backend.bootstrap import ensure_engine

from .operator import BeatOperator
from .path_model import PathModel
from .point_model import PointModel

if TYPE_CHECKING:
    import tensorflow as tf
    import torch

Complex = npt.NDArray[np.complex128]


Model = BeatOperator | PathModel | PointModel
"""What has values and their adjoint."""


def tensorflow_function(model: Model) -> Callable[..., tf.Tensor]:
    """Return a TensorFlow function from a model's parameters to its raw data.

    Parameters
    ----------
    model : BeatOperator, PathModel or PointModel

    Returns
    -------
    callable
        Takes the fields of ``model.parameters`` in their order, float64 and complex128 tensors; returns complex128
        (num_rx, num_chirps_total, num_samples). Gradients are the adjoint in float64, in eager mode and in
        ``tf.function``. Only of first order.

    Raises
    ------
    MissingPackageError
        If TensorFlow is not installed.
    """
    ensure_engine()  # before TensorFlow: each brings an LLVM of its own
    try:
        import tensorflow as tf
    except ImportError as error:
        raise MissingPackageError("tensorflow", "tensorflow") from error

    def forward(*values: npt.ArrayLike) -> Complex:
        return _value(model, values)

    def backward(*values: npt.ArrayLike) -> list[npt.NDArray[Any]]:
        return _reverse(model, values[:-1], values[-1])

    @tf.custom_gradient  # type: ignore[untyped-decorator]
    def synthesize(*values: tf.Tensor) -> tuple[tf.Tensor, Callable[[tf.Tensor], list[tf.Tensor]]]:
        def gradient(upstream: tf.Tensor) -> list[tf.Tensor]:
            slopes = tf.numpy_function(backward, [*values, upstream], [value.dtype for value in values])
            for slope, value in zip(slopes, values, strict=True):
                slope.set_shape(value.shape)
            return list(slopes)

        return tf.numpy_function(forward, list(values), tf.complex128), gradient

    return lambda *values: synthesize(*(tf.convert_to_tensor(value) for value in values))


def torch_function(model: Model) -> Callable[..., torch.Tensor]:
    """Return a PyTorch function from a model's parameters to its raw data.

    Parameters
    ----------
    model : BeatOperator, PathModel or PointModel

    Returns
    -------
    callable
        Takes the fields of ``model.parameters`` in their order, float64 and complex128 tensors on the CPU; returns
        complex128 (num_rx, num_chirps_total, num_samples). Gradients are the adjoint in float64. Only of first order.

    Raises
    ------
    MissingPackageError
        If PyTorch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise MissingPackageError("torch", "torch") from error

    class Synthesis(torch.autograd.Function):
        @staticmethod
        def forward(context: torch.autograd.function.FunctionCtx, *values: torch.Tensor) -> torch.Tensor:
            context.save_for_backward(*values)
            return torch.from_numpy(_value(model, map(_array, values)))

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(context: torch.autograd.function.FunctionCtx, upstream: torch.Tensor) -> tuple[torch.Tensor, ...]:
            saved = context.saved_tensors
            return tuple(torch.from_numpy(part) for part in _reverse(model, map(_array, saved), _array(upstream)))

    return lambda *values: Synthesis.apply(*(torch.as_tensor(value) for value in values))


def _array(value: torch.Tensor) -> npt.NDArray[Any]:
    return np.asarray(value.detach().resolve_conj().numpy())


def _value(model: Model, values: Iterable[npt.ArrayLike]) -> Complex:
    point: Any = model.parameters._make(np.asarray(value) for value in values)
    return model.value(point)


def _reverse(model: Model, values: Iterable[npt.ArrayLike], upstream: npt.ArrayLike) -> list[npt.NDArray[Any]]:
    point: Any = model.parameters._make(np.asarray(value) for value in values)
    return [np.array(part) for part in model.reverse(point, np.asarray(upstream, dtype=np.complex128))]
