"""Reductions over the columns of long arrays, against NumPy's."""

import numpy as np
import pytest

from scarl_sionna.core.arrays.rows import row_all, row_any, row_cross, row_dots, row_max, row_min, row_norm


@pytest.mark.parametrize("shape", [(1000, 3), (0, 3), (50, 4, 3), (20, 1)])
def test_bytes_are_those_of_numpy(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=shape) * 10.0 ** rng.integers(-9, 9, shape)
    values.reshape(-1)[::7] = np.nan
    values.reshape(-1)[::5] = 0.0
    kept = values.copy()
    np.testing.assert_array_equal(row_max(values), values.max(axis=-1))
    np.testing.assert_array_equal(row_min(values), values.min(axis=-1))
    np.testing.assert_array_equal(row_any(values), values.any(axis=-1))
    np.testing.assert_array_equal(row_any(values > 0.0), (values > 0.0).any(axis=-1))
    np.testing.assert_array_equal(row_all(values >= 0.0), (values >= 0.0).all(axis=-1))
    if shape[-1] == 3:
        other = rng.normal(size=shape)
        assert row_norm(values).tobytes() == np.linalg.norm(values, axis=-1).tobytes()
        flat, turned = values.reshape(-1, 3), other.reshape(-1, 3)[::-1][:40]
        expected = (flat[:, None] * turned).sum(axis=2)
        np.testing.assert_array_equal(row_dots(flat, turned), expected)
        assert row_cross(values, other).tobytes() == np.cross(values, other).tobytes()
    np.testing.assert_array_equal(values, kept)  # none works in place


def test_rows_without_columns_have_none_set_and_all() -> None:
    nothing = np.zeros((4, 0), dtype=np.bool_)
    assert row_any(nothing).tolist() == [False] * 4 and row_all(nothing).tolist() == [True] * 4
