"""What a single point looks like in a radar's map: a table over range, velocity and azimuth beside its place."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import SpecError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, MetresPerSecond, Seconds

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Value = tuple[float, float]
"""Real and imaginary part."""

AXES = ("range", "velocity", "azimuth")
MOST_VALUES = 4_000_000
"""Of one table over all axes: 0.5 GB while it is checked."""
SLACK = 0.05
"""The value at 0 may differ from 1 by so much, and no other may be so much above 1: tables are measured."""
_FEWEST = 3


class PointSpread(Spec):
    """Response of a radar's map to a point, over what a cell is beside the point: 1 at the point, 0 beyond the table.

    Either a factor for each axis, or one table over all of them. An axis that the device does not have is left out.
    Where each row of velocity has a range of its own, as in maps whose motion is compensated, `range_per_velocity`
    shears the factors: at offsets d, v and a from the point the response is R(d + k v) V(v) A(a), v not folded in R.
    Of azimuth the table holds for a point at boresight; elsewhere the response keeps its width in the sine of azimuth
    (arrays), or in azimuth itself (antennas that turn).

    Raises
    ------
    SpecError
        If an axis does not rise through 0, the shapes do not fit, a value is not finite, the value at 0 is not 1 or
        others are above it, or a power is negative.
    """

    kind: Literal["amplitude", "power"] = Field(
        "amplitude",
        description='"amplitude": complex, echoes add up with their phases; "power": echoes add up in power',
    )
    range_offset: tuple[Metres, ...] = Field(min_length=_FEWEST, description="of a cell from the point, rising [m]")
    velocity_offset: tuple[MetresPerSecond, ...] = Field((), description="the same over radial velocity [m/s]")
    azimuth_offset_deg: tuple[Degrees, ...] = Field((), description="the same over azimuth, left positive [deg]")
    range_response: tuple[Value, ...] = Field((), description="factor over range; real, imaginary part")
    velocity_response: tuple[Value, ...] = Field((), description="factor over velocity; real, imaginary part")
    azimuth_response: tuple[Value, ...] = Field((), description="factor over azimuth; real, imaginary part")
    response: tuple[Value, ...] = Field(
        (), description="in place of factors: all values, azimuth fastest, then velocity, then range"
    )
    azimuth_scale: Literal["sine", "angle"] = Field(
        "sine",
        description='what the width over azimuth is constant in: "sine" (arrays) or "angle" (antennas that turn)',
    )
    range_per_velocity: Seconds = Field(
        0.0, description="what the offset over range of the factor grows by with that over velocity [s]"
    )
    interpolation: Literal["linear", "cubic"] = Field("cubic", description="between the values of the table")

    @model_validator(mode="after")
    def _check(self) -> PointSpread:
        if bool(self.response) == bool(self.range_response):
            raise ValueError("either response, or range_response and a factor for each other axis")
        for name in AXES:
            self._check_axis(name)
        if self.azimuth_offset_deg and not -90.0 <= self.azimuth_offset_deg[0] < self.azimuth_offset_deg[-1] <= 90.0:
            raise ValueError("azimuth_offset_deg within -90 to 90 deg")
        if self.response and len(self.response) != np.prod(self.shape):
            raise ValueError(f"response of {' x '.join(map(str, self.shape))} values, not {len(self.response)}")
        if len(self.response) > MOST_VALUES:
            raise ValueError(f"at most {MOST_VALUES} values, not {len(self.response)}")
        if self.range_per_velocity and not self.velocity_response:
            raise ValueError("range_per_velocity with factors over range and velocity only")
        for name, values in self._tables():
            self._check_values(name, values)
        return self

    def _check_axis(self, name: str) -> None:
        field = f"{name}_offset" + ("_deg" if name == "azimuth" else "")
        offset, factor = getattr(self, field), getattr(self, f"{name}_response")
        if offset and len(offset) < _FEWEST:
            raise ValueError(f"{field} of at least {_FEWEST} values")
        if any(b <= a for a, b in pairwise(offset)):
            raise ValueError(f"{field} strictly rising")
        if offset and not offset[0] < 0.0 < offset[-1]:
            raise ValueError(f"{field} from below 0 to above 0: offsets are those from the point, not places")
        wanted = 0 if self.response else len(offset)
        if len(factor) != wanted:
            raise ValueError(f"{name}_response of {wanted} values, not {len(factor)}")

    def _check_values(self, name: str, values: Complex) -> None:
        if self.kind == "power" and (np.any(values.imag != 0.0) or np.any(values.real < 0.0)):
            raise ValueError(f"{name} of powers: real, at least 0 (is it in dB, or an amplitude?)")
        size = np.abs(values)
        if size.max() > 1.0 + SLACK:
            raise ValueError(f"{name} at most 1: divide it by its value at the point; it has {size.max():.3g}")
        center = values
        for number, offset in enumerate(self.offsets if name == "response" else [self._offset(name)]):
            nearest = int(np.argmin(np.abs(offset)))
            near = slice(max(nearest - 1, 0), nearest + 2)
            center = np.take(center, range(*near.indices(len(offset))), axis=number)
        if np.abs(center).max() < 1.0 - SLACK:
            where = f"{np.abs(center).max():.3g} there, {size.max():.3g} at most"
            raise ValueError(f"{name} with its peak, 1, at offset 0: it has {where}")

    def _offset(self, name: str) -> Array:
        return self.offsets[[axis for axis in AXES if self._has(axis)].index(name.removesuffix("_response"))]

    def _has(self, axis: str) -> bool:
        return bool(getattr(self, f"{axis}_offset" + ("_deg" if axis == "azimuth" else "")))

    def _tables(self) -> list[tuple[str, Complex]]:
        if self.response:
            return [("response", self.values)]
        return [(f"{axis}_response", factor) for axis, factor in zip(self.axes, self.factors, strict=True)]

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that there are, of `AXES`."""
        return tuple(axis for axis in AXES if self._has(axis))

    @cached_property
    def offsets(self) -> tuple[Array, ...]:
        """Offsets along each axis that there is, (num_values,): [m], [m/s], and of azimuth its sine or [rad]."""
        out = []
        for axis in self.axes:
            if axis == "azimuth":
                angle = np.radians(self.azimuth_offset_deg)
                out.append(np.sin(angle) if self.azimuth_scale == "sine" else angle)
            else:
                out.append(np.array(getattr(self, f"{axis}_offset")))
        return tuple(out)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of offsets of each axis that there is."""
        return tuple(map(len, self.offsets))

    @property
    def is_separable(self) -> bool:
        """Whether there is a factor for each axis."""
        return not self.response

    @cached_property
    def factors(self) -> tuple[Complex, ...]:
        """Factors of the axes, (num_values,) each; none if there is one table over all."""
        if not self.is_separable:
            return ()
        rows = (np.array(getattr(self, f"{axis}_response")) for axis in self.axes)
        return tuple(row[:, 0] + 1j * row[:, 1] for row in rows)

    @cached_property
    def values(self) -> Complex:
        """The whole table, shape (num_range[, num_velocity][, num_azimuth]), dimensionless."""
        if self.response:
            parts = np.array(self.response)
            return np.asarray((parts[:, 0] + 1j * parts[:, 1]).reshape(self.shape))
        out, others = self.factors[0], self.factors[1:]
        if self.range_per_velocity:
            moved = self.offsets[0][:, None] + self.range_per_velocity * self.offsets[1]
            out, others = self.factor_at(0)(moved) * others[0], others[1:]
        for factor in others:
            out = out[..., None] * factor
        return out

    def factor_at(self, number: int) -> Callable[[Array], Complex]:
        """Return a function from offsets along an axis, of any shape, to its factor there: 0 beyond the table."""
        from scipy.interpolate import CubicSpline  # a fifth of a second that few need

        own, values = self.offsets[number], self.factors[number]
        curve = CubicSpline(own, values) if self.interpolation == "cubic" else None

        def at(offset: Array) -> Complex:
            held = (offset >= own[0]) & (offset <= own[-1])
            place = np.where(held, offset, 0.0)
            if curve is not None:
                return np.where(held, curve(place), 0.0)
            found = np.interp(place, own, values.real) + 1j * np.interp(place, own, values.imag)
            return np.where(held, found, 0.0)

        return at

    @classmethod
    def of_arrays(
        cls,
        range_offset: npt.ArrayLike,
        range_response: npt.ArrayLike,
        velocity: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        azimuth: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        **fields: object,
    ) -> PointSpread:
        """Return the table of arrays.

        Parameters
        ----------
        range_offset : array_like of float, shape (num_range,)
            [m]
        range_response : array_like of complex, shape (num_range,) or, with `velocity` and `azimuth` of None in place
            of a factor, (num_range[, num_velocity][, num_azimuth])
            Factor over range, or the whole table.
        velocity, azimuth : pair of array_like, optional
            Offsets [m/s], [deg] and the factor over them; None in its place if `range_response` is the whole table.
        **fields
            Others of the specification.

        Raises
        ------
        SpecError
            If it is no point spread.
        """
        table = np.asarray(range_response)
        whole = table.ndim > 1
        if table.size > MOST_VALUES:
            shown = f"{' x '.join(map(str, table.shape))} = {table.size} values"
            remedy = "take fewer values a cell, or a factor for each axis"
            raise SpecError(cls, ("response",), shown, f"at most {MOST_VALUES}", remedy)
        data: dict[str, object] = {
            "range_offset": np.asarray(range_offset, dtype=np.float64).tolist(),
            "response" if whole else "range_response": pairs(table),
        }
        for name, unit, axis in (("velocity", "", velocity), ("azimuth", "_deg", azimuth)):
            if axis is not None:
                data[f"{name}_offset{unit}"] = np.asarray(axis[0], dtype=np.float64).tolist()
                if not whole:
                    data[f"{name}_response"] = pairs(np.asarray(axis[1]))
        return cls(**data, **fields)


def pairs(values: npt.NDArray[np.number]) -> list[tuple[float, float]]:
    """Return real and imaginary parts of values of any shape, flat.

    Raises
    ------
    ValueError
        If they are more than a table may have.
    """
    if values.size > MOST_VALUES:
        raise ValueError(f"at most {MOST_VALUES} values, not {values.size}")
    flat = np.asarray(values, dtype=np.complex128).ravel()
    return list(zip(flat.real.tolist(), flat.imag.tolist(), strict=True))
