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


def far_shares(grid: Array, value: Array) -> tuple[Index, Array]:
    """Return the neighbours of values on a rising grid and their shares, each (n, num_neighbours).

    Four neighbours with the weights of the cubic polynomial through them; two where the grid has less than four values,
    and one where it has one. Beyond the grid its ends hold; in the first and last interval the polynomial is that of
    the next one.
    """
    held = np.clip(value, grid[0], grid[-1])
    number = _nodes(grid, held, 4 if len(grid) >= 4 else min(len(grid), 2), 1)
    return number, _polynomials(grid[number] - held[:, None])[:, :, 0]


def near_shares(grid: Array, value: Array, bend: Array, turn: float) -> tuple[Index, Shares]:
    r"""Return neighbours as :func:`far_shares` with the shares of waves that bend over a centre's cell.

    Parameters
    ----------
    grid : ndarray of float64
        Rising angles [rad].
    value : ndarray of float64, shape (n,)
        [rad].
    bend : ndarray of float64, shape (n,)
        b, see below [rad2].
    turn : float
        Phase at the edge of a cell for each radian of angle.

    Notes
    -----
    .. math:: e^{j b D^2} A \approx A + j b A'' - \tfrac{1}{2} b^2 A''''

    with the derivatives of the polynomial through six neighbours, four (then without the last term) where the grid has
    less. They are so far apart that the phase at the edge of a cell turns by about `NODE_PHASE` from one to the next. b
    is at most the square of that step: where more would be asked for, noise of the table would be all that is seen.
    """
    count = next(number for number in (6, 4, 2, 1) if number <= len(grid))
    held, step = np.clip(value, grid[0], grid[-1]), float(np.diff(grid).max(initial=0.0))
    wanted = int(NODE_PHASE / max(turn * step, 1e-9) + 0.5) if count >= 4 else 1
    stride = min(max(wanted, 1), (len(grid) - 1) // max(count - 1, 1) or 1)
    number = _nodes(grid, held, count, stride)
    powers = _polynomials(grid[number] - held[:, None])
    shares = powers[:, :, 0].astype(np.complex128)
    if count >= 4:
        b = np.minimum(bend, (stride * step) ** 2)[:, None]
        shares += 2j * b * powers[:, :, 2]
        shares -= 12.0 * b**2 * powers[:, :, 4] if count >= 6 else 0.0
    return number, shares


def _nodes(grid: Array, held: Array, count: int, stride: int) -> Index:
    low = np.searchsorted(grid, held, side="right") - 1 - (count // 2 - 1) * stride
    first = np.clip(low, 0, len(grid) - 1 - (count - 1) * stride)
    return np.asarray(first[:, None] + stride * np.arange(count), dtype=np.int64)


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
