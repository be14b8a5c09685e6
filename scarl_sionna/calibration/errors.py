"""Errors of a calibration: what the problem lacks, and an estimate that is none."""

from __future__ import annotations

from collections.abc import Sequence

from scarl_sionna.core.errors import ScarlError


class CalibrationError(ScarlError):
    """A calibration problem cannot be solved as it is stated."""


class UnusedParameterError(CalibrationError):
    """No measurement depends on a free parameter."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = list(names)
        super().__init__(
            f"no measurement depends on {', '.join(self.names)}; take them out of `parameters`, "
            "or add a measurement that sees "
            "them (a conductivity needs a loss or a phase, a thickness a layer that is not opaque; backscatter of an "
            "entry that states its albedo depends on nothing else unless its scattering is free)"
        )


class ConvergenceError(CalibrationError, RuntimeError):
    """The optimizer found no minimum; `reason` says why."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"the calibration did not converge: {reason}")
