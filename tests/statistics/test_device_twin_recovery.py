"""A hundred planted devices: 95 % intervals hold, held-out captures are at the noise."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.calibration.device import fit_device
from scarl_sionna.calibration.estimate import INTERVAL
from tests.device_captures import ANTENNA_STD, SETTINGS, errors_over_std, planted

COUNT = 100


@pytest.mark.slow
@pytest.mark.parametrize(("coupling_std", "antenna_std", "count"), [(0.0, ANTENNA_STD, 12), (0.1, 0.0, 14)])
def test_intervals_hold_for_a_hundred_devices(coupling_std, antenna_std, count) -> None:
    errors, held_out = [], []
    for seed in range(COUNT):
        device = planted(seed, count, coupling_std=coupling_std, antenna_std=antenna_std)
        settings = SETTINGS.with_(coupling_std=coupling_std, antenna_std=antenna_std)
        fit = fit_device(device.captures, device.stated, settings)
        found = errors_over_std(fit, device)
        errors.append([found[name] for name in sorted(found)])
        held_out += [item.over_noise for item in fit.residuals if item.held_out]
    inside = np.abs(errors) < INTERVAL
    assert inside.mean() >= 0.93
    # of 28 shares of 95 in 100 the smallest is below 88 once in 40
    assert inside.mean(axis=0).min() >= 0.88, dict(zip(sorted(found), inside.mean(axis=0), strict=True))
    assert 0.98 < np.sqrt(np.mean(np.square(held_out))) < 1.02
