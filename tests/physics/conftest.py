"""Fixtures of the physics tests."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.radar.synthesis import groups


@pytest.fixture(params=["as planned", "transforms only"])
def ways(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Synthesise by the plain sum, which a single path goes to, or by the transforms, which many do."""
    if request.param == "transforms only":
        monkeypatch.setattr(groups, "DIRECT_COST", np.inf)
