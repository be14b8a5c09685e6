"""Weights of a table's aspects for what a centre sends back in a direction, far away or near."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Shares = npt.NDArray[np.complex128]

NODE_PHASE = 1.1
"""Phase at the edge of a centre's cell from one node to the next [rad], at most where the table is that fine: six nodes
follow 1 rad to 1e-3, and closer ones would show the steps between traces instead of the cell."""
WIDEST_STEP = 0.35
"""Widest angle from one node to the next [rad] where the table is that fine. Near the poles of a table whole turns of
azimuth are less than a cell; there the directions of polarisation turn with it, which six nodes so far apart follow."""


def shares_of(grid: Array, value: Array, bend: Array, turn: Array, slope: Array | float = 0.0) -> tuple[Index, Shares]:
    r"""Return the neighbours of values on a rising grid, and their shares of waves that bend over a centre's cell.

    Parameters
    ----------
    grid : ndarray of float64
        Rising angles [rad]. Beyond them the ends hold.
    value : ndarray of float64, shape (n,)
        [rad].
    bend : ndarray of float64, shape (n,)
        b, see below [rad2]; 0 of plane waves.
    turn : ndarray of float64, shape (n,)
        Phase at the edge of a cell for each radian of angle.
    slope : ndarray of float64, shape (n,), or number
        s, see below [1/rad].

    Returns
    -------
    tuple of ndarray of int64 and of complex128, shape (n, num_neighbours)
        Six neighbours; four, two or one where the grid has less.

    Notes
    -----
    .. math:: e^{j b (D^2 + s D)} A \approx A + j b (A'' + s A') - \tfrac{1}{2} b^2 A''''

    with the derivatives of the polynomial through the neighbours (of four without the last term, of two or one without
    both). They are so far apart that the phase at the edge of a cell turns by about `NODE_PHASE` from one to the next.
    b is at most the square of that step: where more would be asked for, noise of the table would be all that is seen.
    """
    count = next(number for number in (6, 4, 2, 1) if number <= len(grid))
    held, step = np.clip(value, grid[0], grid[-1]), float(np.diff(grid).max(initial=0.0))
    stride = np.ones(len(held), dtype=np.int64)
    if count >= 4:
        most = min(max(int(WIDEST_STEP / step), 1), (len(grid) - 1) // (count - 1))
        stride = np.clip(NODE_PHASE / np.maximum(turn * step, 1e-9) + 0.5, 1, most).astype(np.int64)
    number = _nodes(grid, held, count, stride)
    powers = _polynomials(grid[number] - held[:, None])
    shares = powers[:, :, 0].astype(np.complex128)
    if count >= 4:
        b = np.minimum(bend, (stride * step) ** 2)[:, None]
        shares += 1j * b * (2.0 * powers[:, :, 2] + np.reshape(slope, (-1, 1)) * powers[:, :, 1])
        shares -= 12.0 * b**2 * powers[:, :, 4] if count >= 6 else 0.0
    return number, shares


def _nodes(grid: Array, held: Array, count: int, stride: Index) -> Index:
    low = np.searchsorted(grid, held, side="right") - 1 - (count // 2 - 1) * stride
    first = np.clip(low, 0, len(grid) - 1 - (count - 1) * stride)
    return np.asarray(first[:, None] + stride[:, None] * np.arange(count), dtype=np.int64)


def _polynomials(node: Array) -> Array:
    """Return the coefficients, rising, of the polynomials that are 1 at one node and 0 at the others.

    Both of shape (n, num_nodes), the result with the powers behind.
    """
    count = node.shape[1]
    result = np.zeros((*node.shape, count))
    result[:, :, 0] = 1.0
    for i in range(count):
        for j in range(count):
            if i != j:
                own = result[:, i] / (node[:, i] - node[:, j])[:, None]
                result[:, i] = -node[:, j, None] * own
                result[:, i, 1:] += own[:, :-1]
    return result
