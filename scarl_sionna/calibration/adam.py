"""Adam on a sum of squares within bounds, for problems whose Hessian is no guide, and to compare with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult

Array = npt.NDArray[np.float64]

FIRST_STEP, LAST_STEP = 0.05, 1e-4
"""Length of a step at the beginning and at the end [range of the bounds]."""
DECAYS = (0.9, 0.999)
EPSILON = 1e-8
NEAR = 0.1
"""Converged: a Newton step would move the estimate by less than this many of its standard deviations."""


def adam(
    residuals: Callable[[Array], Array], jacobian: Callable[[Array], Array], start: Array, max_steps: int
) -> OptimizeResult:
    r"""Minimise half the sum of squared residuals over the unit cube.

    Parameters
    ----------
    residuals, jacobian : callable
        Of parameters between 0 and 1, shape (num_parameters,); weighted by the noise.
    start : ndarray of float64, shape (num_parameters,)
    max_steps : int

    Returns
    -------
    OptimizeResult
        As of :func:`scipy.optimize.least_squares`; `status` is 0 if `max_steps` did not suffice.

    Notes
    -----
    The step shrinks geometrically from `FIRST_STEP` to `LAST_STEP`. With g the gradient and F the Fisher matrix, both
    of the parameters that are not held by a bound, the end is where :math:`g^T F^{-1} g < 0.1^2`.

    References
    ----------
    .. [1] D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", ICLR 2015.
    """
    point = start.copy()
    mean, square = np.zeros_like(point), np.zeros_like(point)
    best = OptimizeResult(x=point.copy(), cost=np.inf, nfev=0, status=0, message="Adam took all its steps")
    for step in range(1, max_steps + 1):
        value, slope = residuals(point), jacobian(point)
        gradient = slope.T @ value
        cost = 0.5 * float(value @ value)
        if cost < best.cost:
            best.update(x=point.copy(), cost=cost)
        best.nfev = step
        if _is_there(point, gradient, slope):
            best.update(
                x=point.copy(), cost=cost, status=1, message="a Newton step is below a tenth of a standard deviation"
            )
            break
        mean = DECAYS[0] * mean + (1.0 - DECAYS[0]) * gradient
        square = DECAYS[1] * square + (1.0 - DECAYS[1]) * gradient**2
        ahead = mean / (1.0 - DECAYS[0] ** step)
        spread = np.sqrt(square / (1.0 - DECAYS[1] ** step))
        rate = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (step / max_steps)
        point = np.clip(point - rate * ahead / (spread + EPSILON), 0.0, 1.0)
    return best


def _is_there(point: Array, gradient: Array, slope: Array) -> bool:
    """Return whether a Newton step within the bounds is short against the standard deviations."""
    free = ~(((point <= 0.0) & (gradient > 0.0)) | ((point >= 1.0) & (gradient < 0.0)))
    if not free.any():
        return True
    step, *_ = np.linalg.lstsq(slope[:, free].T @ slope[:, free], gradient[free], rcond=1e-13)
    return bool(gradient[free] @ step < NEAR**2)
