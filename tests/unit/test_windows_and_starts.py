"""What is computed here so that a start need not wait for SciPy's signal module is what SciPy gives, bit by bit."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy.signal

from scarl_sionna.core.specs.radar.waveforms import codes
from scarl_sionna.signal.windows import window_values

NAMES = {"rect": "boxcar", "hann": "hann", "hamming": "hamming", "blackman": "blackman", "taylor": ("taylor", 4, 35)}


@pytest.mark.parametrize("name", [*NAMES, "blackmanharris"])
def test_windows(name: str) -> None:
    for count in (3, 64, 127):
        longer = 2 * (name in ("hann", "blackman"))  # without the zeros at their ends
        values = scipy.signal.get_window(NAMES.get(name, name), count + longer, fftbins=False)
        values = values[1:-1] if longer else values
        assert window_values(name, count).tobytes() == (values / values.sum()).tobytes()


def test_m_sequences() -> None:
    for bits in range(2, 17):
        expected = 1.0 - 2.0 * scipy.signal.max_len_seq(bits)[0]
        np.testing.assert_array_equal(codes.m_sequence(2**bits - 1), expected)


def test_no_start_waits_for_them() -> None:
    """0.7 and 0.5 s for every worker of an export, and every command."""
    code = "import sys, scarl_sionna.batch.job, scarl_sionna.simulation, scarl_sionna.radar.labels, camera_lidar.lidar"
    code += "; print([name for name in ('scipy.signal', 'scipy.stats') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
