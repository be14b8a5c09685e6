"""A Keras model with the simulation inside trains, and its gradients are those of the simulation."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from scarl_sionna.calibration import CalibrationProblem, ForwardModel, FreeParameter, SlabMeasurement
from scarl_sionna.calibration.keras_layer import simulation_layer, whitened_data

pytestmark = [
    pytest.mark.own_process,
    pytest.mark.skipif(importlib.util.find_spec("tensorflow") is None, reason="needs the extra [tensorflow]"),
]
ANGLES = tuple(np.linspace(0.0, 75.0, 8))


@pytest.fixture(scope="module")
def model() -> ForwardModel:
    free = [
        FreeParameter(name="asphalt.relative_permittivity", lower=2.0, upper=8.0),
        FreeParameter(name="asphalt.conductivity", lower=0.1, upper=6.0),
    ]
    specs = [
        SlabMeasurement(
            name=mode,
            material="asphalt",
            polarization=mode,
            angle_deg=ANGLES,
            values=(0.0,) * 8,
            noise=0.02,
            form="amplitude",
        )
        for mode in ("TE", "TM")
    ]
    return ForwardModel(CalibrationProblem(parameters=free, measurements=specs))


def test_gradient_of_the_layer(model: ForwardModel) -> None:
    import tensorflow as tf

    layer = simulation_layer(model)
    units, weights = tf.constant([[0.3, 0.4], [0.7, 0.2]]), tf.constant(np.linspace(-1, 1, 16)[None], tf.float32)
    with tf.GradientTape() as tape:
        tape.watch(units)
        total = tf.reduce_sum(layer(units) * weights)
    slope = tape.gradient(total, units).numpy()
    numeric = np.zeros((2, 2))

    def value(row: int, column: int, step: float) -> float:
        point = units.numpy()[row].astype(np.float64)
        point[column] += step
        point = model.lower + model.span * point
        parts = [model.predict(item, point) / item.sigma for item in model.channels]
        return float(np.concatenate(parts) @ np.linspace(-1, 1, 16))

    for row, column in np.ndindex(2, 2):
        numeric[row, column] = (value(row, column, 1e-4) - value(row, column, -1e-4)) / 2e-4
    np.testing.assert_allclose(slope, numeric, rtol=1e-3)


def test_an_encoder_learns_to_invert_the_simulation(model: ForwardModel) -> None:
    """A network reads permittivity and loss from measured curves.

    It sees curves only, the layer turns its guess into them.
    """
    import tensorflow as tf

    tf.keras.utils.set_random_seed(1)
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.1, 0.9, (48, 2))
    layer = simulation_layer(model)
    curves = layer(tf.constant(truth, tf.float32)).numpy()
    inputs = tf.keras.Input((16,))
    scaled = tf.keras.layers.Rescaling(0.1)(inputs)
    hidden = tf.keras.layers.Dense(24, "tanh")(scaled)
    guess = tf.keras.layers.Dense(2, "sigmoid", name="guess")(hidden)
    network = tf.keras.Model(inputs, layer(guess))
    network.compile(tf.keras.optimizers.Adam(0.02), "mse")
    history = network.fit(curves, curves, batch_size=16, epochs=20, verbose=0).history["loss"]
    assert history[-1] < 0.1 * history[0]
    guessed = tf.keras.Model(inputs, guess)(curves).numpy()
    before = np.sqrt(np.mean((truth[:, 0] - truth[:, 0].mean()) ** 2))
    assert np.sqrt(np.mean((guessed[:, 0] - truth[:, 0]) ** 2)) < 0.4 * before  # it never saw the permittivity itself


def test_target_of_the_loss_is_the_data(model: ForwardModel) -> None:
    assert whitened_data(model).shape == (16,)
