"""The baseline's average precision against nuscenes-devkit's own, on random detections."""

from __future__ import annotations

import json

import numpy as np

from examples.baseline.grid import Objects
from examples.baseline.metrics import average_precision, match
from tests.client_env import client_python, run_client


def test_average_precision_is_that_of_the_devkit(tmp_path, pytestconfig) -> None:
    python = client_python("nuscenes", pytestconfig)
    rng = np.random.default_rng(3)
    frames, matched = [], []
    for _ in range(20):
        there = rng.uniform(0.0, 40.0, (rng.integers(0, 8), 2))
        near = there[rng.random(len(there)) < 0.8]
        found = np.concatenate(
            [near + rng.normal(0.0, 0.5, near.shape), rng.uniform(0.0, 40.0, (rng.integers(1, 6), 2))]
        )
        scores = np.concatenate([rng.uniform(0.3, 1.0, len(near)), rng.uniform(0.0, 0.7, len(found) - len(near))])
        frames.append(
            [np.column_stack([found, scores]).tolist(), np.column_stack([there, np.ones(len(there))]).tolist()]
        )
        both = [
            Objects(places, np.zeros(len(places), int), values)
            for places, values in ((found, scores), (there, np.ones(len(there))))
        ]
        matched.append(match(*both, 0))
    (tmp_path / "frames.json").write_text(json.dumps(frames))
    run_client(python, "nuscenes_precision_client.py", tmp_path / "frames.json", tmp_path / "result.json")
    theirs = json.loads((tmp_path / "result.json").read_text())
    assert 0.05 < theirs[0] < theirs[3] < 0.95
    np.testing.assert_allclose(average_precision(matched), theirs, rtol=1e-12)
