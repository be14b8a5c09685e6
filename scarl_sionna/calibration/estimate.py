"""Least squares from several starts, with covariance, intervals and what the measurements cannot tell apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult, least_squares
from scipy.stats import chi2, norm, qmc

from .adam import adam
from .errors import ConvergenceError, UnusedParameterError
from .forward import Channel, ForwardModel
from .physics import RADIUS
from .spec import CalibrationProblem

Array = npt.NDArray[np.float64]

INTERVAL = float(norm.ppf(0.975))
"""Half width of a 95 % interval of a normal distribution [standard deviations]."""
WEAK = 0.3
"""A direction is not identified if the data leave more than this of the bounds' range as its standard deviation: a
uniform distribution over the range has 0.29."""
LOST = 3.0
"""A direction with more than this standard deviation, priors included, is no estimate [range of the bounds]."""
SAME_COST = 1e-3
"""Minima whose sums of squares differ by less than this share (or by less than 0.1) are equally good."""
APART = 0.02
"""... and are two if a parameter differs by more than this of its range, and by more than 3 standard deviations."""
INSIDE = 2.0 * RADIUS
"""Searches start this share of the range away from the bounds: roots such as sqrt(1 - S^2) have no derivative on
them."""
SMALL_P = 0.05
"""Below this probability of the misfit it is in doubt whether the best minimum was found ..."""
UNSEEN = 0.1
"""... until minima that were not found are expected to draw no larger share of the starts than this."""
MOST_ROUNDS = 8
"""Rounds of `num_starts` starts that are tried while the best minimum is in doubt."""
TOLERANCE = 1e-10
ROUNDING = 1e-11
"""Of a derivative, a range of the parameter and a unit of the prediction: what Cauchy's integral leaves of a constant
is 1e-13."""


@dataclass(frozen=True, eq=False)
class WeakDirection:
    """A combination of parameters that the data do not fix.

    Attributes
    ----------
    weights : dict of str to float
        Share of each parameter, in units of its range; those below 0.1 are left out.
    std : float
        Standard deviation along it in units of the bounds' range, by the data alone; infinite where nothing is known.
    """

    weights: dict[str, float]
    std: float


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """An estimate with its uncertainty.

    Attributes
    ----------
    problem : CalibrationProblem
    model : ForwardModel
    values, std : ndarray of float64, shape (num_parameters,)
        In the order and the units of ``problem.parameters``; `std` is from the Fisher information with the stated noise
        and priors.
    covariance : ndarray of float64, shape (num_parameters, num_parameters)
    chi_square, degrees_of_freedom : float, int
        Of the measurements that were used and of the priors, each of which counts as a value; dimensionless.
    converged : bool
    reason : str
        Why it converged, or why not.
    at_bound : list of str
        Parameters that ended on a bound; their interval is not valid.
    weak : list of WeakDirection
    correlated : list of (str, str, float)
        Pairs whose correlation, dimensionless, is above 0.95.
    other_minima : list of ndarray of float64, shape (num_parameters,)
        Equally good minima somewhere else, in the units of the parameters.
    starts : list of (ndarray, float)
        Start, in the units of the parameters, and dimensionless sum of squares of each search: more than `num_starts`
        where the best minimum was in doubt.
    num_evaluations : int
    """

    problem: CalibrationProblem
    model: ForwardModel
    values: Array
    std: Array
    covariance: Array
    chi_square: float
    degrees_of_freedom: int
    converged: bool
    reason: str
    at_bound: list[str]
    weak: list[WeakDirection]
    correlated: list[tuple[str, str, float]]
    other_minima: list[Array]
    starts: list[tuple[Array, float]]
    num_evaluations: int

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return self.model.names

    @property
    def misfit(self) -> float:
        """Root of chi-square per degree of freedom, at least 1.

        By how much the stated noise and the priors' deviations are too small for the misfit.
        """
        return max(1.0, (self.chi_square / self.degrees_of_freedom) ** 0.5) if self.degrees_of_freedom > 0 else 1.0

    @property
    def p_value(self) -> float:
        """Probability of so large a misfit if model, noise and priors are right."""
        return _probability(self.chi_square, self.degrees_of_freedom)

    @property
    def interval(self) -> Array:
        """95 % intervals by the stated noise, shape (num_parameters, 2).

        In the units of the parameters.
        """
        return np.stack([self.values - INTERVAL * self.std, self.values + INTERVAL * self.std], axis=1)

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, dimensionless; NaN where a parameter is not determined.

        Shape (num_parameters, num_parameters).
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.covariance / np.outer(self.std, self.std))

    def __getitem__(self, name: str) -> float:
        """Return the estimate of a parameter."""
        return float(self.values[self.names.index(name)])

    def require_converged(self) -> CalibrationResult:
        """Return this result, or raise :class:`ConvergenceError` with the reason."""
        if not self.converged:
            raise ConvergenceError(self.reason)
        return self

    def rms(self, channel: Channel, parameters: Array | None = None) -> float:
        """Return the rms of prediction minus data of a measurement, in the unit of its values.

        `parameters` have the shape (num_parameters,) and their own units; left out: the estimate.
        """
        point = self.values if parameters is None else parameters
        return float(np.sqrt(np.mean((self.model.predict(channel, point) - channel.data) ** 2)))


def calibrate(problem: CalibrationProblem, on_progress: Callable[[int, int], None] | None = None) -> CalibrationResult:
    r"""Estimate the free parameters of a problem.

    Parameters
    ----------
    problem : CalibrationProblem or ForwardModel
        A model that was made before keeps its traced paths.
    on_progress : callable, optional
        Called with the number of finished starts and of all; the latter grows where more starts are tried.

    Returns
    -------
    CalibrationResult
        Look at `converged` and `reason`: a search that failed returns its best point, marked as not converged.

    Raises
    ------
    UnusedParameterError
        If no measurement depends on a parameter.
    ScarlError
        Of :class:`ForwardModel`.

    Notes
    -----
    Minimised is the sum of squares of the residuals over their noise, priors included, by a trust-region method with
    bounds (Levenberg-Marquardt steps, reflective at the bounds) [1]_, or by Adam, from several starts. While the misfit
    of the best is improbable (below 0.05), further rounds of starts follow, up to eight in all, until minima that were
    not found are expected to draw no more than 10 % of the starts [3]_: five starts if all end in one minimum, nine if
    in two. If eight rounds do not suffice, the result is not converged. At the minimum the covariance is the inverse of
    the Fisher information,

    .. math:: C = (J^T J)^{-1}, \quad J_{ik} = \frac{1}{\sigma_i} \frac{\partial f_i}{\partial p_k}

    References
    ----------
    .. [1] M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21(1), 1999; `scipy.optimize.least_squares`.
    .. [2] S. M. Kay, *Fundamentals of Statistical Signal Processing: Estimation Theory*, 1993, chapter 3.
    .. [3] C. G. E. Boender, A. H. G. Rinnooy Kan, Mathematical Programming 37, 1987: of n searches that ended in w
       minima, the share that others draw has the mean w (w + 1) / (n (n - 1)).
    """
    model = problem if isinstance(problem, ForwardModel) else ForwardModel(problem)
    problem = model.problem
    _require_used(model)
    starts: list[Array] = []
    found: list[OptimizeResult] = []
    for batch in _rounds(model):
        starts += batch
        for start in batch:
            found.append(_search(model, start))
            if on_progress is not None:
                on_progress(len(found), len(starts))
        if not _doubt(model, found):
            break
    best = min(found, key=lambda item: float(item.cost))
    costs = [(start, 2.0 * float(item.cost)) for start, item in zip(starts, found, strict=True)]
    return _result(model, best, found, costs)


def _search(model: ForwardModel, start: Array) -> OptimizeResult:
    """Return the minimum that is reached from a start, in units of the bounds' ranges."""
    span, lower = model.span, model.lower

    def residuals(unit: Array) -> Array:
        return model.residuals(lower + span * unit)

    def jacobian(unit: Array) -> Array:
        return np.asarray(model.jacobian(lower + span * unit) * span)

    inside = np.clip((start - lower) / span, INSIDE, 1.0 - INSIDE)
    if model.problem.optimizer == "adam":
        return adam(residuals, jacobian, inside, model.problem.max_evaluations)
    return least_squares(
        residuals,
        inside,
        jac=jacobian,
        bounds=(0.0, 1.0),
        method="trf",
        x_scale="jac",
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=model.problem.max_evaluations,
    )


def _rounds(model: ForwardModel) -> Iterator[list[Array]]:
    """Yield the given start with points spread over the bounds, then further such points."""
    sampler = qmc.LatinHypercube(len(model.free), seed=model.problem.seed)
    for number in range(MOST_ROUNDS):
        first = [model.start] if number == 0 else []
        more = model.problem.num_starts - len(first)
        yield first + [model.lower + model.span * row for row in (sampler.random(more) if more else ())]


def _doubt(model: ForwardModel, found: list[OptimizeResult]) -> str:
    """Return why the best of some searches may not be the best there is, or nothing."""
    costs = sorted(2.0 * float(item.cost) for item in found)
    minima = 1 + sum(not _as_good(high, low) for low, high in pairwise(costs))
    freedom = len(model.residuals(model.start)) - len(model.free)
    probability = _probability(costs[0], freedom)
    count = len(found)
    if probability >= SMALL_P or minima * (minima + 1) <= UNSEEN * count * (count - 1):
        return ""
    return (
        f"the misfit is improbable ({probability:.1g}), and {count} searches ended in {minima} minima, so that a "
        "better one may be left; raise num_starts, bound the parameters more closely, or state a noise that covers the "
        "model's errors"
    )


def _as_good(cost: float, best: float) -> bool:
    """Return whether a sum of squares is as good as a smaller one."""
    return cost - best < max(0.1, SAME_COST * best)


def _probability(chi_square: float, degrees_of_freedom: int) -> float:
    """Return the probability of so large a misfit, 1 without degrees of freedom."""
    return float(chi2.sf(chi_square, degrees_of_freedom)) if degrees_of_freedom > 0 else 1.0


def _require_used(model: ForwardModel) -> None:
    """Raise if the derivatives to a parameter vanish everywhere that was looked."""
    middle = [model.lower + 0.5 * model.span, model.lower + 0.37 * model.span]
    columns = [
        np.abs(model.jacobian(point, with_prior=False) * model.span).max(axis=0) for point in (model.start, *middle)
    ]
    largest = np.max(columns, axis=0)
    size = max(float(np.abs(model.predict(item, middle[0]) / item.sigma).max(initial=0.0)) for item in model.channels)
    least = max(1e-9 * float(largest.max()), ROUNDING * size, 1e-21)
    unused = [name for name, value in zip(model.names, largest, strict=True) if not value > least]
    if unused:
        raise UnusedParameterError(unused)


def _result(
    model: ForwardModel, best: OptimizeResult, found: list[OptimizeResult], starts: list[tuple[Array, float]]
) -> CalibrationResult:
    names, span = model.names, model.span
    values = model.lower + span * best.x
    scaled = model.jacobian(values) * span
    fisher = scaled.T @ scaled
    covariance = _inverse(fisher) * np.outer(span, span)
    std = np.sqrt(np.diag(covariance))
    data_only = model.jacobian(values, with_prior=False) * span
    at_bound = [name for name, unit in zip(names, best.x, strict=True) if unit < 1e-4 or unit > 1.0 - 1e-4]
    others = _other_minima(model, best, found, std)
    weak = _weak(names, data_only.T @ data_only)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(std, std)
    correlated = [
        (names[i], names[k], float(correlation[i, k]))
        for i in range(len(names))
        for k in range(i)
        if np.isfinite(correlation[i, k]) and abs(correlation[i, k]) > 0.95
    ]
    residuals = model.residuals(values)
    converged, reason = _verdict(best, at_bound, others, _weak(names, fisher))
    if converged and (doubt := _doubt(model, found)):
        converged, reason = False, doubt
    return CalibrationResult(
        model.problem,
        model,
        values,
        std,
        covariance,
        float(residuals @ residuals),
        len(residuals) - len(names),
        converged,
        reason,
        at_bound,
        weak,
        correlated,
        others,
        starts,
        sum(int(item.nfev) for item in found),
    )


def _inverse(fisher: Array) -> Array:
    """Return the inverse; infinite variance for parameters in directions without information."""
    values, vectors = np.linalg.eigh(fisher)
    floor = 1e-13 * max(float(values[-1]), 1e-300)
    known = values > floor
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T
    lost = (vectors[:, ~known] ** 2).sum(axis=1) > 1e-6
    inverse[lost, lost] = np.inf
    return np.asarray(inverse)


def _weak(names: list[str], fisher: Array) -> list[WeakDirection]:
    """Return the directions in which the data say less than the bounds."""
    values, vectors = np.linalg.eigh(fisher)
    out = []
    for value, vector in zip(values, vectors.T, strict=True):
        std = float(value**-0.5) if value > 1e-13 * max(float(values[-1]), 1e-300) else float("inf")
        if std > WEAK:
            sign = np.sign(vector[np.argmax(np.abs(vector))])
            weights = {n: float(sign * w) for n, w in zip(names, vector, strict=True) if abs(w) > 0.1}
            out.append(WeakDirection(weights, std))
    return out


def _other_minima(model: ForwardModel, best: OptimizeResult, found: list[OptimizeResult], std: Array) -> list[Array]:
    """Return minima as good as the best one that are somewhere else."""
    others: list[Array] = []
    for item in found:
        as_good = _as_good(2.0 * item.cost, 2.0 * best.cost)
        apart = np.abs(item.x - best.x)
        if item.status > 0 and as_good and np.any((apart > APART) & (apart * model.span > 3.0 * std)):
            point = model.lower + model.span * item.x
            if all(np.any(np.abs(point - other) > APART * model.span) for other in others):
                others.append(point)
    return others


def _verdict(
    best: OptimizeResult, at_bound: list[str], others: list[Array], weak: list[WeakDirection]
) -> tuple[bool, str]:
    """Return whether the best search converged, and the reason."""
    if best.status <= 0:
        return (
            False,
            f"the best search stopped after {best.nfev} evaluations; raise max_evaluations, or scale the bounds down",
        )
    if others:
        return False, f"{len(others) + 1} minima are equally good; add a measurement or a prior that tells them apart"
    lost = [" and ".join(item.weights) for item in weak if item.std > LOST]
    if lost:
        return (
            False,
            f"measurements and priors do not fix {', nor '.join(lost)}; fix one by hand, give it a prior, "
            "or measure more",
        )
    if at_bound:
        return False, f"{', '.join(at_bound)} ended on a bound; widen the bounds, or the model does not fit the data"
    return True, str(best.message)
