"""The calibration's model as a Keras layer, so that a radar simulation can stand inside a TensorFlow model."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MissingPackageError, ScarlWarning
from scarl_sionna.engine.backend.bootstrap import ensure_engine

from .forward import ForwardModel

if TYPE_CHECKING:
    import tensorflow as tf
    from tensorflow import keras

Array = npt.NDArray[np.float64]
Array32 = npt.NDArray[np.float32]


def simulation_layer(model: ForwardModel, name: str = "simulation") -> keras.layers.Layer:
    """Return a Keras layer from parameters to what the measurements show.

    Parameters
    ----------
    model : ForwardModel
    name : str

    Returns
    -------
    keras.layers.Layer
        Maps (batch, num_parameters) between 0 and 1, from lower to upper bound, to (batch, num_values): predictions of
        the measurements that are used, over their noise. Values and gradients are exact in float64 inside, float32
        outside. Another shape, such as one vector without a batch, is a ValueError.

    Raises
    ------
    MissingPackageError
        If TensorFlow is not installed.
    EngineError
        If the engine cannot start beside a TensorFlow that was imported before.

    Warns
    -----
    ScarlWarning
        When the layer is called with values outside of 0 to 1: the model is then taken beyond the parameters' bounds.

    Notes
    -----
    :func:`whitened_data` is the matching target for a loss. The derivatives are those of :mod:`.physics`, so a step of
    training costs four evaluations of the model for each parameter and sample.
    """
    ensure_engine()  # before TensorFlow: each brings an LLVM of its own
    try:
        import tensorflow as tf
    except ImportError as error:
        raise MissingPackageError("tensorflow", "tensorflow") from error

    num_values, num_parameters = len(whitened_data(model)), len(model.names)

    def forward(units: tf.Tensor) -> Array32:
        batch = np.asarray(units, dtype=np.float64)
        _warn_of_outside(model, batch)
        rows = [_predicted(model, unit) for unit in batch]
        return np.array(rows, dtype=np.float32).reshape(-1, num_values)

    def backward(units: tf.Tensor, upstream: tf.Tensor) -> Array32:
        rows = [
            np.asarray(above, dtype=np.float64) @ _slope(model, unit)
            for unit, above in zip(np.asarray(units, dtype=np.float64), upstream, strict=True)
        ]
        return np.array(rows, dtype=np.float32).reshape(-1, num_parameters)

    @tf.custom_gradient  # type: ignore[untyped-decorator]
    def simulate(units: tf.Tensor) -> tuple[tf.Tensor, Callable[[tf.Tensor], tf.Tensor]]:
        values = tf.numpy_function(forward, [units], tf.float32)
        values.set_shape((None, num_values))

        def gradient(upstream: tf.Tensor) -> tf.Tensor:
            slope = tf.numpy_function(backward, [units, upstream], tf.float32)
            slope.set_shape((None, num_parameters))
            return slope

        return values, gradient

    class Simulation(tf.keras.layers.Layer):  # type: ignore[misc]
        """Predictions of a calibration's model."""

        def __init__(self) -> None:
            super().__init__(name=name)
            self.input_spec = tf.keras.layers.InputSpec(ndim=2, axes={-1: num_parameters})

        def call(self, units: tf.Tensor) -> tf.Tensor:
            """Return predictions over noise, shape (batch, num_values)."""
            return simulate(tf.cast(units, tf.float32))

        def compute_output_shape(self, input_shape: tuple[int | None, ...]) -> tuple[int | None, int]:
            """Return (batch, num_values)."""
            return (input_shape[0], num_values)

    return Simulation()


def whitened_data(model: ForwardModel) -> Array:
    """Return the data of the measurements that are used over their noise, shape (num_values,)."""
    return np.concatenate([item.data / item.sigma for item in model.channels if not item.spec.held_out])


def _warn_of_outside(model: ForwardModel, batch: Array) -> None:
    """Warn of parameters outside of 0 to 1, shape (batch, num_parameters)."""
    beyond = np.maximum(-batch, batch - 1.0).max(axis=0, initial=0.0)
    names = [f"{name} (by {far:.3g})" for name, far in zip(model.names, beyond, strict=True) if far > 0.0]
    if names:
        warnings.warn(
            f"outside of 0 to 1: {', '.join(names)}; the model is taken beyond the bounds of its parameters, where "
            "materials may be impossible: end the layers before in a sigmoid",
            ScarlWarning,
            stacklevel=2,
        )


def _predicted(model: ForwardModel, unit: Array) -> Array:
    """Return predictions over noise."""
    point = model.lower + model.span * unit
    return np.concatenate(
        [model.predict(item, point) / item.sigma for item in model.channels if not item.spec.held_out]
    )


def _slope(model: ForwardModel, unit: Array) -> Array:
    """Return the derivatives of the predictions over noise to the unit parameters."""
    return np.asarray(model.jacobian(model.lower + model.span * unit, with_prior=False) * model.span)
