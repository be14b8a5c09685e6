"""Gradients of raw data through TensorFlow and PyTorch are those of the NumPy models."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.radar.gradients import PointModel, PointParameters, tensorflow_function, torch_function

RADAR = ss.RadarSpec().with_(num_chirps=15, num_samples=32, bandwidth=150e6)


def problem() -> tuple[PointModel, np.ndarray, PointParameters, PointParameters, float]:
    model = PointModel(RADAR, ss.Pose([0, 0, 0.5]), [[15.0, 2.0, 0.3], [22.0, -3.0, 0.1]], [[-5.0, 1.0, 0.0]] * 2, 1.0)
    data = model.value(model.start.changed(position=model.start.position + 2e-4))
    start = model.start.changed(rcs=1.3, tx_gain_db=[0.0, 0.5, 0.0])
    scale = 1.0 / np.sum(np.abs(data) ** 2)
    exact = model.reverse(start, 2.0 * scale * (model.value(start) - data))
    return model, data, start, exact, scale


@pytest.mark.slow
@pytest.mark.own_process
@pytest.mark.parametrize("compiled", [False, True], ids=["eager", "graph"])
def test_tensorflow(compiled: bool) -> None:
    pytest.importorskip("tensorflow")
    model, data, start, exact, scale = problem()
    synthesize = tensorflow_function(model)
    import tensorflow as tf

    values = [tf.Variable(value) for value in start]

    def gradients() -> list[tf.Tensor]:
        with tf.GradientTape() as tape:
            residual = synthesize(*values) - data
            loss = scale * tf.reduce_sum(tf.math.real(residual * tf.math.conj(residual)))
        return tape.gradient(loss, values)

    found = (tf.function(gradients) if compiled else gradients)()
    for one, other in zip(found, exact, strict=True):
        assert np.allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())


def test_torch() -> None:
    torch = pytest.importorskip("torch")
    model, data, start, exact, scale = problem()
    values = [torch.tensor(value, requires_grad=True) for value in start]
    residual = torch_function(model)(*values) - torch.from_numpy(data)
    (scale * residual.abs().square().sum()).backward()
    for one, other in zip(values, exact, strict=True):
        assert np.allclose(one.grad.numpy(), other, rtol=1e-9, atol=1e-12 * np.abs(other).max())
